#!/usr/bin/env bash
# How fast a hand-made gait is, on level ground and uphill, as a table and as JSON for a program.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo canter eval --robot doggo --prior stepping --episodes 4
cargo canter eval --robot doggo --prior stepping --episodes 4 --slope 5 --json | grep speed_m_per_s

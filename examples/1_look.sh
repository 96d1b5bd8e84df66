#!/usr/bin/env bash
# What there is: robots with their gaits, presets with the meaning of every value.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo canter robots
cargo canter config
cargo canter config doggo --set policy.authority=0.5 | grep -A 3 "How much of it"

#!/usr/bin/env bash
# A training of a few seconds: far too short for a good gait, long enough to see every file of a run.
set -euo pipefail
cd "$(dirname "$0")/.."

run=$(mktemp -d)
trap 'rm -rf "$run"' EXIT
cargo canter train doggo --steps 20000 --set evaluation.num_episodes=4 --out "$run/first"
ls "$run/first"
cargo canter eval "$run/first" --episodes 4 --slope 5

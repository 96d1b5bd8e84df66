#!/usr/bin/env bash
# A robot that somebody else has modelled, from its model to a verdict: runs the tutorial in docs/robots.md, block by block.
set -euo pipefail
cd "$(dirname "$0")/.."

rm -rf target/tutorial
awk '/^```sh$/ { inside = 1; next } /^```$/ { inside = 0 } inside' docs/robots.md > target/tutorial.sh
bash -euxo pipefail target/tutorial.sh

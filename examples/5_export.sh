#!/usr/bin/env bash
# From a training to code: C that proves itself, a table of the gait, and a dry run over the line protocol.
# The training is far too short for a gait that is fit for a robot, so files are written with --allow-unsafe.
set -euo pipefail
cd "$(dirname "$0")/.."

run=$(mktemp -d)
trap 'rm -rf "$run"' EXIT
cargo canter train doggo --steps 20000 --set evaluation.num_episodes=4 --out "$run/first"

# C99 without a heap. Its self test repeats the built-in vectors: 0 is what a robot wants to see before it moves.
cargo canter export "$run/first" --format c --allow-unsafe
cat >"$run/main.c" <<'C'
#include "canter_policy.h"
#include <stdio.h>

int main(void)
{
    float error = canter_self_test();
    printf("self test: %g rad\n", (double)error);
    return error <= CANTER_SELF_TEST_LIMIT ? 0 : 1;
}
C
cc -std=c99 -O2 -I"$run/first/export/c" "$run/main.c" "$run/first/export/c/canter_policy.c" -o "$run/main" -lm
"$run/main"

# The gait in open loop: 64 rows of actuator targets, and what the replay says of them.
cargo canter export "$run/first" --format table --allow-unsafe
head -n 3 "$run/first/export/table/gait.csv"
cat "$run/first/export/table/certificate.txt"

# The runtime: readings in, targets out, 100 times a second. Here the robot's side says one thing and leaves.
readings=$(printf 'sensors%s' "$(printf ' 0%.0s' {1..22})")
printf '%s\nwalk\nquit\n' "$readings" | cargo canter run "$run/first" | head -n 3

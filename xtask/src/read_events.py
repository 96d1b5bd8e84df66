"""Compares what TensorBoard sees in a run directory with the run's metrics.jsonl.  Argument: the directory."""

import json
import struct
import sys
from pathlib import Path

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

run = Path(sys.argv[1])
lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
expected = {}
for line in lines:
    step = line.pop("env_steps")
    for key, value in line.items():
        # The accidents are an object by cause; a mean over nothing is null and has no point.
        members = {f"{key}/{cause}": count for cause, count in value.items()} if isinstance(value, dict) else {key: value}
        for name, number in members.items():
            if number is not None:
                as_float32 = struct.unpack("f", struct.pack("f", number))[0]
                expected.setdefault(name, []).append((step, as_float32))

# 0 keeps every point, not a sample of them.
accumulator = EventAccumulator(str(run), size_guidance={"scalars": 0}, purge_orphaned_data=False)
accumulator.Reload()
seen = {}
times = []
for tag in accumulator.Tags()["scalars"]:
    events = accumulator.Scalars(tag)
    group, key = tag.split("/")
    seen[tag if group == "accidents" else key] = [(event.step, event.value) for event in events]
    if key == "iteration":
        times = [event.wall_time for event in events]

if accumulator.file_version != 2.0:
    sys.exit(f"file version {accumulator.file_version}")
for name in sorted(expected.keys() | seen.keys()):
    if expected.get(name) != seen.get(name):
        sys.exit(f"{name}: metrics.jsonl has {expected.get(name)}, TensorBoard sees {seen.get(name)}")
if len(times) != len(lines) or times != sorted(times):
    sys.exit(f"wall times {times} for {len(lines)} iterations")
print(f"sees {len(seen)} curves with {len(times)} iterations of a resumed run, as metrics.jsonl has them")

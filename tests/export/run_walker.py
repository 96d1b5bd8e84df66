"""Steps an exported run_policy.py through a script.

usage: run_walker.py FOLDER < inputs > outputs

FOLDER holds policy.onnx, start.onnx and run_policy.py. A record of the input holds all readings (motor angles, motor velocities,
orientation, angular velocity), their age, whether to walk and the step's time, which is the policy's own; one of the output holds the targets and the mode's number;
all are little-endian 32-bit floats.
"""

import sys

import numpy as np

sys.path.insert(0, sys.argv[1])
from run_policy import Walker  # noqa: E402

MODES = ["waiting", "rising", "standing", "ramping-in", "walking", "ramping-out", "holding"]

walker = Walker(f"{sys.argv[1]}/policy.onnx")
m = len(walker.actuators)
records = np.frombuffer(sys.stdin.buffer.read(), "<f4").reshape(-1, 2 * m + 9)
for record in records:
    readings = {
        "motor_angles": record[:m],
        "motor_velocities": record[m : 2 * m],
        "orientation": record[2 * m : 2 * m + 3],
        "angular_velocity": record[2 * m + 3 : 2 * m + 6],
    }
    walker.walk(record[2 * m + 7] != 0)
    targets = walker.step(readings, float(record[2 * m + 6]))
    targets = np.zeros(m) if targets is None else targets
    sys.stdout.buffer.write(np.append(targets, MODES.index(walker.mode)).astype("<f4").tobytes())

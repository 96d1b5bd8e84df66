"""Checks an exported ONNX model with ONNX's own checker and repeats recorded control steps with onnxruntime.

usage: run_onnx.py MODEL < inputs > outputs

A record of the input holds all readings (motor angles, motor velocities, orientation, angular velocity), the phase and
the previous action; one of the output holds targets, next phase and action; all are little-endian 32-bit floats.
"""

import json
import sys

import numpy as np
import onnx
import onnxruntime

path = sys.argv[1]
onnx.checker.check_model(path, full_check=True)
options = onnxruntime.SessionOptions()
options.intra_op_num_threads = 1
session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])

layout = json.loads(session.get_modelmeta().custom_metadata_map["canter.observation_layout"])
num_motors = session.get_outputs()[0].shape[1]
num_actions = session.get_outputs()[2].shape[1]
starts = {
    "motor_angles": 0,
    "motor_velocities": num_motors,
    "orientation": 2 * num_motors,
    "angular_velocity": 2 * num_motors + 3,
}
num_readings = 2 * num_motors + 6
records = np.frombuffer(sys.stdin.buffer.read(), "<f4").reshape(-1, num_readings + 1 + num_actions)
columns = [starts[part["block"]] + i for part in layout for i in range(part["length"])]
inputs = {
    "observation": records[:, columns],
    "phase": records[:, num_readings : num_readings + 1],
    "previous_action": records[:, num_readings + 1 :],
}
targets, next_phase, action = session.run(None, inputs)
# One step on its own, as a robot runs it, gives what it gives among many.
alone = session.run(None, {name: values[:1] for name, values in inputs.items()})
assert np.allclose(alone[0], targets[:1], rtol=0, atol=1e-6)
# A reading that is no number: the action is 0.
broken = {name: values[:1].copy() for name, values in inputs.items()}
broken["observation"][0, 0] = np.nan
assert np.all(session.run(None, broken)[2] == 0.0)
sys.stdout.buffer.write(np.concatenate([targets, next_phase, action], axis=1).astype("<f4").tobytes())

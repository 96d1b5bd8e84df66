"""Runs policy.onnx on a robot: it stands, ramps in, walks, stops, and holds its pose when its sensors go stale.

Needs numpy and onnxruntime. The graph is one control step; this is what has to be around it:

    walker = Walker("policy.onnx")
    walker.walk(True)
    every walker.control_dt_s:
        targets = walker.step(readings, age_s)
        send targets to the actuators, in the order of walker.actuators

`readings` maps the names of the blocks in walker.layout to sequences of numbers; `age_s` is the time since they were
measured, None if there are none.
"""

import json

import numpy as np
import onnxruntime

RAMP_S = np.float32(0.5)
SENSOR_TIMEOUT_S = np.float32(0.05)


class Walker:
    def __init__(self, path):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        self.session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        about = self.session.get_modelmeta().custom_metadata_map
        self.layout = json.loads(about["canter.observation_layout"])
        self.actuators = json.loads(about["canter.actuators"])
        self.control_dt_s = float(about["canter.control_dt_s"])
        self.standing = np.array(json.loads(about["canter.standing_targets"]), np.float32)
        self.targets = self.standing.copy()
        self.base = self.standing.copy()
        self.share = np.float32(0)
        self.is_to_walk = False
        self.mode = "standing"
        self._begin()

    def _begin(self):
        self.phase = np.zeros((1, 1), np.float32)
        self._forget()

    def _forget(self):
        num_actions = self.session.get_inputs()[2].shape[1]
        self.action = np.zeros((1, num_actions), np.float32)

    def walk(self, is_to_walk):
        self.is_to_walk = is_to_walk

    def step(self, readings, age_s):
        if age_s is None or not 0.0 <= age_s <= SENSOR_TIMEOUT_S:
            # What is held is where the ramp begins when readings come back.
            self.base = self.targets.copy()
            self.share = np.float32(0)
            self._forget()
            self.mode = "holding"
            return self.targets
        ramp = min(np.float32(self.control_dt_s) / RAMP_S, np.float32(1))
        self.share = np.clip(self.share + (ramp if self.is_to_walk else -ramp), np.float32(0), np.float32(1))
        self.base = self.base + np.clip(self.standing - self.base, -ramp, ramp)
        if self.share == 0.0:
            self._begin()
            self.targets, self.mode = self.base.copy(), "standing"
            return self.targets
        observation = np.concatenate([np.ravel(readings[part["block"]]) for part in self.layout])
        inputs = {
            "observation": observation.astype(np.float32)[None],
            "phase": self.phase,
            "previous_action": self.action,
        }
        gait, self.phase, self.action = self.session.run(None, inputs)
        self.targets = self.base + self.share * (gait[0] - self.base) if self.share < 1 else gait[0]
        self.mode = "walking" if self.share == 1.0 else "ramping-in" if self.is_to_walk else "ramping-out"
        return self.targets

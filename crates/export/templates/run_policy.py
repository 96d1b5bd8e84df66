"""Runs policy.onnx on a robot: it rises from where it is, stands, walks, stops, holds its pose when sensors go stale.

Needs numpy and onnxruntime. The graph is one control step; this is what has to be around it:

    walker = Walker("policy.onnx")      # start.onnx lies beside it
    every walker.control_dt_s:
        targets = walker.step(readings, age_s)
        if targets is not None:
            send targets to the actuators, in the order of walker.actuators
    walker.walk(True)                   # once walker.mode is "standing"

`readings` maps "motor_angles" and the names of the blocks in walker.layout to sequences of numbers; `age_s` is the time
since they were measured, None if there are none. Numbers that are not finite, and motor angles beyond a whole turn,
count as no readings.
"""

import json
from pathlib import Path

import numpy as np
import onnxruntime


# A whole turn away from standing is no pose of a leg.
MAX_MOTOR_ANGLE = np.float32(2 * np.pi)


def load(path):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


class Walker:
    def __init__(self, path):
        self.session = load(path)
        self.start = load(Path(path).with_name("start.onnx"))
        about = self.session.get_modelmeta().custom_metadata_map
        self.layout = json.loads(about["canter.observation_layout"])
        self.actuators = json.loads(about["canter.actuators"])
        self.control_dt_s = float(about["canter.control_dt_s"])
        self.sensor_timeout_s = np.float32(about["canter.sensor_timeout_s"])
        self.ramp = np.float32(self.control_dt_s) / np.float32(about["canter.ramp_s"])
        self.standing = np.array(json.loads(about["canter.standing_targets"]), np.float32)
        self.num_actions = self.session.get_inputs()[2].shape[1]
        self.targets = None
        self.share = np.float32(0)
        self.is_to_walk = False
        self.mode = "waiting"

    def walk(self, is_to_walk):
        self.is_to_walk = is_to_walk

    def step(self, readings, age_s):
        """The targets of this step [rad]; None while it waits for its first readings."""
        observation = self._observe(readings, age_s)
        if observation is None:
            self.share = np.float32(0)
            self.mode = "waiting" if self.targets is None else "holding"
            return None if self.targets is None else self.targets.copy()
        if self.targets is None:
            angles = np.ravel(readings["motor_angles"]).astype(np.float32)[None]
            self.targets = self.start.run(None, {"motor_angles": angles})[0][0]
        self.targets = self._advance(observation)
        return self.targets.copy()

    def _observe(self, readings, age_s):
        """What the policy sees; None if it is not fresh or no numbers."""
        if age_s is None or not 0.0 <= age_s <= self.sensor_timeout_s:
            return None
        observation = np.concatenate([np.ravel(readings[part["block"]]) for part in self.layout] or [[]])
        observation = observation.astype(np.float32)
        angles = np.ravel(readings["motor_angles"]).astype(np.float32)
        if not np.all(np.isfinite(observation)) or not np.all(np.abs(angles) <= MAX_MOTOR_ANGLE):
            return None
        return observation[None]

    def _advance(self, observation):
        if self.share == 0.0:
            # Every walk begins with phase and action at 0.
            self.phase = np.zeros((1, 1), np.float32)
            self.action = np.zeros((1, self.num_actions), np.float32)
            way = self.standing - self.targets
            if np.any(np.abs(way) > self.ramp):
                self.mode = "rising"
                return np.where(np.abs(way) > self.ramp, self.targets + np.copysign(self.ramp, way), self.standing)
        self.share = np.clip(
            self.share + (self.ramp if self.is_to_walk else -self.ramp), np.float32(0), np.float32(1)
        )
        if self.share == 0.0:
            self.mode = "standing"
            return self.standing
        inputs = {"observation": observation, "phase": self.phase, "previous_action": self.action}
        gait, self.phase, self.action = self.session.run(None, inputs)
        if self.share == 1.0:
            self.mode = "walking"
            return gait[0]
        self.mode = "ramping-in" if self.is_to_walk else "ramping-out"
        return self.standing + self.share * (gait[0] - self.standing)

"""Walks Stanford Doggo in Python's MuJoCo with an exported ONNX model, and prints the mean forward speed as JSON.

usage: walk_onnx.py MODEL.onnx doggo.xml ROBOT.json EPISODES

This shares no code with canter: MuJoCo loads the MJCF, onnxruntime runs the graph, and what a robot has beside these is
written down here once more, from docs/doggo-model.md:
- a command takes effect one control step after it was given;
- a motor gives at most its torque at the current limit, and at most what the supply voltage allows at its speed: at every
  physics step the joint's range of torque is
      high = min(tau_max,  tau_stall (1 - omega / omega_0)), at least 0
      low  = max(-tau_max, -tau_stall (1 + omega / omega_0)), at most 0.
ROBOT.json holds these three numbers, in N m, N m and rad/s.

An episode takes 10 s from standing, with a random phase and small random heading and tilt; its speed is the forward
displacement from 1 s on by time. A robot that lies down or rolls over keeps the full time.
"""

import json
import sys
from collections import deque

import mujoco
import numpy as np
import onnxruntime

CONTROL_DT_S, PHYSICS_DT_S, EPISODE_S, SETTLE_S = 0.01, 0.002, 10.0, 1.0
START_NOISE_RAD, MIN_HEIGHT_M, MAX_TILT_DEG = 0.05, 0.10, 60.0


def euler_to_quaternion(roll, pitch, yaw):
    quaternion = np.array([1.0, 0, 0, 0])
    for axis, angle in (((0, 0, 1), yaw), ((0, 1, 0), pitch), ((1, 0, 0), roll)):
        turn, product = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, np.array(axis, float), angle)
        mujoco.mju_mulQuat(product, quaternion, turn)
        quaternion = product
    return quaternion


def euler(matrix):
    """Roll, pitch and yaw (intrinsic z-y-x)."""
    roll = np.arctan2(matrix[2, 1], matrix[2, 2])
    pitch = -np.arcsin(np.clip(matrix[2, 0], -1, 1))
    return [roll, pitch, np.arctan2(matrix[1, 0], matrix[0, 0])]


model_path, xml_path, robot_path, num_episodes = sys.argv[1:5]
robot = json.load(open(robot_path))
session = onnxruntime.InferenceSession(model_path, providers=["CPUExecutionProvider"])
about = session.get_modelmeta().custom_metadata_map
layout = json.loads(about["canter.observation_layout"])
model = mujoco.MjModel.from_xml_path(xml_path)
model.opt.timestep = PHYSICS_DT_S
legs = ["front_left", "back_left", "back_right", "front_right"]
joints = [model.joint(f"{leg}_motor_{motor}").id for leg in legs for motor in "ab"]
actuators = [model.actuator(name).id for name in json.loads(about["canter.actuators"])]
places, speeds = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
random = np.random.default_rng(1)


def episode():
    data = mujoco.MjData(model)
    roll, pitch, yaw = random.uniform(-START_NOISE_RAD, START_NOISE_RAD, 3)
    data.qpos[3:7] = euler_to_quaternion(roll, pitch, yaw)
    mujoco.mj_forward(model, data)
    feet = [model.geom(f"{leg}_foot").id for leg in legs]
    data.qpos[2] -= min(data.geom_xpos[foot][2] - model.geom_size[foot][0] for foot in feet)
    phase = random.uniform(0, 1, (1, 1)).astype(np.float32)
    action = np.zeros((1, session.get_inputs()[2].shape[1]), np.float32)
    commands = deque([np.zeros(len(actuators))])
    settled_m = 0.0
    for step in range(round(EPISODE_S / CONTROL_DT_S)):
        if step == round(SETTLE_S / CONTROL_DT_S):
            settled_m = data.qpos[0]
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, data.qpos[3:7])
        matrix = matrix.reshape(3, 3)
        if matrix[2, 2] < np.cos(np.radians(MAX_TILT_DEG)) or data.qpos[2] < MIN_HEIGHT_M:
            return (data.qpos[0] - settled_m) / (EPISODE_S - SETTLE_S), True
        blocks = {
            "motor_angles": data.qpos[places],
            "motor_velocities": data.qvel[speeds],
            "orientation": euler(matrix),
            "angular_velocity": data.qvel[3:6],
        }
        observation = np.concatenate([blocks[part["block"]] for part in layout]).astype(np.float32)[None]
        inputs = {"observation": observation, "phase": phase, "previous_action": action}
        targets, phase, action = session.run(None, inputs)
        commands.append(targets[0])
        data.ctrl[actuators] = commands.popleft()
        for _ in range(round(CONTROL_DT_S / PHYSICS_DT_S)):
            ratio = data.qvel[speeds] / robot["no_load_speed_rad_per_s"]
            greatest, stall = robot["max_torque_nm"], robot["stall_torque_nm"]
            model.jnt_actfrcrange[joints, 0] = np.clip(-stall * (1 + ratio), -greatest, 0)
            model.jnt_actfrcrange[joints, 1] = np.clip(stall * (1 - ratio), 0, greatest)
            mujoco.mj_step(model, data)
    return (data.qpos[0] - settled_m) / (EPISODE_S - SETTLE_S), False


episodes = [episode() for _ in range(int(num_episodes))]
print(json.dumps({"speed_m_per_s": float(np.mean([speed for speed, _ in episodes])), "falls": sum(fell for _, fell in episodes)}))

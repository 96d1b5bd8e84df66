"""canter's task in Python: the same MJCF, preset, gait, action law, observation, reward and accidents.

Only what the `doggo` preset uses is here: the sine prior, the `modulate` action law, level ground. `check.py` repeats
canter's own episodes and compares every observation and reward.

Arrays: N robots, L legs, M = 2 L motors, A actions, O observations. Units: m, kg, s, rad, N m.
"""

import dataclasses
import json
import pathlib
import tomllib

import mujoco
import mujoco.batch
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]

# Numbers in [0, 1) that one random start takes: the phase, roll, pitch, yaw, swing and extension of each leg.
NUMBERS_PER_START = 12

# A state could not be a robot's beyond this [m, rad, m/s, rad/s].
LARGEST_SANE = 1e3


@dataclasses.dataclass(frozen=True)
class Task:
    """The preset, the robot and what `peer_task` says of them."""

    preset: dict
    robot: dict
    peer: dict

    @staticmethod
    def load(peer_task):
        """Reads the repository's files and the output of `peer_task` at this path."""
        preset = tomllib.loads((ROOT / "presets/doggo.toml").read_text())
        robot = tomllib.loads((ROOT / "robots" / preset["robot"] / "robot.toml").read_text())
        task = Task(preset, robot, json.loads(pathlib.Path(peer_task).read_text()))
        policy = preset["policy"]
        assert policy["modulation"] == "modulate" and task.gait["kind"] == "sine", "the only gait and law that are here"
        assert "goal_distance_m" not in preset["task"] and "friction" not in preset["task"], "not here"
        assert all(leg["actuated"] == "leg-space" for leg in robot["legs"]), "the only actuators that are here"
        return task

    @property
    def gait(self):
        return next(gait for gait in self.robot["gaits"] if gait["name"] == self.preset["policy"]["prior"])

    @property
    def num_substeps(self):
        return round(self.preset["task"]["control_dt_s"] / self.preset["task"]["physics_dt_s"])

    @property
    def height_margin_m(self):
        """What trainings add to the least height."""
        return self.preset["task"].get("height_margin", 0.0) * self.robot["stance_height_m"]

    @property
    def num_actions(self):
        return 1 + 4 * len(self.robot["legs"])

    @property
    def num_observations(self):
        num_motors = 2 * len(self.robot["legs"])
        lengths = {"motor_angles": num_motors, "motor_velocities": num_motors, "orientation": 3,
                   "angular_velocity": 3, "phase": 2, "previous_action": self.num_actions}
        return sum(lengths[block] for block in self.preset["policy"]["observation"])

    def model(self):
        """The compiled model with the preset's physics step."""
        model = mujoco.MjModel.from_xml_path(str(ROOT / "robots" / self.preset["robot"] / self.robot["model"]))
        model.opt.timestep = self.preset["task"]["physics_dt_s"]
        return model


class SinglePhysics:
    """One robot in one MjData; the arrays have N = 1."""

    def __init__(self, model):
        self.model, self.data = model, mujoco.MjData(model)
        self.qpos, self.qvel, self.ctrl = self.data.qpos[None], self.data.qvel[None], self.data.ctrl[None]
        self.actuator_torques = self.data.qfrc_actuator[None]
        self.torque_ranges = model.jnt_actfrcrange[None]

    def reset(self, _index):
        mujoco.mj_resetData(self.model, self.data)

    def step(self):
        mujoco.mj_step(self.model, self.data)


class BatchPhysics:
    """N robots on MuJoCo's own thread pool."""

    def __init__(self, model, num_robots, num_threads):
        self.batch = mujoco.batch.Batch(model, nsim=num_robots, nthread=num_threads)
        self.qpos, self.qvel, self.ctrl = (self.batch.bind(name) for name in ("qpos", "qvel", "ctrl"))
        self.actuator_torques = self.batch.bind("qfrc_actuator")
        self.torque_ranges = self.batch.expand("jnt_actfrcrange")

    def reset(self, index):
        self.batch.reset([index], stage=mujoco.mjtStage.mjSTAGE_NONE)

    def step(self):
        self.batch.step()


class Motors:
    """The motors' torque-speed curve, which limits them anew at every physics step."""

    def __init__(self, settings, joints, physics):
        self.max_nm, self.stall_nm = settings["max_torque_nm"], settings["stall_torque_nm"]
        self.no_load = settings["no_load_speed_rad_per_s"]
        # Below this speed the current limit alone decides, and nothing has to be written [rad/s].
        self.free_speed = self.no_load * (1.0 - self.max_nm / self.stall_nm)
        self.joints, self.ranges = joints, physics.torque_ranges
        self.ranges[:, joints] = -self.max_nm, self.max_nm
        self.is_limited = False

    def limit(self, velocities):
        """Sets the torque ranges for these joint speeds, `(N, M)` [rad/s]."""
        must_limit = np.abs(velocities).max() > self.free_speed
        if must_limit or self.is_limited:
            ratio = velocities / self.no_load
            self.ranges[:, self.joints, 0] = np.clip(-self.stall_nm * (1.0 + ratio), -self.max_nm, 0.0)
            self.ranges[:, self.joints, 1] = np.clip(self.stall_nm * (1.0 - ratio), 0.0, self.max_nm)
            self.is_limited = must_limit


class Law:
    """The sine gait and the `modulate` action law."""

    def __init__(self, task):
        policy, gait, ranges = task.preset["policy"], task.gait, task.preset["policy"]["ranges"]
        self.authority, self.frequency_hz = policy["authority"], gait["stride_frequency_hz"]
        self.frequency_factor = ranges["frequency_factor"]
        # Swing amplitude, extension amplitude, swing offset, extension offset.
        self.defaults = np.array([gait["swing_amplitude_rad"], gait["extension_amplitude_rad"], 0.0, 0.0])
        keys = ("swing_amplitude_rad", "extension_amplitude_rad", "swing_offset_rad", "extension_offset_rad")
        self.low, self.high = np.array([ranges[key] for key in keys]).T
        # (L, 2): where the swing's and the extension's sine stand in the cycle.
        leg_offsets = np.array(task.peer["phase_offsets_cycles"])
        self.offsets = np.stack([leg_offsets, leg_offsets + gait["extension_phase_cycles"]], axis=1)
        limits = task.robot["limits"]
        self.leg_low, self.leg_high = np.array([limits["swing_rad"], limits["extension_rad"]]).T

    def stride_frequency_hz(self, actions):
        """`(N)` from `(N, A)`."""
        low, high = self.frequency_factor
        action = actions[:, 0]
        factor = 1.0 + action * np.where(action < 0.0, 1.0 - low, high - 1.0)
        return self.frequency_hz * (1.0 - self.authority + self.authority * factor)

    def commands(self, phases, actions):
        """Leg positions, `(N, L, 2)` [rad], at these phases, `(N)` [cycles], under `(N, A)`."""
        action = actions[:, 1:].reshape(len(actions), -1, 4)
        reach = np.where(action < 0.0, self.defaults - self.low, self.high - self.defaults)
        parameters = self.defaults + self.authority * action * reach
        wave = np.sin(2.0 * np.pi * (phases[:, None, None] + self.offsets))
        return np.clip(parameters[:, :, 2:] + parameters[:, :, :2] * wave, self.leg_low, self.leg_high)


def from_euler(roll, pitch, yaw):
    """Quaternion (w, x, y, z) of intrinsic z-y-x angles [rad]."""
    quaternion = np.zeros(4)
    mujoco.mju_euler2Quat(quaternion, np.array([yaw, pitch, roll]), "zyx")
    return quaternion


def to_euler(quaternions):
    """Roll, pitch, yaw and the up axis's rise: four arrays, `(N)`, of `(N, 4)`."""
    w, x, y, z = quaternions.T
    s = 2.0 / (w * w + x * x + y * y + z * z)
    up = 1.0 - s * (x * x + y * y)
    roll = np.arctan2(s * (y * z + w * x), up)
    pitch = np.arcsin(np.clip(s * (w * y - x * z), -1.0, 1.0))
    yaw = np.arctan2(s * (x * y + w * z), 1.0 - s * (y * y + z * z))
    return roll, pitch, yaw, up


class World:
    """N robots that do the task side by side; whoever steps them resets those whose episode has ended.

    `height_margin_m` is added to the least height that is no accident: the preset's while it trains, none while it is
    evaluated.
    """

    def __init__(self, task, physics, height_margin_m):
        self.task, self.physics = task, physics
        self.settings, self.weights = task.preset["task"], task.preset["reward"]
        self.blocks = task.preset["policy"]["observation"]
        legs = task.robot["legs"]
        self.scratch_model = task.model()
        self.scratch = mujoco.MjData(self.scratch_model)
        model = self.scratch_model
        self.motor_joints = np.array([model.joint(name).id for leg in legs for name in leg["motors"]])
        knee_joints = np.array([model.joint(name).id for leg in legs for name in leg["knees"]])
        self.motor_qpos, self.knee_qpos = model.jnt_qposadr[self.motor_joints], model.jnt_qposadr[knee_joints]
        self.motor_dofs = model.jnt_dofadr[self.motor_joints]
        self.actuators = np.array([model.actuator(name).id for leg in legs for name in leg["actuators"]])
        self.feet = np.array([model.geom(leg["foot"]).id for leg in legs])
        root = model.body(task.robot["body"]).jntadr[0]
        self.root, self.root_dof = model.jnt_qposadr[root], model.jnt_dofadr[root]
        self.reference = model.qpos0.copy()
        self.law, self.motors = Law(task), Motors(task.robot["motor"], self.motor_joints, physics)
        self.leg_length_m = task.robot["stance_height_m"]
        self.lift_energy_j = task.peer["mass_kg"] * -model.opt.gravity[2] * self.leg_length_m
        self.max_env_steps = round(self.settings["episode_s"] / self.settings["control_dt_s"])
        self.min_height_m = task.robot["limits"]["min_height_m"] + height_margin_m

        num_robots, delay = len(physics.qpos), task.robot["command_delay_steps"]
        self.phases = np.zeros(num_robots)
        self.previous_actions = np.zeros((num_robots, task.num_actions))
        # Oldest first; each (N, L, 2).
        self.commands = [np.zeros((num_robots, len(legs), 2)) for _ in range(delay + 1)]
        self.stuck_s, self.returns = np.zeros(num_robots), np.zeros(num_robots)
        self.env_steps = np.zeros(num_robots, dtype=int)

    def reset(self, index, numbers):
        """Starts an episode of one robot from standing; `numbers` are NUMBERS_PER_START in [0, 1)."""
        noise = self.settings["start_noise_rad"] * (2.0 * np.asarray(numbers[1:]) - 1.0)
        legs = np.clip(noise[3:].reshape(-1, 2), self.law.leg_low, self.law.leg_high)
        self.phases[index] = numbers[0]
        self.previous_actions[index] = 0.0
        self.stuck_s[index] = self.returns[index] = self.env_steps[index] = 0
        for commands in self.commands:
            commands[index] = legs

        qpos = self.scratch.qpos
        qpos[:] = self.reference
        qpos[self.root : self.root + 2] = 0.0
        qpos[self.root + 3 : self.root + 7] = from_euler(*noise[:3])
        swing, extension = legs.T
        qpos[self.motor_qpos] += np.stack([swing - extension, swing + extension], axis=1).ravel()
        folds = np.array([self.fold(leg, angle) - self.fold(leg, 0.0)
                          for leg, angle in zip(self.task.robot["legs"], extension)])
        qpos[self.knee_qpos] += np.stack([-folds, folds], axis=1).ravel()
        mujoco.mj_kinematics(self.scratch_model, self.scratch)
        lowest = self.scratch.geom_xpos[self.feet, 2] - self.scratch_model.geom_size[self.feet, 0]
        qpos[self.root + 2] -= lowest.min()
        self.physics.reset(index)
        self.physics.qpos[index] = qpos

    def fold(self, leg, extension):
        """Angle between a leg's upper and lower link [rad]."""
        upper, lower, length = leg["upper_link_m"], leg["lower_link_m"], self.leg_length_m
        gamma = np.arccos((upper**2 + length**2 - lower**2) / (2.0 * upper * length)) - extension
        return gamma + np.arcsin(upper * np.sin(gamma) / lower)

    def step(self, actions):
        """One control step of every robot under `(N, A)`; rewards, terminated and truncated, `(N)` each."""
        actions = np.clip(actions, -1.0, 1.0)
        action_change = np.square(actions - self.previous_actions).sum(axis=1)
        self.previous_actions[:] = actions
        self.commands = [*self.commands[1:], self.law.commands(self.phases, actions)]
        self.phases = (self.phases + self.law.stride_frequency_hz(actions) * self.settings["control_dt_s"]) % 1.0

        before, yaw_before = self.positions.copy(), to_euler(self.quaternions)[2]
        work_j = self.simulate()
        self.env_steps += 1
        _, _, yaw, up = to_euler(self.quaternions)
        moved = (self.positions - before) / self.leg_length_m
        turn = np.arctan2(np.sin(yaw - yaw_before), np.cos(yaw - yaw_before))
        w = self.weights
        rewards = (w["forward"] * moved[:, 0] - w["drift"] * np.abs(moved[:, 1]) - w["bounce"] * np.abs(moved[:, 2])
                   - w["energy"] * work_j / self.lift_energy_j - w["turn"] * np.abs(turn)
                   - w["action_rate"] * action_change)
        unstable = self.unstable()
        rewards = np.where(unstable, 0.0, rewards)
        terminated = self.accidents(up) | unstable
        self.returns += rewards
        if terminated.any():
            lost = np.minimum((self.settings["accident_return_weight"] - 1.0) * self.returns, 0.0)
            rewards = rewards + terminated * (lost - self.settings["accident_cost"])
        return rewards, terminated, ~terminated & (self.env_steps >= self.max_env_steps)

    def simulate(self):
        """The physics steps of one control step; the motors' work, `(N)` [J]."""
        physics, dofs = self.physics, self.motor_dofs
        physics.ctrl[:, self.actuators] = self.commands[0].reshape(len(physics.ctrl), -1)
        power_sum = 0.0
        for _ in range(self.task.num_substeps):
            velocities = physics.qvel[:, dofs]
            self.motors.limit(velocities)
            physics.step()
            power_sum = power_sum + np.abs(physics.actuator_torques[:, dofs] * velocities).sum(axis=1)
        return power_sum * self.settings["physics_dt_s"]

    def unstable(self):
        """`(N)`: states that make no sense."""
        is_sane = np.abs(self.physics.qpos).max(axis=1) < LARGEST_SANE
        return ~(is_sane & (np.abs(self.physics.qvel).max(axis=1) < LARGEST_SANE))

    def accidents(self, up):
        """`(N)`: rolled over, too low, or a leg stuck for too long."""
        limits = self.task.robot["limits"]
        angles = self.motor_angles.reshape(len(up), -1, 2)
        swing = (angles[:, :, 0] + angles[:, :, 1]) / 2.0
        extension = (angles[:, :, 1] - angles[:, :, 0]) / 2.0
        errors = np.abs(self.commands[0] - np.stack([swing, extension], axis=2)).max(axis=(1, 2))
        is_far = errors > limits["stuck_error_rad"]
        self.stuck_s = np.where(is_far, self.stuck_s + self.settings["control_dt_s"], 0.0)
        return ((up < np.cos(np.radians(limits["max_tilt_deg"]))) | (self.positions[:, 2] < self.min_height_m)
                | (self.stuck_s >= limits["stuck_time_s"]))

    @property
    def positions(self):
        """The bodies' positions, `(N, 3)` [m]."""
        return self.physics.qpos[:, self.root : self.root + 3]

    @property
    def quaternions(self):
        return self.physics.qpos[:, self.root + 3 : self.root + 7]

    @property
    def motor_angles(self):
        """`(N, M)` [rad], zero in the standing pose."""
        return self.physics.qpos[:, self.motor_qpos] - self.reference[self.motor_qpos]

    def observations(self):
        """`(N, O)`, float32, not normalised."""
        roll, pitch, yaw, _ = to_euler(self.quaternions)
        angle = 2.0 * np.pi * self.phases
        parts = {
            "motor_angles": self.motor_angles,
            "motor_velocities": self.physics.qvel[:, self.motor_dofs],
            "orientation": np.stack([roll, pitch, yaw], axis=1),
            "angular_velocity": self.physics.qvel[:, self.root_dof + 3 : self.root_dof + 6],
            "phase": np.stack([np.sin(angle), np.cos(angle)], axis=1),
            "previous_action": self.previous_actions,
        }
        return np.concatenate([parts[block] for block in self.blocks], axis=1, dtype=np.float32)


def evaluate(task, num_threads, act):
    """Mean forward speed of `act`, observations to actions, over canter's own starts [m/s].

    An episode that falls keeps its full time.
    """
    settings, starts = task.preset["evaluation"], task.peer["starts"]
    control_dt_s = task.preset["task"]["control_dt_s"]
    num_steps, settle_steps = (round(settings[key] / control_dt_s) for key in ("episode_s", "settle_s"))
    world = World(task, BatchPhysics(task.model(), len(starts), num_threads), 0.0)
    for index, start in enumerate(starts):
        world.reset(index, start["numbers"])
        # To the last bit: it decides whether the lowest foot, which just touches the ground, has a contact at once.
        world.physics.qpos[index] = start["qpos"]
    is_walking = np.ones(len(starts), dtype=bool)
    settled, end = np.zeros(len(starts)), np.zeros(len(starts))
    for step in range(num_steps):
        if step == settle_steps:
            settled = end.copy()
        _, terminated, _ = world.step(act(world.observations()))
        end = np.where(is_walking, world.positions[:, 0], end)
        is_walking &= ~terminated
        if step < settle_steps:
            settled = end.copy()
        if not is_walking.any():
            break
    return float((end - settled).mean() / (num_steps * control_dt_s - settings["settle_s"]))

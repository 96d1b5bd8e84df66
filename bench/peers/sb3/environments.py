"""The Python task as Gymnasium and Stable-Baselines3 want it, in three kinds of vector environment."""

import pathlib
import sys

import gymnasium
import numpy as np
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import doggo


def spaces(task):
    """Observation and action space."""
    unbounded, unit = (np.full(length, limit, dtype=np.float32)
                       for length, limit in [(task.num_observations, np.inf), (task.num_actions, 1.0)])
    return gymnasium.spaces.Box(-unbounded, unbounded), gymnasium.spaces.Box(-unit, unit)


class DoggoEnv(gymnasium.Env):
    """One robot."""

    render_mode = None

    def __init__(self, task):
        self.observation_space, self.action_space = spaces(task)
        self.world = doggo.World(task, doggo.SinglePhysics(task.model()), task.height_margin_m)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.world.reset(0, self.np_random.random(doggo.NUMBERS_PER_START))
        return self.world.observations()[0], {}

    def step(self, action):
        rewards, terminated, truncated = self.world.step(action[None])
        return self.world.observations()[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), {}


class BatchVecEnv(VecEnv):
    """All robots in one `mujoco.batch.Batch`, their task computed in arrays."""

    render_mode = None

    def __init__(self, task, num_robots, num_threads):
        super().__init__(num_robots, *spaces(task))
        self.world = doggo.World(task, doggo.BatchPhysics(task.model(), num_robots, num_threads), task.height_margin_m)
        self.rng, self.actions = np.random.default_rng(), None

    def seed(self, seed=None):
        self.rng = np.random.default_rng(seed)
        return [seed] * self.num_envs

    def start(self, index):
        self.world.reset(index, self.rng.random(doggo.NUMBERS_PER_START))

    def reset(self):
        for index in range(self.num_envs):
            self.start(index)
        return self.world.observations()

    def step_async(self, actions):
        self.actions = actions

    def step_wait(self):
        rewards, terminated, truncated = self.world.step(self.actions)
        observations, infos = self.world.observations(), [{} for _ in range(self.num_envs)]
        ended = np.flatnonzero(terminated | truncated)
        for index in ended:
            infos[index] = {"terminal_observation": observations[index], "TimeLimit.truncated": bool(truncated[index])}
            self.start(index)
        if len(ended) > 0:
            # A new array: the infos keep rows of the old one.
            observations = self.world.observations()
        return observations, rewards.astype(np.float32), terminated | truncated, infos

    def close(self):
        pass

    def get_attr(self, attr_name, indices=None):
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None):
        raise NotImplementedError("the robots share their attributes")

    def env_method(self, method_name, *args, indices=None, **kwargs):
        raise NotImplementedError("the robots have no methods of their own")

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * len(list(self._get_indices(indices)))


def make(kind, task, num_robots, num_threads):
    """The vector environment of this kind: `dummy`, `subproc` or `batch`."""
    if kind == "batch":
        return BatchVecEnv(task, num_robots, num_threads)
    robots = [lambda: DoggoEnv(task)] * num_robots
    # A fork starts at once and shares PyTorch's memory; a new process for each robot would import it again.
    return SubprocVecEnv(robots, start_method="fork") if kind == "subproc" else DummyVecEnv(robots)

"""canter's environments as Gymnasium has them.

Observations and rewards are those that `canter train` learns from: the observation is not normalised, and with
`policy.symmetric` the second half of a gait cycle is shown in the mirror.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from canter import _native
from canter.configurations import configuration

Floats: TypeAlias = NDArray[np.float32]
Infos: TypeAlias = dict[str, Any]


def spaces(environments: _native.Environments) -> tuple[Any, Any]:
    """Observation and action space of one environment: `(O)` unbounded, `(A)` in [-1, 1]."""
    observation = gymnasium.spaces.Box(-np.inf, np.inf, (environments.num_observations,), np.float32)
    return observation, gymnasium.spaces.Box(-1.0, 1.0, (environments.num_actions,), np.float32)


class Steps(NamedTuple):
    """What a step of N environments brought."""

    #: `(N, O)`.
    observations: Floats
    #: `(N)`.
    rewards: NDArray[np.float64]
    #: `(N)` way forward [m].
    forward_m: NDArray[np.float64]
    #: `(N)` work of the motors [J].
    work_j: NDArray[np.float64]
    #: `(N)` whether the episode ended in an accident.
    terminations: NDArray[np.bool_]
    #: `(N)` whether it ended at a limit.
    truncations: NDArray[np.bool_]
    #: `(N)` whether the environment was reset instead of stepped.
    resets: NDArray[np.bool_]
    #: `(N, O)` the last observations of the episodes that ended, if they were reset in the same step.
    last_observations: Floats
    #: Environments that had an accident, and which.
    accidents: list[tuple[int, str]]


def reset_all(
    environments: _native.Environments, seeds: Sequence[int | None], mask: NDArray[np.bool_] | None = None
) -> Floats:
    """Resets those in the mask; the observations of all, `(N, O)`."""
    observations = np.empty((environments.num_envs, environments.num_observations), dtype=np.float32)
    environments.reset(seeds, None if mask is None else mask.tolist(), observations)
    return observations


def step_all(environments: _native.Environments, actions: Floats, same_step: bool = False) -> Steps:
    """Steps all by `(N, A)`, into new arrays."""
    shape = (environments.num_envs, environments.num_observations)
    observations = np.empty(shape, dtype=np.float32)
    last_observations = np.empty(shape if same_step else (0, 0), dtype=np.float32)
    numbers = np.empty((3, environments.num_envs), dtype=np.float64)
    flags = np.empty((3, environments.num_envs), dtype=np.uint8)
    results = observations, numbers, flags, last_observations
    accidents = environments.step(np.asarray(actions, dtype=np.float32), same_step, results)
    rewards, forward_m, work_j = numbers
    terminations, truncations, resets = flags.view(np.bool_)
    return Steps(
        observations, rewards, forward_m, work_j, terminations, truncations, resets, last_observations, accidents
    )


class VectorEnv(gymnasium.vector.VectorEnv[Floats, Floats, NDArray[Any]]):
    """Environments of one robot, gait and ground, stepped side by side on threads of canter's own, without Python's lock.

    Args:
        preset: Name of a preset (`canter.presets()`) or path of a configuration file; by default the robot's own
            preset if it has one, else `doggo`.
        robot: Name of a robot (`canter.robots()`) or path of a robot.toml, instead of the preset's.
        gait: Name of the robot's gait that is modulated, instead of the preset's.
        num_envs: Number of environments; None for as many as the preset's training has. With `task.variation` they
            have different grounds, evenly spread.
        threads: Number of threads; None for as many as there are cores. It changes no result.
        overrides: Other values of the configuration by their dotted keys, e.g. `{"task.slope_deg": 10}`:
            what `--set` is for the program.
        autoreset_mode: When an environment whose episode has ended is reset, see Gymnasium.
        evaluation: Whether everything is as in an evaluation: its number of episodes, their starts, length and physics
            steps; no goal, no variation, no height margin. Environment i begins as the evaluation's episode i does,
            then as the one after it.

    Infos hold for each environment that was stepped `forward_m`, its way in this step [m], and `work_j`, the work of its
    motors [J], and `accident` for each whose episode ended in one: `rollover`, `too_low`, `leg_stuck` or `unstable`.

    Raises:
        canter.ConfigError: What `canter train` would say of such a configuration.
    """

    def __init__(
        self,
        preset: str | None = None,
        *,
        robot: str | None = None,
        gait: str | None = None,
        num_envs: int | None = None,
        threads: int | None = None,
        overrides: Mapping[str, Any] | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        evaluation: bool = False,
    ) -> None:
        asked = configuration(preset, robot, gait, overrides)
        self._native = _native.Environments(asked, num_envs, None, threads, evaluation)
        #: Names of the robot and of the gait that is modulated.
        self.robot, self.gait = self._native.robot, self._native.gait
        #: Time between two steps [s].
        self.control_dt_s = self._native.control_dt_s
        #: Names of the observation's blocks, in order.
        self.observation_blocks = self._native.observation_blocks
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.num_envs = self._native.num_envs
        self.single_observation_space, self.single_action_space = spaces(self._native)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        # (N) whether an environment has to be reset before it can be stepped.
        self._ended = np.ones(self.num_envs, dtype=np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Floats, Infos]:
        """Starts a new episode in every environment, or in those of `options["reset_mask"]`, `(N)`.

        Environment i draws its starts from a stream of its own, given by i and the seed: one seed for all, or one for
        each. Without a seed every stream goes on; it begins with the configuration's, in whose states canter's own
        training with this seed begins its episodes.
        """
        seeds: list[int | None]
        if seed is None or isinstance(seed, (int, np.integer)):
            super().reset(seed=None if seed is None else int(seed))
            seeds = [None if seed is None else int(seed)] * self.num_envs
        else:
            seeds = [None if one is None else int(one) for one in seed]
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed: expected one for each of the {self.num_envs} environments, not {len(seeds)}")
        mask = None if options is None else options.get("reset_mask")
        if mask is not None and (
            not isinstance(mask, np.ndarray) or mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any()
        ):
            raise ValueError(f"reset_mask: expected an array of {self.num_envs} truth values, at least one of them True")
        self._ended[slice(None) if mask is None else mask] = False
        return reset_all(self._native, seeds, mask), {}

    def step(
        self, actions: Floats
    ) -> tuple[Floats, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], Infos]:
        """Steps every environment by its row of `actions`, `(N, A)`, clamped to [-1, 1]; NaN counts as 0."""
        if self._ended.any() and self.autoreset_mode is not AutoresetMode.NEXT_STEP:
            raise gymnasium.error.ResetNeeded(f"reset these environments first: {np.flatnonzero(self._ended).tolist()}")
        same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        steps = step_all(self._native, actions, same_step)
        ended = steps.terminations | steps.truncations
        if not same_step:
            self._ended = ended
        return steps.observations, steps.rewards, steps.terminations, steps.truncations, self._infos(steps, ended)

    def _infos(self, steps: Steps, ended: NDArray[np.bool_]) -> Infos:
        """Infos of a step as Gymnasium's own vector environments build them: `_key` says which environments have `key`."""
        if self.autoreset_mode is not AutoresetMode.SAME_STEP or not ended.any():
            return self._what_happened(steps, ~steps.resets)
        infos = self._what_happened(steps, ~ended, accidents=False)
        infos["final_obs"] = np.full(self.num_envs, None, dtype=object)
        for index in np.flatnonzero(ended):
            infos["final_obs"][index] = steps.last_observations[index]
        infos["final_info"] = self._what_happened(steps, ended)
        infos["_final_obs"], infos["_final_info"] = ended, ended.copy()
        return infos

    def _what_happened(self, steps: Steps, mask: NDArray[np.bool_], accidents: bool = True) -> Infos:
        """What happened in this step to the environments in the mask, `(N)`."""
        infos: Infos = {
            "forward_m": np.where(mask, steps.forward_m, 0.0),
            "_forward_m": mask,
            "work_j": np.where(mask, steps.work_j, 0.0),
            "_work_j": mask.copy(),
        }
        if accidents and steps.accidents:
            names, had_one = np.full(self.num_envs, None, dtype=object), np.zeros(self.num_envs, dtype=np.bool_)
            for index, name in steps.accidents:
                names[index], had_one[index] = name, True
            infos["accident"], infos["_accident"] = names, had_one
        return infos

    def __repr__(self) -> str:
        return f"VectorEnv(robot={self.robot!r}, gait={self.gait!r}, num_envs={self.num_envs})"


class Env(gymnasium.Env[Floats, Floats]):
    """One environment, stepped on the calling thread without Python's lock.

    The arguments are those of [`VectorEnv`]; `place` is its number and among how many: `(3, 16)` for the fourth one of a
    vector environment of 16, with the same starts and the same ground.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        preset: str | None = None,
        *,
        robot: str | None = None,
        gait: str | None = None,
        place: tuple[int, int] = (0, 1),
        overrides: Mapping[str, Any] | None = None,
        evaluation: bool = False,
    ) -> None:
        asked = configuration(preset, robot, gait, overrides)
        self._native = _native.Environments(asked, 1, place, 1, evaluation)
        #: As those of [`VectorEnv`].
        self.robot, self.gait = self._native.robot, self._native.gait
        self.control_dt_s = self._native.control_dt_s
        self.observation_blocks = self._native.observation_blocks
        self.observation_space, self.action_space = spaces(self._native)
        self._ended = True

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, Infos]:
        """Starts a new episode; with a seed, the first of its stream."""
        super().reset(seed=seed)
        self._ended = False
        return reset_all(self._native, [seed])[0], {}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, Infos]:
        """Steps by an action, `(A)`, clamped to [-1, 1]; NaN counts as 0."""
        if self._ended:
            raise gymnasium.error.ResetNeeded("reset the environment first: its episode has ended")
        steps = step_all(self._native, np.asarray(action, dtype=np.float32)[np.newaxis])
        terminated, truncated = bool(steps.terminations[0]), bool(steps.truncations[0])
        self._ended = terminated or truncated
        info: Infos = {"forward_m": float(steps.forward_m[0]), "work_j": float(steps.work_j[0])}
        for _, name in steps.accidents:
            info["accident"] = name
        return steps.observations[0], float(steps.rewards[0]), terminated, truncated, info

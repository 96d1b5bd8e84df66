"""canter's environments as Stable-Baselines3 has them: `pip install stable-baselines3` first."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common import vec_env

from canter.environments import VectorEnv


class VecEnv(vec_env.VecEnv):
    """The vector environment for Stable-Baselines3; the arguments are those of [`canter.VectorEnv`]."""

    #: Asked for by the base class: there is nothing to see.
    render_mode = None

    def __init__(self, preset: str | None = None, **arguments: Any) -> None:
        self._env = VectorEnv(preset, autoreset_mode=AutoresetMode.SAME_STEP, **arguments)
        super().__init__(self._env.num_envs, self._env.single_observation_space, self._env.single_action_space)
        self._actions: NDArray[np.float32] | None = None

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seeds the next reset; each environment has its own stream of the same seed. None: the streams go on."""
        self._seeds = [seed] * self.num_envs
        return self._seeds

    def reset(self) -> NDArray[np.float32]:
        """Starts a new episode in every environment."""
        observations, _ = self._env.reset(seed=self._seeds)
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keeps the actions for [`step_wait`]."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Steps every environment, and starts a new episode where one ended."""
        assert self._actions is not None, "step_async() comes first"
        observations, rewards, terminations, truncations, vector_infos = self._env.step(self._actions)
        ended = terminations | truncations
        # A new one each: wrappers write into them.
        infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in range(self.num_envs)]
        for index in np.flatnonzero(ended):
            infos[index]["TimeLimit.truncated"] = bool(truncations[index])
            infos[index]["terminal_observation"] = vector_infos["final_obs"][index]
        return observations, rewards.astype(np.float32), ended, infos

    def close(self) -> None:
        """Nothing is open."""

    def _indices(self, indices: int | Iterable[int] | None) -> list[int]:
        return list(self._get_indices(indices))

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """An attribute, which the environments share."""
        value = getattr(self if attr_name == "render_mode" else self._env, attr_name)
        return [value for _ in self._indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Refused: environments have no attributes of their own."""
        raise NotImplementedError(f"`{attr_name}` cannot be set: give canter.sb3.VecEnv what is to be different")

    def env_method(
        self, method_name: str, *method_args: Any, indices: int | Iterable[int] | None = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refused: environments have no methods of their own."""
        raise NotImplementedError(f"canter's environments have no method `{method_name}`")

    def env_is_wrapped(self, wrapper_class: type, indices: int | Iterable[int] | None = None) -> list[bool]:
        """No environment is wrapped."""
        return [False for _ in self._indices(indices)]

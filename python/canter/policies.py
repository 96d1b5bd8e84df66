"""Learned policies."""

import json
import os
import pathlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from canter import _native


class Policy:
    """The policy of a run: mirror, normaliser and network, computed by the code that runs on the robot."""

    def __init__(self, run: str | os.PathLike[str]) -> None:
        self._native = _native.Policy(pathlib.Path(run))
        #: Everything in the policy's file that is not an array: docs/policy-format.md.
        self.card: dict[str, Any] = json.loads(self._native.card)
        #: Name of the robot that it was trained on.
        self.robot: str = self.card["robot"]["name"]
        #: Name of the gait that it modulates.
        self.gait: str = self.card["gait"]["name"]
        #: Names of the observation's blocks, in order.
        self.observation_blocks: list[str] = self.card["observation"]
        #: Time between two commands [s].
        self.control_dt_s: float = self.card["robot"]["control_dt_s"]
        #: Lengths of an observation and of an action.
        self.num_observations, self.num_actions = self._native.num_observations, self._native.num_actions

    def act(self, observation: ArrayLike) -> NDArray[np.float32]:
        """The action, `(A)`, for an observation as an environment gives it, `(O)`; for `(K, O)` it is `(K, A)`."""
        observations = np.asarray(observation, dtype=np.float32)
        if observations.ndim not in (1, 2):
            raise ValueError(f"observation: expected one or two dimensions, not {observations.ndim}")
        rows = np.atleast_2d(observations)
        actions = np.empty((len(rows), self.num_actions), dtype=np.float32)
        self._native.act(rows, actions)
        return actions if observations.ndim == 2 else actions[0]

    def __repr__(self) -> str:
        return f"Policy(robot={self.robot!r}, gait={self.gait!r})"


def load_policy(run: str | os.PathLike[str]) -> Policy:
    """The policy of a run's folder, which has proved itself on the test vectors in its file.

    Raises:
        canter.RunError: No run there, no policy yet, or one that cannot be used.
    """
    return Policy(run)

"""How fast a gait is."""

import json
import os
import pathlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from canter import _native
from canter.configurations import override
from canter.environments import VectorEnv


def evaluate(
    run: str | os.PathLike[str] | None = None,
    *,
    robot: str | None = None,
    gait: str | None = None,
    slope: float | None = None,
    friction: float | None = None,
    episodes: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Measures the policy of a run, its prior and the robot's default gaits from the same starts, as `canter eval` does.

    Args:
        run: Folder of a run.
        robot: Instead of a run, a robot whose ...
        gait: ... gait is measured.
        slope: Slope of the ground, positive uphill [deg].
        friction: Sliding friction.
        episodes: Number of episodes of each gait.
        seed: Seed of the starts.
        threads: Number of threads; None for as many as there are cores. It changes no result.
        overrides: Other values of the configuration by their dotted keys.

    Returns:
        The verdict in the form of eval.json, see docs/metrics.md.

    Raises:
        canter.RunError: No run there, no policy yet, or one that cannot be used.
        canter.ConfigError: A value cannot be used.
    """
    if run is not None and robot is None and gait is None:
        path = pathlib.Path(run)
        asked = _native.Configuration.of_run(path)
    elif run is None and robot is not None and gait is not None:
        path = None
        asked = _native.Configuration.of_gait(robot, gait)
    else:
        raise TypeError("evaluate() takes either a run, or a robot and its gait")
    named = {
        "task.slope_deg": slope,
        "task.friction": friction,
        "evaluation.num_episodes": episodes,
        "evaluation.seed": seed,
    }
    override(asked, {key: value for key, value in named.items() if value is not None})
    override(asked, overrides or {})
    verdict: dict[str, Any] = json.loads(_native.judge(asked, path, threads))
    return verdict


def measure(
    act: Callable[[NDArray[np.float32]], ArrayLike],
    preset: str | None = None,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    **arguments: Any,
) -> dict[str, Any]:
    """Measures a policy that is written in Python, from canter or not, from the same starts as [`evaluate`].

    Args:
        act: Gives the actions, `(K, A)`, for K observations, `(K, O)`.
        preset: As for [`canter.VectorEnv`], like `overrides` and all further arguments.
        episodes: Number of episodes; None for the configuration's.
        seed: Seed of the starts; None for the evaluation's in the configuration.

    Returns:
        `speed_m_per_s`, `falls` and `speeds_m_per_s`, one for each episode, as in eval.json.
    """
    env = VectorEnv(
        preset,
        num_envs=episodes,
        overrides=overrides,
        evaluation=True,
        autoreset_mode=AutoresetMode.NEXT_STEP,
        **arguments,
    )
    num_steps, settle_steps = env._native.max_env_steps, env._native.settle_steps
    observations, _ = env.reset(seed=seed)
    walking, fell = np.ones(env.num_envs, dtype=np.bool_), np.zeros(env.num_envs, dtype=np.bool_)
    way_m = np.zeros(env.num_envs)
    for step in range(num_steps):
        actions = np.asarray(act(observations), dtype=np.float32)
        observations, _, terminations, _, infos = env.step(actions)
        if step >= settle_steps:
            way_m[walking] += infos["forward_m"][walking]
        fell |= walking & terminations
        walking &= ~terminations
    # Whoever falls keeps the full time.
    speeds = way_m / ((num_steps - settle_steps) * env.control_dt_s)
    return {"speed_m_per_s": float(speeds.mean()), "falls": int(fell.sum()), "speeds_m_per_s": speeds.tolist()}

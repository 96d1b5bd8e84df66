"""Learns a faster version of a legged robot's own gait: canter for Python."""

import pathlib

import gymnasium

from canter import _native
from canter._native import ConfigError, RunError
from canter.environments import Env, VectorEnv
from canter.evaluation import evaluate, measure
from canter.policies import Policy, load_policy

__all__ = [
    "ConfigError",
    "Env",
    "Policy",
    "RunError",
    "VectorEnv",
    "evaluate",
    "load_policy",
    "measure",
    "presets",
    "robots",
]

__version__: str = _native.VERSION

# The program tries the models of robots that do not come with canter, in a process with limits.
_native.set_program(pathlib.Path(__file__).parent / "bin" / "canter")


def presets() -> list[str]:
    """Names of the presets that come with canter."""
    return _native.preset_names()


def robots() -> list[str]:
    """Names of the robots that come with canter."""
    return _native.robot_names()


def _register() -> None:
    """Makes every preset known to Gymnasium: `doggo-robust` is `canter/DoggoRobust-v0`."""
    for preset in presets():
        name = "".join(word.capitalize() for word in preset.split("-"))
        gymnasium.register(
            id=f"canter/{name}-v0",
            entry_point="canter.environments:Env",
            vector_entry_point="canter.environments:VectorEnv",
            kwargs={"preset": preset},
        )


_register()

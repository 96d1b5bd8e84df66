"""What is asked for in Python's words becomes a configuration."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from canter import _native

#: The preset that counts when neither a preset nor a robot is named.
DEFAULT_PRESET = "doggo"


def configuration(
    preset: str | None,
    robot: str | None,
    gait: str | None,
    overrides: Mapping[str, Any] | None,
) -> _native.Configuration:
    """A preset or a configuration file with other values in it; what is wrong is only found when it is used."""
    if preset is None:
        preset = robot if robot in _native.preset_names() else DEFAULT_PRESET
    assert preset is not None
    made = _native.Configuration.of_preset(preset)
    named = {"robot": robot, "policy.prior": gait}
    override(made, {key: value for key, value in named.items() if value is not None})
    override(made, overrides or {})
    return made


def override(configuration: _native.Configuration, values: Mapping[str, Any]) -> None:
    """Puts values over those of a configuration, by their dotted keys."""
    for key, value in values.items():
        configuration.set(key, as_toml(value))


def as_toml(value: Any) -> str:
    """A value as TOML: numbers, strings and truth values are written as in JSON."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(key)} = {as_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, (bool, int, float, str)):
        return json.dumps(value, ensure_ascii=False)
    raise TypeError(
        f"a configuration holds numbers, strings, truth values, lists and tables of them, not {value!r}; "
        "leave a key out for what the preset says"
    )

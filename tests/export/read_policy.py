"""Reads policy.safetensors as docs/policy-format.md describes it, with numpy alone, and repeats its test vectors.

usage: read_policy.py POLICY.safetensors
"""

import json
import sys

import numpy as np


def read(path):
    """The card (what is not an array) and the arrays by name."""
    data = open(path, "rb").read()
    start = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:start])
    card = json.loads(header.pop("__metadata__")["canter"])
    assert card["format_version"] == 3, "another version of the format"
    types = {"F32": "<f4", "U64": "<u8"}
    arrays = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        values = np.frombuffer(data[start + begin : start + end], types[entry["dtype"]])
        arrays[name] = values.reshape(entry["shape"])
    return card, arrays


def act(card, arrays, observation):
    """The action for one raw observation."""
    mirror = card["mirror"]
    is_mirrored = mirror is not None and observation[mirror["sine"]] < 0

    def reflected(vector, components):
        return np.array([sign * vector[source] for source, sign in components], np.float32)

    x = reflected(observation, mirror["observation"]) if is_mirrored else observation
    x = np.clip((x - arrays["normaliser.mean"]) * arrays["normaliser.inverse_std"], -10, 10)
    for layer in range(3):
        x = np.tanh(x @ arrays[f"actor.{layer}.weight"] + arrays[f"actor.{layer}.bias"])
    return reflected(x, mirror["action"]) if is_mirrored else x


if __name__ == "__main__":
    card, arrays = read(sys.argv[1])
    actions = np.array([act(card, arrays, observation) for observation in arrays["test.observation"]])
    error = np.abs(actions - arrays["test.action"]).max()
    print(f"{card['robot']['name']}, {card['gait']['name']}: {len(actions)} test vectors, largest error {error:.1e}")
    assert error < 1e-5

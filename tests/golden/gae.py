"""Writes gae.json: generalised advantages of random cases, by the definition and not by the recursion.

A_t is the sum over l of (gamma lambda)^l delta_{t+l} (Schulman et al. 2016, eq. 16), from step t to the end of its
episode or of the rollout. delta = r + gamma V(next) - V, where V(next) is 0 after an accident, the value of the
last observation before the reset after a limit, and else the value of the next step's observation. Needs Python 3
only.
"""

import json
import pathlib
import random

SEED = 20240607


def make_case(rng, gamma, gae_lambda, accident, limit, num_steps=12):
    rewards = [rng.uniform(-2, 2) for _ in range(num_steps)]
    values = [rng.uniform(-3, 3) for _ in range(num_steps)]
    terminated = [rng.random() < accident for _ in range(num_steps)]
    truncated = [not accident_now and rng.random() < limit for accident_now in terminated]
    last_values = [rng.uniform(-3, 3) for _ in range(num_steps)]  # used after a limit and at the rollout's end

    def value_of_what_follows(t):
        if terminated[t]:
            return 0.0
        if truncated[t] or t == num_steps - 1:
            return last_values[t]
        return values[t + 1]

    next_values = [value_of_what_follows(t) for t in range(num_steps)]
    deltas = [rewards[t] + gamma * next_values[t] - values[t] for t in range(num_steps)]

    def end_of_episode(t):
        return next((s for s in range(t, num_steps) if terminated[s] or truncated[s]), num_steps - 1)

    advantages = [
        sum((gamma * gae_lambda) ** (s - t) * deltas[s] for s in range(t, end_of_episode(t) + 1))
        for t in range(num_steps)
    ]
    return {
        "gamma": gamma,
        "gae_lambda": gae_lambda,
        "rewards": rewards,
        "values": values,
        "next_values": next_values,
        "terminated": terminated,
        "truncated": truncated,
        "advantages": advantages,
    }


rng = random.Random(SEED)
cases = [
    make_case(rng, gamma, gae_lambda, accident, limit)
    for gamma, gae_lambda in [(0.99, 0.95), (0.9, 0.5), (0.99, 0.0), (1.0, 1.0)]
    for accident, limit in [(0.0, 0.0), (0.25, 0.0), (0.0, 0.25), (0.2, 0.2)]
]
for name in ("terminated", "truncated"):
    assert any(any(case[name]) for case in cases)
pathlib.Path(__file__).with_name("gae.json").write_text(
    "[\n" + ",\n".join(json.dumps(case) for case in cases) + "\n]\n"
)

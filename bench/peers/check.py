"""Repeats canter's episodes with the Python task and compares every observation and reward, then measures the prior.

python check.py PEER_TASK_JSON
"""

import json
import sys

import numpy as np

import doggo

# canter computes gait and observation in float32, Python in float64; a walk spreads the difference.
TOLERANCE = 1e-4

# Episodes of 10 s go their own ways after a different rounding, but their mean speed may not [share of the speed].
SPEED_TOLERANCE = 0.03


def differences(task, physics, episode):
    """The largest difference of an observation and of a reward over an episode."""
    world = doggo.World(task, physics, task.height_margin_m)
    start = episode["start"]
    world.reset(0, start["numbers"])
    observation = np.abs(world.observations()[0] - start["observation"]).max()
    assert np.abs(physics.qpos[0] - start["qpos"]).max() < TOLERANCE, "another start"
    physics.qpos[0] = start["qpos"]
    reward = 0.0
    for number, step in enumerate(episode["steps"]):
        rewards, terminated, _ = world.step(np.array([step["action"]], dtype=np.float32))
        assert bool(terminated[0]) == (step["terminated"] is not None), f"step {number}: {step['terminated']}"
        # Velocities are the largest numbers: relative where they are above 1.
        scale = np.maximum(1.0, np.abs(step["observation"]))
        observation = max(observation, (np.abs(world.observations()[0] - step["observation"]) / scale).max())
        reward = max(reward, abs(rewards[0] - step["reward"]))
    return float(observation), float(reward)


def main():
    task = doggo.Task.load(sys.argv[1])
    report = {"tolerance": TOLERANCE, "episodes": []}
    for episode in task.peer["episodes"]:
        for name, physics in [("single", doggo.SinglePhysics(task.model())),
                              ("batch", doggo.BatchPhysics(task.model(), 1, 1))]:
            observation, reward = differences(task, physics, episode)
            report["episodes"].append({"physics": name, "env_steps": len(episode["steps"]),
                                       "accident": episode["steps"][-1]["terminated"],
                                       "observation_difference": observation, "reward_difference": reward})
    prior = doggo.evaluate(task, 1, lambda observations: np.zeros((len(observations), task.num_actions)))
    report["prior_speed_m_per_s"], report["canters_prior_speed_m_per_s"] = prior, task.peer["prior_speed_m_per_s"]
    print(json.dumps(report, indent=2))
    worst = max(max(row["observation_difference"], row["reward_difference"]) for row in report["episodes"])
    if worst > TOLERANCE:
        sys.exit(f"the Python task is not canter's: they differ by {worst}")
    if abs(prior / task.peer["prior_speed_m_per_s"] - 1.0) > SPEED_TOLERANCE:
        sys.exit(f"the prior walks {prior} m/s, with canter {task.peer['prior_speed_m_per_s']} m/s")


if __name__ == "__main__":
    main()

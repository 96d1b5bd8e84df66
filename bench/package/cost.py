"""What a step of the Python package's vector environments costs beside the same step in `canter train`'s collection; JSON.

A process in Rust collects with a new policy and writes down its actions and rewards. The same environments then take the
same actions through `canter.VectorEnv`, and through `canter.sb3.VecEnv`; a reward that differs ends the program. So the
physics is the same work, bit for bit. Collecting asks the policy in its time, the others get their actions for nothing.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import tempfile
import time

import canter
import canter.sb3
import numpy as np


def collect(program, environments, threads, rounds):
    """What the process says, and its actions, `(R, T, N, A)`, and rewards, `(R, T, N)`."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "walks.bin"
        command = [program, f"--environments={environments}", f"--threads={threads}", f"--rounds={rounds}", f"--out={path}"]
        report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        walks = np.fromfile(path, np.float32).reshape(1 + rounds, -1)
    num_envs, horizon = report["environments"], report["horizon"]
    actions, rewards = np.split(walks, [walks.shape[1] - num_envs * horizon], axis=1)
    actions = actions.reshape(1 + rounds, num_envs, horizon, -1).swapaxes(1, 2)
    return report, np.ascontiguousarray(actions), rewards.reshape(1 + rounds, num_envs, horizon).swapaxes(1, 2)


def repeat(step, actions, rewards):
    """Wall and processor times of the rounds after the first [s]."""
    wall_s, processor_s = [], []
    for round_actions, round_rewards in zip(actions, rewards, strict=True):
        wall, processor = time.perf_counter(), time.process_time()
        steps = [step(action)[1] for action in round_actions]
        wall_s.append(time.perf_counter() - wall)
        processor_s.append(time.process_time() - processor)
        assert np.array_equal(np.array(steps, np.float32), round_rewards), "not the same work"
    return wall_s[1:], processor_s[1:]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("collect_walks", help="the program of canter-bench")
    parser.add_argument("--turns", type=int, default=6, help="how often everything is done in turns")
    parser.add_argument("--rounds", type=int, default=5, help="timings in a turn")
    parser.add_argument("--environments", type=int, default=32)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()

    times = {"rust": [], "vector": [], "sb3": []}
    load = os.getloadavg()[0]
    for _ in range(args.turns):
        report, actions, rewards = collect(args.collect_walks, args.environments, args.threads, args.rounds)
        made_of = {"num_envs": args.environments, "threads": args.threads}
        vector = canter.VectorEnv("doggo", autoreset_mode="SameStep", **made_of)
        sb3 = canter.sb3.VecEnv("doggo", **made_of)
        vector.reset()
        sb3.reset()
        times["rust"].append((report["wall_s"], report["processor_s"]))
        times["vector"].append(repeat(vector.step, actions, rewards))
        times["sb3"].append(repeat(sb3.step, actions, rewards))

    env_steps = report["environments"] * report["horizon"]
    result = {"environments": args.environments, "threads": args.threads, "turns": args.turns,
              "load_average_before": load}
    for kind, clock in [(0, "wall"), (1, "processor")]:
        # One median for each turn.
        medians = {name: [statistics.median(turn[kind]) for turn in turns] for name, turns in times.items()}
        for name, values in medians.items():
            result[f"{name}_{clock}_us_per_env_step"] = 1e6 * statistics.median(values) / env_steps
        for name in ["vector", "sb3"]:
            ratios = [one / base for one, base in zip(medians[name], medians["rust"], strict=True)]
            result[f"{name}_over_rust_{clock}"] = statistics.quantiles(ratios, n=4, method="inclusive")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()

"""Trains the Python task with Stable-Baselines3's PPO and prints what it cost, as JSON.

Either for a number of env steps, to see what they cost, or, with --times, until the learned gait is so many times as
fast as canter's default gait in two evaluations in a row. The clock starts after the imports; evaluations count.
"""

import argparse
import json
import pathlib
import time

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

import environments
from environments import doggo

# Evaluations in a row that must reach the speed.
NUM_IN_A_ROW = 2


def canters(preset, num_env_steps):
    """The preset's hyperparameters in Stable-Baselines3's words, for a training of at most so many env steps.

    A learning rate that follows the KL divergence has no counterpart: it stays at its first value.
    """
    ppo, network, training = preset["ppo"], preset["network"], preset["training"]
    first = ppo["learning_rate"]
    last = ppo.get("final_learning_rate", first)

    def learning_rate(share_left):
        share = (1.0 - share_left) * num_env_steps / training["max_env_steps"]
        return first + (last - first) * min(share, 1.0)

    return {
        "num_robots": training["num_environments"],
        "n_steps": training["horizon"],
        "batch_size": ppo["minibatch_size"],
        "n_epochs": ppo["num_epochs"],
        "gamma": ppo["gamma"],
        "gae_lambda": ppo["gae_lambda"],
        "clip_range": ppo["clip_epsilon"],
        "learning_rate": learning_rate,
        "ent_coef": ppo["entropy_coefficient"],
        # canter's value loss has a factor 1/2.
        "vf_coef": 0.5 * ppo["value_coefficient"],
        "max_grad_norm": ppo["max_gradient_norm"],
        "normalize_advantage": ppo["normalise_advantages"],
        "policy_kwargs": {
            "net_arch": {"pi": [network["actor_hidden"]] * 2, "vf": [network["critic_hidden"]] * 2},
            "log_std_init": network["initial_log_std"],
        },
    }


def settings(name, preset, num_env_steps):
    """Hyperparameters by name; `num_robots` is how many robots collect, the rest is PPO's."""
    ours = canters(preset, num_env_steps)
    return {
        "canter": ours,
        # Large minibatches and fewer of them: what PyTorch is fastest with.
        "large-batch": {**ours, "batch_size": 2048, "learning_rate": 6e-4},
        # Less updating for each sample, in longer steps.
        "few-epochs": {**ours, "batch_size": 1024, "n_epochs": 5, "learning_rate": 1e-3},
        # RL Baselines3 Zoo's for Minitaur.
        "zoo": {"num_robots": 8, "n_steps": 2048, "batch_size": 64, "n_epochs": 10, "gamma": 0.99, "gae_lambda": 0.95,
                "clip_range": 0.2, "learning_rate": 2.5e-4, "ent_coef": 0.0, "vf_coef": 0.5, "max_grad_norm": 0.5},
    }[name]


class Watch(BaseCallback):
    """Times collecting and updating, and evaluates."""

    def __init__(self, task, args, start):
        super().__init__()
        self.task, self.args, self.start = task, args, start
        self.collect_s, self.update_s, self.began = [], [], None
        self.evaluations, self.num_reached, self.reached_s = [], 0, None
        self.next_evaluation = args.evaluate_every

    def _on_rollout_start(self):
        if self.began is not None:
            self.update_s.append(time.perf_counter() - self.began)
        # The policy is evaluated as it is after an update.
        if self.args.times is not None and self.num_timesteps >= self.next_evaluation:
            self.next_evaluation += self.args.evaluate_every
            self.evaluate()
        self.began = time.perf_counter()

    def _on_rollout_end(self):
        now = time.perf_counter()
        self.collect_s.append(now - self.began)
        self.began = now

    def _on_training_end(self):
        # The last update, if the training did not end while collecting.
        if len(self.update_s) < len(self.collect_s):
            self.update_s.append(time.perf_counter() - self.began)

    def _on_step(self):
        return self.reached_s is None

    def evaluate(self):
        normalise = self.training_env.normalize_obs
        act = lambda observations: self.model.predict(normalise(observations), deterministic=True)[0]
        speed = doggo.evaluate(self.task, self.args.threads, act)
        seconds = time.perf_counter() - self.start
        self.evaluations.append({"seconds": seconds, "env_steps": self.num_timesteps, "speed_m_per_s": speed})
        target = self.args.times * self.task.peer["default_speed_m_per_s"]
        self.num_reached = self.num_reached + 1 if speed >= target else 0
        if self.num_reached == NUM_IN_A_ROW:
            self.reached_s = seconds


def resident_mb():
    """Memory of this process and its children, shared pages counted once [MB, 10^6 bytes]."""
    parents = {}
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    family, last_size = {int(pathlib.Path("/proc/self").resolve().name)}, 0
    while len(family) > last_size:
        last_size = len(family)
        family |= {process for process, parent in parents.items() if parent in family}
    rollups = (pathlib.Path(f"/proc/{process}/smaps_rollup").read_text() for process in family)
    kib = sum(int(line.split()[1]) for text in rollups for line in text.splitlines() if line.startswith("Pss:"))
    return kib * 1024 / 1e6


def parse_args():
    parser = argparse.ArgumentParser()
    parser.add_argument("peer_task", help="the output of canter's peer_task")
    parser.add_argument("--vec-env", choices=["dummy", "subproc", "batch"], default="batch")
    parser.add_argument("--threads", type=int, default=1, help="of torch and of the batch")
    parser.add_argument("--settings", default="canter")
    parser.add_argument("--batch-size", type=int, help="another minibatch than the settings'")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--env-steps", type=int, default=20_000, help="ends the training, rounded up to an iteration")
    parser.add_argument("--times", type=float, help="stop at this multiple of the default speed")
    parser.add_argument("--evaluate-every", type=int, default=40_000, help="env steps")
    parser.add_argument("--first-step", action="store_true", help="only make the environment and step it once")
    return parser.parse_args()


def main():
    args = parse_args()
    task = doggo.Task.load(args.peer_task)
    hyperparameters = settings(args.settings, task.preset, args.env_steps)
    num_robots = hyperparameters.pop("num_robots")
    if args.first_step:
        env = environments.DoggoEnv(task)
        env.reset(seed=args.seed)
        env.step(np.zeros(task.num_actions, dtype=np.float32))
        return
    if args.batch_size:
        hyperparameters["batch_size"] = args.batch_size
    torch.set_num_threads(args.threads)
    start = time.perf_counter()
    env = VecNormalize(environments.make(args.vec_env, task, num_robots, args.threads), norm_reward=False)
    model = PPO("MlpPolicy", env, seed=args.seed, device="cpu", **hyperparameters)
    watch = Watch(task, args, start)
    model.learn(args.env_steps, callback=watch)
    total_s = time.perf_counter() - start
    num_samples = num_robots * hyperparameters["n_steps"]
    # The first iteration warms up, if there is another one.
    collect, update = (float(np.median(times[1:] or times)) for times in (watch.collect_s, watch.update_s))
    print(json.dumps({
        "vec_env": args.vec_env, "threads": args.threads, "settings": args.settings, "seed": args.seed,
        "batch_size": hyperparameters["batch_size"], "robots": num_robots,
        "collect_s_per_env_step": collect / num_samples, "update_s_per_sample": update / num_samples,
        "env_steps_per_s": num_samples / (collect + update), "update_share": update / (collect + update),
        "resident_mb": resident_mb(), "total_s": total_s,
        "seconds": watch.reached_s, "env_steps": model.num_timesteps, "evaluations": watch.evaluations,
    }, indent=2))
    env.close()


if __name__ == "__main__":
    main()

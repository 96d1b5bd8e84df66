"""Trains with Stable-Baselines3's PPO on the Python package's environments and measures the gait that comes of it; JSON.

The training is that of docs/python.md. The speed is that of `canter eval`: the same starts, physics and length of the
episodes as for the default gaits, which are measured beside it.
"""

import argparse
import json
import os
import time

import canter
import canter.sb3
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="doggo")
    parser.add_argument("--env-steps", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=1, help="of the training")
    parser.add_argument("--evaluation-seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=20)
    parser.add_argument("--threads", type=int, default=2, help="of canter and of torch")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)

    load, start = os.getloadavg()[0], time.perf_counter()
    level = {"task.variation": {}}
    env = VecNormalize(canter.sb3.VecEnv(args.preset, threads=args.threads, overrides=level), norm_reward=False)
    env.seed(args.seed)
    model = PPO("MlpPolicy", env, n_steps=128, batch_size=512, n_epochs=8, gamma=0.98, learning_rate=6e-4,
                policy_kwargs={"log_std_init": -0.7}, seed=args.seed, device="cpu")
    model.learn(args.env_steps)
    seconds = time.perf_counter() - start

    def act(observations):
        return model.predict(env.normalize_obs(observations), deterministic=True)[0]

    protocol = {"episodes": args.episodes, "seed": args.evaluation_seed}
    learned = canter.measure(act, args.preset, threads=args.threads, **protocol)
    walker = canter.Env(args.preset)
    prior = canter.evaluate(robot=walker.robot, gait=walker.gait, threads=args.threads, **protocol)
    print(json.dumps({
        "preset": args.preset,
        "seed": args.seed,
        "env_steps": model.num_timesteps,
        "seconds": seconds,
        "load_average_before": load,
        "default_gait": prior["default_gait"],
        "default_speed_m_per_s": prior["default_speed_m_per_s"],
        "speed_m_per_s": learned["speed_m_per_s"],
        "falls": learned["falls"],
        "speed_ratio": learned["speed_m_per_s"] / prior["default_speed_m_per_s"],
    }, indent=1))


if __name__ == "__main__":
    main()

"""Stable-Baselines3: run where it is installed, because its torch takes gigabytes (`cargo xtask python --sb3`)."""

import numpy as np
import pytest

import canter

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

import canter.sb3

N = 4
# What other packages deprecate is no fault of ours.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")


@pytest.mark.parametrize("preset", canter.presets())
def test_its_checker_has_no_complaint(preset):
    check_env(canter.Env(preset), skip_render_check=True)


def test_the_adapter_does_what_its_own_vector_environment_does():
    """Every number, flag and terminal observation of DummyVecEnv over our single environments."""
    overrides = {"task.episode_s": 0.1, "task.slope_deg": 40, "task.variation": {}}
    ours = canter.sb3.VecEnv("doggo", num_envs=N, overrides=overrides)
    theirs = DummyVecEnv([lambda i=i: canter.Env("doggo", place=(i, N), overrides=overrides) for i in range(N)])
    assert (ours.observation_space, ours.action_space) == (theirs.observation_space, theirs.action_space)
    # DummyVecEnv gives environment i the seed + i, ours has its own stream of one seed.
    for i, env in enumerate(theirs.envs):
        theirs._seeds[i] = 3
        env.reset(seed=3)
    ours.seed(3)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    draw = np.random.default_rng(0)
    num_ended = 0
    for _ in range(30):
        actions = draw.uniform(-1, 1, (N, *ours.action_space.shape)).astype(np.float32)
        our_step, their_step = ours.step(actions), theirs.step(actions)
        for our_array, their_array in zip(our_step[:3], their_step[:3], strict=True):
            np.testing.assert_array_equal(our_array, their_array)
            assert our_array.dtype == their_array.dtype
        for our_info, their_info, ended in zip(our_step[3], their_step[3], our_step[2], strict=True):
            assert our_info["TimeLimit.truncated"] == their_info["TimeLimit.truncated"]
            assert ("terminal_observation" in our_info) == ended
            if ended:
                np.testing.assert_array_equal(our_info["terminal_observation"], their_info["terminal_observation"])
                num_ended += 1
    assert num_ended >= 2 * N


def test_ppo_trains_and_what_it_has_learned_can_be_measured():
    env = VecNormalize(VecMonitor(canter.sb3.VecEnv("doggo", num_envs=N, overrides={"task.episode_s": 0.5})))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=2, seed=1, device="cpu")
    before = model.policy.state_dict()["mlp_extractor.policy_net.0.weight"].clone()
    model.learn(2 * N * 64)
    assert (model.policy.state_dict()["mlp_extractor.policy_net.0.weight"] != before).any()
    # VecMonitor has seen whole episodes.
    assert len(model.ep_info_buffer) >= N
    assert model.ep_info_buffer[0]["l"] <= 50
    measured = canter.measure(
        lambda observations: model.predict(env.normalize_obs(observations), deterministic=True)[0],
        "doggo",
        episodes=2,
        overrides={"evaluation.episode_s": 2.0},
    )
    assert np.isfinite(measured["speeds_m_per_s"]).all()


def test_attributes_are_shared_and_cannot_be_set():
    env = canter.sb3.VecEnv("doggo", num_envs=2)
    assert env.get_attr("robot") == ["doggo", "doggo"]
    assert env.get_attr("gait", [1]) == ["sine"]
    assert env.env_is_wrapped(VecMonitor) == [False, False]
    with pytest.raises(NotImplementedError, match="robot"):
        env.set_attr("robot", "minitaur")

"""The single environment."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import canter


# Whatever is learned, the action 0.5 is no still stand.
def walk(env, num_steps):
    """Observations and rewards of some steps."""
    action = np.full(env.action_space.shape, 0.5, dtype=np.float32)
    steps = [env.step(action) for _ in range(num_steps)]
    return np.array([step[0] for step in steps]), np.array([step[1] for step in steps])


@pytest.mark.filterwarnings("ignore:.*A Box observation space (maximum|minimum) value is.*infinity")
@pytest.mark.parametrize("preset", canter.presets())
def test_gymnasiums_checker_has_no_complaint(preset):
    check_env(canter.Env(preset), skip_render_check=True)


@pytest.mark.filterwarnings("ignore:.*A Box observation space (maximum|minimum) value is.*infinity")
def test_every_preset_can_be_made_by_its_name():
    env = gymnasium.make("canter/Doggo-v0")
    observation, _ = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    assert env.unwrapped.robot == "doggo"
    env = gymnasium.make("canter/MinitaurRobust-v0", overrides={"task.slope_deg": 5})
    assert env.unwrapped.robot == "minitaur"
    envs = gymnasium.make_vec("canter/Doggo-v0", num_envs=3)
    assert isinstance(envs.unwrapped, canter.VectorEnv)
    assert envs.reset()[0].shape == (3, *envs.single_observation_space.shape)


def test_the_same_seed_gives_the_same_walk_and_another_seed_another():
    env = canter.Env("doggo")
    env.reset(seed=7)
    first = walk(env, 20)
    env.reset(seed=7)
    again = walk(env, 20)
    env.reset(seed=8)
    other = walk(env, 20)
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    assert (first[0] != other[0]).any()


def test_without_a_seed_the_configurations_counts_and_its_stream_goes_on():
    starts = [canter.Env("doggo").reset()[0], canter.Env("doggo", overrides={"seed": 1}).reset()[0]]
    np.testing.assert_array_equal(*starts)
    env = canter.Env("doggo")
    assert (env.reset()[0] != env.reset()[0]).any()


def test_an_ended_episode_must_be_reset():
    env = canter.Env("doggo", overrides={"task.episode_s": 0.1})
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(env.action_space.sample())
    env.reset()
    for step in range(10):
        _, _, terminated, truncated, info = env.step(np.zeros(env.action_space.shape, dtype=np.float32))
        assert (terminated, truncated) == (False, step == 9)
        assert set(info) == {"forward_m", "work_j"}
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(env.action_space.sample())


def test_an_accident_has_its_name():
    # 45 degrees uphill are no ground to stand on.
    env = canter.Env("doggo", overrides={"task.slope_deg": 45, "task.variation": {}})
    env.reset(seed=1)
    while True:
        _, _, terminated, truncated, info = env.step(np.ones(env.action_space.shape, dtype=np.float32))
        if terminated or truncated:
            break
    assert terminated
    assert info["accident"] in {"rollover", "too_low", "leg_stuck"}


def test_way_and_reward_are_the_simulators():
    """Where nothing but the way is rewarded, the reward is the way in leg lengths."""
    weights = {f"reward.{term}": 0.0 for term in ["drift", "bounce", "energy", "turn", "action_rate"]}
    env = canter.Env("doggo", overrides={**weights, "task.episode_s": 1.0, "task.variation": {}})
    env.reset(seed=1)
    rewards, ways = [], []
    for _ in range(50):
        _, reward, *_, info = env.step(np.zeros(env.action_space.shape, dtype=np.float32))
        rewards.append(reward)
        ways.append(info["forward_m"])
    # Doggo stands on legs of 0.17 m.
    np.testing.assert_allclose(np.array(rewards), np.array(ways) / 0.17, rtol=1e-5, atol=1e-7)

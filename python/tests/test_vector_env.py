"""The vector environment."""

import subprocess
import sys
import threading

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import canter

N = 5
SHORT = {"task.episode_s": 0.1}


def actions_of(env, seed, num_steps):
    """Random actions, `(T, N, A)`."""
    shape = (num_steps, *env.action_space.shape)
    return np.random.default_rng(seed).uniform(-1, 1, shape).astype(np.float32)


def test_shapes_and_types():
    env = canter.VectorEnv("doggo", num_envs=N)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert env.observation_space.shape == (N, *env.single_observation_space.shape)
    assert env.action_space.shape == (N, *env.single_action_space.shape)
    observations, infos = env.reset(seed=1)
    assert infos == {}
    assert env.observation_space.contains(observations)
    observations, rewards, terminations, truncations, infos = env.step(env.action_space.sample())
    assert env.observation_space.contains(observations)
    for array, dtype in [(rewards, np.float64), (terminations, np.bool_), (truncations, np.bool_)]:
        assert (array.shape, array.dtype) == ((N,), dtype)
    assert {key: infos[key].shape for key in infos} == dict.fromkeys(["forward_m", "_forward_m", "work_j", "_work_j"], (N,))
    assert infos["_forward_m"].all()


def test_each_step_has_arrays_of_its_own():
    env = canter.VectorEnv("doggo", num_envs=N)
    env.reset(seed=1)
    first = env.step(np.zeros(env.action_space.shape, dtype=np.float32))
    kept = [array.copy() for array in first[:4]]
    env.step(np.ones(env.action_space.shape, dtype=np.float32))
    for array, copy in zip(first[:4], kept, strict=True):
        np.testing.assert_array_equal(array, copy)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_it_does_what_gymnasium_does_with_single_environments(mode):
    """Every number, flag and info of Gymnasium's own vector environment over our single ones."""
    overrides = {**SHORT, "task.slope_deg": 40, "task.variation.slope_deg": [20, 45]}
    ours = canter.VectorEnv("doggo", num_envs=N, overrides=overrides, autoreset_mode=mode)
    single = [lambda i=i: canter.Env("doggo", place=(i, N), overrides=overrides) for i in range(N)]
    theirs = gymnasium.vector.SyncVectorEnv(single, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is theirs.metadata["autoreset_mode"]
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    np.testing.assert_array_equal(ours.reset(seed=3)[0], theirs.reset(seed=[3] * N)[0])
    num_ended = 0
    for actions in actions_of(ours, 0, 45):
        our_step, their_step = ours.step(actions), theirs.step(actions)
        for our_array, their_array in zip(our_step[:4], their_step[:4], strict=True):
            np.testing.assert_array_equal(our_array, their_array)
            assert our_array.dtype == their_array.dtype
        assert_same_infos(our_step[4], their_step[4])
        ended = our_step[2] | our_step[3]
        num_ended += ended.sum()
        if mode is AutoresetMode.DISABLED and ended.any():
            with pytest.raises(gymnasium.error.ResetNeeded):
                ours.step(actions)
            our_reset, their_reset = [env.reset(options={"reset_mask": ended.copy()}) for env in (ours, theirs)]
            np.testing.assert_array_equal(our_reset[0], their_reset[0])
    assert num_ended >= 2 * N


def assert_same_infos(ours, theirs):
    """Gymnasium's infos have no keys where there is nothing to say; where a mask is False a number means nothing."""
    for key in {*ours, *theirs} - {key for key in ours if key.startswith("_")}:
        if key.startswith("_"):
            continue
        mask = np.asarray(theirs.get(f"_{key}", np.zeros(N, dtype=bool)))
        if isinstance(ours.get(key), dict):
            assert_same_infos(ours[key], theirs[key])
        else:
            np.testing.assert_array_equal(ours.get(f"_{key}", np.zeros(N, dtype=bool)), mask)
            for i in np.flatnonzero(mask):
                np.testing.assert_array_equal(ours[key][i], theirs[key][i])


def test_the_number_of_threads_changes_nothing():
    walks = []
    for threads in [1, 2, 3]:
        env = canter.VectorEnv("doggo-robust", num_envs=N, threads=threads, overrides=SHORT)
        env.reset(seed=4)
        walks.append([env.step(actions)[:4] for actions in actions_of(env, 1, 25)])
    for other in walks[1:]:
        for step, other_step in zip(walks[0], other, strict=True):
            for array, other_array in zip(step, other_step, strict=True):
                np.testing.assert_array_equal(array, other_array)


def test_seeds_one_for_each():
    env = canter.VectorEnv("doggo", num_envs=3)
    same = env.reset(seed=5)[0]
    again = env.reset(seed=[5, 6, None])[0]
    np.testing.assert_array_equal(same[0], again[0])
    assert (same[1] != again[1]).any()
    with pytest.raises(ValueError, match="3 environments"):
        env.reset(seed=[1, 2])
    with pytest.raises(OverflowError):
        env.reset(seed=[-1, 2, 3])


def test_other_threads_run_while_it_steps():
    """Whoever has Python's lock keeps it here, unless it gives it up by itself: only `step` can let the other one run."""
    env = canter.VectorEnv("doggo", num_envs=16, threads=1)
    env.reset(seed=1)
    still = np.zeros(env.action_space.shape, dtype=np.float32)
    begin, ran = threading.Event(), []

    def run():
        begin.wait()
        ran.append(True)

    other = threading.Thread(target=run)
    before = sys.getswitchinterval()
    other.start()
    sys.setswitchinterval(1000.0)
    try:
        begin.set()
        assert not ran
        for _ in range(1000):
            if ran:
                break
            env.step(still)
        assert ran
    finally:
        sys.setswitchinterval(before)
        other.join()


def test_two_threads_may_step_one_environment():
    env = canter.VectorEnv("doggo", num_envs=4, threads=2)
    env.reset(seed=1)
    still = np.zeros(env.action_space.shape, dtype=np.float32)
    threads = [threading.Thread(target=lambda: [env.step(still) for _ in range(20)]) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert not any(thread.is_alive() for thread in threads)


def test_wrong_actions_and_masks_are_refused():
    env = canter.VectorEnv("doggo", num_envs=2)
    env.reset()
    with pytest.raises(ValueError, match=r"actions: expected the shape \[2, 17\], not \[2, 16\]"):
        env.step(np.zeros((2, 16), dtype=np.float32))
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": np.zeros(2, dtype=bool)})


def test_actions_of_another_type_or_order_are_taken():
    walks = []
    for convert in [np.asarray, np.asfortranarray, lambda a: a.astype(np.float64), lambda a: a.tolist()]:
        env = canter.VectorEnv("doggo", num_envs=2)
        env.reset(seed=1)
        walks.append(env.step(convert(actions_of(env, 2, 1)[0]))[0])
    for other in walks[1:]:
        np.testing.assert_array_equal(walks[0], other)


def test_any_robot_gait_and_ground():
    for robot in canter.robots():
        env = canter.VectorEnv(robot=robot, num_envs=2, overrides={"task.ground": {"roughness": 0.1}, "task.slope_deg": 5})
        assert env.robot == robot
        env.reset(seed=1)
        assert np.isfinite(env.step(env.action_space.sample())[0]).all()
    assert canter.VectorEnv(gait="bound", overrides={"policy.symmetric": False}).gait == "bound"


def test_what_is_wrong_is_said_as_the_program_says_it(program_error):
    wrong = {"ppo.gama": 1, "task.slope_deg": 90, "policy.prior": "galopp"}
    with pytest.raises(canter.ConfigError) as caught:
        canter.VectorEnv("doggo", overrides=wrong)
    settings = ["--set=ppo.gama=1", "--set=task.slope_deg=90", '--set=policy.prior="galopp"']
    assert str(caught.value) == program_error("train", "doggo", *settings)
    assert "gamma" in str(caught.value) and "-45" in str(caught.value)
    with pytest.raises(canter.ConfigError) as caught:
        canter.VectorEnv("dogo")
    assert str(caught.value) == program_error("train", "dogo")
    with pytest.raises(canter.ConfigError) as caught:
        canter.Env(robot="no/robot.toml")
    assert str(caught.value) == program_error("train", "--set=robot=\"no/robot.toml\"")
    assert issubclass(canter.ConfigError, ValueError)


def test_what_toml_cannot_hold_is_refused():
    for value in [None, object()]:
        with pytest.raises(TypeError):
            canter.VectorEnv(overrides={"task.friction": value})
    overrides = {"policy.ranges.swing_amplitude_rad": np.array([0.0, 0.5]), "training.num_environments": np.int64(33)}
    assert canter.VectorEnv(overrides=overrides).num_envs == 33


def test_a_robot_of_ones_own_is_tried_in_a_process_first(tmp_path, repository):
    """A model that would take MuJoCo gigabytes is an exception, and does not end this process."""
    for file in (repository / "robots" / "minitaur").iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    env = canter.VectorEnv("minitaur", robot=str(tmp_path / "robot.toml"), num_envs=2)
    assert env.robot == "minitaur"
    model = next(tmp_path.glob("*.xml"))
    model.write_text(model.read_text().replace("<mujoco", "<mujoco broken='yes'", 1))
    with pytest.raises(canter.ConfigError, match="MuJoCo cannot load this model"):
        canter.VectorEnv("minitaur", robot=str(tmp_path / "robot.toml"), num_envs=2)


@pytest.fixture
def program_error(tmp_path):
    """What the program complains of."""

    def run(*arguments):
        done = subprocess.run([sys.prefix + "/bin/canter", *arguments], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode != 0
        return done.stderr.strip().removeprefix("error: ")

    return run

"""Learned policies and verdicts."""

import json
import struct

import numpy as np
import pytest

import canter


def tensors_of(path):
    """The arrays of a safetensors file, read by the format's own words."""
    data = path.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header, body = json.loads(data[8 : 8 + length]), data[8 + length :]
    header.pop("__metadata__")
    arrays = {}
    for name, tensor in header.items():
        begin, end = tensor["data_offsets"]
        dtype = {"F32": "<f4", "F64": "<f8", "U64": "<u8"}[tensor["dtype"]]
        arrays[name] = np.frombuffer(body[begin:end], dtype).reshape(tensor["shape"])
    return arrays


def test_actions_are_the_files_test_vectors(run):
    policy = canter.load_policy(run)
    tensors = tensors_of(run / "policy.safetensors")
    observations, actions = tensors["test.observation"], tensors["test.action"]
    np.testing.assert_array_equal(policy.act(observations), actions)
    for observation, action in zip(observations, actions, strict=True):
        np.testing.assert_array_equal(policy.act(observation), action)


def test_what_a_policy_says_of_itself(run):
    policy = canter.load_policy(run)
    assert (policy.robot, policy.gait, policy.card["action"]["modulation"]) == ("doggo", "sine", "modulate")
    assert (policy.num_observations, policy.num_actions, policy.control_dt_s) == (41, 17, 0.01)
    assert policy.observation_blocks[0] == "motor_angles"
    assert policy.card["provenance"]["env_steps"] == 1024
    with pytest.raises(ValueError, match="expected 41 components, not 40"):
        policy.act(np.zeros(40))
    with pytest.raises(ValueError, match="dimensions"):
        policy.act(np.zeros((1, 1, 41)))


def test_no_run_no_policy_and_a_damaged_policy(run, tmp_path):
    with pytest.raises(canter.RunError, match="no run directory"):
        canter.load_policy(tmp_path / "none")
    (tmp_path / "config.toml").write_bytes((run / "config.toml").read_bytes())
    with pytest.raises(canter.RunError, match="no policy yet"):
        canter.load_policy(tmp_path)
    bytes_of_policy = bytearray((run / "policy.safetensors").read_bytes())
    bytes_of_policy[-1] ^= 1
    (tmp_path / "policy.safetensors").write_bytes(bytes_of_policy)
    with pytest.raises(canter.RunError, match="the file is damaged"):
        canter.load_policy(tmp_path)


def test_the_verdict_is_the_programs(run, program):
    printed = program("eval", run, "--slope", "5", "--episodes", "3", "--json", cwd=run)
    verdict = canter.evaluate(run, slope=5, episodes=3)
    assert verdict == json.loads(printed)
    assert verdict["protocol"]["slope_deg"] == 5.0
    # And without a word, what the training itself has written.
    assert canter.evaluate(run, threads=1) == json.loads((run / "eval.json").read_text())


def test_the_verdict_on_a_bare_gait_is_the_programs(program, tmp_path):
    overrides = {"evaluation.episode_s": 2.0}
    verdict = canter.evaluate(robot="doggo", gait="stepping", episodes=2, overrides=overrides)
    assert "policy" not in verdict
    assert verdict["protocol"]["episode_s"] == 2.0
    printed = program("eval", "--robot", "doggo", "--prior", "stepping", "--episodes", "2", "--json", cwd=tmp_path)
    assert canter.evaluate(robot="doggo", gait="stepping", episodes=2) == json.loads(printed)


def test_a_verdict_needs_one_subject(run):
    for arguments in [{}, {"run": run, "robot": "doggo"}, {"robot": "doggo"}]:
        with pytest.raises(TypeError):
            canter.evaluate(**arguments)
    with pytest.raises(canter.ConfigError, match="num_episodes"):
        canter.evaluate(run, episodes=1)


def test_what_is_measured_in_python_is_what_is_evaluated(run):
    """The policy of the run is asked from Python: same starts, same actions, same way."""
    policy = canter.load_policy(run)
    # The robust preset varies what it trains on, which no evaluation does.
    for overrides in [{}, {"task.slope_deg": 5, "task.variation": {"share": 1.0, "friction": [0.2, 0.3]}}]:
        overrides = {**overrides, "evaluation.episode_s": 2.0}
        measured = canter.measure(policy.act, "doggo", episodes=3, seed=7, overrides=overrides)
        evaluated = canter.evaluate(run, episodes=3, seed=7, overrides=overrides)["policy"]
        np.testing.assert_allclose(measured["speeds_m_per_s"], evaluated["speeds_m_per_s"], rtol=1e-9)
        assert measured["speed_m_per_s"] == pytest.approx(evaluated["speed_m_per_s"], rel=1e-9)
        assert measured["falls"] == evaluated["falls"]


def test_who_falls_keeps_the_full_time():
    """45 degrees uphill are no ground to walk on: every episode ends in a fall."""
    overrides = {"task.slope_deg": 45, "evaluation.episode_s": 3.0}
    measured = canter.measure(lambda observations: np.ones((len(observations), 17)), overrides=overrides, episodes=4)
    assert measured["falls"] == 4
    assert len(measured["speeds_m_per_s"]) == 4
    assert all(speed < 0.5 for speed in measured["speeds_m_per_s"])

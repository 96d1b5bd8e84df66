"""What the tests share."""

import os
import pathlib
import subprocess
import sys

import pytest

# PyTorch's threads wait by spinning, which makes small networks slow where something else runs too.
os.environ.setdefault("OMP_NUM_THREADS", "1")

#: A training of a second or two.
TINY_TRAINING = {
    "task.episode_s": 0.5,
    "network.actor_hidden": 16,
    "network.critic_hidden": 16,
    "training.num_environments": 4,
    "training.horizon": 32,
    "training.max_env_steps": 1024,
    "ppo.minibatch_size": 64,
    "evaluation.num_episodes": 2,
    "evaluation.episode_s": 2.0,
}


@pytest.fixture(scope="session")
def program():
    """Runs the program `canter` that the package has brought, with an empty environment; gives what it printed."""
    path = pathlib.Path(sys.executable).parent / "canter"

    def run(*arguments, cwd):
        done = subprocess.run([path, *arguments], cwd=cwd, env={}, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture(scope="session")
def run(program, tmp_path_factory):
    """The folder of a tiny training of the default preset."""
    folder = tmp_path_factory.mktemp("runs")
    settings = [f"--set={key}={value}" for key, value in TINY_TRAINING.items()]
    program("train", *settings, "--out", folder / "tiny", cwd=folder)
    return folder / "tiny"


@pytest.fixture(scope="session")
def repository():
    """The repository's folder: the documentation is tested too."""
    return pathlib.Path(os.environ.get("CANTER_REPOSITORY", pathlib.Path(__file__).parents[2]))

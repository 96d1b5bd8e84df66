"""The program and the library that the wheel brings."""

import importlib.metadata
import pathlib
import re
import subprocess

import canter

FOLDER = pathlib.Path(canter.__file__).parent


def test_the_program_is_the_packages(program, tmp_path):
    # Its commit may stand behind it.
    assert program("--version", cwd=tmp_path).split()[:2] == ["canter", canter.__version__]
    assert importlib.metadata.version("canter") == canter.__version__


def test_extension_and_program_run_on_the_library_in_the_package():
    own = str(FOLDER / "mujoco" / "libmujoco.so")
    loaded = set(re.findall(r"\S*libmujoco\S*", pathlib.Path("/proc/self/maps").read_text()))
    assert {str(pathlib.Path(path).resolve()).startswith(own) for path in loaded} == {True}
    # The loader prints what it would load.
    environment = {"LD_TRACE_LOADED_OBJECTS": "1"}
    traced = subprocess.run([FOLDER / "bin" / "canter"], env=environment, capture_output=True, text=True).stdout
    (path,) = re.findall(r"=> (\S*libmujoco\S*)", traced)
    assert str(pathlib.Path(path).resolve()).startswith(own)
    assert (FOLDER / "mujoco" / "licenses").is_dir()


def test_neither_knows_where_it_was_built(repository):
    for file in [FOLDER / "bin" / "canter", *FOLDER.glob("_native*.so")]:
        assert b"/.mujoco/" not in file.read_bytes(), file


def test_a_training_from_an_empty_folder(run):
    assert (run / "policy.safetensors").is_file()
    assert (run / "report.html").is_file()

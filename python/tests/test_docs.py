"""The tutorial's code blocks, one after the other in one Python, as a reader would type them."""

import importlib.util
import re

import pytest

HAS_SB3 = importlib.util.find_spec("stable_baselines3") is not None


@pytest.mark.filterwarnings("ignore:.*A Box observation space (maximum|minimum) value is.*infinity")
def test_the_tutorial_runs(repository, run, tmp_path, monkeypatch, capsys):
    text = (repository / "docs" / "python.md").read_text()
    # Those for Stable-Baselines3 are marked. What a block prints stands below it.
    blocks = re.findall(r"```python( sb3)?\n(.*?)```(?:\n\n```text\n(.*?)```)?", text, re.DOTALL)
    assert len(blocks) >= 5
    monkeypatch.chdir(tmp_path)
    # The tutorial speaks of a run that the reader has.
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "doggo-1-1").symlink_to(run)
    names = {}
    for mark, code, output in blocks:
        if mark and not HAS_SB3:
            continue
        # A training that shows that it runs, not that it learns.
        exec(compile(code.replace("200_000", "1_000"), "docs/python.md", "exec"), names)
        printed = capsys.readouterr().out
        if not mark:
            assert printed == output

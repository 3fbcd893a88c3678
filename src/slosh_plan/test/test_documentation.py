"""Tests that the example on the documentation page runs."""

import re
import shutil
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[3] / "docs" / "predict.md"
MODEL = Path(__file__).parents[2] / "slosh_bringup" / "config" / "model.yaml"


def test_the_example_accepts_a_safe_motion(line, tmp_path, monkeypatch):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    shutil.copy(MODEL, tmp_path / "model.yaml")
    monkeypatch.chdir(tmp_path)
    for durations, expected in (((0.8, 1.7, 2.5), 1.7), ((0.8, 0.9), 1.55)):
        motions = [line(duration) for duration in durations]
        names: dict[str, Any] = {"candidates": [(one.t, one.position) for one in motions]}
        exec(code, names)
        assert abs(names["accepted"].duration - expected) < 0.1

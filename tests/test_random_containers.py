"""Tests containers of any contour: commands, physics, and errors for impossible ones."""

import json
from pathlib import Path

import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_model.constants import GRAVITY
from slosh_model.model_text import read_model
from slosh_model.shapes.solved import SolvedContainer
from slosh_testing.random_containers import IMPOSSIBLE, KINDS, container_text

FOUND = [("bulb", 0), ("polygon", 1)]
"""A surface just above a bulb's edge, and a slot between spikes: their first triangles lacked
parts of the edge."""
EACH = [(kind, number) for number in (7, 8) for kind in KINDS]
PUSH, HELD, LET_GO, END = 3.0, 8.5, 9.0, 12.0
"""When an acceleration is full, when its tilt is read, when it ends, and the motion's end [s]."""
ACCELERATION = 0.4


def pushed(path: Path, x: float, y: float) -> Path:
    """Writes a motion table whose acceleration [m/s²] grows slowly and then stops."""
    t = np.arange(0.0, END, 0.004)
    share = np.clip(t / PUSH, 0.0, 1.0)
    size = share**2 * (3.0 - 2.0 * share) * np.clip((LET_GO + 0.05 - t) / 0.05, 0.0, 1.0)
    table = np.column_stack((t, x * size, y * size, 0.0 * t))
    np.savetxt(path, table, fmt="%.9f", delimiter=",", header="t,ax,ay,az", comments="")
    return path


def model_of(folder: Path, kind: str, number: int) -> Path:
    path = folder / "model.yaml"
    path.write_text(container_text(kind, number))
    return path


def check_physics(folder: Path, model: Path) -> None:
    """Checks the static tilt η = -R a/g along both axes, and the loss of energy afterwards."""
    container = read_model(model).container
    for axis, name in enumerate(("sh_x", "sh_y")):
        push = (ACCELERATION, 0.0) if axis == 0 else (0.0, ACCELERATION)
        motion, out = pushed(folder / "motion.csv", *push), folder / "heights.csv"
        assert main(["simulate", str(model), str(motion), "-o", str(out)]) == 0
        heights = np.genfromtxt(out, delimiter=",", names=True)
        tilt = -container.reaches[axis] * ACCELERATION / GRAVITY
        at = np.searchsorted(heights["t"], [HELD, LET_GO + 0.1])
        assert heights[name][at[0]] == pytest.approx(tilt, rel=1e-2)
        # Let go at once, a wave decays as its energy does.
        free = np.abs(heights[name][at[1] :])
        early, late = (part.max() for part in (free[: len(free) // 3], free[-len(free) // 3 :]))
        assert late < 0.7 * early
    assert isinstance(container, SolvedContainer)
    modes = [container.numbers(n) for n in (1, 2, 3)]
    assert np.all(np.diff([mode.natural_frequency for mode in modes]) > 0.0)
    assert 0.0 < sum(mode.mass_ratio for mode in modes) < 1.0
    assert all(0.0 < mode.damping_ratio(1e-6) < 0.5 for mode in modes)


@pytest.mark.parametrize(("kind", "number"), FOUND)
def test_narrow_places_are_computed_and_physics_holds(kind, number, tmp_path, capsys):
    check_physics(tmp_path, model_of(tmp_path, kind, number))


@pytest.mark.long
@pytest.mark.first(1)
@pytest.mark.parametrize(("kind", "number"), EACH)
def test_every_command_takes_any_container(kind, number, tmp_path, capsys):
    model = model_of(tmp_path, kind, number)
    check_physics(tmp_path, model)
    capsys.readouterr()
    assert main(["modes", str(model), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["modes"]) >= 3
    motion, out = str(tmp_path / "motion.csv"), str(tmp_path / "planned.csv")
    assert main(["predict", str(model), motion]) == 0
    path = tmp_path / "path.csv"
    path.write_text("t,x,y,z\n0,0,0,0.2\n1,0.2,0,0.2\n2,0.2,0.1,0.2\n")
    assert main(["plan", str(model), str(path), "--limit", "0.004", "-o", out]) == 0
    assert main(["shape", str(model), out, "--filter", "zv", "-o", str(tmp_path / "s.csv")]) == 0


@pytest.mark.parametrize("number", range(2))
@pytest.mark.parametrize("kind", IMPOSSIBLE)
def test_impossible_containers_are_refused_in_one_line(kind, number, tmp_path, capsys):
    model = model_of(tmp_path, kind, number)
    assert main(["modes", str(model)]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith("slosh modes: ")
    assert error.count("\n") == 1
    assert "model.yaml" in error

"""Tests that points clicked on a photograph give a model with the right profile."""

import cv2
import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_bringup.cli.new_outline import profile_of
from slosh_model.model_text import read_model
from slosh_testing.mode_solver import needs_solver

SCALE = 0.25e-3
WALL = 0.002
CUP = ["--across", "0.088", "--fill-height", "0.05"]


def clicked(outer, roll=0.0, middle=(320.0, 60.0)):
    """Returns image points of the rim's ends and the right wall for a wall profile (r, z) [m]."""
    rim = outer[-1]
    rows = [(-rim[0], 0.0), (rim[0], 0.0), *((r, rim[1] - z) for r, z in outer[-2::-1])]
    turn = np.array([[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]])
    return np.array(rows) / SCALE @ turn.T + middle


@pytest.fixture
def photograph(tmp_path):
    path = tmp_path / "cup.png"
    cv2.imwrite(str(path), np.full((480, 640, 3), 128, np.uint8))
    return path


@pytest.mark.parametrize("roll", [0.0, 0.1, -0.2])
def test_the_profile_is_the_inside_of_the_outline(roll):
    lean = np.hypot(1.0, 0.012 / 0.1)
    outer = np.array([[0.032, 0.0], [0.038, 0.05], [0.044, 0.1]])
    found = np.array(profile_of(clicked(outer, roll), 0.088, WALL))
    assert found[0] == pytest.approx([0.0, 0.0])
    assert found[1, 1] == 0.0
    wall = 0.032 + (found[1:, 1] + WALL) * 0.12 - WALL * lean
    np.testing.assert_allclose(found[1:, 0], wall, atol=3e-5)
    assert found[-1, 1] == pytest.approx(0.098, abs=1e-6)


@needs_solver
def test_clicks_make_a_model(photograph, tmp_path, capsys):
    outer = [[0.032, 0.0], [0.038, 0.05], [0.044, 0.1]]
    words = [f"{value:.1f}" for value in clicked(np.array(outer)).ravel()]
    folder = tmp_path / "cup"
    given = ["new", str(folder), "--outline", str(photograph), *CUP]
    assert main([*given, "--page", str(tmp_path / "clicks.html")]) == 0
    page = (tmp_path / "clicks.html").read_text()
    assert "--across 0.088 --fill-height 0.05 --points" in page
    assert 'data-least="4"' in page
    assert not folder.exists()
    assert main([*given, "--points", *words]) == 0
    container = read_model(folder / "model.yaml").container
    assert container.shape == "revolution"
    assert container.size == pytest.approx(0.038, abs=2e-4)
    assert container.rim_height == pytest.approx(0.1, abs=2e-4)
    assert "rim_height" not in (folder / "model.yaml").read_text()


@pytest.mark.parametrize(
    ("words", "points", "refusal"),
    [
        ([], "1 2", "--across: is needed"),
        (CUP, "", "--points: is needed with --outline; --page writes a page"),
        (CUP, "1 2 3", "3 numbers; two ends of the rim"),
        (CUP, "100 50 300 50 290 100 900 100", "outside the image"),
        (CUP, "100 50 300 50 190 100 180 120", "left of the middle"),
        (CUP, "100 50 110 90 290 100 280 120", "the rim, level"),
        (CUP, "100 90 300 90 290 60 280 50", "at the floor, below"),
        ([*CUP, "--shape", "frustum"], "1 1 9 1 8 3 7 5", "give only one"),
        ([*CUP, "--wall", "0.04"], "100 50 300 50 290 100 280 120", "leaves no room"),
    ],
)
def test_what_is_no_outline_is_refused_in_one_line(
    words, points, refusal, photograph, tmp_path, capsys
):
    given = ["new", str(tmp_path / "cup"), "--outline", str(photograph), *words]
    clicks = ["--points", *points.split()] if points else []
    assert main([*given, *clicks]) == 2
    error = capsys.readouterr().err
    assert refusal in error
    assert error.count("\n") == 1

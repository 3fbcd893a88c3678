"""Tests `slosh modes`: table, JSON, picture and model file with the modes."""

import json
import math

import pytest

from slosh_bringup.cli.main import main
from slosh_model.model_text import read_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_testing.mode_solver import needs_solver

CUP = (
    "container: {shape: frustum, bottom_radius: 0.028, top_radius: 0.04, height: 0.09, "
    "fill_height: 0.06}\n"
)
KEYS = {"natural_frequency", "damping_ratio", "mass", "height_per_displacement"}


@pytest.fixture
def model(tmp_path):
    def write(text):
        path = tmp_path / "model.yaml"
        path.write_text(text)
        return str(path)

    return write


def shown(capsys, *words):
    assert main(["modes", *words]) == 0, capsys.readouterr()
    return capsys.readouterr().out


def test_a_cylinder_has_its_closed_forms(model, capsys):
    facts = json.loads(
        shown(capsys, model("container: {radius: 0.05, fill_height: 0.07}"), "--json")
    )
    cup = Cylinder(0.05, 0.07)
    assert len(facts["modes"]) == 3
    for n, row in enumerate(facts["modes"], start=1):
        assert set(row) >= KEYS
        assert row["natural_frequency"] == pytest.approx(cup.natural_frequency(n), rel=1e-12)
        assert row["surface"][0] == [0.0, 0.0]
        assert row["surface"][-1] == pytest.approx([0.05, row["height_per_displacement"]])
        assert row["mass"] == pytest.approx(cup.mass_ratio(n) * cup.volume * 998.2, rel=1e-12)
        force = row["mass"] * row["natural_frequency"] ** 2
        assert row["force_per_displacement"] == pytest.approx(force, rel=1e-12)
    shares = sum(row["static_share"] for row in facts["modes"])
    assert 0.9 < shares < 1.0
    assert facts["linear_height"] is None


def test_a_rectangle_has_modes_along_both_axes(model, capsys):
    text = "container: {shape: rectangle, width: 0.2, depth: 0.1, fill_height: 0.06}"
    facts = json.loads(shown(capsys, model(text), "--json", "--count", "2"))
    assert [row["axis"] for row in facts["modes"]] == ["x", "x", "y", "y"]


@needs_solver
def test_a_cup_with_picture_and_model_file(model, capsys, tmp_path):
    picture, output = tmp_path / "cup.svg", tmp_path / "known.yaml"
    said = shown(capsys, model(CUP), "--plot", str(picture), "-o", str(output))
    assert "3.4383 Hz" in said
    assert "BEYOND_LINEAR" in said
    assert picture.read_text().startswith("<?xml")
    known = read_model(output)
    assert known.container.digest in output.read_text()
    assert known.natural_frequency_hz == pytest.approx(3.4383, abs=1e-4)


@needs_solver
def test_a_bulb_tells_that_its_crest_is_inside(model, capsys):
    said = shown(capsys, model("container: {shape: sphere, radius: 0.05, fill_height: 0.08}"))
    assert "away from the wall" in said


@needs_solver
def test_a_trough_is_drawn_along_both_axes(model, capsys, tmp_path):
    tank = model(
        "container: {shape: lying_cylinder, radius: 0.05, length: 0.12, fill_height: 0.07}"
    )
    picture = tmp_path / "trough.svg"
    facts = json.loads(shown(capsys, tank, "--count", "2", "--json", "--plot", str(picture)))
    assert [row["axis"] for row in facts["modes"]] == ["x", "x", "y", "y"]
    for row, reach in zip(facts["modes"], (0.06, 0.06, 0.0458258, 0.0458258), strict=True):
        places = [place for place, _ in row["surface"]]
        assert (places[0], places[-1]) == (0.0, pytest.approx(reach, rel=1e-6))
        assert row["surface"][-1][1] == pytest.approx(row["height_per_displacement"], rel=1e-9)
    said = shown(capsys, tank, "--count", "1", "--plot", str(picture))
    assert "crest along y is 40.8 mm from the axis" in said
    drawn = picture.read_text()
    assert "x [mm]" in drawn
    assert "y [mm]" in drawn


@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        (("--count", "0"), "--count 0: must be"),
        (("--plot", "cup.jpg"), "must end in"),
    ],
)
def test_refuses_in_one_line(words, refusal, model, capsys):
    assert main(["modes", model("container: {radius: 0.05, fill_height: 0.07}"), *words]) == 2
    error = capsys.readouterr().err
    assert refusal in error
    assert error.count("\n") == 1


@needs_solver
def test_a_simulation_tells_the_leaning_wall(model, capsys, tmp_path):
    table = tmp_path / "move.csv"
    rows = [f"{k / 500},{2 * math.sin(k / 30)},0,0" for k in range(500)]
    table.write_text("t,ax,ay,az\n" + "\n".join(rows) + "\n")
    words = ["simulate", model(CUP), str(table), "-o", str(tmp_path / "out.csv"), "--json"]
    main(words)
    facts = json.loads(capsys.readouterr().out)
    lean = math.hypot(0.012, 0.09) / 0.09
    assert facts["wall"]["height_along_wall"] == pytest.approx(lean * facts["peak"], rel=1e-6)
    assert facts["model"] == "2D-L"

"""Tests that `slosh new` writes valid first files, or prints a one-line error."""

import io
import re
import shlex
from dataclasses import replace

import pytest

from slosh_bringup.cli.main import build_parser, main
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.live.run import check_files
from slosh_camera.calibrate.camera_file import read_any_calibration
from slosh_camera.calibrate.intrinsics import read_known_camera
from slosh_camera.errors import SloshCameraError
from slosh_model.containers import SHAPES
from slosh_model.liquid import Liquid
from slosh_model.model_text import read_model
from slosh_model.shapes import Frustum
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_testing.commands import complaint
from slosh_testing.mode_solver import needs_solver

ROUND = ["--diameter", "0.08", "--fill-height", "0.06"]
SQUARE = ["--width", "0.1", "--depth", "0.07", "--fill-height", "0.06"]
WHOLE = ["--rim-height", "0.11", "--wall", "0.002"]
# What calibration adds, as a person would type it.
MATRIX = "[0, 0, 0, 0, 0, 0, 0, 0, 1]"
TYPED = "[1500, 0, 639.5, 0, 1500, 359.5, 0, 0, 1]"
POSE = "pose: {rotation: [1, 0, 0, 0, 0, -1, 0, 1, 0], translation: [0, 0, 0.5]}\n"


class Terminal(io.StringIO):
    """Standard input that behaves like a terminal with a user."""

    def isatty(self):
        return True


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "my cup"


def test_the_model_of_a_rectangle_is_read(folder):
    assert main(["new", str(folder), *SQUARE, "--density", "900", "--viscosity", "5e-5"]) == 0
    model = read_model(folder / "model.yaml")
    assert model.container == Rectangle(width=0.1, depth=0.07, fill_height=0.06)
    assert model.liquid == Liquid(900.0, 5e-5)


CUP = ["--shape", "frustum", "--length", "bottom_radius=28mm", "--length", "top_radius=0.04"]
HIGH = ["--length", "height=92mm", "--fill-height", "65mm"]


@needs_solver
def test_a_cup_by_its_contour_is_read_and_has_no_camera(folder):
    assert main(["new", str(folder), *CUP, *HIGH]) == 0
    model = read_model(folder / "model.yaml")
    expected = Frustum(bottom_radius=0.028, top_radius=0.04, height=0.092, fill_height=0.065)
    assert model.container == expected
    assert model.name == "3D-L"
    setup = read_setup(folder / "cell.yaml")
    assert setup.calibration is None
    check_files(setup)


@needs_solver
@pytest.mark.parametrize(
    ("shape", "lengths"),
    [
        ("wedge", {"top_width": 0.12, "height": 0.09, "length": 0.3}),
        ("lying_cylinder", {"radius": 0.08, "length": 0.3}),
    ],
)
def test_a_trough_is_made_from_its_lengths(folder, shape, lengths):
    words = [word for name, at in lengths.items() for word in ("--length", f"{name}={at}")]
    assert main(["new", str(folder), "--shape", shape, *words, "--fill-height", "0.06"]) == 0
    expected = SHAPES[shape](**lengths, fill_height=0.06)
    assert read_model(folder / "model.yaml").container == expected


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (CUP, "--length height=M: required for a frustum"),
        ([*CUP, "--length", "radius=0.1"], "(a frustum has bottom_radius, top_radius, height)"),
        ([*CUP, "--length", "height=wide"], "--length 'height=wide'"),
        ([*CUP, "--length", "height=92"], "did you mean 0.092 (92 mm)"),
        ([*CUP, "--radius", "0.05"], "--radius: give it as --length of the frustum"),
        (["--shape", "prism"], "the points of a prism are written into model.yaml by hand"),
        (["--length", "height=0.1"], "--length: belongs to --shape"),
    ],
)
def test_lengths_that_are_none_of_the_shape_are_one_line(folder, capsys, words, said):
    assert said in complaint(capsys, "new", folder, *words, "--fill-height", "0.06")
    assert not folder.exists()


def test_the_cell_is_read_with_its_namespace(folder):
    assert main(["new", str(folder), *ROUND, "--namespace", "/line_2/cup"]) == 0
    setup = read_setup(folder / "cell.yaml")
    assert setup.namespace == "/line_2/cup"
    assert (setup.model, setup.calibration) == (folder / "model.yaml", folder / "camera.yaml")


def test_a_cell_without_a_camera(folder, capsys):
    assert main(["new", str(folder), *ROUND, "--no-camera"]) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["cell.yaml", "model.yaml"]
    setup = read_setup(folder / "cell.yaml")
    assert setup.calibration is None
    check_files(setup)
    told = capsys.readouterr().out
    assert "calibrate" not in told
    assert "wall" not in told
    assert f"slosh cell --config '{folder}/cell.yaml'" in told
    names = [process.name for process in setup.processes(folder / "bag")]
    assert names == ["recorder", "estimator", "monitor"]
    assert setup.processes(folder / "bag")[-1].parameters == {"camera": "false"}


@pytest.mark.parametrize("value", ["yes", "camera.yaml", "[none]"])
def test_a_camera_that_is_neither_none_nor_a_calibration_is_refused(folder, value):
    assert main(["new", str(folder), *ROUND]) == 0
    (folder / "cell.yaml").write_text(f"model: model.yaml\ncamera: {value}\n")
    with pytest.raises(SloshBringupError, match=r"cell.yaml:2.*camera = .* must be none"):
        read_setup(folder / "cell.yaml")


@pytest.mark.parametrize("cup", [ROUND, SQUARE], ids=["cylinder", "rectangle"])
def test_the_camera_waits_for_its_calibration_and_for_nothing_else(folder, cup):
    assert main(["new", str(folder), *cup, *WHOLE, "--image-size", "1280x720"]) == 0
    setup = read_setup(folder / "cell.yaml")
    with pytest.raises(
        SloshCameraError, match=r"not calibrated yet; run `slosh intrinsics`.*`slosh cal"
    ):
        check_files(setup)
    path = folder / "camera.yaml"
    text = path.read_text()
    with pytest.raises(SloshCameraError, match=r"K\[0\] is 0, .*; `slosh intrinsics` does it"):
        read_known_camera(path)
    path.write_text(text.replace(MATRIX, TYPED) + POSE)
    check_files(setup)
    view = read_any_calibration(path).view
    held = view.cup if cup is ROUND else view.box
    assert (held.rim_height, held.wall_thickness, view.camera.width) == (0.11, 0.002, 1280)
    if cup is ROUND:
        assert read_known_camera(path).container["radius"] == 0.04


def test_the_next_commands_are_told_with_the_cups_files(folder, capsys):
    assert main(["new", str(folder), *ROUND, *WHOLE]) == 0
    told = capsys.readouterr().out
    assert f"--model '{folder}/model.yaml' --wall 0.002" in told
    assert f"slosh cell --config '{folder}/cell.yaml'" in told
    assert "note" not in told
    assert main(["new", str(folder.with_name("b")), *ROUND]) == 0
    assert "note: no wall thickness given" in capsys.readouterr().out


def test_a_folder_that_holds_something_is_refused(folder, capsys):
    assert main(["new", str(folder), *ROUND]) == 0
    before = {path: path.read_text() for path in folder.iterdir()}
    assert "exists already and holds camera.yaml" in complaint(capsys, "new", folder, *SQUARE)
    assert {path: path.read_text() for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--radius", "50"], "radius = 50 m: did you mean 0.05 (50 mm)?"),
        (["--radius", "5"], "radius = 5 m: did you mean 0.05 (5 cm)?"),
        (["--diameter", "120"], "diameter = 120 m: did you mean 0.12 (120 mm)?"),
        ([*ROUND, "--wall", "2"], "wall = 2 m: did you mean 0.002 (2 mm)?"),
        ([*ROUND, "--density", "1030"], "--density: the viscosity of this liquid is missing"),
        ([*ROUND, "--density", "1.03"], "density = 1.03 kg/m3: did you mean 1030 (1.03 g/cm3)?"),
        ([*ROUND, "--viscosity", "1"], "viscosity = 1 m2/s: did you mean 1e-06 (1 mm2/s)?"),
        ([*ROUND, "--rim-height", "-1"], "rim_height = -1 m: must be 0.002 to 4 m"),
        (["--radius", "nan"], "radius = nan m: must be 0.002 to 2 m"),
        ([*ROUND, "--rim-height", "0.05"], "rim_height = 0.05 m: must lie above the liquid"),
        ([*ROUND, "--radius", "0.04"], "--radius and --diameter: give one of them"),
        ([*ROUND, "--depth", "0.04"], "the container is round or rectangular"),
        ([*ROUND, "--namespace", "slosh"], "namespace = 'slosh': must be names after slashes"),
        ([*ROUND, "--image-size", "big"], "--image-size: 'big' is not WIDTHxHEIGHT"),
        (
            ["--radius", "0.04"],
            "--fill-height: required; the command can ask for values only on a terminal",
        ),
        (["--width", "0.04"], "--depth, --fill-height: required"),
        ([], "--radius, --diameter or --width and --depth, --fill-height: required"),
    ],
)
def test_what_cannot_be_is_one_line(folder, capsys, monkeypatch, words, said):
    monkeypatch.setattr("sys.stdin", io.StringIO())
    assert said in complaint(capsys, "new", folder, *words)
    assert not folder.exists()


def test_a_terminal_is_asked_for_what_is_missing(folder, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", Terminal("\n80\nwide\n0.08\n0.06\n\n0.002\n"))
    assert main(["new", str(folder)]) == 0
    told = capsys.readouterr().out
    assert "diameter = 80 m: did you mean 0.08 (80 mm)?" in told
    assert "'wide' is not a number" in told
    container = read_model(folder / "model.yaml").container
    assert container == Cylinder(radius=0.04, fill_height=0.06)
    assert "wall_thickness: 0.002" in (folder / "camera.yaml").read_text()


def test_a_terminal_is_asked_for_a_rectangle(folder, monkeypatch):
    monkeypatch.setattr("sys.stdin", Terminal("rectangular\n0.1\n0.07\n0.06\n0.1\n\n"))
    assert main(["new", str(folder)]) == 0
    container = read_model(folder / "model.yaml").container
    assert container == replace(container, width=0.1, depth=0.07, fill_height=0.06, rim_height=0.1)


def test_answers_that_end_are_one_line(folder, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", Terminal("\n"))
    assert main(["new", str(folder)]) == 2
    assert "no more input: give the values as options\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    "shape", [ROUND, ["--width", "0.08", "--depth", "0.06", "--fill-height", "0.05"]]
)
def test_each_printed_command_can_be_typed(folder, capsys, monkeypatch, tmp_path, shape):
    """Tests that each printed command can be run, or at least parsed if it needs hardware."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", str(folder), *shape, "--wall", "2mm"]) == 0
    steps = [line.strip() for line in capsys.readouterr().out.splitlines() if "  slosh " in line]
    assert steps
    for step in steps:
        words = shlex.split(re.sub(r"\b[UV][12]\b", "100", step))[1:]
        build_parser(words[0]).parse_args(words)
        if "--print-board" in words:
            assert main(words) == 0
            assert (tmp_path / "board.pdf").is_file()

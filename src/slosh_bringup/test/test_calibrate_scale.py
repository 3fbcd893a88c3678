"""Tests that `slosh calibrate --scale` makes a usable camera.yaml from two image points."""

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_camera.calibrate.camera_file import read_any_calibration
from slosh_camera.calibrate.scale import calibrate_by_scale
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.calibration import SideCalibration
from slosh_testing.mode_solver import needs_solver

LEFT, RIGHT, LEVEL, WIDTH = 100, 340, 200, 0.12
ENDS = ["--scale", "100", "200", "340", "200"]
CUP = ["--length", f"{WIDTH}", "--fill-height", "0.07"]


def picture(rise=0.0):
    """Draws a side view of a container with a liquid line that rises by `rise` pixels."""
    columns, rows = np.meshgrid(np.arange(440), np.arange(380))
    line = LEVEL - 2.0 * rise * (columns - 0.5 * (LEFT + RIGHT)) / (RIGHT - LEFT)
    inside = (columns >= LEFT) & (columns <= RIGHT) & (rows < 340)
    depth = np.clip(rows - line + 0.5, 0.0, 1.0)
    image = np.where(inside, 215.0 - 160.0 * depth, 215.0)
    image[(columns == LEFT) | (columns == RIGHT)] = 120.0
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.8), 0, 255).astype(np.uint8)


@pytest.fixture
def images(tmp_path):
    cv2.imwrite(str(tmp_path / "still.png"), picture())
    folder = tmp_path / "run"
    folder.mkdir()
    for number, rise in enumerate((0.0, 12.0, 24.0)):
        cv2.imwrite(str(folder / f"{number}.png"), picture(rise))
    return tmp_path


def test_heights_are_those_of_the_images_plane_with_the_scales_error(images, capsys):
    camera, table = images / "camera.yaml", images / "heights.csv"
    assert main(["calibrate", str(images / "still.png"), *ENDS, *CUP, "-o", str(camera)]) == 0
    assert "0.500 mm/px" in capsys.readouterr().out
    assert isinstance(read_any_calibration(camera), SideCalibration)
    assert main(["detect", str(images / "run"), "--camera", str(camera), "-o", str(table)]) == 0
    rows = list(csv.DictReader(table.open()))
    heights = [float(row["msh"]) for row in rows]
    assert heights == pytest.approx([0.0, 0.006, 0.012], abs=3e-4)
    # Of 12 mm the scale alone leaves 3 % open.
    assert 3.0e-4 < float(rows[2]["msh_stddev"]) < 8e-4
    assert float(rows[0]["msh_stddev"]) < 1.5e-4


@needs_solver
def test_a_trough_is_measured_along_its_y_as_a_rectangle_of_its_length(images):
    model, camera = images / "trough.yaml", images / "camera.yaml"
    model.write_text(
        "container: {shape: wedge, half_angle: 0.5, height: 0.1, length: 0.12, fill_height: 0.07}"
    )
    still, table = str(images / "still.png"), images / "heights.csv"
    assert main(["calibrate", still, *ENDS, "--model", str(model), "-o", str(camera)]) == 0
    assert main(["detect", str(images / "run"), "--camera", str(camera), "-o", str(table)]) == 0
    heights = [float(row["msh"]) for row in csv.DictReader(table.open())]
    assert heights == pytest.approx([0.0, 0.006, 0.012], abs=3e-4)


def test_a_rolled_camera_reads_a_level_line_as_level():
    side = calibrate_by_scale((640, 480), (100.0, 220.0), (500.0, 260.0), 0.1, 0.07)
    x, z = side.view.on_face([[100.0, 220.0], [300.0, 240.0], [500.0, 260.0]])
    assert z == pytest.approx(0.0, abs=1e-6)
    half = 0.5 * 0.1
    assert x == pytest.approx([-half, 0.0, half], rel=1e-3, abs=1e-6)
    assert side.detection.scale_error > 0.03


@pytest.mark.parametrize(
    ("left", "right", "reason"),
    [
        ((100.0, 220.0), (900.0, 220.0), "outside the image of 640 x 480"),
        ((300.0, 220.0), (100.0, 220.0), "to the right of the first"),
        ((100.0, 100.0), (200.0, 200.0), "inclined by 45 deg"),
    ],
)
def test_refuses_points_that_are_no_level(left, right, reason):
    with pytest.raises(SloshCameraError, match=reason):
        calibrate_by_scale((640, 480), left, right, 0.1, 0.07)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ([*ENDS, "--fill-height", "0.07"], "--length: is needed"),
        ([*ENDS, "--length", "0.1"], "--fill-height: is needed"),
        ([*ENDS, *CUP, "--fov", "40"], "--fov: is not used with --scale"),
        (["--length", "0.1", "--fov", "40"], "--length: needs --scale"),
        (["--radius", "0.05"], "--camera or --fov"),
    ],
)
def test_one_line_says_what_is_missing(images, capsys, words, reason):
    still, output = images / "still.png", images / "camera.yaml"
    assert main(["calibrate", str(still), *words, "-o", str(output)]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert reason in said[0]
    assert not output.exists()


def test_the_models_lengths_are_used_and_a_diameter_is_no_radius(images, capsys):
    still, output, model = (str(images / n) for n in ("still.png", "camera.yaml", "model.yaml"))
    Path(model).write_text("container: {shape: cylinder, radius: 0.06, fill_height: 0.07}\n")
    words = ["calibrate", still, *ENDS, "--model", model, "-o", output]
    assert main(words) == 0
    assert "0.500 mm/px" in capsys.readouterr().out
    for given, told in (
        (["--radius", "0.12"], "--radius: 120 mm is the diameter of the container in"),
        (["--radius", "0.05"], "--radius: 50 mm, but"),
        (["--fill-height", "0.08"], "--fill-height: 80 mm, but"),
    ):
        assert main([*words, *given]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert told in line
    Path(model).write_text(
        "container: {shape: rectangle, width: 0.12, depth: 0.1, fill_height: 0.07}\n"
    )
    assert main(words) == 0
    assert "0.500 mm/px" in capsys.readouterr().out
    assert main(["calibrate", still, "--model", model, "-o", output]) == 2
    assert "from the side all bodies of revolution (--scale)" in capsys.readouterr().err
    assert main([*words, "--page", str(images / "page.html")]) == 2
    assert "do not give both" in capsys.readouterr().err


def test_json(images, capsys):
    words = ["--radius", "0.06", "--fill-height", "0.07", "--json"]
    still, output = images / "still.png", images / "camera.yaml"
    assert main(["calibrate", str(still), *ENDS, *words, "-o", str(output)]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["metre_per_pixel"] == pytest.approx(0.0005)

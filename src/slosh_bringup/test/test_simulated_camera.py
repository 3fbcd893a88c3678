"""Tests the simulated camera in front of cups of other forms."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from slosh_bringup.cell.renderer import CupRenderer, GreyLevels
from slosh_bringup.cell.simulated_camera import simulated_view, write_simulated_camera
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.decoding import read_image
from slosh_model.containers import Container
from slosh_model.shapes import Frustum, Sphere
from slosh_model.shapes.cylinder import Cylinder

PAPER_CUP = Frustum(bottom_radius=0.028, top_radius=0.04, height=0.092, fill_height=0.065)
POT = Frustum(bottom_radius=0.06, top_radius=0.045, height=0.12, fill_height=0.07)
BARE = GreyLevels(noise=0.0, blur=0.0, shading=0.0, glint=0.0, outline=205.0)


def contact_row(container: Frustum, height: float, azimuth: float) -> float:
    """Returns the image row of the front contact line, without the renderer's formulas.

    A plane cuts a cone's wall at z (1 - taper slope cos) = slope R cos.
    """
    view = simulated_view(container)
    taper = (container.top_radius - container.bottom_radius) / container.height
    slope = height / (view.cup.radius + taper * height)  # the plane is so high at its crest
    there = math.cos(view.camera_azimuth - azimuth)
    z = slope * view.cup.radius * there / (1.0 - taper * slope * there)
    radius = view.cup.radius + taper * z
    point = [radius * math.cos(view.camera_azimuth), radius * math.sin(view.camera_azimuth), z]
    return float(view.project([point])[0, 1])


@pytest.mark.parametrize("container", [PAPER_CUP, POT], ids=["widening", "narrowing"])
@pytest.mark.parametrize("away", [0.0, 1.0, 3.0])
def test_the_contact_line_of_a_cone_is_where_a_plane_cuts_it(
    container: Frustum, away: float
) -> None:
    view = simulated_view(container)
    height, azimuth = 0.015, view.camera_azimuth + away
    renderer = CupRenderer(view, dataclasses.replace(BARE, surface=205.0))
    image = renderer.render(height * math.cos(azimuth), height * math.sin(azimuth))
    column = image[:, round(view.camera.cx)].astype(float)
    row = contact_row(container, height, azimuth)
    part = column[round(row) - 6 : round(row) + 7]
    edge = round(row) + 6.5 - np.sum((part - part[0]) / (part[-1] - part[0]))
    assert edge == pytest.approx(row, abs=0.15)


def test_the_detector_reads_the_heights_in_a_paper_cup(tmp_path: Path) -> None:
    path = write_simulated_camera(PAPER_CUP, tmp_path)
    assert isinstance(path, Path)
    calibration = read_calibration(path)
    renderer, detector = CupRenderer(calibration.view), FreeSurfaceDetector(calibration)
    assert calibration.still_image is not None
    detector.learn_still(read_image(calibration.still_image))
    errors = []
    for k, height in enumerate(np.linspace(0.004, 0.01, 13).tolist()):
        azimuth = 0.5 * k
        image = renderer.render(height * math.cos(azimuth), height * math.sin(azimuth))
        errors.append(detector.update(k * 33_000_000, image).msh - height)
    assert np.sqrt(np.mean(np.square(errors))) < 5e-4


@pytest.mark.parametrize(
    "container",
    [PAPER_CUP, POT, Cylinder(0.05, 0.07, rim_height=0.135), Cylinder(0.02, 0.15),
     Cylinder(0.2, 0.03, rim_height=0.1)],
)  # fmt: skip
def test_the_whole_cup_is_in_the_picture(container: Container) -> None:
    view = simulated_view(container)
    outline = view.outline()
    assert (outline > 5.0).all()
    assert (outline < [view.camera.width - 5.0, view.camera.height - 5.0]).all()
    assert np.ptp(outline, axis=0).max() > 200.0


def test_of_other_shapes_it_says_why_not(tmp_path: Path) -> None:
    reason = write_simulated_camera(Sphere(radius=0.05, fill_height=0.05), tmp_path / "none")
    assert isinstance(reason, SloshCameraError)
    assert "a sphere is not measured through its wall" in str(reason)
    assert not (tmp_path / "none").exists()

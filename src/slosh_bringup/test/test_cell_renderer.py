"""Tests the simulated camera images against an independent projection."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import j1

from slosh_bringup.cell.renderer import LUMA, CupRenderer, GreyLevels
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.measurement import PeakSide
from slosh_camera.optics.camera import look_at
from slosh_camera.optics.cup import CupView

CALIBRATION = read_calibration(config_folder() / "camera.yaml")
VIEW = CALIBRATION.view
BARE = GreyLevels(noise=0.0, blur=0.0, shading=0.0, glint=0.0, outline=205.0)
XI = 1.8411837813406593


def seen_from(azimuth, elevation, distance=0.42):
    """Returns the shipped camera view moved to another position."""
    centre = distance * np.array(
        [
            math.cos(elevation) * math.cos(azimuth),
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
        ]
    )
    return CupView(VIEW.camera, look_at(centre, (0.0, 0.0, 0.0)), VIEW.cup)


def components(height, azimuth):
    return height * math.cos(azimuth), height * math.sin(azimuth)


def rows_along(view, column, height, azimuth):
    """Returns the image rows of the surface in a column, from the near to the far wall.

    Independent of the renderer: points at equal depth, moved sideways until OpenCV projects them
    into the column.
    """
    radius, centre = view.cup.radius, view.pose.camera_centre
    towards = np.array([centre[0], centre[1]]) / np.hypot(centre[0], centre[1])
    aside = np.array([-towards[1], towards[0]])
    rotation, _ = cv2.Rodrigues(view.pose.rotation)
    depth = radius * np.cos(np.linspace(0.0, np.pi, 4001))
    lateral = np.zeros_like(depth)
    for _ in range(12):
        x, y = depth * towards[:, np.newaxis] + lateral * aside[:, np.newaxis]
        r = np.hypot(x, y)
        shape = np.divide(j1(XI * r / radius), r, out=np.zeros_like(r), where=r > 0.0) / j1(XI)
        z = height * shape * (x * math.cos(azimuth) + y * math.sin(azimuth))
        points = np.column_stack((x, y, z))
        pixels, _ = cv2.projectPoints(
            points, rotation, view.pose.translation, view.camera.matrix, None
        )
        u, v = pixels[:, 0].T
        lateral += (column - u) * 0.42 / view.camera.fx
    return v[(r <= radius) & (np.abs(column - u) < 1e-6)]


def edge_near(image, column, row):
    """Returns the sub-pixel row of an edge, from the sum of the grey levels around it."""
    middle = round(row)
    values = image[middle - 4 : middle + 5, column].astype(float)
    above, below = values[0], values[-1]
    assert abs(above - below) > 30.0, "there is no edge"
    return middle + 4.5 - np.sum((values - above) / (below - above))


@pytest.mark.first(6)
@pytest.mark.parametrize("elevation", [0.0, math.radians(10.0), math.radians(25.0)])
@pytest.mark.parametrize(
    ("height", "away"),
    [(0.0, 0.0), (0.02, 0.0), (0.02, 1.0), (0.03, 1.57), (0.03, 2.5), (0.025, 3.14)],
)
def test_edges_lie_where_an_independent_projection_says(elevation, height, away):
    view = seen_from(0.7, elevation)
    azimuth = 0.7 + away
    front = CupRenderer(view, dataclasses.replace(BARE, surface=205.0))
    whole = CupRenderer(view, dataclasses.replace(BARE, surface=BARE.liquid))
    image, silhouette = (r.render(*components(height, azimuth)) for r in (front, whole))
    for column in (240, 290, 320, 351, 400):
        rows = rows_along(view, column, height, azimuth)
        assert edge_near(image, column, rows[0]) == pytest.approx(rows[0], abs=0.1)
        assert edge_near(silhouette, column, rows.min()) == pytest.approx(rows.min(), abs=0.1)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 0.035), st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_turning_cup_and_camera_together_changes_nothing(height, azimuth, turn):
    one = CupRenderer(seen_from(0.0, 0.2), BARE).render(*components(height, azimuth))
    other = CupRenderer(seen_from(turn, 0.2), BARE).render(*components(height, azimuth + turn))
    assert np.abs(one.astype(int) - other).max() <= 1


def test_colour_has_the_same_grey_levels_and_a_brown_liquid():
    grey = CupRenderer(VIEW).render(0.02, 0.01)
    colour = CupRenderer(VIEW).render_colour(0.02, 0.01)
    assert colour.shape == (480, 640, 3)
    assert np.abs(colour @ LUMA - grey).max() <= 1.5
    blue, green, red = colour[330, 320].astype(int)
    assert red > green > blue
    assert len(set(colour[20, 20].tolist())) == 1


@settings(max_examples=30, deadline=None)
@given(st.floats(0.005, 0.035), st.floats(-math.pi, math.pi))
def test_the_detector_reads_what_was_drawn(height, azimuth):
    image = CupRenderer(VIEW).render(*components(height, azimuth))
    measurement = FreeSurfaceDetector(CALIBRATION).update(0, image)
    assert measurement.msh == pytest.approx(height, abs=0.0015)
    away = azimuth - VIEW.camera_azimuth
    if math.cos(away) > 0.5:
        assert measurement.peak_side is PeakSide.FRONT
    if math.cos(away) < -0.5:
        assert measurement.peak_side is PeakSide.REAR

"""Tests that a calibration for another fill height moves the level and not the container."""

import numpy as np
import pytest

from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.box import Box, BoxView
from slosh_camera.optics.calibration import SideCalibration, refilled
from slosh_camera.optics.camera import PinholeCamera, look_at
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle

FILL = 0.05


def test_floor_and_rim_are_seen_where_they_were(make_scene):
    calibration = make_scene().calibration()
    cup = calibration.view.cup
    found = refilled(calibration, Cylinder(radius=cup.radius, fill_height=FILL))
    around = np.linspace(-3.0, 3.0, 20)
    for height in (0.0, cup.rim_height):
        before = calibration.view.project_wall(around, height - cup.fill_height)
        after = found.view.project_wall(around, height - FILL)
        assert after == pytest.approx(before, abs=1e-9, nan_ok=True)
    assert (found.view.cup.fill_height, found.view.cup.rim_height) == (FILL, cup.rim_height)
    back = refilled(found, Cylinder(radius=cup.radius, fill_height=cup.fill_height))
    assert back.view.pose.translation == pytest.approx(calibration.view.pose.translation)


def test_a_box_likewise_and_nothing_changes_for_the_same_container():
    box = Box(width=0.1, fill_height=0.04, depth=0.05, rim_height=0.09)
    camera = PinholeCamera(640, 480, 800.0, 800.0, 319.5, 239.5)
    view = BoxView(camera, look_at((0.0, -0.4, 0.02), (0.0, 0.0, 0.0)), box)
    calibration = SideCalibration(view)
    same = Rectangle(width=0.1, depth=0.05, fill_height=0.04)
    assert refilled(calibration, same) is calibration
    found = refilled(calibration, Rectangle(width=0.1, depth=0.05, fill_height=FILL))
    sides = np.array([-0.05, 0.05])
    assert found.view.project_face(sides, -FILL) == pytest.approx(view.project_face(sides, -0.04))


def test_what_the_camera_cannot_see_is_refused(make_scene):
    with pytest.raises(SloshCameraError, match="inside the container"):
        refilled(make_scene().calibration(), Cylinder(radius=0.6, fill_height=FILL))

"""Tests that the level is where the colour changes along the wall, and not at print or foam."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from slosh_camera.calibrate.curves import Curve, view_at
from slosh_camera.calibrate.edges import edge_image
from slosh_camera.calibrate.level import _from_other_side, check_exchange, check_line
from slosh_camera.calibrate.pose import place_of
from slosh_camera.calibrate.still import calibrate_by_edges
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import Pose

LOOKS = {
    "dark": {},
    "pale": {"liquid": 200, "surface": 207},
    "from above": {"liquid": 150, "surface": 190, "camera_height": 0.08},
    "from below": {"liquid": 190, "surface": 200, "camera_height": -0.05},
    "noise": {"liquid": 180, "surface": 190, "noise": 3.0},
}
RINGS = (0.03, 0.006, -0.03)


def glass(make_scene, look, rings=RINGS):
    """Returns a scene and its picture with rings printed on a glass."""
    scene = make_scene(**LOOKS[look])
    return scene, scene.with_rings(scene.with_sides(scene.draw()), rings)


def believed(scene, height):
    """Returns the view of a scene whose level is taken to be at a height [m]."""
    view = scene.calibration().view
    rotation, translation = view.pose.rotation, view.pose.translation
    pose = Pose(rotation, translation + rotation @ (0.0, 0.0, height))
    cup = replace(view.cup, fill_height=view.cup.fill_height + height)
    return replace(view, pose=pose, cup=cup)


@pytest.mark.parametrize("look", LOOKS)
def test_the_level_between_rings_is_the_level(make_scene, look):
    scene, image = glass(make_scene, look, (0.03, -0.03))
    check_line(edge_image(image), believed(scene, 0.0))


@pytest.mark.parametrize("look", LOOKS)
@pytest.mark.parametrize("height", RINGS)
def test_a_printed_ring_is_not_the_level(make_scene, look, height):
    """Whether it is in the air, in the liquid or so close that the level is at its window."""
    scene, image = glass(make_scene, look)
    with pytest.raises(SloshCameraError, match=r"level is in doubt.*--level U V") as caught:
        check_line(edge_image(image), believed(scene, height))
    assert "\n" not in str(caught.value)


def test_a_ring_above_foam_is_not_the_level(make_scene):
    scene = make_scene(liquid=150, surface=155)
    image = scene.with_rings(scene.with_sides(scene.draw()), (0.012,))
    rng = np.random.default_rng(1)
    for angle, rise in zip(rng.uniform(-np.pi, 0.0, 400), rng.uniform(0, 0.011, 400), strict=True):
        across = scene.radius * np.array([np.cos(angle), np.sin(angle)])
        ((u, v),) = np.rint(scene.project(np.array([[*across, rise]]))).astype(int)
        cv2.circle(image, (u, v), 4, int(rng.integers(60, 240)), -1, cv2.LINE_AA)
    truth = scene.calibration().view
    with pytest.raises(SloshCameraError, match="uneven, as foam is"):
        calibrate_by_edges(image, truth.camera, truth.cup)


def test_a_pale_label_is_not_the_level_of_dark_liquid(make_scene):
    scene, image = glass(make_scene, "dark", ())
    azimuth = scene.camera_azimuth + np.deg2rad(np.linspace(-80.0, 80.0, 61))
    across = scene.radius * np.column_stack((np.cos(azimuth), np.sin(azimuth)))
    low, high = (np.column_stack((across, np.full(61, z))) for z in (0.015, 0.035))
    outline = np.rint(scene.project(np.vstack((low, high[::-1]))) * 16).astype(np.int32)
    cv2.fillPoly(image, [outline], 190, cv2.LINE_AA, 4)
    with pytest.raises(
        SloshCameraError, match=r"3[56] mm below the best fit parts two colours more"
    ):
        check_line(edge_image(image), believed(scene, 0.035))
    check_line(edge_image(image), believed(scene, 0.0))


@pytest.mark.parametrize("height", [0.015, pytest.param(-0.02, marks=pytest.mark.long)])
def test_a_ring_without_a_rear_line_is_no_level(make_scene, height):
    """Seen from above, the rear line of a level lies where its front line and the pose put it."""
    scene = make_scene(liquid=190, surface=193, camera_height=0.06)
    truth = scene.calibration().view
    image = scene.with_rings(scene.with_sides(scene.draw()), (height,))
    with pytest.raises(
        SloshCameraError, match=r"neither the rear line nor the floor.*--level U V"
    ):
        calibrate_by_edges(image, truth.camera, truth.cup)


def banded(scene, low, high, colour=(60, 60, 60)):
    """Returns the picture of a scene with a thick ring between two heights [m]."""
    azimuth = scene.camera_azimuth + np.deg2rad(np.linspace(-80.0, 80.0, 61))
    across = scene.radius * np.column_stack((np.cos(azimuth), np.sin(azimuth)))
    lower, upper = (np.column_stack((across, np.full(61, z))) for z in (low, high))
    outline = np.rint(scene.project(np.vstack((lower, upper[::-1]))) * 16).astype(np.int32)
    image = cv2.cvtColor(scene.with_sides(scene.draw()), cv2.COLOR_GRAY2BGR)
    cv2.fillPoly(image, [outline], colour, cv2.LINE_AA, 4)
    return image


def test_the_edge_of_a_ring_close_above_a_pale_level_is_not_the_level(make_scene):
    """Both are within the windows of one step: what is between them has the air's colour."""
    scene = make_scene(liquid=190, surface=212, camera_height=0.07)
    image = edge_image(banded(scene, 0.0055, 0.0085))
    with pytest.raises(SloshCameraError, match="the colours part 5 mm below the best fit"):
        check_line(image, believed(scene, 0.005))
    check_line(image, believed(scene, 0.0))


def test_the_upper_edge_of_a_ring_that_hides_a_part_of_the_step_is_not_the_level(make_scene):
    scene = make_scene(
        liquid=180, surface=192, camera_height=-0.03, radius=0.032, fill_height=0.05,
        rim_height=None, distance=0.34, focal=1500.0,
    )  # fmt: skip
    image = edge_image(banded(scene, 0.0012, 0.0026))
    with pytest.raises(SloshCameraError, match="2 mm below the best fit parts two colours more"):
        check_line(image, believed(scene, 0.0026))
    check_line(image, believed(scene, 0.0))


@pytest.mark.parametrize("height", [0.03, 0.06])
def test_the_rear_line_of_a_level_is_not_its_front_line(make_scene, height):
    """A liquid that looks as its surface shows the rear line alone, which bows as a front one
    does that is seen from below."""
    scene = make_scene(liquid=60, surface=60, camera_height=height)
    image, view = edge_image(scene.with_sides(scene.draw())), scene.calibration().view
    below = _from_other_side(place_of(view.pose)[0], view.cup, -height)
    with pytest.raises(
        SloshCameraError, match=r"the rear one of a level \d+ mm below it"
    ) as caught:
        check_exchange(image, view_at(view.camera, view.cup, below), Curve.FRONT)
    assert "--level U V" in str(caught.value)


@pytest.mark.parametrize("height", [0.08, -0.08])
def test_a_front_line_is_not_the_rear_one(make_scene, height):
    scene = make_scene(liquid=60, surface=205, camera_height=height)
    image = edge_image(scene.with_sides(scene.draw()))
    check_exchange(image, scene.calibration().view, Curve.FRONT)

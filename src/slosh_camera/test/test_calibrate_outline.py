"""A container by its sides first: its level among printed rings, from above and below."""

import dataclasses

import numpy as np
import pytest

from slosh_camera.calibrate.curves import Curve
from slosh_camera.calibrate.edges import edge_image
from slosh_camera.calibrate.outline import find_outline
from slosh_camera.calibrate.still import calibrate_by_edges
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import Wall

RINGS = np.arange(-0.06, 0.05, 0.00186)
"""Every 2 mL of a graduated cylinder of 250 mL."""


def tall(make_scene, **look):
    """A graduated cylinder half round whose print is darker than its liquid, and the truth."""
    scene = make_scene(
        radius=0.0185, distance=0.33, width=260, height=700, focal=900.0, oversampling=2, **look
    )
    image = scene.with_sides(scene.draw())
    return scene, scene.with_rings(image, RINGS, (-20.0, 60.0)), scene.calibration().view


def front_of(outline):
    """Middle of the level's front line (2,) [px]."""
    (front,) = (curve for curve in outline.curves if curve.curve is Curve.FRONT)
    return front.pixels[len(front.pixels) // 2]


LOOKS = {
    "level with the camera": {"liquid": 150},
    "from above": {"liquid": 150, "surface": 170, "camera_height": 0.06},
    "from far above": {"liquid": 150, "surface": 170, "camera_height": 0.12},
    "from below": {"liquid": 190, "camera_height": -0.06},
}


@pytest.mark.parametrize("look", LOOKS)
def test_the_level_is_found_between_rings(make_scene, look):
    _, image, truth = tall(make_scene, **LOOKS[look])
    outline = find_outline(edge_image(image), truth.camera, truth.cup)
    ((_, v),) = truth.project_wall(truth.camera_azimuth, 0.0, Wall.FRONT)
    assert outline is not None
    # 1 mm is 2.9 px.
    assert front_of(outline)[1] == pytest.approx(v, abs=1.5)


def test_of_two_lines_round_the_glass_a_click_tells_the_level(make_scene):
    scene, image, truth = tall(make_scene, liquid=214, surface=214)
    image = scene.with_rings(image, (0.0, 0.01))
    with pytest.raises(SloshCameraError, match=r"two levels are possible.*--level U V"):
        find_outline(edge_image(image), truth.camera, truth.cup)
    for height in (0.0, 0.01):
        ((u, v),) = truth.project_wall(truth.camera_azimuth, height, Wall.FRONT)
        outline = find_outline(edge_image(image), truth.camera, truth.cup, (u + 3.0, v + 2.0))
        assert outline is not None
        assert front_of(outline)[1] == pytest.approx(v, abs=2.2)


def test_rings_alone_are_no_level(make_scene):
    scene = make_scene(radius=0.0185, distance=0.33, width=260, height=700, focal=900.0)
    image = scene.with_rings(scene.with_sides(scene.empty()), RINGS, (-20.0, 60.0))
    view = scene.calibration().view
    assert find_outline(edge_image(image), view.camera, view.cup) is None


def test_no_sides_no_container(make_scene):
    view = make_scene().calibration().view
    image = make_scene(noise=3.0).empty()
    assert find_outline(edge_image(image), view.camera, view.cup) is None


def test_a_shallow_liquid_needs_a_click(make_scene):
    _, image, truth = tall(make_scene, liquid=150)
    edges, cup = edge_image(image), dataclasses.replace(truth.cup, fill_height=0.02)
    assert find_outline(edges, truth.camera, cup) is None
    ((u, v),) = truth.project_wall(truth.camera_azimuth, 0.0, Wall.FRONT)
    outline = find_outline(edges, truth.camera, cup, (u, v))
    assert outline is not None
    assert front_of(outline)[1] == pytest.approx(v, abs=1.5)


@pytest.mark.long
def test_a_large_picture_of_a_graduated_cylinder_is_calibrated(make_scene):
    scene = make_scene(
        radius=0.0185, distance=0.33, width=620, height=1660, focal=2200.0, oversampling=1,
        liquid=150, surface=170, camera_height=0.06,
    )  # fmt: skip
    image = scene.with_rings(scene.with_sides(scene.draw()), RINGS, (-20.0, 60.0))
    truth = scene.calibration().view
    fit = calibrate_by_edges(image, truth.camera, truth.cup)
    for height in (-0.01, 0.0, 0.01):
        pixel = truth.project_wall(truth.camera_azimuth, height, Wall.FRONT)
        assert fit.view.on_wall(pixel, Wall.FRONT)[1][0] == pytest.approx(height, abs=0.8e-3)


def test_a_wall_of_a_few_rows_shows_no_level(make_scene, monkeypatch):
    """Two lines of another thing: where the image sees their container's wall it is far away."""
    _, image, truth = tall(make_scene, liquid=150)
    monkeypatch.setattr("slosh_camera.calibrate.outline._extent", lambda *_: (-9.0, -8.0))
    assert find_outline(edge_image(image), truth.camera, truth.cup) is None

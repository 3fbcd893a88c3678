"""Tests that images give no height if the container has been moved or removed."""

import cv2
import numpy as np
import pytest

from slosh_camera.cylinder.container_edges import ContainerEdges
from slosh_camera.cylinder.detector import FreeSurfaceDetector, outer_edges
from slosh_camera.images.still_edges import StillEdges
from slosh_camera.measurement import Flag
from slosh_camera.rectangle.detector import SideViewDetector
from slosh_testing.side_view_scene import Liquid, Look, Setup, draw, still

SIDE = Setup(columns=360, rows=440, focal=1200.0, elevation=-0.05)
SLOSHING = Liquid(0.001, 0.0, (-0.010, 0.003, 0.001))


def warped(across=0.0, down=0.0, degrees=0.0, scale=1.0):
    def change(image):
        middle = (0.5 * (image.shape[1] - 1), 0.5 * (image.shape[0] - 1))
        matrix = cv2.getRotationMatrix2D(middle, degrees, scale)
        matrix[:, 2] += across, down
        size = image.shape[1::-1]
        return cv2.warpAffine(image, matrix, size, borderMode=cv2.BORDER_REPLICATE)

    return change


MISFITS = {
    "upside down": lambda image: np.ascontiguousarray(image[::-1, ::-1]),
    "mirrored": lambda image: np.ascontiguousarray(image[::-1]),
    "turned": warped(degrees=20.0),
    "right": warped(across=30.0),
    "left": warped(across=-12.0),
    "down": warped(down=25.0),
    "up": warped(down=-12.0),
    "larger": warped(scale=1.2),
    "smaller": warped(scale=0.8),
}
HARMLESS = {
    "as it is": lambda image: image,
    "a pixel aside": warped(across=1.0, down=1.0),
    "darker": lambda image: (0.4 * image).astype(np.uint8),
    "brighter": lambda image: np.clip(1.15 * image, 0, 255).astype(np.uint8),
    "blurred": lambda image: cv2.GaussianBlur(image, (0, 0), 2.0),
    "coarse": lambda image: cv2.imdecode(
        cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, 20))[1], cv2.IMREAD_UNCHANGED
    ),
    "colour": lambda image: cv2.cvtColor(image, cv2.COLOR_GRAY2BGR),
}


def table_of(scene, image):
    """Draws the scene's glass on a table."""
    picture = image.copy()
    floor = scene.calibration().view.project(np.array([[0.0, 0.0, -0.07]]))[0, 1]
    picture[int(floor) :] = 120
    return scene.with_sides(picture)


@pytest.fixture(params=["level", "pitched"])
def cup(request, make_scene):
    """An initialised detector and an image of a wave."""
    height = 0.0 if request.param == "level" else 0.08
    scene = make_scene(noise=2.0, camera_height=height, aim=0.0)
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(table_of(scene, scene.draw()))
    return detector, table_of(scene, scene.draw(0.015, -1.0))


@pytest.mark.first(6)
@pytest.mark.parametrize("change", MISFITS)
def test_a_cup_elsewhere_in_the_picture_is_not_measured(cup, change):
    detector, image = cup
    measured = detector.measure(0, MISFITS[change](image))
    assert Flag.NOT_FOUND in measured.flags
    assert np.isnan(measured.msh)


@pytest.mark.first(5)
@pytest.mark.parametrize("change", HARMLESS)
def test_light_blur_and_coarse_files_move_no_cup(cup, change):
    detector, image = cup
    measured = detector.measure(0, HARMLESS[change](image))
    assert Flag.NOT_FOUND not in measured.flags
    assert measured.msh == pytest.approx(0.015, abs=0.001)


@pytest.mark.first(3)
@pytest.mark.parametrize("change", MISFITS)
def test_a_tank_elsewhere_in_the_picture_is_not_measured(change):
    detector = SideViewDetector(SIDE.calibration())
    detector.learn_still(still(SIDE, Look()))
    measured = detector.measure(0, MISFITS[change](draw(SIDE, SLOSHING, Look())))
    assert Flag.NOT_FOUND in measured.flags
    assert np.isnan(measured.msh)


@pytest.mark.first(3)
@pytest.mark.parametrize("change", HARMLESS)
def test_light_blur_and_coarse_files_move_no_tank(change):
    detector = SideViewDetector(SIDE.calibration())
    detector.learn_still(still(SIDE, Look()))
    image = draw(SIDE, SLOSHING, Look())
    measured = detector.measure(0, HARMLESS[change](image))
    assert Flag.NOT_FOUND not in measured.flags


def edges_of(scene):
    view = scene.calibration().view
    return StillEdges(outer_edges(view), view.camera.size)


@pytest.fixture
def edges(make_scene):
    """An edge check that is initialised with an image, and that image."""
    scene = make_scene(noise=2.0)
    image = table_of(scene, scene.draw())
    edges = edges_of(scene)
    edges.learn(image)
    return edges, image


@pytest.mark.parametrize("columns", [slice(0, 250), slice(400, 640)], ids=["left", "right"])
def test_what_hides_one_side_leaves_the_other(edges, columns):
    learnt, image = edges
    image[:, columns] = 60
    assert not learnt.missing(image)


def test_without_a_still_image_nothing_is_missed(make_scene):
    scene = make_scene()
    edges = edges_of(scene)
    assert not edges.missing(scene.draw())
    edges.learn(np.full((480, 640), 128, np.uint8))  # teaches no edge
    assert not edges.missing(scene.draw())


def test_a_container_at_the_border_teaches_what_is_seen(make_scene):
    scene = make_scene(distance=0.2, focal=1400.0)
    edges = edges_of(scene)
    image = scene.draw()
    edges.learn(image)
    assert not edges.missing(image[::-1])


def rolled(image, degrees):
    middle = (0.5 * (image.shape[1] - 1), 0.5 * (image.shape[0] - 1))
    turn = cv2.getRotationMatrix2D(middle, -degrees, 1.0)
    size = image.shape[1::-1]
    return cv2.warpAffine(
        image, turn, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )


@pytest.mark.parametrize("degrees", [-3.0, -2.0, 2.0, 3.0])
def test_the_turn_is_measured(make_scene, degrees):
    scene = make_scene(noise=2.0)
    edges = ContainerEdges(scene.calibration().view)
    image = rolled(scene.with_sides(scene.draw(0.01, -1.0)), degrees)
    assert np.degrees(edges.turn(image)) == pytest.approx(degrees, abs=0.51)
    assert edges.turned(image, 0.0)
    assert not edges.turned(image, np.radians(degrees))


@pytest.mark.parametrize("azimuth", np.arange(-3.0, 3.5, 1.5))
def test_waves_and_missing_walls_are_no_turn(make_scene, azimuth):
    scene = make_scene(noise=2.0)
    edges = ContainerEdges(scene.calibration().view)
    image = scene.draw(0.025, azimuth)
    assert not edges.turned(image, 0.0)
    assert not edges.turned(scene.with_sides(image), 0.0)


def test_a_camera_pushed_after_the_still_image_is_noticed(make_scene):
    scene = make_scene()
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(scene.with_sides(scene.draw()))
    image = scene.with_sides(scene.draw(0.015, -1.0))
    assert detector.measure(0, image).flags == Flag.NONE
    pushed = detector.measure(1, rolled(image, 2.0))
    assert pushed.flags == Flag.NOT_FOUND
    assert np.isnan(pushed.msh)


def test_sides_outside_the_image_are_not_looked_for(make_scene):
    scene = make_scene(distance=0.2, focal=1400.0)
    edges = ContainerEdges(scene.calibration().view)
    image = rolled(scene.draw(), 3.0)
    assert edges.turn(image) == 0.0
    assert not edges.turned(image, 0.0)

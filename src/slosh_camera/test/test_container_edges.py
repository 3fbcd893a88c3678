import cv2
import numpy as np
import pytest

from slosh_camera.cylinder.container_edges import ContainerEdges
from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.measurement import Flag


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

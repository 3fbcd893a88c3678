import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from slosh_camera.calibrate.camera_file import (
    format_calibration,
    parse_calibration,
    read_calibration,
)
from slosh_camera.detection.detectors import read_still_image
from slosh_camera.errors import SloshCameraError
from slosh_camera.settings import DetectionSettings, LiquidContrast, RegionOfInterest

TEXT = """\
image_width: 640
image_height: 480
camera_name: side
distortion_model: plumb_bob
camera_matrix: {rows: 3, cols: 3, data: [1000.0, 0, 319.5, 0, 1000.0, 239.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.01, 0, 0, 0]}
container: {radius: 0.05, fill_height: 0.07, wall_thickness: 0.002, rim_height: 0.12,
            wall_refractive_index: 1.52}
pose:
  rotation: [1, 0, 0, 0, 0, -1, 0, 1, 0]
  translation: [0, 0, 0.45]
region_of_interest: {x_offset: 100, y_offset: 20, width: 400, height: 440}
detection: {liquid: lighter, min_contrast: 30, max_dark: 5}
still_image: images/still.png
"""


def test_every_value_arrives():
    calibration = parse_calibration(TEXT)
    camera, cup = calibration.view.camera, calibration.view.cup
    assert (camera.width, camera.height, camera.fx, camera.cy) == (640, 480, 1000.0, 239.5)
    assert camera.distortion == (-0.1, 0.01, 0.0, 0.0, 0.0)
    assert (cup.radius, cup.fill_height, cup.wall_thickness) == (0.05, 0.07, 0.002)
    assert cup.rim_level == pytest.approx(0.05)
    assert_array_equal(calibration.view.pose.camera_centre, [0.0, -0.45, 0.0])
    assert calibration.region == RegionOfInterest(100, 20, 400, 440)
    assert calibration.detection == DetectionSettings(
        LiquidContrast.LIGHTER, min_contrast=30.0, max_dark=5.0
    )
    assert calibration.camera_name == "side"
    assert cup.wall_refractive_index == 1.52
    assert calibration.still_image == Path("images/still.png")


def test_file_round_trip(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(TEXT)
    assert read_calibration(path).camera_name == "side"


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("radius: 0.05", "radius: -1", "container.radius"),
        ("radius: 0.05", "radius: .nan", "container.radius"),
        ("radius: 0.05", "radius: wide", "container.radius"),
        ("radius: 0.05, ", "", "container.radius"),
        ("radius", "diameter", "container.diameter"),
        ("rim_height: 0.12", "rim_height: 0.06", "container.rim_height"),
        ("camera_name: side", "camera_name: 3", "camera_name"),
        ("camera_name", "camera", "camera"),
        ("plumb_bob", "fov", "distortion_model"),
        ("[1000.0, 0", "[0.0, 0", "camera_matrix"),
        ("data: [1000.0,", "data: [.inf,", "camera_matrix.data"),
        ("[-0.1, ", "[", "distortion_coefficients.data"),
        ("image_width: 640", "image_width: 640.5", "image_width"),
        ("image_width: 640", "image_width: true", "image_width"),
        ("image_height: 480\n", "", "image_height"),
        ("rotation: [1,", "rotation: [2,", "pose.rotation"),
        ("rotation: [1,", "rotation: [-1,", "pose.rotation"),
        ("rotation: [1, ", "rotation: [", "pose.rotation"),
        ("[0, 0, 0.45]", "[0, 0, -0.45]", "pose"),
        ("[0, 0, 0.45]", "[0, 0, 0.01]", "pose"),
        ("pose:\n", "pose: 3\nx:\n", "x"),
        ("width: 400", "width: 600", "region_of_interest"),
        ("width: 400", "width: 0", "region_of_interest"),
        ("liquid: lighter", "liquid: blue", "detection.liquid"),
        ("min_contrast: 30", "min_contrast: 300", "detection.min_contrast"),
        ("max_dark", "dark", "detection.dark"),
        ("index: 1.52", "index: 0.9", "container.wall_refractive_index"),
        ("index: 1.52", "index: .inf", "container.wall_refractive_index"),
        ("images/still.png", "3", "still_image"),
        ("images/still.png", "''", "still_image"),
        ("images/still.png", "[a]", "still_image"),
    ],
)
def test_a_wrong_value_is_named_with_file_and_key(old, new, key):
    assert old in TEXT
    with pytest.raises(SloshCameraError) as caught:
        parse_calibration(TEXT.replace(old, new, 1), "cell/camera.yaml")
    message = str(caught.value)
    assert re.match(rf"cell/camera\.yaml(:\d+)?: {re.escape(key)}", message)
    assert message.count("cell/camera.yaml") == 1
    assert "\n" not in message


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("image_height: 480", "image_height: 480\nimage_width: 2", "3: image_width: given twice"),
        ("radius: 0.05", "radius: wide", "7: container.radius: 'wide' is not a number"),
        ("radius: 0.05", "radius: -1", "7: container.radius: "),
        ("rim_height: 0.12", "rim_hight: 0.12", "7: container.rim_hight: unknown key"),
        ("index: 1.52", "index: .inf", "8: container.wall_refractive_index: inf is not a finite"),
        ("rotation: [1,", "rotation: [2,", "10: pose.rotation: "),
        ("  translation: [0, 0, 0.45]\n", "", "9: pose.translation: is missing"),
        ("width: 400", "width: 600", "12: region_of_interest: leaves the image"),
        ("still_image", "\tstill_image", "14: not YAML: "),
    ],
)
def test_a_mistake_is_told_with_its_line(old, new, said):
    assert old in TEXT
    with pytest.raises(SloshCameraError) as caught:
        parse_calibration(TEXT.replace(old, new, 1), "cell/camera.yaml")
    assert str(caught.value).startswith(f"cell/camera.yaml:{said}")


@pytest.mark.parametrize("text", ["", "3", "[1, 2]", "a: [", "\x00"])
def test_a_file_that_holds_something_else(text):
    with pytest.raises(SloshCameraError, match=r"^camera\.yaml(:1)?: "):
        parse_calibration(text)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(SloshCameraError, match=r"nowhere\.yaml: cannot be read"):
        read_calibration(tmp_path / "nowhere.yaml")


def test_a_file_that_is_not_text(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(SloshCameraError, match="UTF-8"):
        read_calibration(path)


@pytest.fixture
def with_still(tmp_path):
    """Calibration file with a still image that the test writes."""
    (tmp_path / "images").mkdir()
    path = tmp_path / "camera.yaml"
    path.write_text(TEXT)
    return path, tmp_path / "images" / "still.png"


@pytest.mark.parametrize("shape", [(480, 640), (480, 640, 3)])
def test_the_still_image_lies_beside_the_file(with_still, shape, monkeypatch):
    path, still = with_still
    image = np.random.default_rng(1).integers(0, 255, shape, np.uint8)
    cv2.imwrite(str(still), image)
    monkeypatch.chdir(path.parent)
    calibration = read_calibration(path.name)
    assert calibration.still_image == still
    monkeypatch.chdir("/")
    assert_array_equal(read_still_image(calibration), image)
    again = parse_calibration(format_calibration(calibration))
    assert_array_equal(read_still_image(again), image)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (None, "cannot be read"),
        (b"", "is empty"),
        (b"not an image", "not a complete image"),
        (cv2.imencode(".png", np.zeros((480, 600), np.uint8))[1].tobytes(), "600 x 480"),
    ],
)
def test_a_still_image_that_cannot_be_used_is_named_when_it_is_read(with_still, content, word):
    path, still = with_still
    if content is not None:
        still.write_bytes(content)
    calibration = read_calibration(path)
    with pytest.raises(SloshCameraError, match=word) as caught:
        read_still_image(calibration)
    assert str(caught.value).startswith(f"{still}: ")
    assert "\n" not in str(caught.value)


def test_no_still_image_to_read():
    calibration = parse_calibration(TEXT.replace("still_image: images/still.png\n", ""))
    with pytest.raises(SloshCameraError, match="still_image"):
        read_still_image(calibration)

"""Tests that the liquid level, and no printed ring or rim, is found in photographs."""

import math
import os
from pathlib import Path

import cv2
import pytest

from slosh_camera.calibrate.still import calibrate_by_edges
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup, Wall

SHARED = Path(os.environ.get("SLOSH_SHARED_DATA", Path(__file__).parents[4] / "shared" / "data"))
FOLDER = SHARED / "photographs"
RADIUS, FIELD_OF_VIEW = 0.0185, math.radians(35.0)
if not FOLDER.is_dir():
    pytest.skip(
        f"no photographs in {FOLDER}: name their folder in SLOSH_SHARED_DATA",
        allow_module_level=True,
    )
LEVELS = {
    "01": (0.186, 1020.6), "02": (0.167, 1343.6), "05": (0.135, 1297.8), "08": (0.082, 1493.9),
    "11": (0.035, 1617.0), "13": (0.149, 1034.6), "14": (0.186, 1062.0), "15": (0.223, 776.7),
}  # fmt: skip
"""Fill height [m] by the printed scale, and the row of the level's front line by eye [px]."""


def still(name: str) -> tuple:
    image = cv2.imread(str(FOLDER / f"graduated_cylinder_{name}.jpg"))
    height, width = image.shape[:2]
    focal = 0.5 * width / math.tan(0.5 * FIELD_OF_VIEW)
    return image, PinholeCamera(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))


@pytest.mark.first(2)
@pytest.mark.parametrize("name", LEVELS)
def test_the_level_is_where_the_eye_sees_it(name):
    fill, row = LEVELS[name]
    image, camera = still(name)
    view = calibrate_by_edges(image, camera, Cup(RADIUS, fill)).view
    (found,) = view.project_wall(view.camera_azimuth, 0.0, Wall.FRONT)
    away = (row - found[1]) * view.height_per_pixel(found, Wall.FRONT)
    assert abs(away) < 1.5e-3


@pytest.mark.parametrize(
    ("name", "fill"),
    [
        pytest.param("15", 0.1, id="the rim of a cylinder that is fuller than told"),
        pytest.param("12", 0.052, id="the edge of the foot, told too little"),
        pytest.param("12", 0.074, id="the edge of the foot"),
        pytest.param("09", 0.029, id="the rear of a foaming level near the foot"),
    ],
)
def test_where_another_line_may_be_the_level_a_click_is_asked_for(name, fill):
    image, camera = still(name)
    with pytest.raises(SloshCameraError, match="--level U V"):
        calibrate_by_edges(image, camera, Cup(RADIUS, fill))


@pytest.mark.long
def test_the_rim_of_an_empty_cylinder_is_no_level():
    image, camera = still("10")
    with pytest.raises(SloshCameraError, match="sides go on below"):
        calibrate_by_edges(image, camera, Cup(RADIUS, 0.15))

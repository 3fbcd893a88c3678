"""Tests crests almost as high as the rim, on the near and the far wall."""

import math

import pytest

from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_camera.cylinder.detector import FreeSurfaceDetector


@pytest.mark.parametrize("side", [0.0, math.pi], ids=["near", "far"])
@pytest.mark.parametrize("height", [0.036, 0.039, 0.042, 0.044])
def test_a_high_crest_is_not_read_too_low(side, height):
    calibration = read_calibration(config_folder() / "camera.yaml")
    azimuth = calibration.view.camera_azimuth + side
    image = CupRenderer(calibration.view).render(
        height * math.cos(azimuth), height * math.sin(azimuth)
    )
    measurement = FreeSurfaceDetector(calibration).update(0, image)
    assert measurement.msh == pytest.approx(height, abs=1e-3)

"""Places the simulated camera in front of a cup, and writes its camera.yaml."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from slosh_base.files import write_bytes, write_text
from slosh_bringup.cell.renderer import CupRenderer
from slosh_camera.calibrate.camera_file import format_calibration
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.camera import PinholeCamera, look_at
from slosh_camera.optics.cup import Cup, CupView
from slosh_model.containers import Container

CAMERA = PinholeCamera(640, 480, 1000.0, 1000.0, 319.5, 239.5)
DOWN = np.radians(10.0)
"""How far the camera looks down."""
DISTANCE = 5.5
"""Of the camera from the still surface's centre, per half of what it must see."""
STILL, FILE = "still.png", "camera.yaml"


def simulated_view(container: Container) -> CupView:
    """Returns the view of a camera that sees a whole cup, from the container's -y.

    Raises:
        SloshCameraError: a container that is not measured through its wall.
    """
    cup = Cup.of(container)
    rim = cup.radius if cup.rim_level is None else cup.rim_level
    widest = float(cup.radius_at(np.array([-cup.fill_height, rim])).max())
    away = DISTANCE * max(widest * CAMERA.height / CAMERA.width, cup.fill_height, rim, cup.radius)
    away += widest
    place = away * np.array([0.0, -np.cos(DOWN), np.sin(DOWN)])
    return CupView(CAMERA, look_at(place, np.zeros(3)), cup)


def write_simulated_camera(container: Container, folder: Path) -> Path | SloshCameraError:
    """Writes camera.yaml and the image of the liquid at rest for a container.

    Returns:
        the path of camera.yaml, or why a camera measures no heights in the container.
    """
    try:
        view = simulated_view(container)
    except SloshCameraError as error:
        return error
    folder.mkdir(parents=True, exist_ok=True)
    _, png = cv2.imencode(".png", CupRenderer(view).render(0.0, 0.0))
    write_bytes(folder / STILL, png.tobytes())
    calibration = Calibration(view, camera_name="simulated", still_image=folder / STILL)
    write_text(folder / FILE, format_calibration(calibration))
    return folder / FILE

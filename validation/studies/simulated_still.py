"""Draws the simulated camera's image of the liquid at rest, without noise.

    tools/run python validation/studies/simulated_still.py

Its calibration names it, as one from `slosh calibrate` names its own: so a picture that is upside
down, shifted or of another camera is refused in a demonstration, too.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2

from slosh_bringup.cell.renderer import CupRenderer, GreyLevels
from slosh_camera.calibrate.camera_file import read_calibration

CONFIG = Path(__file__).resolve().parents[2] / "src" / "slosh_bringup" / "config"


def main() -> int:
    """Writes the image beside the simulated cell's camera.yaml."""
    calibration = read_calibration(CONFIG / "camera.yaml")
    if calibration.still_image is None:
        raise SystemExit(f"{CONFIG / 'camera.yaml'}: names no still_image")
    image = CupRenderer(calibration.view, GreyLevels(noise=0.0)).render(0.0, 0.0)
    if not cv2.imwrite(str(calibration.still_image), image):
        raise SystemExit(f"{calibration.still_image}: cannot be written")
    return 0


if __name__ == "__main__":
    sys.exit(main())

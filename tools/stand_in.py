"""Replaces a camera and a robot in the first-steps tutorials, for users who have none.

    tools/run python tools/stand_in.py camera MODEL.yaml [-o DIR]
    tools/run python tools/stand_in.py robot MODEL.yaml MOTION.csv
    tools/run python tools/stand_in.py joints

`camera` draws what a camera of 640 x 480 pixels sees: a chessboard (DIR/pictures), the cup of the
model with its liquid at rest (DIR/still.png), and a wave in it (DIR/footage). `robot` publishes
the motion and the camera's images of the cup over ROS 2, as soon as a cell listens. The cup is
round and has no wall to speak of; its liquid is damped a little more than the formula says.
`joints` publishes the joint states of examples/robot.urdf in motion, as soon as a cell listens.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.live.cell_setup import NAMESPACE
from slosh_bringup.processes import NodeProcess, node_environment
from slosh_camera.calibrate.camera_file import format_calibration
from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.camera import PinholeCamera, look_at
from slosh_camera.optics.cup import Cup, CupView
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.model_text import format_model, read_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_testing.board_scene import POSES, BoardCamera, Image, chessboard_pictures
from slosh_testing.joint_driver import play_joints

CAMERA = BoardCamera((640, 480), (1000.0, 1000.0), (319.5, 239.5), (0.0, 0.0, 0.0, 0.0, 0.0))
COLUMNS, ROWS, SQUARE = 9, 6, 0.025
# Beside the usual poses: the board near enough to fill most of the picture.
NEAR = ((5, 5, 0, 0, 0.20), (20, -10, 0, 0, 0.22), (-20, 10, 0, 0, 0.22), (10, 25, 0, 0, 0.24))
FARTHER = 2.3  # as the board is larger, and the camera sees less wide, than those of POSES
DISTANCE, DOWN = 8.4, math.radians(10.0)  # of the camera from the cup, in radii; how it looks down
WAVE, FREQUENCY, DECAY = 0.15, 3.0, 0.4  # its height in radii, Hz, 1/s
IMAGES, RATE = 90, 60.0
MORE_DAMPING = 1.25


class StandInError(ValueError):
    """Error of a request that cannot be fulfilled; the text is one line."""


def main(words: Sequence[str] | None = None) -> int:
    """Draws camera images, or plays a motion over ROS 2, as the command line says."""
    parser = argparse.ArgumentParser(description="Stands in for a camera and a robot.")
    parts = parser.add_subparsers(required=True)
    camera = parts.add_parser("camera", help="pictures of a board and of the cup")
    camera.set_defaults(run=lambda given: draw(view_of(read_model(given.model)), given.output))
    robot = parts.add_parser("robot", help="a motion and the camera's images over ROS 2")
    robot.set_defaults(run=lambda given: play(read_model(given.model), given.motion))
    parts.add_parser("joints", help="joint states over ROS 2").set_defaults(
        run=lambda given: play_joints("robot: the motion is over")
    )
    for part in (camera, robot):
        part.add_argument("model", type=Path, metavar="MODEL.yaml", help="model of the cup")
    camera.add_argument(
        "-o", "--output", type=Path, default=Path(), metavar="DIR", help="default: here"
    )
    robot.add_argument("motion", type=Path, metavar="MOTION.csv", help="motion table")
    given = parser.parse_args(words)
    try:
        given.run(given)
    except (StandInError, SloshModelError) as error:
        print(f"stand_in: {error}", file=sys.stderr)
        return 2
    return 0


def view_of(model: Model) -> CupView:
    """Returns the camera's view of the model's cup: from -y and slightly above.

    Raises:
        StandInError: the container is not round.
    """
    container = model.container
    if not isinstance(container, Cylinder):
        raise StandInError("the container is not round: only round cups are drawn")
    radius = container.radius
    cup = Cup(radius, container.fill_height, rim_height=container.rim_height)
    (width, height), (fx, fy), (cx, cy) = CAMERA.size, CAMERA.focal, CAMERA.centre
    away = DISTANCE * radius
    centre = (0.0, -away * math.cos(DOWN), away * math.sin(DOWN))
    return CupView(
        PinholeCamera(width, height, fx, fy, cx, cy), look_at(centre, (0.0, 0.0, 0.0)), cup
    )


def draw(view: CupView, folder: Path) -> None:
    """Writes simulated camera images of a calibration board and of the cup."""
    renderer = CupRenderer(view)
    write(folder / "pictures", board_pictures())
    write(folder, [renderer.render_colour(0.0, 0.0)], "still.png")
    crest = WAVE * view.cup.radius
    waves = [
        crest * math.exp(-DECAY * t) * math.cos(2.0 * math.pi * FREQUENCY * t)
        for t in np.arange(IMAGES) / RATE
    ]
    write(folder / "footage", [renderer.render(wave, 0.0) for wave in waves])
    print(f"{folder / 'pictures'}, {folder / 'still.png'}, {folder / 'footage'}")


def board_pictures() -> list[Image]:
    """Renders the calibration board in many poses, as the camera sees it."""
    poses = [(*where[:4], FARTHER * where[4]) for where in (*POSES, *NEAR)]
    return chessboard_pictures(COLUMNS, ROWS, SQUARE, poses, CAMERA)


def write(folder: Path, images: Sequence[Image], name: str = "image_{:03d}.png") -> None:
    """Writes images to a folder, which is created if it does not exist.

    Raises:
        StandInError: one cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for number, image in enumerate(images):
        path = folder / name.format(number)
        if not cv2.imwrite(str(path), image):
            raise StandInError(f"{path}: cannot be written")


def play(model: Model, motion: Path) -> None:
    """Plays a motion and its camera images to a running cell until the motion ends.

    Raises:
        StandInError: it was not played.
    """
    truth = model.with_effect("damping_mismatch", factor=MORE_DAMPING)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "truth.yaml").write_text(format_model(truth), encoding="utf-8")
        calibration = format_calibration(Calibration(view_of(model)))
        (folder / "camera.yaml").write_text(calibration, encoding="utf-8")
        parameters = {
            "motion": str(motion.resolve()),
            "model": str(folder / "truth.yaml"),
            "calibration": str(folder / "camera.yaml"),
        }
        command = NodeProcess("cell", parameters=parameters).command(NAMESPACE)
        done = subprocess.run(command, env=node_environment(), check=False)
    if done.returncode != 0:
        raise StandInError("the motion was not played")
    print("robot: the motion is over", flush=True)


if __name__ == "__main__":
    sys.exit(main())

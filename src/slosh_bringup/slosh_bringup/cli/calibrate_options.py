"""The options of `slosh calibrate`."""

from __future__ import annotations

import argparse
from pathlib import Path

from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.quantities import ERROR, PERCENT, angle, length
from slosh_camera.calibrate.board import FORMAT

_DOUBTS = (
    ("--focal-error", "PERCENT", PERCENT, "the focal length or the field of view [percent]"),
    ("--wall-error", "M", ERROR, "the wall's thickness [m]"),
    ("--fill-error", "M", ERROR, "the fill height [m]"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh calibrate` to the argument parser."""
    parser.add_argument("still", type=Path, help="image of the liquid at rest")
    camera = parser.add_mutually_exclusive_group()
    camera.add_argument(
        "--camera", type=Path, metavar="FILE",
        help="intrinsic parameters: a file of ROS camera_calibration, or a camera.yaml",
    )  # fmt: skip
    camera.add_argument(
        "--fov", type=angle(3.15, 180.0), metavar="DEG",
        help="horizontal field of view [deg] of a lens without distortion (default: from the "
        "picture's EXIF)",
    )  # fmt: skip
    # Of a cup with an inclined wall, by --model alone.
    parser.set_defaults(taper=None)
    cup = parser.add_argument_group("container (defaults: --model, or else the --camera file)")
    cup.add_argument(
        "--model", type=Path, metavar="FILE",
        help="model.yaml, for the container's radius, fill height and rim height",
    )  # fmt: skip
    cup.add_argument("--radius", type=length(2.0), metavar="M", help="inner radius [m]")
    cup.add_argument(
        "--fill-height",
        type=length(4.0),
        metavar="M",
        help="height of the liquid at rest above the inner floor [m]",
    )
    wall = cup.add_argument(
        "--wall",
        dest="wall_thickness",
        type=length(0.05),
        metavar="M",
        help="thickness of the wall [m] (default 0)",
    )
    old_name(parser, wall, "--wall-thickness")
    cup.add_argument(
        "--rim-height",
        type=length(4.0),
        metavar="M",
        help="height of the rim above the inner floor [m]",
    )
    cup.add_argument(
        "--wall-refractive-index",
        type=float,
        metavar="N",
        help="refractive index of the wall (default 1.49)",
    )
    cup.add_argument(
        "--azimuth", type=angle(), default=-90.0, metavar="DEG",
        help="direction of the camera seen from the container's axis, from its +x towards +y "
        "[deg] (default -90)",
    )  # fmt: skip
    doubt = parser.add_argument_group("standard errors of the inputs (default 0: exact)")
    for option, unit, kind, what in _DOUBTS:
        doubt.add_argument(
            option,
            type=kind,
            default=0.0,
            metavar=unit,
            help=f"standard error of {what}; if above 0, the calibration also estimates it "
            "(default 0)",
        )
    parser.add_argument(
        "--distance", type=length(10.0), metavar="M",
        help="approximate distance of the camera from the container's axis [m], within 10 "
        "percent; chooses between ambiguous poses; needed with --scale for a body of revolution",
    )  # fmt: skip
    parser.add_argument(
        "--level", nargs=2, type=float, metavar=("U", "V"),
        help="pixel on the liquid level at the front wall; needed where printed rings look "
        "like levels",
    )  # fmt: skip
    board = parser.add_argument_group("board of markers")
    board.add_argument(
        "--board",
        metavar="BOARD",
        help=f"calibration board with markers: {FORMAT}, lengths in m; see docs/calibration.md",
    )
    board.add_argument(
        "--board-place", nargs=6, type=float, metavar=("X", "Y", "Z", "YAW", "PITCH", "ROLL"),
        help="pose of the --board in the container's frame [m, deg] (default: the board lies "
        "face up on the plane on which the container stands)",
    )  # fmt: skip
    board.add_argument(
        "--base-thickness", type=length(0.05), default=0.0, metavar="M",
        help="thickness of the container's floor [m], for a board that lies next to the "
        "container (default 0)",
    )  # fmt: skip
    scale = parser.add_argument_group("side view calibrated by its scale only, without a pose")
    scale.add_argument(
        "--scale", nargs=4, type=float, metavar=("U1", "V1", "U2", "V2"),
        help="pixels of the left and the right end of the liquid level at rest",
    )  # fmt: skip
    scale.add_argument(
        "--length",
        type=length(4.0),
        metavar="M",
        help="distance between the two --scale points [m] (default: twice the radius; for a body "
        "of revolution its outer width at the level)",
    )
    scale.add_argument(
        "--page", type=Path, metavar="OUT.html",
        help="HTML page to write: on it you click the two --scale points, and it shows the "
        "command to run",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="name of the camera.yaml to write"
    )
    parser.add_argument(
        "--picture",
        type=Path,
        metavar="OUT.png",
        help="image to write: the pose drawn over the input image",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")

"""`slosh calibrate`: makes camera.yaml from an image of the liquid at rest."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import fields
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_base.files import check_apart, write_bytes, write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.calibrate_model import take_model
from slosh_bringup.cli.calibrate_scale import run_page, run_scale
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.quantities import ERROR, PERCENT, angle, length
from slosh_bringup.cli.quiet_decoders import quiet_decoders
from slosh_bringup.errors import SloshBringupError
from slosh_camera.calibrate.board import (
    FORMAT,
    BoardFit,
    check_hint,
    find_board,
    hint_of_flat_board,
    parse_board,
    pose_by_board,
)
from slosh_camera.calibrate.camera_file import format_calibration, parse_calibration
from slosh_camera.calibrate.doubt import ToldDeviations
from slosh_camera.calibrate.intrinsics import KnownCamera, camera_of_view, read_known_camera
from slosh_camera.calibrate.picture import draw_calibration
from slosh_camera.calibrate.pose import CameraPlace
from slosh_camera.calibrate.still import calibrate_by_edges, check_pose, check_size
from slosh_camera.calibrate.still_fit import StillFit
from slosh_camera.calibrate.warning_words import warnings_of
from slosh_camera.detection.learnt import still_doubt
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image, to_colour
from slosh_camera.images.decoding import read_image
from slosh_camera.images.exif import read_exif
from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.cup import Cup, CupView, Wall
from slosh_camera.optics.pose import Pose
from slosh_report.json_values import plain

_CUP_KEYS = tuple(entry.name for entry in fields(Cup))
_DOUBTS = (
    ("--focal-error", "PERCENT", PERCENT, "the focal length or the field of view [percent]"),
    ("--wall-error", "M", ERROR, "the wall's thickness [m]"),
    ("--fill-error", "M", ERROR, "the fill height [m]"),
)
_NUMBERS = tuple(entry.name for entry in fields(CameraPlace))
_SENSE = (
    (1e3, 1, "mm from the axis"),
    (1e3, 1, "mm above the still level"),
    (180.0 / np.pi, 2, "deg to the left of the axis"),
    (180.0 / np.pi, 2, "deg down"),
    (180.0 / np.pi, 2, "deg clockwise"),
)
# About which axis yaw, pitch and roll turn.
_AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


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
            help=f"standard error of {what}; if above 0, the value is estimated too (default 0)",
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
        help=f"board with markers: {FORMAT}, lengths in m; see docs/calibration.md",
    )
    board.add_argument(
        "--board-place", nargs=6, type=float, metavar=("X", "Y", "Z", "YAW", "PITCH", "ROLL"),
        help="pose of the board in the container's frame [m, deg] (default: the board lies "
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
        help="page to write: click the two points on the image, and it shows the command",
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


def run(arguments: argparse.Namespace) -> int:
    """Estimates the camera pose, writes camera.yaml and prints the accuracy."""
    take_model(arguments)
    if arguments.page is not None:
        return run_page(arguments)
    if arguments.scale is not None:
        return run_scale(arguments)
    if arguments.length is not None:
        raise SloshBringupError("--length: needs --scale")
    check_apart([arguments.output, arguments.picture], [arguments.still, arguments.camera])
    with quiet_decoders():
        image = to_colour(read_image(arguments.still))
    known = _known_camera(arguments, image)
    cup = _cup(arguments, known)
    try:
        fit, board = _fitted(arguments, image, known, cup)
        detection = _detection_warnings(fit, known, image)
        if detection and not fit.level_shows:
            raise SloshCameraError(
                f"still image: the still level is not certain: {detection[0]}; click on its "
                "front line: --level U V"
            )
    except SloshCameraError as error:
        raise SloshBringupError(f"{arguments.still}: {error}") from error
    text = _camera_yaml(arguments, fit, known)
    if arguments.picture is not None:
        _write_picture(arguments.picture, draw_calibration(image, fit, board))
    write_text(arguments.output, text)
    assumed = _assumptions(arguments, known, fit)
    warnings = [*warnings_of(fit), *detection]
    answer = _as_json if arguments.json else _as_text
    print(answer(arguments, fit, board, assumed, warnings))
    return 0


def _detection_warnings(fit: StillFit, known: KnownCamera, image: Image) -> list[str]:
    """Returns warnings if the detector finds no surface, or a tilted one, in the still image.

    Raises:
        SloshCameraError: it would take the liquid at rest for a wave: there is no zero.
    """
    doubt = still_doubt(Calibration(fit.view, known.name), image)
    return [f"`slosh detect` and the node: {doubt}"] if doubt else []


def _known_camera(arguments: argparse.Namespace, image: Image) -> KnownCamera:
    if arguments.camera is not None:
        return read_known_camera(arguments.camera)
    height, width = image.shape[:2]
    try:
        given = arguments.fov is not None
        angle = np.deg2rad(arguments.fov) if given else _exif_view(arguments, image)
        camera = camera_of_view(width, height, angle)
    except SloshCameraError as error:
        raise SloshBringupError(f"--fov: {error}") from error
    return KnownCamera(camera, "camera", {})


def _exif_view(arguments: argparse.Namespace, image: Image) -> float:
    """Returns the field of view from the image's EXIF data [rad]."""
    height, width = image.shape[:2]
    try:
        return read_exif(arguments.still).field_of_view(width, height)
    except SloshCameraError as error:
        raise SloshBringupError(
            f"--camera or --fov: one of them is needed, or --scale ({error})"
        ) from error


def _cup(arguments: argparse.Namespace, known: KnownCamera) -> Cup:
    """Returns the container from the command-line options, or else from the camera file."""
    values = {key: known.container[key] for key in _CUP_KEYS if key in known.container}
    given = {key: getattr(arguments, key) for key in _CUP_KEYS}
    values.update({key: value for key, value in given.items() if value is not None})
    for key in ("radius", "fill_height"):
        if key not in values:
            raise SloshBringupError(
                f"--{key.replace('_', '-')}: is needed, or --model; --camera does not give it"
            )
    return Cup(**values)


def _fitted(
    arguments: argparse.Namespace, image: Image, known: KnownCamera, cup: Cup
) -> tuple[StillFit, BoardFit | None]:
    azimuth = np.deg2rad(_finite(arguments.azimuth, "--azimuth"))
    doubt, distance = _doubt(arguments), _positive(arguments.distance, "--distance")
    level = _level(arguments)
    if arguments.board is None:
        if arguments.board_place is not None:
            raise SloshBringupError("--board-place: needs --board")
        fit = calibrate_by_edges(
            image, known.camera, cup, azimuth, doubt=doubt, distance=distance, level=level
        )
        return fit, None
    check_size(image, known.camera)
    board = find_board(image, known.camera, parse_board(arguments.board))
    if arguments.board_place is not None:
        if level is not None:
            raise SloshBringupError("--level: is not used with --board-place, which gives it")
        pose, covariance = pose_by_board(board, _board_place(arguments.board_place))
        return check_pose(image, CupView(known.camera, pose, cup), covariance), board
    base = _finite(arguments.base_thickness, "--base-thickness")
    hint = hint_of_flat_board(board, cup, base)
    fit = calibrate_by_edges(image, known.camera, cup, azimuth, hint, doubt, distance, level)
    check_hint(hint, fit.place.numbers)
    return fit, board


def _doubt(arguments: argparse.Namespace) -> ToldDeviations:
    """Returns the standard deviations of the inputs from the options; converts percentages."""
    values = []
    for name, unit in (("focal_error", 0.01), ("wall_error", 1.0), ("fill_error", 1.0)):
        option = f"--{name.replace('_', '-')}"
        value = unit * _finite(getattr(arguments, name), option)
        if not 0.0 <= value < 1.0:
            raise SloshBringupError(f"{option}: {value / unit:g}, must be at least 0 and small")
        values.append(value)
    return ToldDeviations(*values)


def _level(arguments: argparse.Namespace) -> tuple[float, float] | None:
    if arguments.level is None:
        return None
    u, v = (_finite(value, "--level") for value in arguments.level)
    return u, v


def _positive(value: float | None, option: str) -> float | None:
    if value is not None and _finite(value, option) <= 0.0:
        raise SloshBringupError(f"{option}: {value:g}, must be positive")
    return value


def _finite(value: float, option: str) -> float:
    if not np.isfinite(value):
        raise SloshBringupError(f"{option}: {value} is not a finite number")
    return float(value)


def _board_place(values: list[float]) -> Pose:
    """Returns the transform from the board to the container from x, y, z, roll, pitch and yaw."""
    x, y, z, yaw, pitch, roll = (_finite(value, "--board-place") for value in values)
    turns = [
        np.deg2rad(angle) * axis for angle, axis in zip((yaw, pitch, roll), _AXES, strict=True)
    ]
    about_z, about_y, about_x = (cv2.Rodrigues(turn)[0] for turn in turns)
    return Pose(about_z @ about_y @ about_x, np.array([x, y, z]))


def _camera_yaml(arguments: argparse.Namespace, fit: StillFit, known: KnownCamera) -> str:
    """Formats the text of camera.yaml, with the still image's path relative to the file."""
    folder = arguments.output.resolve().parent
    still = Path(os.path.relpath(arguments.still.resolve(), folder))
    text = format_calibration(Calibration(fit.view, known.name, still_image=still))
    # What was written must be what `slosh detect` reads.
    parse_calibration(text, str(arguments.output), folder)
    return text


def _write_picture(path: Path, picture: Image) -> None:
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise SloshBringupError(f"{path}: pictures are written as .png or .jpg")
    write_bytes(path, cv2.imencode(path.suffix, picture)[1].tobytes())


def _as_json(
    arguments: argparse.Namespace, fit: StillFit, board: BoardFit | None, assumed: list[str],
    warnings: list[str],
) -> str:  # fmt: skip
    pose = fit.view.pose
    facts = {
        "output": str(arguments.output),
        "rotation": pose.rotation.ravel().tolist(),
        "translation": pose.translation.tolist(),
        "place": _named(fit.place.numbers),
        "stddev": _named(fit.stddev[: len(_NUMBERS)]),
        "residual": fit.residual,
        "residual_height": fit.residual_height,
        "height_stddev": {wall.value: fit.height_stddev[wall] for wall in Wall},
        "curves": {
            curve.name: {"share": curve.share, "offset": curve.offset} for curve in fit.curves
        },
        "board_residual": None if board is None else board.residual,
        "assumed": assumed,
        "warnings": warnings,
    }
    return json.dumps(plain(facts))


def _named(numbers: NDArray[np.float64]) -> dict[str, float]:
    return dict(zip(_NUMBERS, (float(value) for value in numbers), strict=True))


def _as_text(
    arguments: argparse.Namespace, fit: StillFit, board: BoardFit | None, assumed: list[str],
    warnings: list[str],
) -> str:  # fmt: skip
    place, error = fit.place, fit.stddev[: len(_NUMBERS)]
    lines = [
        f"{name:9}{scale * value:8.{digits}f} +- {scale * sigma:.{digits}f} {unit}"
        for name, value, sigma, (scale, digits, unit) in zip(
            _NUMBERS, place.numbers, error, _SENSE, strict=True
        )
    ]
    lines += _estimated(fit)
    lines += [
        f"{curve.name:27} {100.0 * curve.share:4.0f} % seen, {curve.offset:+.2f} px off"
        for curve in fit.curves
    ]
    if board is not None:
        lines.append(f"board    {len(board.corners)} corners, {board.residual:.2f} px rms")
    front, rear = (1e3 * fit.height_stddev[wall] for wall in (Wall.FRONT, Wall.REAR))
    level = 1e3 * fit.residual_height
    lines += [
        f"residual {fit.residual:8.2f} px rms (sides, still level); still level {level:.2f} mm",
        f"a height's error by the pose, at -20 to 20 mm: {front:.2f} mm (front wall), "
        f"{rear:.2f} mm (rear wall), 1 sigma",
        *(f"assumed  {assumption}" for assumption in assumed),
        *(f"warning: {warning}" for warning in warnings),
        plain_line(arguments.output),
    ]
    return "\n".join(lines)


def _assumptions(arguments: argparse.Namespace, known: KnownCamera, fit: StillFit) -> list[str]:
    """Lists the values assumed by default, each with the option that sets it."""
    focal, wall, _ = fit.stddev[len(_NUMBERS) :]
    found = []
    if arguments.camera is None and not focal:
        camera = known.camera
        angle = np.rad2deg(2.0 * np.arctan(0.5 * camera.width / camera.fx))
        by = "" if arguments.fov is not None else " by the picture's EXIF"
        found.append(
            f"a field of view of {angle:.4g} deg{by} to the last digit, no distortion "
            "(--camera, or --focal-error)"
        )
    turned = read_exif(arguments.still).orientation
    if arguments.camera is not None and turned != 1:
        found.append(
            f"intrinsic parameters from pictures that are turned as this one is, by its EXIF "
            f"orientation {turned}"
        )
    told = arguments.wall_thickness is not None or "wall_thickness" in known.container
    if not told and not wall:
        found.append("a wall without thickness (--wall, or --wall-error)")
    return found


def _estimated(fit: StillFit) -> list[str]:
    """Lists the uncertain inputs with their estimated values, as text lines."""
    cup, camera = fit.view.cup, fit.view.camera
    focal, wall, fill = fit.stddev[len(_NUMBERS) :]
    rows = (
        ("focal", camera.fx, camera.fx * focal, "px"),
        ("wall", 1e3 * cup.wall_thickness, 1e3 * wall, "mm thick"),
        ("fill", 1e3 * cup.fill_height, 1e3 * fill, "mm high"),
    )
    return [
        f"{name:9}{value:8.1f} +- {error:.1f} {unit}" for name, value, error, unit in rows if error
    ]

"""`slosh calibrate`: makes camera.yaml from an image of the liquid at rest."""

from __future__ import annotations

import argparse
import math
import os
from dataclasses import fields
from pathlib import Path

import cv2
import numpy as np

from slosh_base.files import check_apart, write_bytes, write_text
from slosh_base.files.quiet_decoders import quiet_decoders
from slosh_bringup.cli.calibrate_answer import as_json, as_text, assumptions
from slosh_bringup.cli.calibrate_options import add_arguments
from slosh_bringup.cli.calibrate_scale import run_page, run_scale
from slosh_bringup.cli.output_names import PAGE, YAML, check_ending
from slosh_bringup.errors import SloshBringupError
from slosh_camera.calibrate.board import (
    BoardFit,
    check_hint,
    find_board,
    hint_of_flat_board,
    parse_board,
    pose_by_board,
)
from slosh_camera.calibrate.camera_file import format_calibration, parse_calibration
from slosh_camera.calibrate.intrinsics import KnownCamera, camera_of_view, read_known_camera
from slosh_camera.calibrate.pose import GivenDeviations
from slosh_camera.calibrate.still import calibrate_by_edges, check_pose, check_size
from slosh_camera.calibrate.still_fit import StillFit, draw_calibration, warnings_of
from slosh_camera.detection.detectors import still_doubt
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image, to_colour
from slosh_camera.images.decoding import read_image
from slosh_camera.images.headers import read_exif
from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.camera import Pose
from slosh_camera.optics.cup import Cup, CupView
from slosh_model.containers import ROUND, Container
from slosh_model.model_text import read_model

SAME = 1e-3
"""Lengths that differ by a smaller share are one."""

__all__ = ["add_arguments", "run"]

_CUP_KEYS = tuple(entry.name for entry in fields(Cup))
# About which axis yaw, pitch and roll turn.
_AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def run(arguments: argparse.Namespace) -> int:
    """Estimates the camera pose, writes camera.yaml and prints the accuracy."""
    take_model(arguments)
    check_ending(arguments.output, "a camera's file", YAML)
    check_ending(arguments.page, "a page", PAGE)
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
                "contact line: --level U V"
            )
    except SloshCameraError as error:
        raise SloshBringupError(f"{arguments.still}: {error}") from error
    text = _camera_yaml(arguments, fit, known)
    if arguments.picture is not None:
        _write_picture(arguments.picture, draw_calibration(image, fit, board))
    write_text(arguments.output, text)
    assumed = assumptions(arguments, known, fit)
    warnings = [*warnings_of(fit), *detection]
    answer = as_json if arguments.json else as_text
    print(answer(arguments, fit, board, assumed, warnings))
    return 0


def _detection_warnings(fit: StillFit, known: KnownCamera, image: Image) -> list[str]:
    """Returns a warning if the detector finds no surface, or a tilted one, in the image at rest.

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


def _doubt(arguments: argparse.Namespace) -> GivenDeviations:
    """Returns standard deviations of focal length, wall and fill height from the options."""
    values = []
    for name, unit in (("focal_error", 0.01), ("wall_error", 1.0), ("fill_error", 1.0)):
        option = f"--{name.replace('_', '-')}"
        value = unit * _finite(getattr(arguments, name), option)
        if not 0.0 <= value < 1.0:
            raise SloshBringupError(f"{option}: {value / unit:g}, must be at least 0 and small")
        values.append(value)
    return GivenDeviations(*values)


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
    """Returns the pose of the container relative to the calibration board, from --board-place."""
    x, y, z, yaw, pitch, roll = (_finite(value, "--board-place") for value in values)
    turns = [
        np.deg2rad(angle) * axis for angle, axis in zip((yaw, pitch, roll), _AXES, strict=True)
    ]
    about_z, about_y, about_x = (cv2.Rodrigues(turn)[0] for turn in turns)
    return Pose(about_z @ about_y @ about_x, np.array([x, y, z]))


def _camera_yaml(arguments: argparse.Namespace, fit: StillFit, known: KnownCamera) -> str:
    """Formats the text of camera.yaml; the path of the image at rest is relative to the file."""
    folder = arguments.output.resolve().parent
    still = Path(os.path.relpath(arguments.still.resolve(), folder))
    text = format_calibration(Calibration(fit.view, known.name, still_image=still))
    # What was written must be what `slosh detect` reads.
    parse_calibration(text, str(arguments.output), folder)
    return text


def _write_picture(path: Path, picture: Image) -> None:
    check_ending(path, "a picture", (".png", ".jpg", ".jpeg"))
    write_bytes(path, cv2.imencode(path.suffix, picture)[1].tobytes())


def take_model(arguments: argparse.Namespace) -> None:
    """Sets missing container options from the file given by --model, if there is one.

    Raises:
        SloshBringupError: an option says another length; a container that is not seen through
            its wall and no --scale.
    """
    if arguments.model is None:
        return
    container = read_model(arguments.model).container
    _check_radius(arguments, container)
    lengths = {"fill_height": container.fill_height, "rim_height": container.rim_height}
    if container.section == ROUND:
        lengths["radius"] = container.size
    elif arguments.scale is None and arguments.page is None:
        try:
            cup = Cup.of(container)
        except SloshCameraError as error:
            raise SloshBringupError(f"--model: {arguments.model}: {error}") from None
        arguments.radius, arguments.taper = cup.radius, cup.taper
    elif container.cornered and arguments.length is None:
        arguments.length = container.size
    for name, told in lengths.items():
        given = getattr(arguments, name)
        if given is None:
            setattr(arguments, name, told)
        elif told is not None and not math.isclose(given, told, rel_tol=SAME):
            raise SloshBringupError(
                f"--{name.replace('_', '-')}: {_mm(given)}, but {arguments.model} has "
                f"{_mm(told)}; leave the option out or correct the file"
            )


def _check_radius(arguments: argparse.Namespace, container: Container) -> None:
    """Raises an error if --radius is the model's diameter, or its container is not round."""
    given = arguments.radius
    if given is None:
        return
    if container.section != ROUND:
        raise SloshBringupError(
            f"--radius: {arguments.model} contains no cylinder ({container.described})"
        )
    if math.isclose(given, 2.0 * container.size, rel_tol=0.1):
        raise SloshBringupError(
            f"--radius: {_mm(given)} is the diameter of the container in {arguments.model}; its "
            f"radius is {_mm(container.size)}"
        )


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.4g} mm"

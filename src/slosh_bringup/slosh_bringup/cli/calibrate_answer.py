"""Result of `slosh calibrate`: pose, standard errors and warnings, as text or as JSON."""

from __future__ import annotations

import argparse
import json
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from slosh_base.files.plain_text import plain_line
from slosh_camera.calibrate.board import BoardFit
from slosh_camera.calibrate.intrinsics import KnownCamera
from slosh_camera.calibrate.pose import CameraPlace
from slosh_camera.calibrate.still_fit import StillFit
from slosh_camera.images.headers import read_exif
from slosh_camera.optics.cup import Wall
from slosh_report.json_values import plain

_NUMBERS = tuple(entry.name for entry in fields(CameraPlace))
_SENSE = (
    (1e3, 1, "mm from the axis"),
    (1e3, 1, "mm above the still level"),
    (180.0 / np.pi, 2, "deg to the left of the axis"),
    (180.0 / np.pi, 2, "deg down"),
    (180.0 / np.pi, 2, "deg clockwise"),
)


def as_json(
    arguments: argparse.Namespace, fit: StillFit, board: BoardFit | None, assumed: list[str],
    warnings: list[str],
) -> str:  # fmt: skip
    """Returns the result of `slosh calibrate --json`: one line of JSON, lengths in m."""
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


def as_text(
    arguments: argparse.Namespace, fit: StillFit, board: BoardFit | None, assumed: list[str],
    warnings: list[str],
) -> str:  # fmt: skip
    """Returns the result of `slosh calibrate` as lines for a terminal: mm, degrees and pixels."""
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


def assumptions(arguments: argparse.Namespace, known: KnownCamera, fit: StillFit) -> list[str]:
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

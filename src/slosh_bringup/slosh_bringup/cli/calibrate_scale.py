"""`slosh calibrate --scale`: calibrates a side view from the two ends of the still surface."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from slosh_base.files import check_apart, write_text
from slosh_base.files.plain_text import plain_line
from slosh_base.files.quiet_decoders import quiet_decoders
from slosh_bringup.errors import SloshBringupError
from slosh_camera.calibrate.camera_file import format_calibration, parse_any_calibration
from slosh_camera.calibrate.scale import calibrate_by_scale
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import to_colour
from slosh_camera.images.decoding import read_image
from slosh_camera.optics.round_body import RoundBody
from slosh_model.containers import REVOLVED
from slosh_model.model_text import read_model
from slosh_report.json_values import plain

# What a scale has no use for, and what it would be taken for.
_UNUSED = ("camera", "fov", "board", "level", "picture")
_OF_BODIES = ("distance", "wall_thickness", "wall_refractive_index")
"""What only the silhouette of a body of revolution has a use for."""


def run_page(arguments: argparse.Namespace) -> int:
    """Writes the HTML page on which the user clicks the two ends of the still surface."""
    from slosh_bringup.scale_page import render_clicks

    check_apart([arguments.page, arguments.output], [arguments.still, arguments.model])
    if arguments.scale is not None:
        raise SloshBringupError("--page: is for finding --scale; do not give both")
    body = _body(arguments)
    length = _length(arguments, body)
    with quiet_decoders():
        image = to_colour(read_image(arguments.still))
    words = _words(arguments, body, length)
    before = ["slosh", "calibrate", str(arguments.still), "--scale"]
    after = [*words, "-o", str(arguments.output)]
    write_text(arguments.page, render_clicks(image, arguments.still.name, before, after))
    print(f"{plain_line(arguments.page)}: open it, click, and run the command that it shows")
    return 0


def _words(arguments: argparse.Namespace, body: RoundBody | None, length: float) -> list[str]:
    """Returns the `slosh calibrate` options that the HTML page adds to the two clicked points."""
    if body is None:
        words = ["--length", f"{length:g}", "--fill-height", f"{arguments.fill_height:g}"]
        if arguments.rim_height is not None:
            words += ["--rim-height", f"{arguments.rim_height:g}"]
        return words
    words = ["--model", str(arguments.model)]
    for option, value in (
        ("--distance", arguments.distance), ("--wall", arguments.wall_thickness),
        ("--wall-refractive-index", arguments.wall_refractive_index),
    ):  # fmt: skip
        words += [] if value is None else [option, f"{value:g}"]
    return words


def _body(arguments: argparse.Namespace) -> RoundBody | None:
    """Returns the model's container if it is a body of revolution, otherwise None.

    Raises:
        SloshBringupError: the container is none that can be seen from the side.
    """
    if arguments.model is None:
        return None
    container = read_model(arguments.model).container
    if container.section != REVOLVED:
        return None
    index = arguments.wall_refractive_index
    return RoundBody.of(
        container, arguments.wall_thickness or 0.0,
        *(() if index is None else (index,)),
    )  # fmt: skip


def _length(arguments: argparse.Namespace, body: RoundBody | None) -> float:
    """Returns the distance between the two clicked points [m].

    Raises:
        SloshBringupError: it or the fill height is not known; an option has no use here.
    """
    for name in (*_UNUSED, *(_OF_BODIES if body is None else ())):
        if getattr(arguments, name) is not None:
            option = name.removesuffix("_thickness").replace("_", "-")
            raise SloshBringupError(
                f"--{option}: is not used with --scale"
                + (", except of a body of revolution (--model)" if name in _OF_BODIES else "")
            )
    if body is not None and arguments.length is None:
        return body.width
    if arguments.length is None and arguments.radius is None:
        raise SloshBringupError(
            "--length: is needed with --scale, or --radius or --model for a cylinder"
        )
    if arguments.fill_height is None:
        raise SloshBringupError("--fill-height: is needed, or --model")
    return float(arguments.length or 2.0 * arguments.radius)


def run_scale(arguments: argparse.Namespace) -> int:
    """Writes camera.yaml and prints the image scale and the uncertainty of heights."""
    check_apart([arguments.output], [arguments.still, arguments.model])
    body = _body(arguments)
    length = _length(arguments, body)
    with quiet_decoders():
        image = read_image(arguments.still)
    u1, v1, u2, v2 = arguments.scale
    size = (int(image.shape[1]), int(image.shape[0]))
    try:
        found = calibrate_by_scale(
            size, (u1, v1), (u2, v2), length, arguments.fill_height, arguments.rim_height,
            body, arguments.distance,
        )  # fmt: skip
    except SloshCameraError as error:
        raise SloshBringupError(f"{arguments.still}: {error}") from error
    folder = arguments.output.resolve().parent
    still = Path(os.path.relpath(arguments.still.resolve(), folder))
    text = format_calibration(replace(found, still_image=still))
    # What was written must be what `slosh detect` reads.
    parse_any_calibration(text, str(arguments.output), folder)
    write_text(arguments.output, text)
    pixel = length / float(np.hypot(u2 - u1, v2 - v1))
    known = found.detection.scale_error
    if arguments.json:
        facts = {"output": str(arguments.output), "metre_per_pixel": pixel, "scale_error": known}
        print(json.dumps(plain(facts)))
    else:
        plane = "the image's plane" if body is None else "the plane through the axis"
        print(f"scale    {1e3 * pixel:8.3f} mm/px, heights in {plane} to {known:.1%}")
        print(plain_line(arguments.output))
    return 0

"""`slosh calibrate --scale`: makes camera.yaml of a side view from the level's two ends."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from slosh_base.files import check_apart, write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.quiet_decoders import quiet_decoders
from slosh_bringup.errors import SloshBringupError
from slosh_camera.calibrate.camera_file import format_calibration, parse_any_calibration
from slosh_camera.calibrate.scale import calibrate_by_scale
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import to_colour
from slosh_camera.images.decoding import read_image
from slosh_report.json_values import plain

# What a scale has no use for, and what it would be taken for.
_UNUSED = ("camera", "fov", "board", "distance", "level", "picture", "wall_thickness")


def run_page(arguments: argparse.Namespace) -> int:
    """Writes the page on which the user clicks the two ends."""
    from slosh_bringup.scale_page import render_clicks

    check_apart([arguments.page, arguments.output], [arguments.still, arguments.model])
    if arguments.scale is not None:
        raise SloshBringupError("--page: is for finding --scale; do not give both")
    length = _length(arguments)
    with quiet_decoders():
        image = to_colour(read_image(arguments.still))
    words = ["--length", f"{length:g}", "--fill-height", f"{arguments.fill_height:g}"]
    if arguments.rim_height is not None:
        words += ["--rim-height", f"{arguments.rim_height:g}"]
    before = ["slosh", "calibrate", str(arguments.still), "--scale"]
    after = [*words, "-o", str(arguments.output)]
    write_text(arguments.page, render_clicks(image, arguments.still.name, before, after))
    print(f"{plain_line(arguments.page)}: open it, click, and run the command that it shows")
    return 0


def _length(arguments: argparse.Namespace) -> float:
    """Returns the distance of the two points [m].

    Raises:
        SloshBringupError: it or the fill height is not known; an option has no use here.
    """
    for name in _UNUSED:
        if getattr(arguments, name) is not None:
            raise SloshBringupError(
                f"--{name.removesuffix('_thickness')}: is not used with --scale"
            )
    if arguments.length is None and arguments.radius is None:
        raise SloshBringupError(
            "--length: is needed with --scale, or --radius or --model for a cylinder"
        )
    if arguments.fill_height is None:
        raise SloshBringupError("--fill-height: is needed, or --model")
    return float(arguments.length or 2.0 * arguments.radius)


def run_scale(arguments: argparse.Namespace) -> int:
    """Writes camera.yaml; prints the scale and the uncertainty of heights."""
    check_apart([arguments.output], [arguments.still, arguments.model])
    length = _length(arguments)
    with quiet_decoders():
        image = read_image(arguments.still)
    u1, v1, u2, v2 = arguments.scale
    size = (int(image.shape[1]), int(image.shape[0]))
    try:
        found = calibrate_by_scale(
            size, (u1, v1), (u2, v2), length, arguments.fill_height, arguments.rim_height
        )
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
        print(f"scale    {1e3 * pixel:8.3f} mm/px, heights in the image's plane to {known:.1%}")
        print(plain_line(arguments.output))
    return 0

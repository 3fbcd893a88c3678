"""`slosh modes`: lists frequency, damping, mass and mass height of a container's modes."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from slosh_base.files import check_apart
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.output_names import YAML, check_ending, check_picture
from slosh_bringup.errors import SloshBringupError
from slosh_model.bessel import MAXIMUM_MODE
from slosh_model.errors import SloshModelError
from slosh_model.mode_table import ModeRow, mode_table
from slosh_model.model import Model
from slosh_model.model_text import read_model, write_model
from slosh_model.shapes.mode_numbers import FILM
from slosh_model.shapes.profiled import INSIDE

SURFACE_PLACES = 21
_AWAY = 0.999
"""Part of the distance to the wall below which a crest is away from it."""
EPILOG = """The modes of a container with a contour (shape: revolution, prism, trough, ...) are
computed once by the add-on slosh_shapes and cached. With -o they are stored in a model file, which
can be read without it.

columns:
  azimuth    direction of the motion from the container's +x
  frequency  natural frequency [Hz]
  damping    damping ratio
  mass       sloshing mass [kg], and its share of the liquid's mass
  height     wave height at the wall per displacement of the sloshing mass [1]
  static     share of the mode in the static height at the wall under constant acceleration
  pendulum   length of a pendulum of the same frequency [mm]
  position   height of the sloshing mass above the still surface [mm]
  force      lateral force on the container per displacement of the sloshing mass [N/m]
  crest      maximum wave height divided by that at the wall; above 1 if the crest is elsewhere"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh modes` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("model", type=Path, help="model of the liquid (model.yaml)")
    parser.add_argument(
        "--count", type=int, default=3, metavar="N", help="number of modes per axis (default: 3)"
    )
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="FILE",
        help="picture to write: the container's contour and its modes (.png, .svg)",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT.yaml",
        help="model file to write, which contains the computed modes",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the modes as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Prints a container's sloshing modes and writes the requested picture and model file."""
    check_apart([arguments.output, arguments.plot], [arguments.model])
    if not 1 <= arguments.count <= MAXIMUM_MODE:
        raise SloshBringupError(f"--count {arguments.count}: must be 1 … {MAXIMUM_MODE}")
    check_picture(arguments.plot)
    check_ending(arguments.output, "a model", YAML)
    model = read_model(arguments.model)
    rows = mode_table(model, arguments.count)
    if arguments.plot is not None:
        from slosh_bringup.modes_picture import write_modes_picture  # matplotlib is slow to load

        write_modes_picture(arguments.plot, model, rows)
    if arguments.output is not None:
        write_model(arguments.output, model)
    print(json.dumps(facts(model, rows), indent=1) if arguments.json else text(model, rows))
    return 0


def facts(model: Model, rows: tuple[ModeRow, ...]) -> dict[str, Any]:
    """Returns the modes as a dictionary in SI units; unknown values are None."""
    container = model.container
    return {
        "container": container.shape,
        "described": container.described,
        "surface_reach": list(container.reaches),
        "liquid_mass": _known(container.volume * model.liquid.density),
        "freeboard": container.freeboard,
        "linear_height": _known(container.linear_height),
        "modes": [
            {**{name: _known(value) for name, value in asdict(row).items()},
             "surface": _surface(model, row)}
            for row in rows
        ],
    }  # fmt: skip


def _surface(model: Model, row: ModeRow) -> list[list[float]] | None:
    """Returns the points (position [m], relative height) of a mode's surface; None if unknown."""
    if not model.container.surface_known:
        return None
    try:
        places, heights = model.container.surface_shape(row.number, "xy".index(row.axis))
    except SloshModelError:  # a file has the numbers alone, and nothing here computes the shape
        return None
    inside = np.linspace(places[0], places[-1], SURFACE_PLACES)
    shape = row.height_per_displacement * np.interp(inside, places, heights)
    return [[float(x), float(h)] for x, h in zip(inside, shape, strict=True)]


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def text(model: Model, rows: tuple[ModeRow, ...]) -> str:
    """Formats the modes of a container as a text table."""
    lines = [
        plain_line(model.container.described),
        "axis mode  azimuth  frequency  damping     mass  share  height  static  pendulum"
        "  position   force  crest",
    ]
    lines += [
        f"{row.axis:>4} {row.number:>4}  {math.degrees(row.azimuth):>5.1f}°"
        f" {row.natural_frequency / math.tau:>7.4f} Hz  {row.damping_ratio:.5f}"
        f" {row.mass:>8.4f}  {100.0 * row.mass_ratio:>4.1f} %"
        f" {row.height_per_displacement:>7.4f}  {100.0 * row.static_share:>4.1f} %"
        f"  {1e3 * row.pendulum_length:>6.1f} mm {1e3 * row.mass_height:>6.1f} mm"
        f" {row.force_per_displacement:>7.2f} {row.crest_ratio:>6.3f}"
        for row in rows
    ]
    return "\n".join([*lines, *_remarks(model, rows)])


def _remarks(model: Model, rows: tuple[ModeRow, ...]) -> list[str]:
    limit, reaches = model.container.linear_height, model.container.reaches
    inside = (row for row in rows if row.number == 1 and row.crest_ratio > INSIDE)
    found = [
        f"The first mode's crest along {row.axis} is {1e3 * row.crest_place:.1f} mm from the "
        f"axis, away from the wall, and {row.crest_ratio:.3f} times as high; heights refer to the "
        "wall."
        for row in inside
        if row.crest_place < _AWAY * reaches["xy".index(row.axis)]
    ]
    if model.damping_ratio is None and model.container.digest:
        found.append(
            f"Damping is that of the wetted wall and {100.0 * FILM:.0f} % of a surface "
            "film that does not yield; slosh identify measures it."
        )
    if math.isfinite(limit):
        found.append(
            f"Only the linear model applies: waves above {1e3 * limit:.1f} mm are flagged "
            "BEYOND_LINEAR."
        )
    return found

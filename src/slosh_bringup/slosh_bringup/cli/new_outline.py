"""`slosh new --outline`: makes a body of revolution from points clicked on a photograph."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from slosh_base.files import check_apart, write_text
from slosh_base.files.plain_text import plain_line
from slosh_base.files.quiet_decoders import quiet_decoders
from slosh_base.types import Array
from slosh_bringup.cli.output_names import PAGE, check_ending
from slosh_bringup.cli.quantities import length
from slosh_bringup.errors import SloshBringupError
from slosh_camera.images.colour import to_colour
from slosh_camera.images.decoding import read_image

Profile = tuple[tuple[float, float], ...]

LEAST, MOST = 2, 60
"""Points of the wall."""
_INCLINED = np.deg2rad(20.0)
_MICROMETRE = 6


def add_outline_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options for an outline from a photograph to the argument parser."""
    group = parser.add_argument_group("container by a photograph of its outline, from the side")
    group.add_argument(
        "--outline", type=Path, metavar="IMAGE", help="photograph of the container from the side"
    )
    group.add_argument(
        "--across", type=length(), metavar="M",
        help="outer width between the first two points, the ends of the rim [m]",
    )  # fmt: skip
    group.add_argument(
        "--page", type=Path, metavar="OUT.html",
        help="HTML page to write: on it you click the --points, and it shows the command to run",
    )  # fmt: skip
    group.add_argument(
        "--points", nargs="+", type=float, metavar="PX",
        help="pixels U V of the rim's left and right end, then of points on the right wall, from "
        "the rim down to the floor",
    )  # fmt: skip


def write_page(arguments: argparse.Namespace) -> int:
    """Writes the HTML page on which the user clicks the outline's points."""
    from slosh_bringup.scale_page import OUTLINE, render_clicks

    if arguments.outline is None:
        raise SloshBringupError("--page: needs --outline, the photograph")
    if arguments.points is not None:
        raise SloshBringupError("--page: is for finding --points; do not give both")
    if arguments.across is None:
        raise SloshBringupError("--across: is needed with --outline")
    check_apart([arguments.page], [arguments.outline])
    check_ending(arguments.page, "a page", PAGE)
    with quiet_decoders():
        image = to_colour(read_image(arguments.outline))
    before = [
        "slosh", "new", str(arguments.folder), "--outline", str(arguments.outline),
        "--across", f"{arguments.across:g}",
    ]  # fmt: skip
    for name in ("fill_height", "wall"):
        value = getattr(arguments, name)
        before += [] if value is None else [f"--{name.replace('_', '-')}", f"{value:g}"]
    page = render_clicks(
        image, arguments.outline.name, [*before, "--points"], [], OUTLINE,
        (LEAST + 2, MOST + 2),
    )  # fmt: skip
    write_text(arguments.page, page)
    print(f"{plain_line(arguments.page)}: open it, click, and run the command that it shows")
    return 0


def outline_profile(arguments: argparse.Namespace) -> Profile:
    """Returns the inner wall profile that --outline gives, from floor centre to rim [m].

    Raises:
        SloshBringupError: what is missing, or points that are no outline.
    """
    if arguments.outline is None:
        for name in ("across", "points"):
            if getattr(arguments, name) is not None:
                raise SloshBringupError(f"--{name}: needs --outline, the photograph")
        return ()
    for name in ("across", "points"):
        if getattr(arguments, name) is None:
            hint = "; --page writes a page for clicking them" if name == "points" else ""
            raise SloshBringupError(f"--{name}: is needed with --outline{hint}")
    if arguments.shape:
        raise SloshBringupError("--shape and --outline: give only one")
    with quiet_decoders():
        high, wide = read_image(arguments.outline).shape[:2]
    numbers = arguments.points
    if len(numbers) % 2 or not LEAST <= len(numbers) // 2 - 2 <= MOST:
        raise SloshBringupError(
            f"--points: {len(numbers)} numbers; two ends of the rim and {LEAST} … {MOST} points "
            "of the wall are needed, U V each"
        )
    points = np.array(numbers).reshape(-1, 2)
    inside = (points > -1.0) & (points < [wide, high])
    if not (np.isfinite(points).all() and inside.all()):
        raise SloshBringupError(f"--points: outside the image of {wide} x {high} pixels")
    return profile_of(points, arguments.across, arguments.wall or 0.0)


def profile_of(points: Array, across: float, wall: float) -> Profile:
    """Computes a wall profile [m] from points of an outline in a photograph.

    The photograph is taken to be without perspective, which is right to the share that the
    container's width is of the camera's distance, squared.

    Args:
        points: (N, 2) pixels: the rim's left and right end, then the right wall downwards.
        across: the outer width of the rim [m].
        wall: thickness of the wall and the floor [m].

    Raises:
        SloshBringupError: no outline of a container.
    """
    left, right = points[:2]
    way = right - left
    wide = float(np.hypot(*way))
    roll = float(np.arctan2(way[1], way[0]))
    if wide < 1.0 or abs(roll) > _INCLINED:
        raise SloshBringupError(
            "--points: the first two must be the left and the right end of the rim, level"
        )
    turn = np.array([[np.cos(roll), np.sin(roll)], [-np.sin(roll), np.cos(roll)]])
    away = (points[1:] - 0.5 * (left + right)) @ turn.T * (across / wide)
    outer = np.column_stack([away[:, 0], -away[:, 1]])[::-1]
    if outer[:, 0].min() < 0.0:
        raise SloshBringupError(
            "--points: a point of the wall lies to the left of the middle; click the right wall"
        )
    if not outer[0, 1] < outer[-1, 1]:
        raise SloshBringupError("--points: the last point must be at the floor, below the rim")
    inner = outer + wall * _inwards(outer)
    inner[-1] = inner[-1, 0], outer[-1, 1]
    inner = inner[inner[:, 0] > 0.0]
    floor = outer[0, 1] + wall
    above = inner[inner[:, 1] > floor + 1e-6]
    if len(above) < LEAST - 1 or len(inner) < LEAST:
        raise SloshBringupError(f"--wall {wall:g} m leaves no room inside this outline")
    # Where the wall meets the floor; a round bottom has no flat one.
    below = inner[inner[:, 1] <= floor + 1e-6]
    edge = float(np.interp(floor, inner[:, 1], inner[:, 0])) if len(below) else 0.0
    flat = [(0.0, floor), (edge, floor)] if edge > 1e-6 else [(0.0, floor)]
    rows = np.vstack([flat, above]) - np.array([0.0, floor])
    return tuple((round(float(r), _MICROMETRE), round(float(z), _MICROMETRE)) for r, z in rows)


def _inwards(outer: Array) -> Array:
    """Returns unit vectors, (N, 2), that point from an outer wall profile to its inside."""
    way = np.gradient(outer, axis=0)
    normal = np.column_stack([-way[:, 1], way[:, 0]])
    found: Array = normal / np.maximum(np.hypot(*normal.T), 1e-12)[:, np.newaxis]
    return found

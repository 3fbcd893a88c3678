"""Compares the exact heights in ray-traced sequences with this folder's geometry.

check_truth.py DIR [--edges N] [--masks N]: DIR is a sequence or holds some (each with a
truth.json). Every field that follows from the surface and the camera is computed anew from the
surface's amplitudes and the camera; the largest differences are printed. With --edges, the stored
masks of the still liquid and of N frames are compared with the wall's line as the geometry sees
it; with --masks, N frames of each sequence are traced anew and compared pixel by pixel.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from definitions import Camera, Cup, Scene
from numpy.typing import NDArray
from optics import View, wrap
from povray import axes
from render import Renderer
from scipy.interpolate import CubicSpline
from surface import Wave
from truth import frame_truth, mask_truth

Array = NDArray[np.float64]

HEIGHTS = ("MSH", "SH_left", "SH_right", "SH_left_tangent", "SH_right_tangent")
PIXELS = ("peak_px", "peak_px_norefraction")
# Camera's elevation over the still surface (deg) from which its rear line is clear of its front.
MIN_ELEVATION = 2.0
# This far below the wall's line (px) there must be liquid.
BELOW = 1
WORDS = ("peak_half", "peak_on_visible_front_wall", "peak_out_of_frame")
# A mask's pixels are whole: a column is off by up to half a pixel, twice that where a lens bends
# the picture; the mean of all columns is not.
LIMITS = {"m": 1e-7, "px": 0.05, "deg": 0.01, "masks": 0.005, "mean": 0.25, "column": 1.2}


def scene_of(truth: dict[str, Any]) -> Scene:
    """Returns the scene (cup and camera only) that a truth.json describes."""
    camera = truth["camera"]
    x, y, z = (1e3 * v for v in camera["centre_in_cup"])
    rotation = np.array(camera["R_cup2cam"])
    cup = Cup(
        radius=1e3 * truth["R"],
        wall=1e3 * truth["wall_thickness"],
        fill=1e3 * truth["h"],
        rim=1e3 * truth["rim_z"],
        base=1e3 * truth["base_thickness"],
        index=truth["n_wall"],
    )
    return Scene(
        truth["sequence"],
        "",
        cup,
        camera=Camera(
            width=camera["width"],
            height_px=camera["height"],
            focal=camera["fx"],
            azimuth=math.degrees(math.atan2(y, x)),
            distance=math.hypot(x, y),
            height=z,
            pitch=math.degrees(-math.asin(rotation[2, 2])),
            k1=camera["k1"],
        ),
    )


def view_of_truth(truth: dict[str, Any]) -> View:
    """Returns the camera's view with exactly the numbers of a truth.json."""
    camera = truth["camera"]
    return View(
        np.array(camera["R_cup2cam"]),
        np.array(camera["t_cup2cam"]),
        (camera["fx"], camera["fy"]),
        (camera["cx"], camera["cy"]),
        (camera["width"], camera["height"]),
        camera["k1"],
        truth["R"],
        truth["wall_thickness"],
        truth["rim_z"],
        truth["n_wall"],
    )


def wave_of(frame: dict[str, Any], radius: float) -> Wave:
    """Returns the liquid's surface that a frame's entry in truth.json describes."""
    phi, phi2 = math.radians(frame["phi"]), math.radians(frame["phi2"])
    second = (frame.get("A20", 0.0), frame.get("A22", 0.0))
    return Wave(radius, frame["A1"], phi, frame["A2"], phi2, *second)


def compare(truth: dict[str, Any]) -> tuple[dict[str, float], list[str]]:
    """Returns the largest difference per field, and the frames whose texts or nulls differ."""
    view = view_of_truth(truth)
    worst: dict[str, float] = {}
    notes = []

    def note(field: str, gap: float) -> None:
        worst[field] = max(worst.get(field, 0.0), gap)

    for name, angle in zip(("theta_left", "theta_right"), view.edges(), strict=True):
        note("deg " + name, abs(math.degrees(wrap(angle - math.radians(truth[name + "_deg"])))))
    for frame in truth["frames"]:
        mine = frame_truth(view, wave_of(frame, truth["R"]))
        for field in HEIGHTS:
            note("m " + field, abs(mine[field] - frame[field]))
        if frame["peak_az"] is None or mine["peak_az"] is None:
            if frame["peak_az"] != mine["peak_az"]:
                notes.append(f"{frame['index']}: peak_az {frame['peak_az']}, {mine['peak_az']}")
            continue
        gap = wrap(math.radians(mine["peak_az"] - frame["peak_az"]))
        note("deg peak_az", abs(math.degrees(gap)))
        for field in PIXELS:
            if mine[field] is None or frame[field] is None:
                if mine[field] is not frame[field]:
                    notes.append(f"{frame['index']}: {field} {frame[field]}, here {mine[field]}")
            else:
                note("px " + field, math.dist(mine[field], frame[field]))
        notes += [
            f"{frame['index']}: {field} {frame[field]}, here {mine[field]}"
            for field in WORDS
            if mine[field] != frame[field]
        ]
    return worst, notes


def compare_masks(truth: dict[str, Any], folder: Path, count: int) -> tuple[float, list[str]]:
    """Returns the largest share of differing liquid pixels, and frames with other fields."""
    scene = scene_of(truth)
    rotation, _ = axes(scene.camera)
    if not np.allclose(rotation, truth["camera"]["R_cup2cam"], atol=1e-6):
        return math.nan, ["the camera is rolled or turned: no mask made"]
    frames = truth["frames"]
    worst, notes = 0.0, []
    with tempfile.TemporaryDirectory() as temporary:
        renderer = Renderer(scene, Path(temporary))
        for frame in frames[:: max(1, len(frames) // count)]:
            mask = renderer.mask(wave_of(frame, truth["R"]))
            stored = cv2.imread(str(folder / frame["mask"]), cv2.IMREAD_GRAYSCALE)
            if stored is None:
                return math.nan, [f"{folder / frame['mask']}: is missing or no image"]
            worst = max(worst, float(np.mean(mask != stored) / np.mean(stored > 0)))
            mine = mask_truth(mask, frame)
            gap = abs(mine["liquid_top_px"]["v"] - frame["liquid_top_px"]["v"])
            touches = mine["liquid_touches_frame_top"] != frame["liquid_touches_frame_top"]
            if gap > 1 or touches:
                notes.append(f"{frame['index']}: top {frame['liquid_top_px']}, here {mine}")
    return worst, notes


def edge_gaps(view: View, wave: Wave, mask: NDArray[np.uint8], rear: bool) -> Array:
    """Returns by how many rows [px] a mask's line lies below the projected wall line.

    Args:
        view: camera and cup.
        wave: the surface.
        mask: its classes.
        rear: the upper edge of the free surface, else that of the liquid seen through the wall.

    Returns:
        One value per column between points of the line; none close to the cup's edges, where
        the line is steep. NaN: no liquid below the line.
    """
    left, _ = view.edges()
    half = 0.4 * math.pi if rear else 0.95 * abs(wrap(left - view.azimuth))
    azimuths = view.azimuth + math.pi * rear + np.linspace(-half, half, 61)
    seen = [view.seen(a, float(wave.wall(a))) for a in azimuths]
    line = np.array([pixel for pixel in seen if pixel is not None])
    line = line[np.argsort(line[:, 0])]
    columns = np.arange(math.ceil(line[0, 0]) + 2, math.floor(line[-1, 0]) - 1)
    columns = columns[(columns >= 0) & (columns < mask.shape[1])]
    rows = CubicSpline(line[:, 0], line[:, 1])(columns)
    inside = (rows > 0.5) & (rows < mask.shape[0] - BELOW - 1)
    return np.array(
        [
            _top_of_run(mask[:, column] == (2 if rear else 1), row) - row
            for column, row in zip(columns[inside], rows[inside], strict=True)
        ]
    )


def _top_of_run(there: NDArray[np.bool_], row: float) -> float:
    """Returns the upper edge of the mask's pixel run below a row; NaN if there is none."""
    start = math.ceil(row) + BELOW
    if not there[start]:
        return math.nan
    above = np.flatnonzero(~there[:start])
    return float(above[-1]) + 0.5 if above.size else -0.5


def compare_edges(truth: dict[str, Any], folder: Path, count: int) -> dict[str, float]:
    """Returns mean and largest distance [px] of mask lines from the projected wall line."""
    view = view_of_truth(truth)
    frames = truth["frames"]
    chosen = frames[:: max(1, len(frames) // count)]
    still = Wave(truth["R"])
    lines = [("front", wave_of(frame, truth["R"]), frame["mask"], False) for frame in chosen]
    # Only at rest, and from above, no crest stands before the rear wall's line.
    if math.degrees(math.atan2(view.position[2], view.distance)) > MIN_ELEVATION:
        lines.append(("rear", still, truth["static"]["mask"], True))
    gaps: dict[str, list[Array]] = {}
    for name, wave, file, rear in lines:
        mask = cv2.imread(str(folder / file), cv2.IMREAD_GRAYSCALE)
        if mask is None:
            return {f"mean {file} is missing": math.nan}
        gaps.setdefault(name, []).append(edge_gaps(view, wave, np.asarray(mask, np.uint8), rear))
    result = {}
    for name, parts in gaps.items():
        result[f"mean {name} line"] = max(abs(float(np.mean(part))) for part in parts if part.size)
        result[f"column {name} line"] = max(float(np.abs(p).max()) for p in parts if p.size)
    return result


def main() -> int:
    """Compares the sequences; returns 1 if a difference exceeds its limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--edges", type=int, default=0, help="number of stored masks to compare with the geometry"
    )
    parser.add_argument(
        "--masks", type=int, default=0, help="number of masks to render again per sequence"
    )
    args = parser.parse_args()
    files = sorted([*args.folder.glob("truth.json"), *args.folder.glob("*/truth.json")])
    if not files:
        parser.error(f"no sequence with a truth.json in {args.folder}")
    bad = 0
    for file in files:
        truth = json.loads(file.read_text())
        worst, notes = compare(truth)
        if args.edges:
            worst |= compare_edges(truth, file.parent, args.edges)
        if args.masks:
            worst["masks share of pixels"], more = compare_masks(truth, file.parent, args.masks)
            notes += more
        print(truth["sequence"])
        for field, gap in worst.items():
            wrong = not gap <= LIMITS[field.split()[0]]
            bad += wrong
            print(f"  {field:28} {gap:.3g}{'  TOO FAR' if wrong else ''}")
        for note in notes:
            print(f"  frame {note}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())

"""Compares this folder's geometry with ray-traced sequences made elsewhere.

check_truth.py DIR [--masks N]: DIR holds sequences (each with a truth.json). Every field that
follows from the surface and the camera is computed anew from A1, phi, A2, phi2 and the camera;
the largest differences are printed. With --masks, N frames of each sequence get a new mask,
which is compared with the stored one pixel by pixel.
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
from optics import View, wrap
from povray import axes
from render import Renderer
from surface import Wave
from truth import frame_truth, mask_truth

HEIGHTS = ("MSH", "SH_left", "SH_right", "SH_left_tangent", "SH_right_tangent")
PIXELS = ("peak_px", "peak_px_norefraction")
WORDS = ("peak_half", "peak_on_visible_front_wall", "peak_out_of_frame")
LIMITS = {"m": 1e-7, "px": 0.05, "deg": 0.01, "masks": 0.005}


def scene_of(truth: dict[str, Any]) -> Scene:
    """The scene (cup and camera alone) that a truth.json describes."""
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
    """The camera and cup that a truth.json gives, taken literally."""
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
        truth["n_wall"],
    )


def wave_of(frame: dict[str, Any], radius: float) -> Wave:
    """The surface that a frame's entry describes."""
    phi, phi2 = math.radians(frame["phi"]), math.radians(frame["phi2"])
    second = (frame.get("A20", 0.0), frame.get("A22", 0.0))
    return Wave(radius, frame["A1"], phi, frame["A2"], phi2, *second)


def compare(truth: dict[str, Any]) -> tuple[dict[str, float], list[str]]:
    """The largest difference per field, and the frames where words or nulls differ."""
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
    """The largest share of liquid pixels whose class differs, and frames whose fields differ."""
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


def main() -> int:
    """Reads the command line; returns 1 if a difference is beyond its limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--masks", type=int, default=0, help="masks to render per sequence")
    args = parser.parse_args()
    files = sorted(args.folder.glob("*/truth.json"))
    if not files:
        parser.error(f"no sequence with a truth.json in {args.folder}")
    bad = 0
    for file in files:
        truth = json.loads(file.read_text())
        worst, notes = compare(truth)
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

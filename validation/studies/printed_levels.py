"""Counts levels that `slosh calibrate` puts on print, foam or a foot's edge, on drawn glasses.

    tools/run python validation/studies/printed_levels.py [--half even|odd] [--count 100]

Each seed draws a glass with liquid at rest, mostly of weak contrast, and what is on such a glass:
rings, a scale, foam, and a foot that hides the lowest part. The glass is tall and the picture
large for two seeds of four.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass, replace

import cv2
import numpy as np
import with_tools  # noqa: F401

from slosh_camera.calibrate.still import calibrate_by_edges
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import Cup, CupView, Wall
from slosh_testing.drawn_cup import Scene

WRONG = 1.5e-3
"""Height by which an accepted level is off that is wrong [m]."""
_BACK = 215


@dataclass(frozen=True)
class Glass:
    """A drawn glass: picture, true view, and what the user tells of the container."""

    image: np.ndarray
    truth: CupView
    told: Cup

    def error(self) -> float:
        """Returns how much too high the calibrated level is on the front wall [m].

        Raises:
            SloshCameraError: the picture is refused.
        """
        found = calibrate_by_edges(self.image, self.truth.camera, self.told).view
        pixel = found.project_wall(found.camera_azimuth, 0.0, Wall.FRONT)
        return float(self.truth.on_wall(pixel, Wall.FRONT)[1][0])


def glass(seed: int) -> Glass:
    """Draws the glass of a seed."""
    rng = np.random.default_rng(seed)
    large = seed // 2 % 2 == 1
    radius = rng.uniform(0.0185, 0.03) if large else rng.uniform(0.025, 0.05)
    fill = radius * (rng.uniform(1.2, 6.0) if large else rng.uniform(0.8, 2.5))
    top = rng.uniform(0.8, 4.0) * radius
    rows = 1660 if large else 800
    distance = max(2.0 * (fill + top), rng.uniform(6.0, 12.0) * radius)
    liquid = int(rng.choice([_BACK - rng.integers(12, 60), rng.integers(30, 160)]))
    scene = Scene(
        radius=radius, fill_height=fill, rim_height=None, distance=distance, height=rows,
        width=rows // 2, focal=0.75 * rows * distance / (fill + top + 2.0 * radius),
        camera_height=rng.uniform(-0.1, 0.35) * distance, aim=0.5 * (top - fill),
        liquid=liquid, surface=min(liquid + int(rng.integers(0, 40)), _BACK),
        background=_BACK, oversampling=2,
    )  # fmt: skip
    image = cv2.cvtColor(scene.draw(), cv2.COLOR_GRAY2BGR)
    if rng.random() < 0.3:
        _foam(image, scene, rng)
    _sides(image, scene, top, int(rng.integers(70, 190)))
    _print(image, scene, rng, top)
    if rng.random() < 0.5:
        _foot(image, scene, rng)
    noise = rng.normal(0.0, rng.uniform(0.5, 3.0), image.shape)
    image = np.clip(np.rint(cv2.GaussianBlur(image, (0, 0), 0.7) + noise), 0, 255)
    truth = scene.calibration().view
    told = Cup(radius, fill * float(rng.choice([1.0, rng.uniform(0.85, 1.2)])))
    cup = replace(truth.cup, wall_thickness=0.0)
    return Glass(image.astype(np.uint8), CupView(truth.camera, truth.pose, cup), told)


def _ring(scene: Scene, height: float, degrees: tuple[float, float]) -> np.ndarray:
    """Returns the pixels (61, 2) of a line on the front wall, in sixteenths."""
    azimuth = scene.camera_azimuth + np.deg2rad(np.linspace(*degrees, 61))
    across = scene.radius * np.column_stack((np.cos(azimuth), np.sin(azimuth)))
    points = np.column_stack((across, np.full(61, height)))
    return np.asarray(np.rint(scene.project(points) * 16).astype(np.int32))


def _line(image: np.ndarray, points: np.ndarray, colour: tuple[int, ...], thick: int) -> None:
    cv2.polylines(image, [points], False, colour, thick, cv2.LINE_AA, 4)


def _sides(image: np.ndarray, scene: Scene, top: float, grey: int) -> None:
    half = np.arccos(scene.radius / scene.distance)
    for azimuth in (scene.camera_azimuth - half, scene.camera_azimuth + half):
        across = scene.radius * np.array([np.cos(azimuth), np.sin(azimuth)])
        ends = np.array([[*across, -scene.fill_height], [*across, top]])
        _line(image, np.rint(scene.project(ends) * 16).astype(np.int32), (grey,) * 3, 2)


def _print(image: np.ndarray, scene: Scene, rng: np.random.Generator, top: float) -> None:
    """Draws up to three rings of one colour, and in half of the pictures a scale."""
    scale = image.shape[0] / 800
    bright = rng.random() < 0.2
    colour = tuple(int(v) for v in rng.integers(200 if bright else 20, 250 if bright else 160, 3))
    for _ in range(rng.integers(0, 4)):
        height = rng.uniform(-0.9 * scene.fill_height, 0.9 * top)
        whole = rng.random() < 0.7
        arc = (-76.0, 76.0) if whole else (-20.0, 60.0)
        _line(image, _ring(scene, height, arc), colour, round(scale * rng.integers(1, 7)))
    if rng.random() < 0.5:
        start, step = rng.uniform(0.0, 0.2), rng.uniform(0.08, 0.4) * scene.radius
        marks = np.arange(-(1.0 - start) * scene.fill_height, 0.9 * top, step)
        for index, height in enumerate(marks):
            arc = (-76.0, 60.0) if index % 5 == 0 else (-20.0, 30.0)
            _line(image, _ring(scene, height, arc), colour, round(scale))


def _foam(image: np.ndarray, scene: Scene, rng: np.random.Generator) -> None:
    """Draws bubbles along the contact line, on the wall and on the surface."""
    for _ in range(rng.integers(60, 250)):
        angle, rise = rng.uniform(-np.pi, np.pi), rng.exponential(0.0006)
        across = scene.radius * np.array([np.cos(angle), np.sin(angle)])
        if rng.random() < 0.3:
            across *= np.sqrt(rng.random())
        middle = np.rint(scene.project(np.array([[*across, rise]])) * 16).astype(int)[0]
        size = int(rng.uniform(0.01, 0.05) * scene.radius * scene.focal / scene.distance * 16)
        for grey, part in ((int(rng.integers(60, 150)), 1.0), (int(rng.integers(120, 240)), 0.7)):
            cv2.circle(image, tuple(middle), int(part * size), (grey,) * 3, -1, cv2.LINE_AA, 4)


def _foot(image: np.ndarray, scene: Scene, rng: np.random.Generator) -> None:
    """Draws an opaque foot that hides the lowest part of the glass."""
    hidden = rng.uniform(0.05, 0.6) * scene.fill_height - scene.fill_height
    upper = _ring(scene, hidden, (-75.0, 75.0))
    wide = 1.8 * (upper - upper.mean(axis=0)) + upper.mean(axis=0)
    down = np.array([0.0, 16.0 * image.shape[0] * 0.12])
    outline = np.vstack((upper, (wide + down)[::-1])).astype(np.int32)
    colour = tuple(int(v) for v in rng.integers(20, 180, 3))
    cv2.fillPoly(image, [outline], colour, cv2.LINE_AA, 4)


def outcome(seed: int) -> tuple[str, str]:
    """Returns right, wrong or refused for a seed, and the error or the refusal."""
    try:
        error = glass(seed).error()
    except SloshCameraError as refused:
        return "refused", str(refused)
    return ("right" if abs(error) <= WRONG else "wrong"), f"{1e3 * error:+.1f} mm"


def main() -> int:
    """Prints each seed's outcome and the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--half", choices=("even", "odd"), default="even")
    parser.add_argument("--count", type=int, default=100, help="pictures of each half")
    arguments = parser.parse_args()
    counts: Counter[str] = Counter()
    for seed in range(arguments.half == "odd", 2 * arguments.count, 2):
        what, words = outcome(seed)
        counts[what] += 1
        print(f"{seed} {what} {words}", flush=True)
    print(", ".join(f"{counts[key]} {key}" for key in ("right", "wrong", "refused")))
    return 0


if __name__ == "__main__":
    sys.exit(main())

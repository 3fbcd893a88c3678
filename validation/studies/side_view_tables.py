"""Measures the side view's accuracy on ray-traced images; fills docs/side_view.md.

tools/run python validation/studies/side_view_tables.py [--docs]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import cv2
import numpy as np
import with_tools  # noqa: F401
from camera_sequences import ROOT
from camera_tables import replace_table
from numpy.typing import NDArray

from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag
from slosh_camera.rectangle.detector import SideViewDetector
from slosh_testing.side_view_scene import Liquid, Look, Patch, Setup, draw, still

PAGE = ROOT / "docs" / "side_view.md"
IMAGES = 24
SETUP = Setup(elevation=-0.05)
PLAIN = Look(noise=3.0)
LABEL = Patch((-0.008, -0.02), (0.008, 0.02), 235.0)
DROPS = tuple(Patch((x, 0.024), (x + 0.004, 0.029), 60.0, round=True) for x in (-0.03, 0.0, 0.025))
CASES: dict[str, tuple[Setup, Look]] = {
    "noise of 3 levels": (SETUP, PLAIN),
    "noise of 10 levels": (SETUP, replace(PLAIN, noise=10.0)),
    "blur of 2 px": (SETUP, replace(PLAIN, blur=2.0)),
    "motion blur of 9 px along x": (SETUP, replace(PLAIN, motion=9)),
    "light from the side, 1 : 3": (SETUP, replace(PLAIN, gradient=1.0)),
    "brightness x 0.3": (SETUP, replace(PLAIN, brightness=0.3)),
    "brightness x 1.5, clipped": (SETUP, replace(PLAIN, brightness=1.5)),
    "JPEG 40": (SETUP, replace(PLAIN, jpeg=40)),
    "coloured, equally bright": (
        SETUP,
        replace(PLAIN, liquid=(160.0, 90.0, 40.0), background=(110.0, 95.0, 130.0)),
    ),
    "label over a fifth of the line": (SETUP, replace(PLAIN, patches=(LABEL,))),
    "droplets above the line": (SETUP, replace(PLAIN, patches=DROPS)),
    "camera distorted, rolled 3 deg, 10 deg aside": (
        replace(SETUP, distortion=(-0.2, 0.05, 0.001, -0.002, 0.0), roll=0.05, yaw=0.17),
        PLAIN,
    ),
    "camera 3 deg above, surface seen": (replace(SETUP, elevation=0.05), PLAIN),
    "camera level, surface seen in troughs": (replace(SETUP, elevation=0.0), PLAIN),
}


def main() -> int:
    """Measures all cases and prints or writes the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--docs", action="store_true", help="write the table into the page")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    head = (
        "| images | profile RMS | highest RMS | max | fitted RMS | slope RMS | max | "
        "1σ highest | 1σ fitted | 1σ slope | flags |\n"
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|---|\n"
    )
    table = head + "".join(row(name, *case) for name, case in CASES.items())
    print(table)
    try:
        if arguments.docs:
            replace_table(PAGE, "side view", table)
    except SloshCameraError as error:
        print(f"side_view_tables: {error}", file=sys.stderr)
        return 2
    return 0


def row(name: str, setup: Setup, look: Look) -> str:
    """Measures one case; formats its errors [px of 0.25 mm, deg] as a table row."""
    detector = SideViewDetector(setup.calibration())
    detector.learn_still(still(setup, look))
    generator = np.random.default_rng(11)
    errors, ratios, profiles, flags = [], [], [], Flag.NONE
    view = setup.calibration().view
    pixel = view.height_per_pixel(view.project_face(0.0, 0.0)[0])
    for seed in range(IMAGES):
        liquid = random_liquid(generator)
        found = detector.measure(0, draw(setup, liquid, look, seed))
        flags |= found.flags
        truth = liquid.highest(setup.width)
        error = np.array(
            [
                found.msh - truth,
                found.fitted_msh - truth,
                found.slope_angle - liquid.angle(setup.width),
            ]
        )
        errors.append(error)
        ratios.append(error / (found.msh_stddev, found.fitted_msh_stddev, found.slope_stddev))
        profiles.append(found.profile_height - liquid.at(found.profile_x, setup.width))
    rms, most = _rms(np.array(errors)), np.max(np.abs(errors), axis=0)
    within = 100.0 * np.mean(np.abs(ratios) <= 1.0, axis=0)
    names = " ".join(str(flag.name) for flag in Flag if flag and flag in flags)
    lengths = np.array([np.sqrt(np.nanmean(np.square(profiles))), rms[0], most[0], rms[1]]) / pixel
    angles = np.degrees([rms[2], most[2]])
    cells = [f"{value:.2f}" for value in lengths] + [f"{value:.3f}" for value in angles]
    cells += [f"{value:.0f} %" for value in within]
    return f"| {name} | {' | '.join(cells)} | {names} |\n"


def random_liquid(generator: np.random.Generator) -> Liquid:
    """Draws a surface with a random slope and waves."""
    modes = tuple(generator.normal(0.0, (0.006, 0.002, 0.001)))
    return Liquid(generator.normal(0.0, 5e-4), generator.normal(0.0, 0.1), modes)


def _rms(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


if __name__ == "__main__":
    sys.exit(main())

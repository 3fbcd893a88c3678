"""Tabulates modes, heights and allowed accelerations of twelve everyday containers.

    tools/run python validation/studies/daily_containers.py [--docs]

Each is simulated with three modes while an acceleration is switched on at once, the hardest way to
reach it. The height grows in proportion, so that one run gives the acceleration that leaves the
liquid 10 mm below the rim.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from result_tables import fill

from slosh_bringup.modes_picture import draw_mode
from slosh_bringup.simulate.chart import new_picture
from slosh_model import Inputs, Model, simulate
from slosh_model.constants import GRAVITY
from slosh_model.mode_table import mode_table
from slosh_model.shapes import (
    Beaker,
    Bottle,
    Cone,
    Flask,
    Frustum,
    Prism,
    Revolution,
    Sphere,
    Tray,
)
from slosh_model.shapes.solved import SolvedContainer

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "results" / "daily_containers.md"
PICTURE = DOCS / "images" / "daily_containers.svg"
BELOW_RIM = 0.01
"""So much is left between the crest and the rim [m]."""
SECONDS, RATE = 3.0, 500.0


def hexagon(reach: float) -> tuple[tuple[float, float], ...]:
    """Returns the corners of a regular hexagon [m]."""
    angles = [k * math.pi / 3.0 for k in range(6)]
    return tuple((reach * math.cos(a), reach * math.sin(a)) for a in angles)


CONTAINERS: dict[str, SolvedContainer] = {
    "paper cup": Frustum(bottom_radius=0.028, top_radius=0.04, height=0.092, fill_height=0.065),
    "pint glass": Frustum(bottom_radius=0.03, top_radius=0.044, height=0.148, fill_height=0.125),
    "wine glass": Revolution(
        profile=(
            (0.0, 0.0), (0.018, 0.004), (0.034, 0.018), (0.042, 0.04), (0.041, 0.062),
            (0.037, 0.08), (0.033, 0.095),
        ),
        smooth=True, fill_height=0.045,
    ),
    "beaker": Beaker(radius=0.034, foot_radius=0.006, height=0.095, fill_height=0.055),
    "Erlenmeyer flask": Flask(
        bottom_radius=0.04, neck_radius=0.014, shoulder_height=0.09, height=0.13,
        fill_height=0.055,
    ),
    "bottle": Bottle(
        radius=0.036, foot_radius=0.008, body_height=0.13, neck_radius=0.013,
        shoulder_height=0.18, height=0.24, fill_height=0.15,
    ),
    "bowl": Sphere(radius=0.08, fill_height=0.045, rim_height=0.075),
    "soup plate": Revolution(
        profile=(
            (0.0, 0.0), (0.05, 0.001), (0.07, 0.008), (0.085, 0.025), (0.1, 0.034),
            (0.115, 0.042),
        ),
        smooth=True, fill_height=0.02,
    ),
    "tray": Tray(width=0.3, depth=0.2, corner_radius=0.03, fill_height=0.02, rim_height=0.045),
    "hexagonal jar": Prism(outline=hexagon(0.04), fill_height=0.07, rim_height=0.1),
    "half-full sphere": Sphere(radius=0.06, fill_height=0.06, rim_height=0.11),
    "funnel": Cone(top_radius=0.05, height=0.05, fill_height=0.03),
}  # fmt: skip


def highest(model: Model) -> float:
    """Returns the maximum height [m] after a step of the acceleration to 1 m/s² along x."""
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    acceleration = np.zeros((len(t), 3))
    acceleration[1:, 0] = 1.0
    response, _ = simulate(model, Inputs(t, acceleration))
    return float(response.msh.max())


def row(name: str, container: SolvedContainer) -> str:
    """Formats one container's table row."""
    model = Model(container, modes=3)
    first = mode_table(model, 1)[0]
    peak = highest(model)
    room = container.freeboard
    assert room is not None
    cells = (
        name,
        f"{1e3 * container.reaches[0]:.1f}",
        f"{1e3 * room:.0f}",
        f"{first.natural_frequency / math.tau:.3f}",
        f"{first.damping_ratio:.4f}",
        f"{100.0 * first.mass_ratio:.0f}",
        f"{first.crest_ratio:.2f}",
        f"{1e3 * container.reaches[0] / GRAVITY:.2f}",
        f"{1e3 * peak:.2f}",
        f"{max(room - BELOW_RIM, 0.0) / peak:.2f}",
        f"{1e3 * container.linear_height:.1f}",
    )
    return f"| {' | '.join(cells)} |"


HEAD = (
    "| container | R [mm] | rim [mm] | f1 [Hz] | ζ1 | mass 1 [%] | crest / wall |"
    " height, steady [mm per m/s²] | switched on [mm per m/s²] | 10 mm below the rim [m/s²] |"
    " linear up to [mm] |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
)


def draw(path: Path) -> None:
    """Draws all containers with their first sloshing mode to a file."""
    with new_picture(path, (9.6, 7.6)) as figure:
        places = figure.subplots(3, 4).flat
        for axes, (name, container) in zip(places, CONTAINERS.items(), strict=True):
            first = mode_table(Model(container), 1)[0]
            draw_mode(axes, Model(container), first)
            axes.set_title(f"{name}, {first.natural_frequency / math.tau:.2f} Hz", fontsize=9.0)
            axes.set_xlabel("")


def main() -> int:
    """Prints the table; with --docs also writes it and the picture to the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--docs", action="store_true", help="write table and picture")
    arguments = parser.parse_args()
    text = "\n".join([HEAD, *(row(name, one) for name, one in CONTAINERS.items())])
    print(text)
    if arguments.docs:
        fill(PAGE, "containers", text)
        draw(PICTURE)
    return 0


if __name__ == "__main__":
    sys.exit(main())

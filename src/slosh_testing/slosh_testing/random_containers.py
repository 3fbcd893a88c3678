"""Creates random containers of any contour from a seed, possible and impossible ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import yaml

from slosh_base.types import Array

Draw = Callable[[np.random.Generator], dict[str, Any]]


def container_text(kind: str, number: int) -> str:
    """Returns the text of the model file of a random container.

    Args:
        kind: of KINDS or IMPOSSIBLE.
        number: of the container; the same number is the same container.
    """
    every = {**KINDS, **IMPOSSIBLE}
    rng = np.random.default_rng([sorted(every).index(kind), number])
    return yaml.safe_dump({"container": every[kind](rng), "damping_ratio": 0.05})


def _rounded(points: Array) -> list[list[float]]:
    return [[round(float(a), 6), round(float(b), 6)] for a, b in points]


def _revolved(points: Array, share: float, **more: Any) -> dict[str, Any]:
    """Returns a body of revolution from a profile (r, z), filled to a fraction of its height."""
    low, high = float(points[:, 1].min()), float(points[-1, 1])
    return {
        "shape": "revolution", "profile": _rounded(points),
        "fill_height": round(float(share) * (high - low), 6), **more,
    }  # fmt: skip


def _bowl(rng: np.random.Generator) -> dict[str, Any]:
    angle = np.linspace(0.0, 0.5 * math.pi, 9)
    power = rng.uniform(0.6, 1.6)
    radius, height = rng.uniform(0.03, 0.12), rng.uniform(0.03, 0.1)
    points = np.column_stack((np.sin(angle) ** power, 1.0 - np.cos(angle))) * (radius, height)
    return _revolved(points, rng.uniform(0.3, 0.8), smooth=True)


def _bulb(rng: np.random.Generator) -> dict[str, Any]:
    """Returns a flask whose still surface is narrower than its belly."""
    belly, neck = rng.uniform(0.03, 0.06), rng.uniform(0.25, 0.6)
    turn = np.linspace(0.0, math.pi - math.asin(neck), 15)
    round_part = np.column_stack((np.sin(turn), 1.0 - np.cos(turn))) * belly
    end = round_part[-1]
    neck_part = end + np.array([[0.0, 0.01], [0.0, 0.04]])
    points = np.vstack((round_part, neck_part))
    return _revolved(points, rng.uniform(0.45, 0.7), smooth=True)


def _narrow_neck(rng: np.random.Generator) -> dict[str, Any]:
    """Returns a bottle that is filled into its neck."""
    body, neck = rng.uniform(0.025, 0.05), rng.uniform(0.008, 0.015)
    points = np.array([[0.0, 0.0], [body, 0.0], [body, 0.1], [neck, 0.14], [neck, 0.2]])
    return _revolved(points, rng.uniform(0.75, 0.9))


def _core(rng: np.random.Generator) -> dict[str, Any]:
    """Returns a ring-shaped container with a core, like a cake tin."""
    core, out = rng.uniform(0.01, 0.03), rng.uniform(0.05, 0.09)
    high = rng.uniform(0.05, 0.1)
    lean = rng.uniform(0.0, 0.01)
    points = np.array([[core, high], [core + lean, 0.0], [out, 0.0], [out + lean, high]])
    return _revolved(points, rng.uniform(0.3, 0.8))


def _steps(rng: np.random.Generator) -> dict[str, Any]:
    radii = np.cumsum(rng.uniform(0.01, 0.025, 4)) + 0.01
    levels = np.concatenate(([0.0], np.cumsum(rng.uniform(0.01, 0.03, 4))))
    points = [[0.0, 0.0]]
    for k, radius in enumerate(radii):
        points += [[radius, levels[k]], [radius, levels[k + 1]]]
    # Not at a step, where a surface would have no radius.
    share = float(levels[3] + rng.uniform(0.3, 0.8) * (levels[4] - levels[3])) / levels[4]
    return _revolved(np.array(points), share)


def _cone(rng: np.random.Generator) -> dict[str, Any]:
    high = float(rng.uniform(0.05, 0.15))
    return {
        "shape": "cone", "top_radius": round(high * float(rng.uniform(0.3, 1.5)), 5),
        "height": round(high, 5), "fill_height": round(high * float(rng.uniform(0.3, 0.9)), 5),
    }  # fmt: skip


def _polygon(rng: np.random.Generator) -> dict[str, Any]:
    """Returns a random outline that is symmetric about y."""
    count = int(rng.integers(2, 6))
    angle = np.sort(rng.uniform(-0.45 * math.pi, 0.45 * math.pi, count))
    away = rng.uniform(0.03, 0.08, count)
    right = np.column_stack((away * np.cos(angle), away * np.sin(angle)))
    top, bottom = [[0.0, rng.uniform(0.04, 0.09)]], [[0.0, -rng.uniform(0.04, 0.09)]]
    left = right[::-1] * (-1.0, 1.0)
    points = np.vstack((bottom, right, top, left))
    return {
        "shape": "prism", "outline": _rounded(points),
        "fill_height": round(float(rng.uniform(0.02, 0.08)), 5),
    }  # fmt: skip


def _tray(rng: np.random.Generator) -> dict[str, Any]:
    width, depth = rng.uniform(0.08, 0.4, 2)
    return {
        "shape": "tray", "width": round(float(width), 4), "depth": round(float(depth), 4),
        "corner_radius": round(float(rng.uniform(0.1, 0.45)) * float(min(width, depth)), 4),
        "fill_height": round(float(rng.uniform(0.02, 0.06)), 4),
    }  # fmt: skip


def _trough(rng: np.random.Generator) -> dict[str, Any]:
    """Returns a trough whose section is a random polygon, symmetric about its middle."""
    count = int(rng.integers(2, 6))
    right = np.column_stack((
        rng.uniform(0.03, 0.08, count), np.cumsum(rng.uniform(0.008, 0.03, count))
    ))  # fmt: skip
    right = np.vstack(([[0.5 * right[0, 0], 0.0]], right))
    points = np.vstack((right[::-1] * (-1.0, 1.0), right))
    return _long(rng) | {
        "shape": "trough", "profile": _rounded(points),
        # Not at a corner, where a surface would have two slopes.
        "fill_height": round(float(right[-2:, 1] @ (0.4, 0.6)), 5),
    }  # fmt: skip


def _lying(rng: np.random.Generator) -> dict[str, Any]:
    radius = round(float(rng.uniform(0.03, 0.1)), 4)
    fill = round(radius * float(rng.uniform(0.2, 1.8)), 5)
    return _long(rng) | {"shape": "lying_cylinder", "radius": radius, "fill_height": fill}


def _wedge(rng: np.random.Generator) -> dict[str, Any]:
    high = round(float(rng.uniform(0.05, 0.15)), 4)
    return _long(rng) | {
        "shape": "wedge", "top_width": round(high * float(rng.uniform(0.5, 4.0)), 4),
        "height": high, "fill_height": round(high * float(rng.uniform(0.3, 0.9)), 5),
    }  # fmt: skip


def _long(rng: np.random.Generator) -> dict[str, Any]:
    # Waves along a longer one still ring where the tests read their tilt.
    return {"length": round(float(rng.uniform(0.06, 0.25)), 4)}


def _askew(rng: np.random.Generator) -> dict[str, Any]:
    trough = _trough(rng)
    (y, z), *rest = trough["profile"]
    return trough | {"profile": [[y - 0.02, z], *rest]}


def _trough_closed(rng: np.random.Generator) -> dict[str, Any]:
    trough = _trough(rng)
    points = trough["profile"]
    return trough | {"profile": [*points, points[0]]}


def _trough_crossed(rng: np.random.Generator) -> dict[str, Any]:
    trough = _trough(rng)
    points = trough["profile"]
    middle = len(points) // 2
    points[middle - 1], points[middle] = points[middle], points[middle - 1]
    return trough


def _trough_in_millimetres(rng: np.random.Generator) -> dict[str, Any]:
    trough = _trough(rng)
    return trough | {"profile": [[1e3 * y, 1e3 * z] for y, z in trough["profile"]]}


def _overfilled(rng: np.random.Generator) -> dict[str, Any]:
    bowl = _bowl(rng)
    return bowl | {"fill_height": 1.5 * max(z for _, z in bowl["profile"])}


def _in_millimetres(rng: np.random.Generator) -> dict[str, Any]:
    bulb = _bulb(rng)
    return bulb | {
        "profile": [[1e3 * r, 1e3 * z] for r, z in bulb["profile"]],
        "fill_height": 1e3 * bulb["fill_height"],
    }


def _open_floor(rng: np.random.Generator) -> dict[str, Any]:
    steps = _steps(rng)
    return steps | {"profile": [[0.01, 0.0], *steps["profile"][1:]]}


def _negative_radius(rng: np.random.Generator) -> dict[str, Any]:
    cone = _narrow_neck(rng)
    return cone | {"profile": [[0.0, 0.0], *([-r, z] for r, z in cone["profile"][1:])]}


def _crossed(rng: np.random.Generator) -> dict[str, Any]:
    polygon = _polygon(rng)
    first, second, third, *rest = polygon["outline"]
    return polygon | {"outline": [first, third, [-second[0], third[1]], second, *rest]}


KINDS: Mapping[str, Draw] = {
    "bowl": _bowl, "bulb": _bulb, "narrow neck": _narrow_neck, "core": _core, "steps": _steps,
    "cone": _cone, "polygon": _polygon, "tray": _tray, "trough": _trough,
    "trough, round": _lying, "wedge": _wedge,
}  # fmt: skip
"""Kinds of containers that are possible."""
IMPOSSIBLE: Mapping[str, Draw] = {
    "overfilled": _overfilled, "millimetres": _in_millimetres, "open floor": _open_floor,
    "negative radius": _negative_radius, "crossed": _crossed, "askew": _askew,
    "trough, closed": _trough_closed,
    "trough, crossed": _trough_crossed, "trough, in millimetres": _trough_in_millimetres,
}  # fmt: skip
"""Kinds that are refused in one line."""

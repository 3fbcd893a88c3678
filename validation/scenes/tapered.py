"""Random scenes of cups with inclined walls, seen from above or below the level.

Drawn at random by a number; those of even number are for tuning, those of odd number for the
report. The surface is the first mode of the container's own; the truth is where it meets the wall.
"""

from __future__ import annotations

import numpy as np
from contours import draw_cup
from definitions import Motion, Scene
from unkind import LIQUIDS, draw_camera, draw_photo, draw_room

COUNT = 24
FRAMES = 5
_LIQUIDS = ("dark", "blue", "red", "milk")
_KINDS = ("paper cup", "pint glass")


def tapered() -> list[Scene]:
    """Returns all scenes."""
    return [tapered_cup(index) for index in range(COUNT)]


def tapered_cup(index: int) -> Scene:
    """Returns the scene with a number, which is the random seed."""
    rng = np.random.default_rng(11_000 + index)
    kind = _KINDS[(index // 2) % len(_KINDS)]
    name = _LIQUIDS[int(rng.integers(len(_LIQUIDS)))]
    cup = draw_cup(rng, kind)
    camera, look = draw_camera(rng, cup, (480, 360), (150.0, 200.0))
    motion = Motion(
        "rotating", peak=float(rng.uniform(0.15, 0.4) * min(cup.radius, cup.rim, cup.fill)),
        phi=float(rng.uniform(-180.0, 180.0)),
        minor=float(rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.95)),
    )  # fmt: skip
    return Scene(
        f"tapered_{index:02d}", f"{kind}, {name}, {look}", cup, LIQUIDS[name], camera,
        draw_photo(rng), draw_room(rng, name), motion, frames=FRAMES, still_frames=1,
    )  # fmt: skip

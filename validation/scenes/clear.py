"""Random scenes whose liquid looks nearly like its background.

Clear liquids that take from 2 to 50 % of the light, tea, and labels over the line: the first
before boards with shelves, posters and patterns, some of which move; those from PLAIN on before
plain boards, seen from slightly above, so that the far edge of a dark table is seen through the
liquid.
Scenes of even number are for tuning, those of odd number for the report.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from definitions import Camera, Cup, Label, Liquid, Motion, Room, Scene
from unkind import LIQUIDS, draw_camera, draw_cup, draw_photo

SCENES, PLAIN = 36, 20

_KINDS = ("clear", "tea", "clear", "label")
_LABELLED = ("blue", "dark", "red", "tea")


def clear() -> list[Scene]:
    """Returns the scenes: short sequences of small images."""
    return [_scene(index) for index in range(SCENES)]


def _scene(index: int) -> Scene:
    rng = np.random.default_rng(9000 + index)
    kind = _KINDS[index // 2 % len(_KINDS)]
    cup = draw_cup(rng)
    camera, look = draw_camera(rng, cup, (480, 360), (150.0, 200.0))
    liquid, about = _liquid(rng, kind, 2e-3 * cup.radius)
    label = None
    if kind == "label":
        azimuth = camera.azimuth + float(rng.uniform(-50.0, 50.0))
        wide, high = (float(size) for size in rng.uniform(15.0, 40.0, 2))
        label = Label(azimuth, float(rng.uniform(-10.0, 6.0)), wide, high)
    room, seen = _room(rng)
    if index >= PLAIN:
        camera, look = _from_slightly_above(rng, camera, cup), "slightly above"
        room, seen = _plain(rng, room), ["plain board"]
    motion = Motion(
        kind="planar" if rng.random() < 0.25 else "rotating",
        peak=float(rng.uniform(10.0, 0.5 * cup.radius)),
        phi=float(rng.uniform(-180.0, 180.0)),
        minor=float(rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.95)),
        sharpening=(float(rng.uniform(0.0, 0.12)), float(rng.uniform(0.0, 0.3))),
    )
    return Scene(
        f"clear_{index:02d}",
        ", ".join((about, *seen, look)),
        cup,
        liquid,
        camera,
        replace(draw_photo(rng), hunting=0.0 if rng.random() < 0.5 else 0.15),
        room,
        motion,
        label,
        frames=8,
        still_frames=1,
    )


def _from_slightly_above(rng: np.random.Generator, camera: Camera, cup: Cup) -> Camera:
    """Moves the camera so that front and rear contact line at rest are well visible."""
    height = camera.distance * math.tan(math.radians(float(rng.uniform(3.0, 10.0))))
    aim = 0.5 * (cup.rim - cup.fill) + float(rng.uniform(-10.0, 10.0))
    pitch = math.degrees(math.atan2(height - aim, camera.distance))
    return replace(camera, height=height, pitch=pitch)


def _plain(rng: np.random.Generator, room: Room) -> Room:
    """Returns the room with only a light board and a dark table."""
    light, dark = float(rng.uniform(0.4, 0.75)), float(rng.uniform(0.04, 0.2))
    return replace(
        room,
        wall=(light, light, 0.97 * light),
        table=(dark, dark, 1.1 * dark),
        things=int(rng.integers(0, 5)),
        contrast=float(rng.uniform(0.1, 0.6)),
        posters=0,
        texture=0.0,
        moving=0.0,
    )


def _liquid(rng: np.random.Generator, kind: str, diameter: float) -> tuple[Liquid, str]:
    """Draws a liquid of a kind for a container diameter [m]; returns it and its description."""
    if kind == "tea":
        strength = float(rng.uniform(0.4, 1.3))
        red, green, blue = LIQUIDS["tea"].absorption
        absorption = (strength * red, strength * green, strength * blue)
        return replace(LIQUIDS["tea"], absorption=absorption), f"tea of strength {strength:.1f}"
    if kind == "label":
        name = str(rng.choice(_LABELLED))
        return LIQUIDS[name], f"{name}, label"
    lost = math.exp(rng.uniform(math.log(0.02), math.log(0.5)))
    parts = rng.uniform(0.3, 1.0, 3)
    dense = -math.log(1.0 - lost) / diameter * parts / parts.max()
    absorption = (float(dense[0]), float(dense[1]), float(dense[2]))
    return Liquid(absorption, (0.0, 0.0, 0.0), 0.0), f"clear, takes {100 * lost:.0f} %"


def _room(rng: np.random.Generator) -> tuple[Room, list[str]]:
    """Draws a background with objects; returns it and its description."""
    wall = float(rng.uniform(0.25, 0.75)) * rng.uniform(0.9, 1.1, 3)
    table = float(rng.choice([0.06, 0.2, 0.5])) * rng.uniform(0.9, 1.1, 3)
    texture = float(rng.choice([0.0, 0.0, 0.1]))
    posters = int(rng.choice([0, 0, 2, 4]))
    moving = float(rng.choice([0.0, 0.0, 0.0, 40.0]))
    room = Room(
        wall=(float(wall[0]), float(wall[1]), float(wall[2])),
        table=(float(table[0]), float(table[1]), float(table[2])),
        things=int(rng.integers(0, 6)),
        posters=posters,
        contrast=float(rng.uniform(0.2, 0.8)),
        seed=int(rng.integers(1, 10_000)),
        slope=(float(rng.uniform(0.8, 1.2)), float(rng.uniform(0.8, 1.2))),
        texture=texture,
        moving=moving,
        behind=float(rng.uniform(0.2, 0.9)),
    )
    words = [f"table {table.mean():.2f}"]
    words += ["pattern"] if texture else []
    words += [f"{posters} posters"] if posters else []
    words += ["moving"] if moving else []
    return room, words

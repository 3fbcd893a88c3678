"""Random scenes with realistic difficulties: still images and sequences.

Walls of unequal thickness, thick floors, menisci, dirt, droplets, labels, another glass behind,
parts outside the image, clear and coloured liquids, cameras above, at and below the level, noise,
compression, an automatic exposure, a rolling shutter. Scenes of even number are for tuning, those
of odd number for the report.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from definitions import Camera, Cup, Label, Liquid, Motion, Photo, Room, Scene

STILLS, SEQUENCES = 40, 20

LIQUIDS = {
    "dark": Liquid(),
    "blue": Liquid(absorption=(120, 60, 12), colour=(0.02, 0.05, 0.14), opacity=0.25),
    "red": Liquid(absorption=(8, 90, 70), colour=(0.25, 0.02, 0.03), opacity=0.25),
    "orange": Liquid(colour=(0.95, 0.30, 0.04), opacity=0.9, glow=0.45),
    "milk": Liquid(colour=(0.85, 0.83, 0.78), opacity=0.97, glow=0.45),
    "tea": Liquid(absorption=(3, 9, 26), colour=(0.2, 0.1, 0.03), opacity=0.0),
    "clear": Liquid(absorption=(1.5, 0.6, 0.4), colour=(0.0, 0.0, 0.0), opacity=0.0),
}
_SEQUENCE_LIQUIDS = ("dark", "blue", "red", "milk", "dark", "tea")


def stills() -> list[Scene]:
    """Returns the scenes of which only the image at rest is used."""
    return [still(index) for index in range(STILLS)]


def sequences() -> list[Scene]:
    """Returns the scenes with motion, of small images."""
    return [sequence(index) for index in range(SEQUENCES)]


def still(index: int) -> Scene:
    """Returns the still scene with a number; higher numbers give further scenes."""
    rng = np.random.default_rng(7000 + index)
    name = list(LIQUIDS)[int(rng.integers(len(LIQUIDS)))]
    cup = draw_cup(rng)
    camera, look = draw_camera(rng, cup, (640, 480), (150.0, 400.0))
    scene = Scene(
        f"still_{index:02d}",
        "",
        cup,
        LIQUIDS[name],
        camera,
        draw_photo(rng),
        draw_room(rng, name),
        frames=0,
    )
    return _dirtied(rng, scene, f"{name}, {look}", 0.5)


def sequence(index: int) -> Scene:
    """Returns the moving scene with a number; higher numbers give scenes for tuning."""
    rng = np.random.default_rng(8000 + index)
    name = _SEQUENCE_LIQUIDS[index % len(_SEQUENCE_LIQUIDS)]
    cup = draw_cup(rng)
    camera, look = draw_camera(rng, cup, (480, 360), (150.0, 200.0))
    motion = Motion(
        kind="planar" if rng.random() < 0.25 else "rotating",
        peak=float(rng.uniform(10.0, 0.5 * cup.radius)),
        phi=float(rng.uniform(-180.0, 180.0)),
        minor=float(rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.95)),
        second=float(rng.uniform(0.0, 0.08)),
        sharpening=(float(rng.uniform(0.0, 0.12)), float(rng.uniform(0.0, 0.3))),
    )
    photo = draw_photo(rng, rolling=index % 5 == 4)
    scene = Scene(
        f"sequence_{index:02d}",
        "",
        cup,
        LIQUIDS[name],
        camera,
        photo,
        draw_room(rng, name),
        motion,
        frames=10,
    )
    return _dirtied(rng, scene, f"{name}, {look}", 0.3)


def draw_cup(rng: np.random.Generator) -> Cup:
    """Draws a container with an uneven wall and often a meniscus."""
    radius = float(rng.uniform(32.0, 60.0))
    fill = float(rng.uniform(0.9, 1.6) * radius)
    wall = float(rng.uniform(1.2, 4.0))
    uneven = rng.uniform(-0.12, 0.12, 2) * wall
    return Cup(
        radius=radius,
        wall=wall,
        fill=fill,
        rim=float(rng.uniform(0.8, 1.2) * radius),
        base=float(rng.uniform(2.0, 12.0)),
        index=float(rng.choice([1.49, 1.52])),
        eccentricity=(float(uneven[0]), float(uneven[1])),
        meniscus=float(rng.uniform(0.0, 1.5)),
    )


def draw_camera(
    rng: np.random.Generator, cup: Cup, size: tuple[int, int], widths: tuple[float, float]
) -> tuple[Camera, str]:
    """Draws a camera above, at or below the level; returns it and its description."""
    width = float(rng.uniform(*widths))
    focal = float(rng.uniform(0.9, 2.2)) * size[0]
    distance = focal * 2.0 * (cup.radius + cup.wall) / width
    place = str(rng.choice(["above", "above", "above", "level", "below"]))
    turn = {"above": (5.0, 22.0), "level": (-1.0, 1.5), "below": (-7.0, -2.0)}[place]
    height = distance * math.tan(math.radians(float(rng.uniform(*turn))))
    # The camera looks between floor and rim, or past the middle so that one end is cut off.
    scale = width / (2.0 * (cup.radius + cup.wall))
    aim = float(rng.uniform(-0.25, 0.25)) * (cup.fill + cup.rim) + 0.5 * (cup.rim - cup.fill)
    aim = float(np.clip(aim, -0.25 * size[1] / scale, 0.25 * size[1] / scale))
    pitch = math.degrees(math.atan2(height - aim, distance))
    half = 0.5 * size[1] / scale
    cut = [
        end
        for end, out in (
            ("rim", cup.rim > aim + half),
            ("base", -cup.fill - cup.base < aim - half),
        )
        if out
    ]
    camera = Camera(
        width=size[0],
        height_px=size[1],
        focal=focal,
        distance=distance,
        height=height,
        pitch=pitch,
        roll=float(rng.normal(0.0, 1.0)),
        k1=float(rng.uniform(-0.15, 0.02)),
        offset=(float(rng.normal(0.0, 6.0)), float(rng.normal(0.0, 6.0))),
    )
    return camera, place + "".join(f", {end} cut off" for end in cut)


def draw_photo(rng: np.random.Generator, *, rolling: bool = False) -> Photo:
    """Draws a camera's noise, compression, blur and exposure changes."""
    return Photo(
        gain=float(rng.uniform(0.7, 1.3)),
        shot=float(rng.uniform(0.003, 0.012)),
        read=float(rng.uniform(0.002, 0.006)),
        quality=int(rng.integers(45, 95)),
        lens_blur=float(rng.uniform(0.3, 0.9)),
        hunting=float(rng.uniform(0.0, 0.25)),
        readout_s=0.006 if rolling else 0.0,
    )


def draw_room(rng: np.random.Generator, liquid: str) -> Room:
    """Draws a background of other brightness than the liquid, often with another glass."""
    tone = rng.uniform(0.05, 0.2) if liquid == "milk" else rng.uniform(0.35, 0.8)
    wall = tone * rng.uniform(0.9, 1.1, 3)
    behind = rng.random() < 0.3
    return Room(
        wall=(float(wall[0]), float(wall[1]), float(wall[2])),
        things=int(rng.integers(0, 8)),
        contrast=float(rng.uniform(0.1, 0.8)),
        seed=int(rng.integers(1, 10_000)),
        slope=(float(rng.uniform(0.6, 1.2)), float(rng.uniform(0.6, 1.2))),
        texture=float(rng.choice([0.0, 0.0, 0.05])),
        behind=float(rng.uniform(0.2, 0.9)),
        glass_behind=(float(rng.uniform(-90, 90)), float(rng.uniform(110, 300)))
        if behind
        else None,
    )


def _dirtied(rng: np.random.Generator, scene: Scene, about: str, chance: float) -> Scene:
    """Adds a label, droplets and dirt to a scene, each with a given probability."""
    words = [about]
    label = None
    if rng.random() < chance:
        azimuth = -90.0 + float(rng.uniform(-55.0, 55.0))
        z = float(rng.uniform(-0.5, 0.2) * scene.cup.fill)
        label = Label(azimuth, z, float(rng.uniform(12, 45)), float(rng.uniform(15, 45)))
        words.append("label")
    droplets = int(rng.integers(8, 40)) if rng.random() < chance else 0
    words += ["droplets"] if droplets else []
    dirt = int(rng.integers(10, 60)) if rng.random() < chance else 0
    words += ["dirt"] if dirt else []
    words += ["glass behind"] if scene.room.glass_behind else []
    words += ["rolling shutter"] if scene.photo.readout_s else []
    return replace(scene, label=label, droplets=droplets, dirt=dirt, about=", ".join(words))

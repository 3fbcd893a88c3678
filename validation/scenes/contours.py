"""Random scenes with side views of two kinds of cup, a bowl and a bottle.

Scenes of even number are for tuning, those of odd number for the report. The surface is the first
mode of the container's own, in any direction; the truth is where it meets the wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml
from definitions import Camera, Cup, Liquid, Motion, Photo, Room, Scene
from numpy.typing import NDArray
from optics import View

from slosh_model.model_text import parse_model
from slosh_model.shapes.revolution import RevolvedContainer

Array = NDArray[np.float64]

COUNT = 16
FRAMES = 5
KINDS = ("paper cup", "pint glass", "bowl", "bottle")
_LIQUIDS = {
    "dark": Liquid(),
    "blue": Liquid(absorption=(120, 60, 12), colour=(0.02, 0.05, 0.14), opacity=0.25),
    "red": Liquid(absorption=(8, 90, 70), colour=(0.25, 0.02, 0.03), opacity=0.25),
    "milk": Liquid(colour=(0.85, 0.83, 0.78), opacity=0.97, glow=0.45),
}


def contours() -> list[Scene]:
    """Returns all scenes."""
    return [contour(index) for index in range(COUNT)]


def contour(index: int) -> Scene:
    """Returns the scene with a number, which is the random seed."""
    rng = np.random.default_rng(9000 + index)
    kind = KINDS[(index // 2) % len(KINDS)]
    cup = draw_cup(rng, kind)
    name = list(_LIQUIDS)[int(rng.integers(len(_LIQUIDS)))]
    distance = float(rng.uniform(380.0, 650.0))
    widest = max(r for r, _ in cup.profile) + cup.wall
    camera = Camera(
        400, 300, focal=0.62 * 400 * distance / (2.0 * max(widest, 0.6 * (cup.fill + cup.rim))),
        distance=distance, height=float(rng.uniform(-8.0, 8.0)),
        pitch=float(rng.uniform(-0.4, 0.4)), roll=float(rng.uniform(-1.0, 1.0)),
    )  # fmt: skip
    bright = name == "milk"
    tone = (0.11, 0.12, 0.13) if bright else (0.7, 0.7, 0.68)
    room = Room(wall=tone, things=int(rng.integers(0, 4)), contrast=0.25, seed=100 + index,
                behind=0.3 if bright else 0.8)  # fmt: skip
    motion = Motion(
        "rotating", peak=float(rng.uniform(0.12, 0.3) * min(cup.radius, cup.rim, cup.fill)),
        phi=float(rng.uniform(-180.0, 180.0)),
        minor=float(rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.9)),
    )  # fmt: skip
    return Scene(
        f"contour_{index:02d}", f"{kind}, {name}, camera {camera.height:.0f} mm above the level "
        f"at {distance:.0f} mm", cup, _LIQUIDS[name], camera,
        Photo(read=float(rng.uniform(0.001, 0.004))), room, motion, frames=FRAMES,
    )  # fmt: skip


def draw_cup(rng: np.random.Generator, kind: str) -> Cup:
    """Draws a container of a kind with random dimensions."""
    size, fill = rng.uniform(0.85, 1.15), rng.uniform(0.85, 1.15)
    made: dict[str, dict[str, Any]] = {
        "paper cup": {"shape": "frustum", "bottom_radius": 0.028, "top_radius": 0.041,
                      "height": 0.095, "fill_height": 0.055},
        "pint glass": {"shape": "frustum", "bottom_radius": 0.031, "top_radius": 0.044,
                       "height": 0.15, "fill_height": 0.085},
        "bowl": {"shape": "ellipsoid", "radius": 0.07, "semi_height": 0.06,
                 "fill_height": 0.038, "rim_height": 0.06},
        "bottle": {"shape": "bottle", "radius": 0.036, "foot_radius": 0.006, "body_height": 0.12,
                   "neck_radius": 0.014, "shoulder_height": 0.16, "height": 0.19,
                   "fill_height": 0.07},
    }  # fmt: skip
    container = {
        name: value if isinstance(value, str) else round(value * size, 5)
        for name, value in made[kind].items()
    }
    container["fill_height"] = round(round(made[kind]["fill_height"] * size, 5) * fill, 5)
    body = revolved(container)
    inner = 1e3 * (body.silhouette + np.array([0.0, body.fill_height]))
    inner = inner[np.append(True, np.hypot(*np.diff(inner, axis=0).T) > 1e-6)]
    level, rim = 1e3 * body.fill_height, 1e3 * (body.freeboard or 0.0)
    return Cup(
        radius=1e3 * body.size, wall=float(rng.uniform(1.0, 2.5)), fill=level, rim=rim,
        base=float(rng.uniform(2.0, 4.0)), index=float(rng.choice([1.49, 1.52])),
        profile=tuple((float(r), float(z)) for r, z in inner), container=container,
    )  # fmt: skip


def revolved(container: dict[str, Any]) -> RevolvedContainer:
    """Returns the container that a model file's container section describes."""
    found = parse_model(yaml.safe_dump({"container": container})).container
    assert isinstance(found, RevolvedContainer)
    return found


@dataclass(frozen=True)
class ContourWave:
    """The first sloshing mode's surface in a body of revolution.

    Attributes:
        radius: of the still surface, m.
        a1, phi: height at the still surface's edge (m) and its azimuth (rad).
        places, shape: the mode's height from the axis to the wall, 1 at the wall.
        radii, levels: the wall, m, levels above the still one.
    """

    radius: float
    a1: float
    phi: float
    places: Array
    shape: Array
    radii: Array
    levels: Array

    @property
    def reach(self) -> float:
        """Radius up to which the liquid's surface is drawn [m]."""
        return float(self.radii.max())

    def height(self, r: Array, azimuth: Array) -> Array:
        """Returns the surface height [m] at radius `r` [m] and `azimuth` [rad]."""
        r = np.asarray(r)
        slope = (self.shape[-1] - self.shape[-3]) / (self.places[-1] - self.places[-3])
        inside = np.interp(r, self.places, self.shape)
        beyond = np.maximum(r - self.places[-1], 0.0)
        return np.asarray(self.a1 * (inside + slope * beyond) * np.cos(azimuth - self.phi))

    def wall(self, azimuth: Array | float) -> Array:
        """Returns the height [m] at which the surface meets the wall at `azimuth` [rad]."""
        azimuth = np.asarray(azimuth)
        found = self.height(np.asarray(self.radius), azimuth)
        for _ in range(60):
            found = self.height(np.interp(found, self.levels, self.radii), azimuth)
        return found

    def peak(self) -> tuple[float, float]:
        """Returns the maximum height on the wall [m] and its azimuth [rad]."""
        azimuth = math.atan2(math.sin(self.phi), math.cos(self.phi))
        return float(self.wall(azimuth)), azimuth


def contour_wave(scene: Scene, a1: float, phi: float) -> ContourWave:
    """Returns a scene's surface with an amplitude [m] in the direction of an azimuth [rad]."""
    body = revolved(scene.cup.container)
    places, shape = body.surface_shape(1)
    wall = body.wall
    return ContourWave(
        body.size, abs(a1), phi if a1 >= 0.0 else phi + math.pi, places, shape / shape[-1],
        wall.radii, wall.heights,
    )  # fmt: skip


def frame_truth(wave: ContourWave) -> dict[str, Any]:
    """Returns the exact heights on the wall, for a frame's entry in truth.json."""
    height, azimuth = wave.peak()
    return {
        "MSH": height,
        "peak_az": math.degrees(azimuth),
        "SH_left": float(wave.wall(math.pi)),
        "SH_right": float(wave.wall(0.0)),
        "wall_profile": np.round(wave.wall(np.radians(np.arange(360.0))), 8).tolist(),
    }


def header(scene: Scene, view: View) -> dict[str, Any]:
    """Returns the data in truth.json that hold for the whole sequence."""
    cup, camera = scene.cup, scene.camera
    return {
        "sequence": scene.name, "about": scene.about, "units": "m, s, deg, px",
        "container": cup.container, "wall_thickness": 1e-3 * cup.wall, "n_wall": cup.index,
        "radius": 1e-3 * cup.radius, "rim_z": 1e-3 * cup.rim,
        "frame_rate": scene.motion.frame_rate,
        "camera": {
            "width": camera.width, "height": camera.height_px, "focal": camera.focal,
            "distance": 1e-3 * camera.distance, "above_level": 1e-3 * camera.height,
            "pitch": camera.pitch, "roll": camera.roll, "k1": view.k1,
            "cx": view.centre[0], "cy": view.centre[1],
            "R_cup2cam": view.rotation.tolist(), "t_cup2cam": view.translation.tolist(),
        },
        "static": {"file": "calib.jpg"}, "frames": [],
    }  # fmt: skip

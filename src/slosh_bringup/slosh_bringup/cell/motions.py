"""Container motions of the paper DL22: paths, acceleration levels, and time law along paths.

Planar paths S(σ), σ from 0 to 1 (DL22, Fig. 4): `l` back and forth along y, `e` a figure of eight,
`c` a circle run twice. The law σ(t) is the modified trapezoid, so that S̈ = S″σ̇² + S′σ̈ starts and
ends at zero. The duration is what makes the greatest ‖S̈‖ equal to the level of DL22, Table 3. The
spatial motions l3, e3, c3 (Table 4) keep the middle level's planar motion and add a vertical one,
in step with the path, whose greatest |z̈| is 2.5 or 4.5 m/s².
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import scipy

from slosh_base.files.nearest import did_you_mean
from slosh_base.types import Array
from slosh_bringup.errors import SloshBringupError
from slosh_model.constants import GRAVITY
from slosh_model.motion_profiles import modified_trapezoid

Path = Callable[[Array], tuple[Array, Array, Array]]

REST_BEFORE = 1.0
DWELL_AFTER = 3.0
STROKE = 0.40
"""Length of the l path [m]."""
EIGHT = (0.40, 0.19)
"""Half width and half height of the e path [m]."""
CIRCLE = 0.25
"""Radius of the c path [m]."""


@dataclass(frozen=True, slots=True)
class CellMotion:
    """A sampled motion of the container; its arrays are read-only copies.

    Attributes:
        name: e.g. 'c-8.9'.
        t: (N,) time, evenly spaced from 0 [s].
        position: (N, 3) of the container's origin in the world [m].
        acceleration: (N, 3) its second derivative [m/s²].
        attitude: (N, 4) quaternion x, y, z, w, world ← container; None: upright throughout.
        angular_velocity: (N, 3) in the container's frame [rad/s]; None: it does not turn.
    """

    name: str
    t: Array
    position: Array
    acceleration: Array
    attitude: Array | None = None
    angular_velocity: Array | None = None

    def __post_init__(self) -> None:
        """Copies the arrays and makes the copies read-only."""
        for name in ("t", "position", "acceleration", "attitude", "angular_velocity"):
            if getattr(self, name) is not None:
                array = np.array(getattr(self, name), dtype=np.float64)
                array.setflags(write=False)
                object.__setattr__(self, name, array)

    @property
    def duration(self) -> float:
        """Time from the motion's first to its last sample [s]."""
        return float(self.t[-1] - self.t[0])

    def specific_force(self) -> Array:
        """Returns an accelerometer's specific force in the container, (N, 3) [m/s²] (REP-145)."""
        force = self.acceleration + np.array([0.0, 0.0, GRAVITY])
        if self.attitude is not None:
            turns = scipy.spatial.transform.Rotation.from_quat(self.attitude)
            force = turns.apply(force, inverse=True)
        return np.asarray(force, dtype=np.float64)

    def repeated(self, times: int) -> CellMotion:
        """Returns the motion repeated a number of times."""

        def tiled(array: Array | None) -> Array | None:
            return None if array is None else np.tile(array, (times, 1))

        step = self.duration / max(len(self.t) - 1, 1)
        return CellMotion(
            self.name,
            np.arange(times * len(self.t), dtype=np.float64) * step,
            np.tile(self.position, (times, 1)),
            np.tile(self.acceleration, (times, 1)),
            tiled(self.attitude),
            tiled(self.angular_velocity),
        )


@dataclass(frozen=True, slots=True)
class MotionSpec:
    """Definition of a motion: path, maximum planar and vertical acceleration [m/s²]."""

    path: str
    planar: float
    vertical: float = 0.0


def _harmonic(amplitude: float, turns: float, phase: float) -> Path:
    """Returns amplitude · cos(2π · turns · σ + phase) and its derivatives with respect to σ."""
    rate = 2.0 * math.pi * turns

    def path(sigma: Array) -> tuple[Array, Array, Array]:
        angle = rate * sigma + phase
        return (
            amplitude * np.cos(angle),
            -amplitude * rate * np.sin(angle),
            -amplitude * rate**2 * np.cos(angle),
        )

    return path


_QUARTER = -math.pi / 2.0  # cos(x - π/2) = sin x
PATHS: Mapping[str, tuple[Path, Path]] = MappingProxyType(
    {
        "l": (_harmonic(0.0, 1.0, 0.0), _harmonic(-STROKE / 2.0, 1.0, 0.0)),
        "e": (_harmonic(EIGHT[0], 1.0, _QUARTER), _harmonic(EIGHT[1], 2.0, _QUARTER)),
        "c": (_harmonic(CIRCLE, 2.0, 0.0), _harmonic(CIRCLE, 2.0, _QUARTER)),
    }
)
# Up and down twice along the path.
_VERTICAL = _harmonic(-0.5, 2.0, 0.0)
LEVELS: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {"l": (5.2, 7.4, 8.1), "e": (4.7, 8.1, 9.2), "c": (5.8, 8.9, 9.5)}
)
VERTICAL_LEVELS = (2.5, 4.5)


def _catalogue() -> dict[str, MotionSpec]:
    specs = {}
    for path, levels in LEVELS.items():
        for level in levels:
            specs[f"{path}-{level}"] = MotionSpec(path, level)
        specs[path] = MotionSpec(path, levels[0])
        for vertical in VERTICAL_LEVELS:
            specs[f"{path}3-{vertical}"] = MotionSpec(path, levels[1], vertical)
        specs[f"{path}3"] = MotionSpec(path, levels[0], VERTICAL_LEVELS[0])
    return specs


MOTIONS: Mapping[str, MotionSpec] = MappingProxyType(_catalogue())
"""Every motion by name; the short names are gentle ones."""


def make_motion(name: str, rate: float = 1000.0) -> CellMotion:
    """Makes a motion by name; the container is at rest for a time before and after it.

    Args:
        name: one of MOTIONS.
        rate: samples per second.

    Raises:
        SloshBringupError: unknown name, or a rate that is not positive.
    """
    spec = MOTIONS.get(name)
    if spec is None:
        raise SloshBringupError(
            f"unknown motion {name!r} (known: {', '.join(sorted(MOTIONS))})"
            f"{did_you_mean(name, MOTIONS)}"
        )
    if not (math.isfinite(rate) and rate > 0.0):
        raise SloshBringupError(f"rate = {rate!r} Hz must be positive")
    duration = _duration(spec)
    total = REST_BEFORE + duration + DWELL_AFTER
    t = np.arange(math.floor(total * rate) + 1) / rate
    position, acceleration = _along(spec, (t - REST_BEFORE) / duration, duration)
    return CellMotion(name, t, position - position[0], acceleration)


def _duration(spec: MotionSpec) -> float:
    """Computes the duration of a motion [s]; its accelerations scale with 1 / duration²."""
    _, acceleration = _along(MotionSpec(spec.path, spec.planar), np.linspace(0.0, 1.0, 20001), 1.0)
    return math.sqrt(float(np.hypot(acceleration[:, 0], acceleration[:, 1]).max()) / spec.planar)


def _along(spec: MotionSpec, u: Array, duration: float) -> tuple[Array, Array]:
    """Returns position [m] and acceleration [m/s²], (N, 3), at fractions of the whole duration."""
    law = modified_trapezoid(u)
    x, y = PATHS[spec.path]
    columns = [_chain(path, law, duration) for path in (x, y, _VERTICAL)]
    if spec.vertical:
        law_fine = modified_trapezoid(np.linspace(0.0, 1.0, 20001))
        unit = float(np.abs(_chain(_VERTICAL, law_fine, duration)[1]).max())
        scale = spec.vertical / unit
    else:
        scale = 0.0
    columns[2] = (scale * columns[2][0], scale * columns[2][1])
    position = np.stack([column[0] for column in columns], axis=1)
    acceleration = np.stack([column[1] for column in columns], axis=1)
    return position, acceleration


def _chain(path: Path, law: tuple[Array, Array, Array], duration: float) -> tuple[Array, Array]:
    """Applies the chain rule to a path S(σ) and a time law σ(t): S̈ = S″σ̇² + S′σ̈."""
    sigma, rate, change = law
    place, slope, curvature = path(sigma)
    return place, (curvature * rate**2 + slope * change) / duration**2

"""Time laws along a path, and the motions at 1 kHz that they give.

A law runs over all legs of a path, one after another. That of a leg is given by its third
derivative, constant between nodes, so that place, speed and acceleration are polynomials, exact at
every moment.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from slosh_base.types import Array
from slosh_plan.planning.joint_path import JointLeg, JointMotion, gathered, joints_along
from slosh_plan.planning.path import Path

Law = Callable[[Array], tuple[Array, Array, Array]]
"""Time [s] to s [m] and its first two derivatives."""

STEP = 1e-3
"""Between two rows of a motion [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class JerkLaw:
    """Time law of a leg with a piecewise constant third derivative (jerk).

    Attributes:
        duration: of the leg [s]; the nodes are evenly spaced.
        jerk: (N,) third derivative of s between them [m/s³].
        start: s, ds/dt and d²s/dt² at the start; the last one is not 0 where a path turns back.
    """

    duration: float
    jerk: Array
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Returns path length s [m], ds/dt and d²s/dt² (M,) at times [s] from the leg's start."""
        step = self.duration / len(self.jerk)
        nodes = self.nodes()
        row = np.clip((t / step).astype(np.int64), 0, len(self.jerk) - 1)
        since = np.clip(t, 0.0, self.duration) - row * step
        s, v, a = nodes[row].T
        j = self.jerk[row]
        return (
            s + since * (v + since * (a / 2.0 + since * j / 6.0)),
            v + since * (a + since * j / 2.0),
            a + since * j,
        )

    def nodes(self) -> Array:
        """Returns path length s, ds/dt and d²s/dt² at the nodes (N + 1, 3)."""
        step = self.duration / len(self.jerk)
        place, speed, change = self.start
        a = change + np.concatenate([[0.0], np.cumsum(self.jerk) * step])
        v = speed + np.concatenate([[0.0], np.cumsum(step * (a[:-1] + step * self.jerk / 2.0))])
        ways = step * (v[:-1] + step * (a[:-1] / 2.0 + step * self.jerk / 6.0))
        return np.column_stack([place + np.concatenate([[0.0], np.cumsum(ways)]), v, a])

    def stretched(self, factor: float) -> JerkLaw:
        """Returns the time law slowed by a factor, along the same path."""
        place, speed, change = self.start
        start = (place, speed / factor, change / factor**2)
        return JerkLaw(self.duration * factor, self.jerk / factor**3, start)


@dataclass(frozen=True, slots=True, eq=False)
class PlannedMotion:
    """A planned motion from rest to rest, sampled at 1 kHz or coarser.

    Attributes:
        t: (N,) time from 0 [s].
        position: (N, 3) of the container's origin in the world's axes [m].
        acceleration: (N, 3) its second derivative [m/s²].
        speed: (N,) along the path [m/s].
        tilt: how the container tilts; None: it keeps its attitude, or turns as the joints do.
        joints: the joints that carry it; None: they are not known.
    """

    t: Array
    position: Array
    acceleration: Array
    speed: Array
    tilt: Tilt | None = None
    joints: JointMotion | None = None

    @property
    def attitude(self) -> Array | None:
        """Quaternions (N, 4) x, y, z, w, world ← container, or None if constant."""
        if self.joints is not None:
            return self.joints.attitude
        return None if self.tilt is None else self.tilt.attitude

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return float(self.t[-1])

    @property
    def step(self) -> float:
        """Interval between the motion's samples [s]."""
        return float(self.t[1])


def motion_along(
    path: Path, laws: Sequence[Law], durations: Sequence[float], step: float = STEP
) -> PlannedMotion:
    """Creates the motion along a path from the time laws of its legs.

    Args:
        path: the path.
        laws: one for each leg.
        durations: of the legs [s]; their sum is taken to be a whole number of rows.
        step: between two rows [s].
    """
    count = round(sum(durations) / step)
    t: Array = step * np.arange(count + 1, dtype=np.float64)
    ends = np.cumsum(durations)
    leg_of = np.minimum(np.searchsorted(ends, t), len(durations) - 1)
    position, acceleration = np.empty((2, len(t), 3))
    speed, parts = np.empty(len(t)), []
    for n, (leg, law) in enumerate(zip(path.legs, laws, strict=True)):
        rows = np.flatnonzero(leg_of == n)
        s, v, a = law(t[rows] - (ends[n] - durations[n]))
        place, tangent, bend = leg.at(s, 2)
        position[rows] = place
        acceleration[rows] = bend * (v**2)[:, None] + tangent * a[:, None]
        speed[rows] = v
        if isinstance(leg, JointLeg):
            parts.append(joints_along(leg, s, v, a))
    acceleration[0] = acceleration[-1] = 0.0
    speed[0] = speed[-1] = 0.0
    joints = gathered(parts) if parts else None
    return PlannedMotion(t, position, acceleration, speed, joints=joints)


@dataclass(frozen=True, slots=True, eq=False)
class TimeLaw(ABC):
    """A time law along a path, for any duration.

    Attributes:
        path: the path.
    """

    path: Path

    @abstractmethod
    def durations(self, duration: float) -> tuple[float, ...]:
        """Returns the durations of the legs for a total duration [s]."""

    @abstractmethod
    def laws(self, duration: float) -> Sequence[Law]:
        """Returns the time laws of the legs for a total duration [s]."""

    def motion(self, duration: float, step: float = STEP) -> PlannedMotion:
        """Creates the motion with a total duration and a sample interval [s]."""
        return motion_along(self.path, self.laws(duration), self.durations(duration), step)


def whole_rows(duration: float) -> float:
    """Rounds a duration up to a whole number of sample intervals [s]."""
    return STEP * math.ceil(duration / STEP - 1e-9)


@dataclass(frozen=True, slots=True, eq=False)
class Tilt:
    """Tilt about the container's horizontal axes, as rotation vector (x, y, 0).

    Attributes:
        yaw: of the container before it tilts [rad].
        vector: (N, 2) x and y [rad], at the motion's rows.
        rate, acceleration: (N, 2) its derivatives [rad/s, rad/s²].
    """

    yaw: float
    vector: Array
    rate: Array
    acceleration: Array

    @property
    def attitude(self) -> Array:
        """Quaternions (N, 4) x, y, z, w, world ← container."""
        vectors = np.column_stack([self.vector, np.zeros(len(self.vector))])
        turned = Rotation.from_euler("z", self.yaw) * Rotation.from_rotvec(vectors)
        quaternions: Array = turned.as_quat()
        return quaternions * np.where(quaternions[:, 3:] < 0.0, -1.0, 1.0)

    @property
    def largest(self) -> tuple[float, float, float]:
        """Largest angle, rate and acceleration of the tilt [rad, rad/s, rad/s²]."""
        sizes = (np.linalg.norm(one, axis=1).max() for one in
                 (self.vector, self.rate, self.acceleration))  # fmt: skip
        angle, rate, acceleration = (float(size) for size in sizes)
        return angle, rate, acceleration

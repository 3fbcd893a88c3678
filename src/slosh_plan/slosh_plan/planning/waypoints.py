"""A path as it is given."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.types import Array

TURNED = 1e-3
"""By which an attitude may differ from the first one [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Waypoints:
    """A path as it is given.

    Attributes:
        t: (N,) times, a proposal [s].
        position: (N, 3) of the container's origin in the world's axes [m].
        attitude: (4,) quaternion x, y, z, w, world ← container, kept all along; None: not given.
    """

    t: Array
    position: Array
    attitude: Array | None

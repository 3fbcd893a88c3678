"""How a container tilts during a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Tilt:
    """A tilt about horizontal axes of the container, by its rotation vector (x, y, 0).

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
        """(N, 4) quaternion x, y, z, w, world ← container."""
        vectors = np.column_stack([self.vector, np.zeros(len(self.vector))])
        turned = Rotation.from_euler("z", self.yaw) * Rotation.from_rotvec(vectors)
        quaternions: Array = turned.as_quat()
        return quaternions * np.where(quaternions[:, 3:] < 0.0, -1.0, 1.0)

    @property
    def largest(self) -> tuple[float, float, float]:
        """Of the angle, its rate and acceleration [rad, rad/s, rad/s²]."""
        sizes = (np.linalg.norm(one, axis=1).max() for one in
                 (self.vector, self.rate, self.acceleration))  # fmt: skip
        angle, rate, acceleration = (float(size) for size in sizes)
        return angle, rate, acceleration

"""Uncertainty of the user's lens and container dimensions, and their estimated corrections."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup

FloatArray = NDArray[np.float64]

QUANTITIES = 3


@dataclass(frozen=True, slots=True)
class GivenDeviations:
    """Standard deviations of the user's focal length and container dimensions; 0: exact.

    Attributes:
        focal_length: relative.
        wall_thickness: [m].
        fill_height: [m].
    """

    focal_length: float = 0.0
    wall_thickness: float = 0.0
    fill_height: float = 0.0

    @property
    def stddev(self) -> FloatArray:
        """Returns the standard deviations as an array (QUANTITIES,)."""
        return np.array([self.focal_length, self.wall_thickness, self.fill_height])

    @property
    def open(self) -> NDArray[np.bool_]:
        """Mask (QUANTITIES,) of the user's values that are uncertain and so are estimated."""
        return self.stddev > 0.0


KNOWN = GivenDeviations()


@dataclass(frozen=True, slots=True, eq=False)
class GivenView:
    """The camera and container that the user gave, with their uncertainties.

    Attributes:
        camera: the camera.
        cup: the container.
        doubt: how far both may be off.
    """

    camera: PinholeCamera
    cup: Cup
    doubt: GivenDeviations = KNOWN

    def off_by(self, change: FloatArray) -> tuple[PinholeCamera, Cup]:
        """Returns camera and container with corrections added to the values that the user gave.

        Args:
            change: (QUANTITIES,) of the focal length's logarithm, the wall's thickness [m] and
                the fill height [m].
        """
        if not np.any(change):
            return self.camera, self.cup
        zoom = float(np.exp(np.clip(change[0], -3.0, 3.0)))
        camera = replace(self.camera, fx=zoom * self.camera.fx, fy=zoom * self.camera.fy)
        wall = max(self.cup.wall_thickness + float(change[1]), 0.0)
        fill = max(
            self.cup.fill_height + float(change[2]), TUNING.least_told * self.cup.fill_height
        )
        rim = self.cup.rim_height
        cup = replace(
            self.cup,
            radius=float(self.cup.radius_at(fill - self.cup.fill_height)),
            wall_thickness=wall,
            fill_height=fill,
            rim_height=rim if rim is None or rim > fill else None,
        )
        return camera, cup

"""Systematic error of the contact line measured on the liquid at rest.

An uneven wall bends a line, and where front and rear line are one edge in the image, what is found
lies between them. A surface that is fitted to such a contact line alone leans towards the camera
or away from it. The liquid at rest is level, so that its image tells; once the line has risen or
fallen by some rows, it is seen through another place of the wall, and apart from the other line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.surface_evidence import SurfaceFit, WallPoints
from slosh_camera.cylinder.tuning import TUNING

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FrontBias:
    """Systematic height error of the front contact line, measured on the liquid at rest.

    Attributes:
        zero: (SHAPES,) heights of the surface at rest [m].
        offset: (M,) of the line's points above it [m]; 0 where nothing is known.
        holds: standard deviation of the rise over which the offset changes [m].
    """

    zero: FloatArray
    offset: FloatArray
    holds: float

    @classmethod
    def unknown(cls, zero: FloatArray, lines: int) -> Self:
        """Returns a bias of zero for a number of scan lines, for an unknown surface at rest."""
        return cls(zero, np.zeros(lines), 1.0)

    @classmethod
    def at_rest(cls, fit: SurfaceFit, zero: FloatArray, footprint: float) -> Self:
        """Estimates the contact line's bias from a fit to the image of the liquid at rest.

        Args:
            fit: the points that agree with it count.
            zero: (SHAPES,) heights of the surface at rest [m].
            footprint: of a row on the wall [m].
        """
        points = fit.points
        known = (fit.front_weight > TUNING.inlier) & ~points.bound
        above = np.where(known, points.height - points.shapes @ zero, 0.0)
        window = np.ones(TUNING.bias_lines)
        count = np.convolve(known.astype(np.float64), window, "same")
        offset = np.convolve(above, window, "same") / np.maximum(count, 1.0)
        return cls(zero, np.where(known, offset, 0.0), TUNING.bias_rows * footprint)

    def removed(self, points: WallPoints) -> WallPoints:
        """Subtracts the bias from contact-line points (M,), fully at rest level, less above it."""
        rise = points.height - points.shapes @ self.zero - self.offset
        part = np.exp(-0.5 * np.square(rise / self.holds))
        return replace(points, height=points.height - part * self.offset)

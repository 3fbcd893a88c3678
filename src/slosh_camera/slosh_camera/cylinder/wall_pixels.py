"""Looks up the image positions of wall points in a precomputed table.

Through a wall of glass the way from a point to its pixel is found step by step, which costs more
than all the rest of a measurement: it is done once for a net of points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.optics.cup import CupView

FloatArray = NDArray[np.float64]

_AZIMUTHS = 180
_STEP = 2.0 * np.pi / _AZIMUTHS
_HEIGHTS = 25


class WallPixels:
    """Table of the image positions of a container's wall points by azimuth and height."""

    def __init__(self, view: CupView) -> None:
        """Projects a grid of wall points into the image, as a look-up table."""
        self._view = view
        level = view.cup.rim_level
        top = TUNING.unknown_rim * view.cup.radius if level is None else level
        self._low = -view.cup.fill_height
        self._spacing = (top - self._low) / (_HEIGHTS - 1)
        heights = self._low + self._spacing * np.arange(_HEIGHTS)
        azimuth, height = np.meshgrid(_STEP * np.arange(_AZIMUTHS), heights, indexing="ij")
        pixels = view.project_wall(azimuth.ravel(), height.ravel())
        self._table: FloatArray = pixels.reshape(_AZIMUTHS, _HEIGHTS, 2)
        # Next to the container's sides the net is too wide.
        sides = np.asarray(view.tangent_azimuths())
        self._exact = {int(side // _STEP + k) % _AZIMUTHS for side in sides for k in range(-4, 5)}

    def __call__(self, azimuth: float, height: float) -> tuple[float, float]:
        """Returns image column and row of a wall point [px], or NaN if it is not visible.

        Args:
            azimuth: [rad].
            height: above the still level [m].
        """
        if not (np.isfinite(azimuth) and np.isfinite(height)):
            return float("nan"), float("nan")
        across = (azimuth / _STEP) % _AZIMUTHS
        up = (height - self._low) / self._spacing
        i, j = int(across) % _AZIMUTHS, int(up)
        if i in self._exact or not 0 <= j < _HEIGHTS - 1:
            u, v = self._view.project_wall(azimuth, height)[0]
            return float(u), float(v)
        a, b = across - int(across), up - j
        here, beside = self._table[i], self._table[(i + 1) % _AZIMUTHS]
        low = (1.0 - a) * here[j] + a * beside[j]
        high = (1.0 - a) * here[j + 1] + a * beside[j + 1]
        u, v = (1.0 - b) * low + b * high
        return float(u), float(v)

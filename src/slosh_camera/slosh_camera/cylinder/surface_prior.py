"""Prior distribution of the free surface's mode amplitudes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.surface_modes import SHAPES
from slosh_camera.cylinder.tuning import TUNING

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Prior distribution of the mode amplitudes, before an image is used.

    Attributes:
        centre: (SHAPES,) [m], at rest.
        first: standard deviation of the first mode [m].
        level: of the level [m].
        higher: part of their usual standard deviation that the higher shapes have; hardly any at
            rest.
        rare: what each of these surfaces takes from the agreement with a picture.
    """

    centre: FloatArray
    first: float
    level: float = 3e-4
    higher: float = 1.0
    rare: float = 0.0

    def of_changed_level(self) -> Self:
        """Returns the prior for liquid that has been added or removed."""
        return replace(self, level=TUNING.level_stddev, rare=TUNING.rare)

    def at_rest_on_changed_level(self) -> Self:
        """Returns the prior for a changed liquid level at rest."""
        return replace(
            self,
            first=TUNING.at_rest * self.first,
            level=TUNING.level_stddev,
            higher=TUNING.at_rest,
            rare=TUNING.rare_at_rest,
        )

    def conditional(
        self, heights: FloatArray, radius: float, *, front_alone: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Returns mean and inverse covariance of the mode amplitudes [m] for a known first mode.

        The shapes of second order grow with the square of the first mode. Crests are sharper than
        troughs: the double shape has its crest where the first mode has it. A contact line alone
        cannot tell these shapes from the first, so they are held tighter then.

        Args:
            heights: (SHAPES,) of which the first mode counts [m].
            radius: of the container [m].
            front_alone: whether there is no upper edge.
        """
        x, y = heights[1:3] - self.centre[1:3]
        size, square = float(np.hypot(x, y)), float(x * x + y * y) / radius
        tight = self.higher * (0.3 if front_alone else 1.0)
        second = tight * (3e-4 + 0.05 * size)
        mean = tight * (1e-4 + 0.25 * square)
        along, across = tight * (1e-4 + 0.25 * square), tight * (1e-4 + 0.12 * square)
        spread = (self.level, self.first, self.first, second, second, mean)
        precision = np.zeros((SHAPES, SHAPES))
        np.fill_diagonal(precision[:6, :6], np.power(spread, -2.0))
        # The double shape's crest turns by twice the azimuth.
        c, s = ((x * x - y * y) / size**2, 2.0 * x * y / size**2) if size > 0.0 else (1.0, 0.0)
        p, q = along**-2.0, across**-2.0
        precision[6:, 6:] = (
            (c * c * p + s * s * q, c * s * (p - q)),
            (c * s * (p - q), s * s * p + c * c * q),
        )
        centre = self.centre.copy()
        centre[6] += 0.15 * tight * square * c
        centre[7] += 0.15 * tight * square * s
        return centre, precision

    def surprise(self, heights: FloatArray, radius: float) -> float:
        """Returns how improbable mode amplitudes (SHAPES,) [m] are under the prior."""
        centre, precision = self.conditional(heights, radius)
        deviation = heights - centre
        return self.rare + TUNING.prior_surprise * float(deviation @ precision @ deviation)

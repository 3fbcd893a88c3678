"""The truth liquid: what the container really holds while the nodes estimate and measure it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_bringup.cell.motions import Motion
from slosh_model.constants import GRAVITY
from slosh_model.model import Model
from slosh_model.simulate import Inputs, simulate

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TruthLiquid:
    """The liquid's answer to a motion.

    Attributes:
        t: (N,) time [s].
        sh_x, sh_y: (N,) wall height at +x and +y [m]; the wall's height at an azimuth φ is
            sh_x cos φ + sh_y sin φ.
    """

    t: Array
    sh_x: Array
    sh_y: Array

    def at(self, t: float) -> tuple[float, float]:
        """Wall height at +x and +y at a moment, interpolated [m]."""
        # Of two rows alone: for each moment np.interp would copy the whole of a long motion.
        start = max(min(int(np.searchsorted(self.t, t)), len(self.t) - 1) - 1, 0)
        rows = slice(start, start + 2)
        here = self.t[rows]
        return (
            float(np.interp(t, here, self.sh_x[rows])),
            float(np.interp(t, here, self.sh_y[rows])),
        )


def integrate_truth(model: Model, motion: Motion) -> TruthLiquid:
    """The truth liquid of a motion, from rest.

    A tilted container's liquid feels gravity from the side, a = Rᵀ(a + g ẑ) − g ẑ: the truth
    always does, whatever effects its model names.

    Args:
        model: the truth model.
        motion: the container's motion.
    """
    felt = motion.specific_force() - np.array([0.0, 0.0, GRAVITY])
    response, _ = simulate(model, Inputs(motion.t, felt))
    return TruthLiquid(response.t, response.sh_x, response.sh_y)

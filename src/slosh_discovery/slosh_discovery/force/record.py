"""A measured force and the motion of the container."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.types import Array
from slosh_model.simulate import Inputs


@dataclass(frozen=True, slots=True, eq=False)
class ForceRecord:
    """A motion, and the force that a sensor under the container measured during it.

    Attributes:
        name: of the recording.
        inputs: the motion.
        t: (K,) of the forces, on the clock of the motion but for a delay [s].
        force: (K, 3) in the sensor's axes, which may lie anyhow to the container's [N]; NaN: none.
    """

    name: str
    inputs: Inputs
    t: Array
    force: Array

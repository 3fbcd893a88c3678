"""Results of an identification from the force under a container."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.types import Array
from slosh_discovery.force.tuning import TUNING
from slosh_estimator.sensed.payload import UNITS


@dataclass(frozen=True, slots=True)
class Measured:
    """An identified number, its standard error, and the model's value of it.

    Attributes:
        value: in SI units.
        error: one standard error; NaN: not known.
        model: what the model says of it; NaN: nothing.
    """

    value: float
    error: float
    model: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class ForceIdentification:
    """The values identified from a measured force.

    Attributes:
        name: of the recording.
        natural_frequency: of the first mode along the motion [rad/s].
        damping_ratio: of it.
        sloshing_mass: of it [kg].
        payload: mass of container and liquid, as far as the sensor carries it [kg].
        delay: by which the force is later than the motion [s].
        directions: for each direction of the motion, its unit vector in the container's axes and
            that of the force that accelerates the payload in the sensor's, (3,) each.
        stiffness: α of the cubic spring of high waves; None: the container has none.
        noise_at_rest, noise_moving: standard deviation of the residual below the cutoff [N].
        cutoff: frequency below which the force was used [Hz].
        unit: of the force as recorded.
        unobserved: what this record cannot tell, in a sentence; empty: nothing of this.
        notes: what was left out or assumed, a sentence each.
        t: (n,) times of the fitted forces [s].
        measured, modelled: (n, k) force along the sensor's directions, below the cutoff [N].
        liquid: (n, k) the liquid's part of the modelled one [N].
    """

    name: str
    natural_frequency: Measured
    damping_ratio: Measured
    sloshing_mass: Measured
    payload: Measured
    delay: Measured
    directions: tuple[tuple[Array, Array], ...]
    stiffness: Measured | None
    noise_at_rest: float
    noise_moving: float
    cutoff: float
    unit: str
    unobserved: str
    notes: tuple[str, ...]
    t: Array
    measured: Array
    modelled: Array
    liquid: Array


NEWTON = "N"


def likely_unit(mass: float, expected: float) -> str:
    """Returns the unit of force for which the sloshing mass best matches the model's [kg].

    Newton, where no unit fits much better: the mass may be another one.
    """
    if not (expected > 0.0 and math.isfinite(expected) and mass > 0.0):
        return NEWTON
    off = {unit: abs(math.log(mass * factor / expected)) for unit, factor in UNITS.items()}
    best = min(off, key=lambda unit: off[unit])
    return best if off[best] < math.log(TUNING.unit) else NEWTON

"""Checks whether a force in motion is that of the identified payload: sign, unit, axes."""

from __future__ import annotations

import math

from slosh_estimator.sensed.payload import UNITS, Payload
from slosh_estimator.tuning import TUNING


class LoadCheck:
    """Compares the mass that force and acceleration in motion give with the identified mass.

    Args:
        payload: as it was identified.

    Attributes:
        wrong: in one line what is wrong with the force; empty if nothing is known to be.
    """

    def __init__(self, payload: Payload) -> None:
        self._payload = payload
        self._product = self._square = 0.0
        self._blocks = 0
        self.wrong = ""

    def add(self, forces: list[float], pushes: list[float]) -> None:
        """Adds the forces of a block of time in which the container moved to the check.

        Args:
            forces: less the sensor's zero, along each direction [N].
            pushes: acceleration along each direction [m/s²].
        """
        kept = TUNING.load_memory
        product = math.fsum(f * a for f, a in zip(forces, pushes, strict=True))
        self._product = kept * self._product + product
        self._square = kept * self._square + math.fsum(a * a for a in pushes)
        self._blocks += 1
        if self._blocks >= TUNING.load_least:
            self.wrong = self._judged(self._product / self._square / self._payload.mass)

    def _judged(self, ratio: float) -> str:
        """Explains a wrong ratio of measured to identified mass in one line; else empty."""
        if 1.0 / TUNING.load_wrong < ratio < TUNING.load_wrong:
            return ""
        told = f"the force in motion is {ratio:.2g} times that of the identified payload: "
        if ratio < 0.0 and 1.0 / TUNING.load_wrong < -ratio < TUNING.load_wrong:
            return told + "its sign is reversed; mount the sensor as identified, or identify anew"
        for unit, newton in UNITS.items():
            if abs(math.log(max(abs(ratio), 1e-12) * newton / self._payload.newton)) < math.log(
                TUNING.load_unit
            ):
                return told + f"it seems to be in {unit}; publish the unit of the identification"
        return told + "axes, unit or payload are others; identify anew"

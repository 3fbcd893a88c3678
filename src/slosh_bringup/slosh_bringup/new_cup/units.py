"""Quantities of a cup and its liquid; a value that looks like another unit is refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from slosh_bringup.errors import SloshBringupError

_LENGTHS = {"mm": 1e-3, "cm": 1e-2}


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a value of a kind can be.

    Attributes:
        words: what it is, for people.
        unit: SI.
        least: smallest value that is taken.
        most: largest value that is taken.
        typical: of two units that a refused value may be in, the one nearer to this is proposed.
        others: units that people type by mistake, in SI.
    """

    words: str
    unit: str
    least: float
    most: float
    typical: float
    others: Mapping[str, float]

    def check(self, name: str, value: float) -> float:
        """The value, where it can be one.

        Args:
            name: how the refusal calls it.
            value: in SI.

        Raises:
            SloshBringupError: it is outside the limits; with the unit that it looks like.
        """
        if math.isfinite(value) and self.least <= value <= self.most:
            return value
        told = f"{name} = {value:g} {self.unit}"
        guess = self._guess(value)
        if guess is not None:
            raise SloshBringupError(
                f"{told}: did you mean {value * self.others[guess]:g} ({value:g} {guess})?"
            )
        raise SloshBringupError(f"{told}: must be {self.least:g} to {self.most:g} {self.unit}")

    def _guess(self, value: float) -> str | None:
        """The unit that the value is likely in."""
        likely = [
            unit for unit, size in self.others.items() if self.least <= value * size <= self.most
        ]
        return min(
            likely, key=lambda unit: self._distance(value * self.others[unit]), default=None
        )

    def _distance(self, value: float) -> float:
        return abs(math.log(value / self.typical)) if value > 0.0 else math.inf


def _length(words: str, least: float, most: float, typical: float) -> Quantity:
    return Quantity(words, "m", least, most, typical, _LENGTHS)


# From a test tube to a tank on wheels.
QUANTITIES: Mapping[str, Quantity] = {
    "radius": _length("inner radius", 2e-3, 2.0, 0.05),
    "diameter": _length("inner diameter", 4e-3, 4.0, 0.1),
    "width": _length("inner width along x", 4e-3, 4.0, 0.1),
    "depth": _length("inner depth along y", 4e-3, 4.0, 0.1),
    "fill_height": _length("height of the liquid at rest above the inner floor", 2e-3, 4.0, 0.07),
    "rim_height": _length("height of the rim above the inner floor", 2e-3, 4.0, 0.12),
    "wall": _length("thickness of the wall", 0.0, 0.05, 2e-3),
    "density": Quantity("density", "kg/m3", 100.0, 2e4, 1e3, {"g/cm3": 1e3}),
    "viscosity": Quantity(
        "kinematic viscosity", "m2/s", 1e-8, 0.02, 1e-6, {"mm2/s": 1e-6, "cm2/s": 1e-4}
    ),
}
"""By the option's name."""

"""Properties of a container that stands loosely on a tray."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_model.checks import within

BOUNDS = {
    "mass": ("kg", 1e-4, 1e3),
    "centre_height": ("m", 0.0, 2.0),
    "base_radius": ("m", 1e-3, 2.0),
    "friction": ("", 1e-3, 5.0),
}
"""Unit, least and largest value of each number."""


@dataclass(frozen=True, slots=True)
class Standing:
    """Mass, base and friction of an empty container that stands on a tray.

    >>> Standing(mass=0.15, centre_height=0.05, base_radius=0.03, friction=0.3).friction
    0.3

    Attributes:
        mass: of the empty container [kg].
        centre_height: of its centre of mass above the base [m].
        base_radius: of the circle on which it stands; of another base the inscribed circle [m].
        friction: coefficient between base and tray, at rest [1].

    Raises:
        SloshModelError: a number outside BOUNDS.
    """

    mass: float
    centre_height: float
    base_radius: float
    friction: float

    def __post_init__(self) -> None:
        for name, (unit, least, most) in BOUNDS.items():
            within(f"standing.{name}", getattr(self, name), unit, least, most)

"""What an effect is."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from numba import njit

from slosh_model.errors import SloshModelError
from slosh_model.modes import Mode

Parameters = Mapping[str, float]

compiled = njit(error_model="numpy")
"""Compiles a term; a division by zero gives inf or NaN, whose check would double the cost."""

# A compiled function of (mode, elapsed, q, inputs, p) -> (fx, fy, mxx, mxy, myy).
# mode: (ω [rad/s], ζ, C, R [m]); elapsed: time since rest [s]; q: (x, y, vx, vy), the mass's
# place [m] and velocity [m/s]; inputs: (ax, ay, az), the container's acceleration [m/s²]; p: the
# effect's parameters in their order. It returns what the effect adds to (I + m) q̈ = f: force per
# modal mass [m/s²] and, symmetric, relative mass [1]. mode and inputs are tuples so that what a
# later effect needs can be appended without a change to the others.
Term = Callable[..., tuple[float, float, float, float, float]]


class Stage(Enum):
    """Where an effect acts."""

    INPUT = "input"
    DYNAMICS = "dynamics"
    HEIGHT = "height"
    MEASUREMENT = "measurement"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an effect.

    Attributes:
        name: as in model.yaml.
        unit: SI unit, '1' for none.
        lower, upper: bounds, both allowed.
        neutral: the value at which the effect does nothing; None: there is none.
        description: what it means.
        default: used where model.yaml gives none; None: it must be given.
    """

    name: str
    unit: str
    lower: float
    upper: float
    neutral: float | None
    description: str
    default: float | None = None

    def check(self, owner: str, value: float) -> float:
        """The value as float.

        Raises:
            SloshModelError: it is not a finite number within the bounds.
        """
        if not (math.isfinite(value) and self.lower <= value <= self.upper):
            raise SloshModelError(
                f"{owner}.{self.name} = {value!r} must lie in [{self.lower:g}, {self.upper:g}]"
                + (f" {self.unit}" if self.unit != "1" else "")
            )
        return float(value)


@dataclass(frozen=True, slots=True)
class Effect:
    """A physical or measurement effect that a model may include.

    Attributes:
        name: id, as in model.yaml.
        title: a few words for people.
        stages: where it acts.
        equation: what it adds, as LaTeX.
        source: paper and equation.
        parameters: in the order in which `term` receives them.
        term: adds to the equations of motion of every mode (stage DYNAMICS).
        modes: replaces the modes before anything else is computed (DYNAMICS, HEIGHT).
        height_gain: replaces a mode's wall height per displacement [1] (HEIGHT).
    """

    name: str
    title: str
    stages: tuple[Stage, ...]
    equation: str
    source: str
    parameters: tuple[Parameter, ...] = ()
    term: Term | None = None
    modes: Callable[[tuple[Mode, ...], Parameters], tuple[Mode, ...]] | None = None
    height_gain: Callable[[Mode, Parameters], float] | None = None

    def complete(self, given: Parameters) -> dict[str, float]:
        """All parameters in order: the given ones, checked, and the defaults.

        Raises:
            SloshModelError: a parameter is unknown, missing or out of bounds.
        """
        owner = f"effect {self.name}"
        names = [parameter.name for parameter in self.parameters]
        for name in given:
            if name not in names:
                known = ", ".join(names) or "none"
                raise SloshModelError(f"{owner}: unknown parameter {name!r} (known: {known})")
        values: dict[str, float] = {}
        for parameter in self.parameters:
            value = given.get(parameter.name, parameter.default)
            if value is None:
                raise SloshModelError(f"{owner}: parameter {parameter.name!r} is missing")
            values[parameter.name] = parameter.check(owner, value)
        return values

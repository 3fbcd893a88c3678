"""Base classes of the effects: stages, parameters and equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from slosh_base.compiled.compilation import compiled
from slosh_base.files.nearest import did_you_mean
from slosh_model.errors import SloshModelError
from slosh_model.modes import Mode

Parameters = Mapping[str, float]

__all__ = ["SETTLING", "Effect", "Parameter", "Parameters", "Stage", "compiled"]

# The compiled hooks. `slosh_model.indices` names what stands where in the tuples mode, q, inputs,
# pose and wall, and in what `term` gives back.
#   elapsed: time since rest [s]; p: the effect's parameters in their order;
#   memory: an array of the effect's own, zero at the start, to write to.

# (mode, elapsed, q, inputs, p) -> (fx, fy, mxx, mxy, myy), what the effect adds to (I + m) q̈ = f.
Term = Callable[..., tuple[float, float, float, float, float]]
# (mode, elapsed, p) -> mode: the mode's constants at a moment.
Modulation = Callable[..., tuple[float, ...]]
# (dt, inputs, pose, memory, p) -> inputs, dt: time since the sample before [s]; 0 for the first;
# SETTLING for the constant input at which the liquid has come to rest before the first.
Drive = Callable[..., tuple[float, float, float, float]]
# (dt, eta, wall, memory, p) -> eta, what the sensor reads of a height [m].
Reading = Callable[..., float]

SETTLING = -1.0
"""In place of dt: the input before the first sample, since ever."""


class Stage(Enum):
    """Stage of the computation at which an effect acts."""

    INPUT = "input"
    DYNAMICS = "dynamics"
    HEIGHT = "height"
    MEASUREMENT = "measurement"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a modelled effect, with bounds and unit.

    Attributes:
        name: as in model.yaml.
        unit: SI unit, '1' for none.
        lower, upper: bounds, both allowed.
        neutral: the value at which the effect does nothing; None: there is none.
        description: what it means.
        default: used where model.yaml gives none; None: it must be given.
        expected: where a discovery expects it; None: at its neutral value.
        choices: the values that it may have, where it chooses between variants; None: any.
        plausible: where it usually lies, and where a discovery looks. None: within the bounds.
        spread: standard deviation about what is expected of what people and rigs have wrong; a
            discovery weighs by it what it finds. None: all that is plausible is as likely.
        starts: where a fit may start; empty: in the middle of what is plausible.
    """

    name: str
    unit: str
    lower: float
    upper: float
    neutral: float | None
    description: str
    default: float | None = None
    choices: tuple[float, ...] | None = None
    plausible: tuple[float, float] | None = None
    spread: float | None = None
    expected: float | None = None
    starts: tuple[float, ...] = ()

    def check(self, owner: str, value: float) -> float:
        """Returns a parameter's value as a float, or raises an error if it is out of bounds.

        Raises:
            SloshModelError: it is not a finite number within the bounds.
        """
        if not (math.isfinite(value) and self.lower <= value <= self.upper):
            raise SloshModelError(
                f"{owner}.{self.name} = {value!r} must lie in [{self.lower:g}, {self.upper:g}]"
                + (f" {self.unit}" if self.unit != "1" else ""),
                (self.name,),
            )
        if self.choices is not None and value not in self.choices:
            known = " or ".join(f"{choice:g}" for choice in self.choices)
            raise SloshModelError(f"{owner}.{self.name} = {value!r} must be {known}", (self.name,))
        return float(value)


@dataclass(frozen=True, slots=True)
class Effect:
    """A physical effect or measurement error that a model may include.

    Attributes:
        name: id, as in model.yaml.
        title: a few words for people.
        meaning: what it is physically, in one sentence without signs.
        stages: where it acts.
        equation: what it adds, as LaTeX.
        source: paper and equation.
        parameters: in the order in which `term` receives them.
        order: effects of one stage act in this order, then by name.
        needs_rotation: whether it does nothing while the container does not turn.
        of_rig: whether its parameters belong to how sensors and rig were set up, so that they may
            be others after they were set up anew; else to the liquid and the container.
        odds: how likely it is before any data, relative to any other effect; a discovery names
            what has small odds only where nothing else is plausible.
        sections: kinds of containers for which it has a meaning (SECTIONS); empty: all.
        instead: what to do in a container whose modes are computed, for people.
        drive: changes what drives the liquid (INPUT).
        drive_memory: length of its memory.
        modes: replaces the modes before anything else is computed (DYNAMICS, HEIGHT).
        modulation: changes a mode's constants with time (DYNAMICS, HEIGHT).
        term: adds to the equations of motion of every mode (DYNAMICS).
        height_gain: replaces a mode's wall height per displacement [1] (HEIGHT).
        static_share: of what the modes leave of the height under a constant acceleration, the
            share that follows the acceleration at once [1] (HEIGHT).
        reading: changes what is measured of a height (MEASUREMENT).
        reading_memory: length of its memory.
        delay: by how much the measurement comes late at the first sample [s] (MEASUREMENT).
        drift: by how much that grows in a second [1] (MEASUREMENT); only beside a delay.
    """

    name: str
    title: str
    stages: tuple[Stage, ...]
    equation: str
    source: str
    meaning: str = ""
    parameters: tuple[Parameter, ...] = ()
    order: int = 0
    needs_rotation: bool = False
    of_rig: bool = False
    odds: float = 1.0
    sections: tuple[str, ...] = ()
    instead: str = ""
    drive: Drive | None = None
    drive_memory: int = 0
    modes: Callable[[tuple[Mode, ...], Parameters], tuple[Mode, ...]] | None = None
    modulation: Modulation | None = None
    term: Term | None = None
    height_gain: Callable[[Mode, Parameters], float] | None = None
    static_share: Callable[[Parameters], float] | None = None
    reading: Reading | None = None
    reading_memory: int = 0
    delay: Callable[[Parameters], float] | None = None
    drift: Callable[[Parameters], float] | None = None

    def fits(self, section: str) -> bool:
        """Returns whether the effect applies to containers of a cross-section, such as round."""
        return not self.sections or section in self.sections

    def complete(self, given: Parameters) -> dict[str, float]:
        """Returns all parameters of the effect in order: given values, else the defaults.

        Raises:
            SloshModelError: a parameter is unknown, missing or out of bounds.
        """
        owner = f"effect {self.name}"
        names = [parameter.name for parameter in self.parameters]
        for name in given:
            if name not in names:
                known = ", ".join(names) or "none"
                raise SloshModelError(
                    f"{owner}: unknown parameter {name!r:.60} (known: {known})"
                    f"{did_you_mean(name, names)}",
                    (name,),
                )
        values: dict[str, float] = {}
        for parameter in self.parameters:
            value = given.get(parameter.name, parameter.default)
            if value is None:
                raise SloshModelError(f"{owner}: parameter {parameter.name!r} is missing")
            values[parameter.name] = parameter.check(owner, value)
        return values

"""Moves the simulated container and its reference liquid by the governor's output."""

from __future__ import annotations

import bisect
import math
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
import scipy

from slosh_base.types import Array
from slosh_bringup.cell.motions import CellMotion
from slosh_bringup.cell.truth import Push, integrate_truth
from slosh_bringup.errors import SloshBringupError
from slosh_model.model import Model
from slosh_model.simulate import Simulator
from slosh_plan.heights import msh_of


def commanded_velocity(motion: CellMotion) -> Array:
    """Returns the velocity (N, 3) [m/s] of a motion from rest, as commanded by an operator.

    Raises:
        SloshBringupError: the motion turns the container, which no velocity does.
    """
    if motion.attitude is not None and np.ptp(motion.attitude, axis=0).max() > 0.0:
        raise SloshBringupError(
            f"{motion.name}: turns the container: a governor takes velocities only"
        )
    found: Array = scipy.integrate.cumulative_trapezoid(
        motion.acceleration, motion.t, axis=0, initial=0
    )
    return found


LATE = 1.5
"""Periods of a governor between two steps that are late."""


class CupSample(NamedTuple):
    """Acceleration, velocity and position of the container at one time.

    Attributes:
        t: time since the governor's first step [s].
        acceleration, velocity, position: (3,) in the world's axes [m/s², m/s, m].
    """

    t: float
    acceleration: Array
    velocity: Array
    position: Array


@dataclass(frozen=True, slots=True)
class GovernedOutcome:
    """Comparison of a governed motion with its commands: distance and liquid height.

    Attributes:
        limit: of the height, that the governor keeps [m].
        highest: greatest height of the reference liquid [m].
        ungoverned: that of the commands without a governor, simulated [m].
        distance, commanded: covered and commanded way [m].
        steps: of the governor.
        lost: those of them that did not arrive.
        late: those that began more than LATE periods after the one before: a safe stop that
            they interrupt may not be one any more.
    """

    limit: float
    highest: float
    ungoverned: float
    distance: float
    commanded: float
    steps: int = 0
    lost: int = 0
    late: int = 0

    @property
    def slower(self) -> float:
        """Relative reduction of the mean speed by the governor; NaN if no motion is commanded."""
        return 1.0 - self.distance / self.commanded if self.commanded > 0.0 else math.nan

    def document(self) -> dict[str, float]:
        """Returns the comparison's values as a dictionary for JSON, in SI units."""
        return asdict(self)

    def rows(self) -> dict[str, str]:
        """Returns the comparison's values as texts for display, by name."""
        reached = f"at most {1e3 * self.highest:.1f} mm of {1e3 * self.limit:g} mm"
        slower = f", {1e2 * self.slower:.0f} % slower than commanded" if self.slower > 0.0 else ""
        found = {
            "governed height": f"{reached}; the commands alone {1e3 * self.ungoverned:.1f} mm",
            "governed distance": f"{self.distance:.2f} of {self.commanded:.2f} m{slower}",
        }
        if self.late or self.lost:
            many = f"{self.late} of {self.steps} late, {self.lost} lost"
            found["governed steps"] = f"{many}: the limit holds for steps on time only"
        return found


class GovernedStep(NamedTuple):
    """Velocity and acceleration that a governor sets for the end of one of its steps.

    Attributes:
        number: of the step, from 1.
        end: its time since the first step's begin [s].
        velocity, acceleration: (3,) in the world's axes [m/s, m/s²].
    """

    number: int
    end: float
    velocity: Array
    acceleration: Array


class GovernedCup:
    """Simulated container that follows the velocities of a governor's steps.

    Between two steps the acceleration is linear in time, as the governor has it. Where a step
    comes early or late, all of it is a little higher or lower, so that the velocity is reached.

    Args:
        model: of the reference liquid.
        rate: samples of the motion per second.
        period: of the governor [s].
        push: by hand, at a time since the first step; None: there is none.

    """

    def __init__(self, model: Model, rate: float, period: float, push: Push | None = None) -> None:
        self._model, self._rate, self._push = model, rate, push
        self._longest, self._lost, self._late = LATE * period, 0, 0
        self._liquid = Simulator(model)
        rest = np.zeros(3)
        self._step = GovernedStep(0, 0.0, rest, rest)
        self._last = CupSample(0.0, rest, rest, rest)
        self._t, self._heights = [0.0], [self._liquid.step(0.0, 0.0, 0.0, 0.0)]
        self._distance = 0.0

    @property
    def now(self) -> float:
        """Time since the governor's first step up to which the motion is computed [s]."""
        return self._last.t

    def move(self, step: GovernedStep) -> list[CupSample]:
        """Moves the container to the end of a step; returns the samples of this motion.

        Raises:
            SloshBringupError: a step or a time that is not after the last one, or a velocity or
                acceleration that is not finite.
        """
        before, begun = self._step, self._last
        if (
            step.number <= before.number
            or not step.end > before.end
            or not np.isfinite([*step.velocity, *step.acceleration]).all()
        ):
            raise SloshBringupError(
                f"step {step.number} of the governor, at {step.end:.3f} s, follows step "
                f"{before.number}, at {before.end:.3f} s, with an acceleration of "
                f"{step.acceleration.tolist()} m/s²"
            )
        self._lost += step.number - before.number - 1
        self._late += before.number > 0 and step.end - before.end > self._longest
        self._step = step
        # A hair of tolerance: a step ends at a sample.
        first, last = (math.floor(self._rate * t + 1e-6) for t in (begun.t, step.end))
        t = np.arange(first, last + 1) / self._rate
        if len(t) < 2:
            return []
        change = (step.acceleration - before.acceleration) / (step.end - before.end)
        rows = before.acceleration + np.outer(t - before.end, change)
        rows[0] = begun.acceleration
        gained: Array = scipy.integrate.trapezoid(rows, t, axis=0)
        reached = step.velocity - (step.end - t[-1]) * step.acceleration
        rows[1:] += (reached - begun.velocity - gained) / (t[-1] - t[0] - 0.5 / self._rate)
        return [self._reach(*pair) for pair in zip(t[1:].tolist(), rows[1:], strict=True)]

    def _reach(self, t: float, acceleration: Array) -> CupSample:
        """Moves the container to the next sample with constant jerk, and advances the liquid."""
        last = self._last
        after, a, v = t - last.t, last.acceleration, last.velocity
        here = CupSample(
            t,
            acceleration,
            v + 0.5 * after * (a + acceleration),
            last.position + after * (v + after * (2.0 * a + acceleration) / 6.0),
        )
        felt = acceleration
        if self._push is not None:
            felt = felt + self._push.acceleration(np.array([t]))[0]
        self._heights.append(self._liquid.step(after, *felt.tolist()))
        self._t.append(t)
        self._distance += float(np.linalg.norm(here.position - last.position))
        self._last = here
        return here

    def at(self, t: float) -> tuple[float, float]:
        """Returns liquid heights [m] at the wall at +x and +y at a time from the first step."""
        place = bisect.bisect_left(self._t, t, hi=len(self._t) - 1)
        rows = slice(max(place - 1, 0), place + 1)
        x, y = np.transpose(self._heights[rows])
        return float(np.interp(t, self._t[rows], x)), float(np.interp(t, self._t[rows], y))

    def outcome(self, motion: CellMotion, limit: float) -> GovernedOutcome:
        """Compares the motion so far with the commanded one.

        Args:
            motion: that was commanded.
            limit: of the height, that the governor keeps [m].
        """
        alone = integrate_truth(self._model, motion, self._push)
        container = self._model.container
        both = np.column_stack([alone.sh_x, alone.sh_y])
        speed = np.linalg.norm(commanded_velocity(motion), axis=1)
        return GovernedOutcome(
            limit,
            float(msh_of(container, np.array(self._heights)).max()),
            float(msh_of(container, both).max()),
            self._distance,
            float(scipy.integrate.trapezoid(speed, motion.t)),
            self._step.number,
            self._lost,
            self._late,
        )

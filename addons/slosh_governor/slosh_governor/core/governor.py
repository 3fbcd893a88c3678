"""Limits a commanded motion in real time so that the liquid stays below its height limit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.core import layout
from slosh_governor.core.commands import (
    Command,
    Governed,
    GovernorState,
    ModelDoubt,
    SeenLiquid,
    StopReason,
)
from slosh_governor.core.cups import cups_of
from slosh_governor.core.doubts import LiquidDoubts
from slosh_governor.core.mechanics import Mechanics
from slosh_governor.core.requests import Requests
from slosh_governor.core.results import Results
from slosh_governor.core.robot_arm import GovernedArm
from slosh_governor.core.step_clock import StepClock
from slosh_governor.core.unknown import Cause
from slosh_governor.tuning import TUNING
from slosh_model.model import Model
from slosh_model.tray import Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import first_period
from slosh_plan.planning.limits import PlanLimits

MOST_STEPS = 10_000
PERIODS = (1e-3, 0.05)
"""Shortest and longest time of a step [s]."""


class Governor:
    """Limits commanded motions so that the liquid stays below its limit; advances step by step.

    Unless the liquid is at rest at the first step it may have its largest wave then, which decays
    from the first call on: `safe` is false until half of the limit is left for the motion, which
    is all that is used meanwhile. Each call makes one step of `period`. Where a step is late, the
    robot has held its velocity: the liquid is advanced by that time first. Where the steps are
    early by a period, the motion of the last step is repeated. A step that comes late by itself is
    a reason to stop. What the liquid may have done by uneven steps, a clock that jumps, or others
    who move the container is added to the unknown wave, and so is what an observer tells
    otherwise than the models. An observer that is proven to see the liquid bounds it.

    >>> from slosh_model import Model
    >>> from slosh_plan.planning.limits import PlanLimits
    >>> cup = Model.from_cup(diameter=0.08, fill_height=0.06)
    >>> governor = Governor(cup, PlanLimits(0.01), at_rest=True)
    >>> governor.take(Command(0, (0.3, 0.0, 0.0)))
    >>> moved = governor.step(1_000_000)
    >>> moved.share, moved.safe
    (1.0, True)

    Args:
        held: the container's model, or a tray; NL twins of its models decide.
        limits: to keep: height, acceleration and jerk of the origin; each container of a tray
            keeps its own height, too, and stands if it stands loosely.
        doubt: by how much the liquids may differ from the models.
        period: time of a step [s].
        timeout: a command holds for so long [s].
        arm: robot whose joints are commanded; None: x, y, z of the upright container are.
        carrier: robot that carries the upright container, in axes parallel to those of its root,
            and whose joints keep their limits; None: unknown. Not with `arm`.
        at_rest: whether the liquids are at rest at the first step; else they are unknown.

    Attributes:
        model: the first container's NL twin.
        limits: with the first container's rim.
        period, timeout, arm: as given.

    Raises:
        SloshPlanError: an infinite or impossible limit, an impossible period, a container that
            cannot be kept safe.
    """

    def __init__(
        self,
        held: Model | Tray,
        limits: PlanLimits,
        *,
        doubt: ModelDoubt | None = None,
        period: float = 1.0 / TUNING.rate,
        timeout: float = TUNING.timeout,
        arm: GovernedArm | None = None,
        carrier: GovernedArm | None = None,
        at_rest: bool = False,
    ) -> None:
        if not PERIODS[0] <= period <= PERIODS[1]:
            raise SloshPlanError(f"period = {period!r} s must lie in 0.001 … 0.05 s")
        tray = held if isinstance(held, Tray) else Tray((TrayContainer("", held),))
        cups = cups_of(tray, limits, turns=arm is not None)
        self.model, self.limits = cups[0].model, cups[0].limits
        self.period, self.timeout, self.arm = period, timeout, arm
        doubt = doubt or ModelDoubt()
        self._mechanics = Mechanics(cups, limits, doubt, period, arm, carrier)
        self._doubts = LiquidDoubts(
            self._mechanics, doubt, period, timeout, at_rest=at_rest, watched=not tray.first.empty
        )
        self._clock = StepClock(period, first_period(self.model), timeout)
        self._requests = Requests(self._mechanics.motion.shape[1], timeout, arm)
        self._results = Results(self._mechanics, self._doubts, self._requests)
        self._steps = 0
        self._last: Governed | None = None

    def take(self, command: Command) -> None:
        """Stores a command for the next step; it replaces the previous command."""
        self._requests.take(command)

    def see(self, liquid: SeenLiquid) -> str:
        """Stores an observed state of the first container's liquid, which the next step uses.

        Returns:
            why it is not used; empty: it is.
        """
        return self._doubts.see(liquid)

    def wait_since(self, stamp_ns: int) -> None:
        """Sets since when the unknown wave of the start decays [ns]; 0: there is none."""
        self._doubts.since_ns = stamp_ns

    def stop(self) -> None:
        """Requests a stop of the motion from the next step on, which lasts until `release`."""
        self._requests.reason = StopReason.REQUESTED

    def locate(self, places: Sequence[float]) -> str:
        """Compares measured positions (J,) of the joints; at rest, adopts them as the new start.

        Returns:
            why they make the next step a stop; empty: they do not.
        """
        measured, carrier = np.array(places, dtype=np.float64), self._mechanics.carrier
        doubt = carrier.doubt(measured, rests=self.rests)
        self._requests.lost = bool(doubt)
        if self.rests and not doubt and carrier.differs(measured):
            self._doubts.move(carrier.way_to(measured), begun=self._clock.has_begun)
            carrier.start_at(measured, self.place)
            self._results.start_at(tuple(measured.tolist()))
        return doubt

    def lose(self, *, lost: bool) -> None:
        """Sets whether the joints' positions are unknown, which makes the governor stop."""
        self._requests.lost = lost

    def go_on(self, before: Governor) -> None:
        """Takes over the place of the container and that of its targets from a governor at rest.

        For another container, or another model of it, in the same robot: without this the next
        target would be taken for the present place. Joints know their places themselves.
        """
        if self.arm is None and before.arm is None:
            self._mechanics.motion[layout.PLACE] = before.place
            self._requests.origin = before._requests.origin

    def release(self) -> bool:
        """Ends a requested stop if the container is at rest; returns whether it did."""
        return self._requests.release(rests=self.rests)

    @property
    def rests(self) -> bool:
        """Whether the container is at rest: zero velocity and acceleration."""
        return self._mechanics.rests

    @property
    def commands(self) -> int:
        """Number of commands that `take` has received."""
        return self._requests.count

    @property
    def place(self) -> Array:
        """Position (D,): displacement from the start [m], or joint positions [rad or m]."""
        place: Array = self._mechanics.motion[layout.PLACE].copy()
        return place

    @property
    def joints(self) -> Array:
        """The robot's joint velocities, accelerations and positions (3, J); J = 0: unknown."""
        return self._mechanics.joints

    def idle(self, now_ns: int) -> Governed:
        """Returns the result to publish before the first command: the container is at rest."""
        self._doubts.idle(now_ns)
        self._doubts.allow()
        self._results.idle()
        told = self._results.governed(now_ns, self._steps, share=0.0, safe=True)
        return told._replace(state=GovernorState.RESTING)

    def step(self, now_ns: int) -> Governed:
        """Computes the container's motion for the next step.

        Args:
            now_ns: the present moment [ns].
        """
        self._steps += 1
        rests, requests = self.rests, self._requests
        since = self._clock.since(now_ns)
        early = self._clock.arrive(now_ns) and not rests
        requests.look(now_ns, since, late=self._clock.is_late, rests=rests)
        if early and self._last is not None:
            return self._repeated(self._last, now_ns)
        lapse = self._clock.make(now_ns)
        if lapse is None:
            self._doubts.begin(now_ns)
        else:
            self._doubts.make_up(lapse)
        self._doubts.look(now_ns)
        # A stop is not made longer by a wave that has become unknown in it: that wave would be
        # there all the same, and `safe` counts it.
        if requests.reason is StopReason.NONE or rests:
            self._doubts.allow()
        follow = requests.follows
        safe = self._mechanics.govern(requests.velocity(self.place), follow=follow)
        share = float(self._mechanics.answer[layout.SHARE]) if follow else 0.0
        self._last = self._results.governed(now_ns, self._steps, share=share, safe=safe)
        return self._last

    def _repeated(self, last: Governed, now_ns: int) -> Governed:
        """Leaves a step out where the steps are early by a period; repeats the last motion."""
        doubtful = self._clock.left_out()
        if doubtful > 0.0:  # a clock that went back looks the same
            self._doubts.doubt_time(doubtful, Cause.LATE)
        return last._replace(
            stamp_ns=now_ns, reason=self._requests.reason, steps=self._steps,
            commands=self.commands, joint_start=(), age=self._results.age(now_ns),
            wanted=self._results.wanted,
        )  # fmt: skip

    def stopped(self) -> list[Governed]:
        """Simulates a stop until the container is at rest; returns the result of each step.

        A copy of a governor tells so how it will stop.
        """
        self.stop()
        moved, period_ns = list[Governed](), round(self.period * SECOND)
        while not moved or (not self.rests and len(moved) < MOST_STEPS):
            moved.append(self.step(self._clock.last_ns + period_ns))
        return moved

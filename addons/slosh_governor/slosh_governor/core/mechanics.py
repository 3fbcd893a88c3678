"""The governed motion, the models of the liquids in it, and the held stop, for compiled code."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.types import Array
from slosh_governor.core import cups as containers
from slosh_governor.core import kernel, layout, liquids
from slosh_governor.core.carrier import Carrier
from slosh_governor.core.chain import tip
from slosh_governor.core.commands import ModelDoubt
from slosh_governor.core.cups import Cup
from slosh_governor.core.robot_arm import NO_JOINTS, GovernedArm
from slosh_governor.tuning import TUNING
from slosh_model import kernel as model_kernel
from slosh_plan.heights import first_period
from slosh_plan.planning.limits import PlanLimits

AXES = 3


class Mechanics:
    """Arrays of the governor's compiled code, and what they tell; see `layout`.

    Args:
        cups: the containers.
        limits: of the acceleration and jerk of the origin.
        doubt: by how much the liquids may differ from the models.
        period: time of a step [s].
        arm: robot whose joints are commanded; None: x, y, z are.
        carrier: robot that carries the container that is commanded by x, y, z; None: unknown.

    Attributes:
        cups, arm: as given.
        carrier: state of the robot that carries the container.
        stores: (C MODELS, …) models of the liquids at the present moment.
        table: (C, CUP) of the containers.
        motion: (3, D) present velocity, acceleration and place.
        chosen: (P, 3) present acceleration of each point [m/s²].
        told: (C, USES) what the last step uses of the limits; NaN: not looked at.
        answer: (ANSWER,) of the last step.
    """

    def __init__(
        self,
        cups: tuple[Cup, ...],
        limits: PlanLimits,
        doubt: ModelDoubt,
        period: float,
        arm: GovernedArm | None,
        carrier: GovernedArm | None,
    ) -> None:
        self.cups, self.arm, self.carrier = cups, arm, Carrier(carrier)
        self.stores = containers.stores_of(cups, doubt.factors)
        turns = arm is not None
        per_row = containers.steps_of(cups, period)
        spacing = per_row * period
        slowest = max(first_period(cup.model) for cup in cups)
        # Around the level of a tilted container a wave is highest once a period.
        tail = (TUNING.tilted_tail if turns else TUNING.tail) * slowest
        if any(cup.model.modes > 1 for cup in cups):
            tail = TUNING.modes_tail * slowest  # until the crests of all modes have met
        reserve = containers.reserve_of(cups, spacing, doubt.frequency)
        self._settings = _settings(limits, period, per_row, tail, reserve)
        self.table, self._points = containers.table_of(cups, spacing, doubt.frequency, turns=turns)
        self._joints = arm.chain if arm else NO_JOINTS
        size = len(arm.start) if arm else AXES
        free = np.array([[-math.inf], *[[math.inf]] * 4]) * np.ones(AXES)
        self._bounds = arm.bounds if arm else free
        rows = math.ceil((TUNING.longest + tail) / spacing) + 4
        self._stop, self.motion = np.zeros((rows, size)), np.zeros((3, size))
        self._state = np.zeros(layout.STATE)
        self._state[[layout.ROWS, layout.BOUND]] = 1.0, math.inf
        self._state[layout.DURATION] = TUNING.first * slowest
        self.chosen = np.zeros((len(self._points), 3))
        self._before = self.chosen.copy()
        self.told, self.answer = np.zeros((len(cups), layout.USES)), np.zeros(layout.ANSWER)
        self._ranks = np.tile(np.array([0, 1, layout.LIGHT]), (len(cups), 1))
        self._ranks[:, layout.ORDER] = np.arange(len(cups))
        if arm is not None:
            self.motion[layout.PLACE] = arm.start
            self._settle()
        for one in (kernel.govern, liquids.hold, tip, model_kernel.step):
            one.load()

    @property
    def rests(self) -> bool:
        """Whether the container is at rest: zero velocity and acceleration."""
        return not self.motion[: layout.PLACE].any()

    @property
    def joints(self) -> Array:
        """The robot's joint velocities, accelerations and positions (3, J); J = 0: unknown."""
        return self.carrier.joints if self.arm is None else self.motion

    @property
    def first(self) -> Array:
        """Models (MODELS, …) of the first container."""
        return self.models(0)

    def models(self, cup: int) -> Array:
        """Returns the models (MODELS, …) of a container."""
        rows = slice(cup * layout.MODELS, (cup + 1) * layout.MODELS)
        found: Array = self.stores[rows, : int(self.table[cup, layout.SIZE])]
        return found

    def felt(self, cup: int) -> Array:
        """Returns the present acceleration (3,) of a container [m/s²]."""
        found: Array = self.chosen[int(self.table[cup, layout.POINT])]
        return found

    @property
    def felt_lately(self) -> Array:
        """Mean accelerations (C, 3) of the containers in the last step [m/s²]."""
        points = self.table[:, layout.POINT].astype(np.int64)
        found: Array = 0.5 * (self._before + self.chosen)[points]
        return found

    @property
    def moved(self) -> Array:
        """Velocity, acceleration and position (3, 3) of the container's origin."""
        if self.arm is None:
            return self.motion
        moved = np.empty((3, AXES))
        tip(self._joints, self.motion, moved)
        return moved

    def govern(self, wanted: Array, *, follow: bool) -> bool:
        """Makes one step; returns whether it keeps the limits.

        Args:
            wanted: (D,) commanded velocity.
            follow: whether it counts; else the stop goes on.
        """
        self._before[:] = self.chosen
        unsafe = kernel.govern(
            self.stores, self._stop, self.motion, self._state, wanted, follow, self._settings,
            self._bounds, self.table, self._joints, self._points, *self.carrier.arrays,
            self._ranks, self.chosen, self.told, self.answer,
        )  # fmt: skip
        return not unsafe

    def doubt_stop(self) -> None:
        """Takes the held stop for one that nobody has verified."""
        self._state[layout.BOUND] = math.inf

    def hold(self, seconds: float) -> None:
        """Advances motion and liquids by a time [s] in which the robot holds its velocity.

        Its acceleration is zero then, and before and behind that of the motion.
        """
        before = self.chosen.copy()
        self._feel(at_rate=False)
        liquids.hold(
            self.stores, self.motion, seconds, self.table, self._joints, self._points,
            *self.carrier.arrays, self.chosen,
        )  # fmt: skip
        self.chosen[:] = before
        self._feel(at_rate=True)
        self.doubt_stop()

    def _feel(self, *, at_rate: bool) -> None:
        """Lets the liquids feel at once the motion's acceleration, or that of a steady speed."""
        if len(self._joints):
            motion = self.motion.copy()
            motion[layout.RATE] *= at_rate
            liquids.feel(self._joints, self._points, motion, self.chosen)
        else:
            self.chosen *= at_rate
        for cup in range(len(self.cups)):
            felt = self.felt(cup).tolist()
            for store in self.models(cup):
                model_kernel.step(store, 0.0, *felt)

    def _settle(self) -> None:
        """Brings the liquids to rest in containers that are tilted at the start."""
        liquids.feel(self._joints, self._points, self.motion, self.chosen)
        for number, cup in enumerate(self.cups):
            for store in self.models(number):
                containers.settle(store, self.felt(number), first_period(cup.model))


def _settings(
    limits: PlanLimits, period: float, per_row: int, tail: float, reserve: float
) -> Array:
    spacing = per_row * period
    values = {
        layout.PERIOD: period, layout.SPACING: spacing, layout.SUBDIVISION: per_row,
        layout.RESERVE: reserve, layout.ACCELERATION: limits.acceleration,
        layout.JERK: limits.jerk, layout.TAIL: tail,
        layout.SHORTEST: 4.0 * spacing, layout.LONGEST: TUNING.longest,
        layout.RATIO: TUNING.ratio, layout.EARLY: TUNING.early,
        layout.LATE: TUNING.late_bump, layout.ENOUGH: TUNING.enough,
        layout.HASTE: TUNING.haste, layout.SPREAD: TUNING.spread,
        layout.LEAST: TUNING.least * period,
    }  # fmt: skip
    return np.array([values[place] for place in range(layout.SETTINGS)], dtype=np.float64)

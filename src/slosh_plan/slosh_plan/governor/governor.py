"""Executes as much of a commanded motion as the liquid allows; see `governor.kernel`."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_model import kernel as model_kernel
from slosh_model.indices import POSE_COUNT
from slosh_model.layout import MODAL, divided
from slosh_model.model import Model
from slosh_model.simulate import store_of
from slosh_plan.errors import SloshPlanError
from slosh_plan.governor import kernel
from slosh_plan.heights import first_period
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.trajectory import FARTHEST
from slosh_plan.tuning import TUNING

MOST_STEPS = 10_000
PERIODS = (1e-3, 0.05)
"""Shortest and longest time of a step [s]."""


class GovernorState(IntEnum):
    """What the governor does with the command; the values of GovernedMotion.msg."""

    FOLLOWING = 0
    LIMITED = 1
    STOPPING = 2
    RESTING = 3


class StopReason(IntEnum):
    """Reason why the governor stops; values are those of GovernedMotion.msg."""

    NONE = 0
    SILENT = 1
    INVALID = 2
    LATE = 3
    REQUESTED = 4


class Command(NamedTuple):
    """A commanded motion of the container.

    Attributes:
        stamp_ns: when it was sent [ns]; 0: unknown.
        velocity: x, y, z of the container's origin in the world's axes [m/s]; of a target as it
            is approached: the governor computes it.
        target: x, y, z of a place to go to [m]; None: the velocity is commanded. At the first
            target of a run the container is there.
    """

    stamp_ns: int
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    target: tuple[float, float, float] | None = None


class SeenLiquid(NamedTuple):
    """State of the liquid as an observer estimates it.

    Attributes:
        stamp_ns: the moment [ns].
        modal: (modes, 4) x, y, vx, vy of each mode's mass in the NL model [m, m/s].
        stddev: standard deviation of its height [m].
        frequency_factor: natural frequency over the model's, of which heights by displacement
            are the square.
    """

    stamp_ns: int
    modal: Array
    stddev: float
    frequency_factor: float = 1.0


@dataclass(frozen=True, slots=True)
class ModelDoubt:
    """Largest deviation of the liquid from the model that the governor allows for.

    >>> from slosh_plan.governor import ModelDoubt
    >>> ModelDoubt(frequency=0.03, damping=2.0).factors[0]
    (1.0, 1.0)

    Attributes:
        frequency: relative error of the natural frequencies, to either side.
        damping: factor by which the damping ratios may be larger or smaller.

    Raises:
        SloshPlanError: an impossible value.
    """

    frequency: float = 0.03
    damping: float = 2.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.frequency <= 0.3:
            raise SloshPlanError(f"frequency error = {self.frequency!r} must lie in 0 … 0.3")
        if not 1.0 <= self.damping <= 10.0:
            raise SloshPlanError(f"damping factor = {self.damping!r} must lie in 1 … 10")

    @property
    def factors(self) -> tuple[tuple[float, float], ...]:
        """Factors of frequency and damping for each of the models, the nominal one first."""
        e, d = self.frequency, self.damping
        count = kernel.LIGHT - 1
        light = [(1.0 + e * (2.0 * k / count - 1.0), 1.0 / d) for k in range(count + 1)]
        return ((1.0, 1.0), *light, (1.0, d))


class Governed(NamedTuple):
    """The container's motion at the next step, with the governor's state and heights.

    Attributes:
        stamp_ns: of the step [ns]; the motion is that of one period later.
        velocity, acceleration: (3,) of the container's origin in the world's axes [m/s, m/s²].
        position: (3,) since the start [m].
        share: of the command that is followed, 0 … 1.
        state, reason: what the governor does, and why.
        safe: whether the stop that is held keeps the limit for all models.
        peak: highest height in the next step and the stop after it, over all models [m].
        margin: by how much that exceeds the nominal model's [m].
        limit: of the height [m].
        rest: time until the container rests, if it stops now [s].
        age: of the command in force [s]; NaN: its stamp or there is none.
        steps, commands: how many so far.
        liquid_ns: stamp of the last observed state of the liquid that was taken [ns]; 0: none.
    """

    stamp_ns: int
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    position: tuple[float, ...]
    share: float
    state: GovernorState
    reason: StopReason
    safe: bool
    peak: float
    margin: float
    limit: float
    rest: float
    age: float
    steps: int
    commands: int
    liquid_ns: int


class Governor:
    """Computes safe motion from commands, step by step, without reading a clock.

    The liquid is at rest at the first step. It makes one step of `period` at each call, whatever
    the times are; a step that comes late is a reason to stop.

    >>> from slosh_model import Model
    >>> from slosh_plan.planning.limits import PlanLimits
    >>> governor = Governor(Model.from_cup(diameter=0.08, fill_height=0.06), PlanLimits(0.01))
    >>> governor.take(Command(0, (0.3, 0.0, 0.0)))
    >>> moved = governor.step(1_000_000)
    >>> moved.share, moved.safe
    (1.0, True)

    Args:
        model: of the container and its liquid; its NL twin decides.
        limits: to keep: height, acceleration and jerk.
        doubt: by how much the liquid may differ from the model.
        period: time of a step [s].
        timeout: a command holds for so long [s].

    Attributes:
        model: the NL twin.
        limits: with the container's rim.
        period, timeout: as given.

    Raises:
        SloshPlanError: an infinite or impossible limit, an impossible period.
    """

    def __init__(
        self,
        model: Model,
        limits: PlanLimits,
        *,
        doubt: ModelDoubt | None = None,
        period: float = 0.01,
        timeout: float = TUNING.governor_timeout,
    ) -> None:
        if not PERIODS[0] <= period <= PERIODS[1]:
            raise SloshPlanError(f"period = {period!r} s must lie in 0.001 … 0.05 s")
        self.limits, self.period, self.timeout = limits.under_rim(model), period, timeout
        if not math.isfinite(self.limits.height):
            raise SloshPlanError("the governor needs a limit of the height, or a rim")
        self.model = nonlinear = model.nonlinear()
        self._factors = (doubt or ModelDoubt()).factors
        self._stores = np.stack([_twin(nonlinear, *factors) for factors in self._factors])
        fastest = max(mode.natural_frequency for mode in nonlinear.mode_constants())
        per_row = max(math.floor(TUNING.governor_phase / fastest / period), 1)
        spacing = per_row * period
        tail = TUNING.governor_tail * first_period(nonlinear)
        # A crest between two rows is higher than both.
        reserve = (1.0 + TUNING.governor_reserve) / math.cos(0.5 * spacing * fastest) - 1.0
        self._settings = _settings(self.limits, period, per_row, tail, reserve)
        self._how = np.array(
            [
                bool(nonlinear.uses("drive")),
                bool(nonlinear.uses("modulation")),
                math.ceil(spacing * fastest / (2.0 * TUNING.governor_phase)),
            ],
            dtype=np.int64,
        )
        rows = math.ceil((TUNING.governor_longest + tail) / spacing) + 4
        self._stop, self._state = np.zeros((rows, 3)), np.zeros(kernel.STATE)
        self._state[[kernel.ROWS, kernel.BOUND]] = 1.0, math.inf
        self._state[kernel.DURATION] = TUNING.governor_first * first_period(nonlinear)
        self._chosen, self._answer = np.zeros(3), np.zeros(kernel.ANSWER)
        self._past: deque[tuple[int, Array, Array]] = deque(maxlen=TUNING.governor_past)
        self._command: Command | None = None
        self._came = False
        self._seen: SeenLiquid | None = None
        self._origin: Array | None = None
        self._taken_ns = self._last_ns = -(2**62)
        self._steps = self._commands = self._liquid_ns = 0
        self._reason = StopReason.NONE
        kernel.govern.load()

    def take(self, command: Command) -> None:
        """Stores a command; the last one before a step is used."""
        self._commands += 1
        self._command, self._came = command, True

    def see(self, liquid: SeenLiquid) -> None:
        """Stores an observed state of the liquid; the last one before a step is used."""
        self._seen = liquid

    def stop(self) -> None:
        """Requests a stop that begins at the next step and lasts until `release`."""
        self._reason = StopReason.REQUESTED

    def release(self) -> bool:
        """Ends a requested stop if the container is at rest; returns whether it did."""
        if self._reason is StopReason.REQUESTED and self.rests:
            self._reason = StopReason.NONE
            self._command = None
        return self._reason is not StopReason.REQUESTED

    @property
    def rests(self) -> bool:
        """Whether the container is at rest."""
        return not self._state[: kernel.AZ + 1].any()

    def step(self, now_ns: int) -> Governed:
        """Computes the container's motion for the next step.

        Args:
            now_ns: the present moment [ns].
        """
        self._steps += 1
        self._look(now_ns)
        if self._seen is not None:
            self._use(self._seen)
            self._seen = None
        follow = self._reason is StopReason.NONE and self._command is not None
        wanted = self._velocity() if follow else np.zeros(3)
        self._past.append((now_ns, self._stores.copy(), self._chosen.copy()))
        unsafe = kernel.govern(
            self._stores, self._stop, self._state, wanted, follow, self._settings, self._how,
            self._chosen, self._answer,
        )  # fmt: skip
        return self._told(now_ns, follow, not unsafe)

    def _look(self, now_ns: int) -> None:
        """Checks whether there is a reason to stop."""
        late = not 0 < now_ns - self._last_ns <= TUNING.governor_late * self.period * SECOND
        late = late and self._last_ns > -(2**62)
        self._last_ns = now_ns
        if self._came:
            self._came, self._taken_ns = False, now_ns
        reason = StopReason.NONE
        if self._command is not None:
            if not _possible(self._command):
                reason = StopReason.INVALID
            elif now_ns - self._taken_ns > self.timeout * SECOND:
                reason = StopReason.SILENT
            elif late:
                reason = StopReason.LATE
        if reason is not StopReason.NONE:
            self._command = None
            if self._reason is StopReason.NONE:
                self._reason = reason
        elif self.rests and self._command is not None and self._reason < StopReason.REQUESTED:
            self._reason = StopReason.NONE

    def _velocity(self) -> Array:
        """Returns the commanded velocity [m/s], or one proportional to a target's distance."""
        assert self._command is not None
        if self._command.target is None:
            return np.array(self._command.velocity, dtype=np.float64)
        place = self._state[kernel.PX : kernel.PZ + 1]
        if self._origin is None:
            self._origin = np.array(self._command.target) - place
        wanted: Array = TUNING.governor_pull * (self._command.target - self._origin - place)
        return wanted

    def _use(self, liquid: SeenLiquid) -> None:
        """Sets all models to an observed state, propagated to the present time."""
        modes = divided(self._stores[0])[1]
        known = liquid.modal.shape == (len(modes), 4) and np.isfinite(liquid.modal).all()
        behind = []
        for past in reversed(self._past):
            if past[0] < liquid.stamp_ns:
                break
            behind.append(past)
        oldest_ns = self._past[0][0] if self._past else math.inf
        if not known or not behind or oldest_ns > liquid.stamp_ns:
            return
        behind.reverse()
        self._liquid_ns = liquid.stamp_ns
        self._state[kernel.BOUND] = math.inf
        self._state[kernel.EXTRA] = TUNING.governor_stddevs * liquid.stddev
        _, stores, _ = behind[0]
        inputs = np.array([chosen for _, _, chosen in behind[1:]] + [self._chosen.copy()])
        intervals = np.full(len(inputs), self.period)
        history, heights = np.empty((len(inputs), len(modes), 4)), np.empty((len(inputs), 2))
        yaws, poses = np.zeros(len(inputs)), np.empty((0, POSE_COUNT))
        for (frequency, _), store, past in zip(self._factors, self._stores, stores, strict=True):
            begun = past.copy()
            same_height = (liquid.frequency_factor / frequency) ** 2
            for name, column in zip(MODAL, same_height * liquid.modal.T, strict=True):
                divided(begun)[1][name] = column
            model_kernel.advance_many(begun, intervals, inputs, yaws, poses, history, heights)
            store[:] = begun

    def _told(self, now_ns: int, follow: bool, safe: bool) -> Governed:
        state = GovernorState.RESTING if self.rests else GovernorState.STOPPING
        share = float(self._answer[kernel.SHARE]) if follow else 0.0
        if follow:
            state = GovernorState.FOLLOWING if share == 1.0 else GovernorState.LIMITED
        sent = 0 if self._command is None else self._command.stamp_ns
        peak, nominal, rest = (
            float(self._answer[i]) for i in (kernel.PEAK, kernel.NOMINAL, kernel.REST)
        )
        velocity, acceleration, position = (
            tuple(self._state[at : at + 3].tolist()) for at in (kernel.VX, kernel.AX, kernel.PX)
        )
        return Governed(
            now_ns, velocity, acceleration, position, share, state, self._reason, safe, peak,
            peak - nominal, self.limits.height, rest,
            (now_ns - sent) / SECOND if sent > 0 else math.nan,
            self._steps, self._commands, self._liquid_ns,
        )  # fmt: skip

    def stopped(self) -> list[Governed]:
        """Computes all steps until the container is at rest, without new commands.

        A copy of a governor tells so how it will stop.
        """
        self.stop()
        moved = [self.step(self._last_ns + round(self.period * SECOND))]
        while not self.rests and len(moved) < MOST_STEPS:
            moved.append(self.step(self._last_ns + round(self.period * SECOND)))
        return moved


def _possible(command: Command) -> bool:
    """Whether a command is plausible: finite and in the right unit."""
    if command.target is not None:
        return math.hypot(*command.target) <= FARTHEST
    return math.hypot(*command.velocity) <= TUNING.governor_fastest


def _twin(model: Model, frequency: float, damping: float) -> Array:
    """Returns the state array of a model at rest with changed frequencies and damping ratios."""
    other = replace(model, natural_frequency=model.mode_frequency(1) * frequency, covariance=None)
    store = store_of(other)
    divided(store)[1]["damping_ratio"] *= damping
    model_kernel.step(store, 0.0, 0.0, 0.0, 0.0)  # at rest, before the first step
    return store


def _settings(
    limits: PlanLimits, period: float, per_row: int, tail: float, reserve: float
) -> Array:
    spacing = per_row * period
    values = {
        kernel.PERIOD: period, kernel.SPACING: spacing, kernel.SUBDIVISION: per_row,
        kernel.HEIGHT: limits.height, kernel.RESERVE: reserve,
        kernel.ACCELERATION: limits.acceleration, kernel.JERK: limits.jerk, kernel.TAIL: tail,
        kernel.SHORTEST: 4.0 * spacing, kernel.LONGEST: TUNING.governor_longest,
        kernel.RATIO: TUNING.governor_ratio, kernel.EARLY: TUNING.governor_early,
        kernel.LATE: TUNING.governor_late_bump, kernel.ENOUGH: TUNING.governor_enough,
        kernel.HASTE: TUNING.governor_haste, kernel.SPREAD: TUNING.governor_spread,
    }  # fmt: skip
    return np.array([values[place] for place in range(kernel.SETTINGS)], dtype=np.float64)

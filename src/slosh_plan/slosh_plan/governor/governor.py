"""Limits a commanded motion in real time so that the liquid stays below its height limit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_model import kernel as model_kernel
from slosh_model.model import Model
from slosh_model.tray import Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.governor import cups as containers
from slosh_plan.governor import kernel, layout, liquids
from slosh_plan.governor.carrier import Carrier
from slosh_plan.governor.chain import tip
from slosh_plan.governor.commands import (
    Command,
    Governed,
    GovernorState,
    ModelDoubt,
    SeenLiquid,
    StopReason,
)
from slosh_plan.governor.past import PastLiquid
from slosh_plan.governor.robot_arm import NO_JOINTS, GovernedArm
from slosh_plan.governor.seen import Witness, refusal
from slosh_plan.governor.unknown import (
    Cause,
    UnknownWave,
    advanced,
    measured,
    usual_share,
    wave_heights,
)
from slosh_plan.heights import first_period
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.trajectory import FARTHEST
from slosh_plan.tuning import TUNING

MOST_STEPS = 10_000
PERIODS = (1e-3, 0.05)
"""Shortest and longest time of a step [s]."""
AXES = 3


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
        period: float = 1.0 / TUNING.governor_rate,
        timeout: float = TUNING.governor_timeout,
        arm: GovernedArm | None = None,
        carrier: GovernedArm | None = None,
        at_rest: bool = False,
    ) -> None:
        if not PERIODS[0] <= period <= PERIODS[1]:
            raise SloshPlanError(f"period = {period!r} s must lie in 0.001 … 0.05 s")
        tray = held if isinstance(held, Tray) else Tray((TrayContainer("", held),))
        turns = arm is not None
        self._cups = containers.cups_of(tray, limits, turns=turns)
        self._seen_cup = not tray.first.empty
        self.model, self.limits = self._cups[0].model, self._cups[0].limits
        self.period, self.timeout, self.arm = period, timeout, arm
        self._carrier = Carrier(carrier)
        doubt = doubt or ModelDoubt()
        factors = doubt.factors
        self._stores = containers.stores_of(self._cups, factors)
        per_row = containers.steps_of(self._cups, period)
        spacing = per_row * period
        slowest = max(first_period(cup.model) for cup in self._cups)
        # Around the level of a tilted container a wave is highest once a period.
        tail = (TUNING.governor_tilted_tail if turns else TUNING.governor_tail) * slowest
        if any(cup.model.modes > 1 for cup in self._cups):
            tail = TUNING.governor_modes_tail * slowest  # until the crests of all modes have met
        reserve = containers.reserve_of(self._cups, spacing, doubt.frequency)
        self._settings = _settings(limits, period, per_row, tail, reserve)
        self._table, self._points = containers.table_of(
            self._cups, spacing, doubt.frequency, turns=turns
        )
        self._joints = arm.chain if arm else NO_JOINTS
        size = len(arm.start) if arm else AXES
        free = np.array([[-math.inf], *[[math.inf]] * 4]) * np.ones(AXES)
        self._bounds = arm.bounds if arm else free
        rows = math.ceil((TUNING.governor_longest + tail) / spacing) + 4
        self._stop, self._motion = np.zeros((rows, size)), np.zeros((3, size))
        self._state = np.zeros(layout.STATE)
        self._state[[layout.ROWS, layout.BOUND]] = 1.0, math.inf
        self._state[layout.DURATION] = TUNING.governor_first * slowest
        self._chosen = np.zeros((len(self._points), 3))
        self._told, self._answer = (
            np.zeros((len(self._cups), layout.USES)),
            np.zeros(layout.ANSWER),
        )
        self._uses = self._told.copy()
        self._ranks = np.tile(np.array([0, 1, layout.LIGHT]), (len(self._cups), 1))
        self._ranks[:, layout.ORDER] = np.arange(len(self._cups))
        self._loose = [k for k, cup in enumerate(self._cups) if cup.standing is not None]
        if arm is not None:
            self._motion[layout.PLACE] = arm.start
            self._settle()
        self._size = int(self._table[0, layout.SIZE])
        self._past = PastLiquid(self._stores[: layout.MODELS, : self._size])
        self._unknown = UnknownWave(self._cups, doubt)
        first = self._cups[0]
        self._witness = Witness(
            np.array([frequency for frequency, _ in factors]), first_period(first.model),
            first.limits.height,
        )  # fmt: skip
        self._own, self._felt = np.zeros(len(self._cups)), np.zeros((len(self._points), AXES))
        self._since_ns: int | None = 0 if at_rest else None
        self._usual = self._later = self._sooner = 0.0
        self._usual_gap, self._usual_share = period, usual_share(period, first_period(self.model))
        self._command: Command | None = None
        self._latest = Command(0)
        self._came = False
        self._seen: SeenLiquid | None = None
        self._origin: Array | None = None
        self._taken_ns = self._last_ns = self._due_ns = self._made_ns = -(2**62)
        self._steps = self._commands = self._liquid_ns = 0
        self._reason, self._lost = StopReason.NONE, False
        self._joint_start: tuple[float, ...] = ()
        self._last: Governed | None = None
        for one in (kernel.govern, liquids.hold, tip, advanced, measured, model_kernel.step):
            one.load()

    def take(self, command: Command) -> None:
        """Stores a command for the next step; it replaces the previous command."""
        self._commands += 1
        self._command = self._latest = command
        self._came = True

    def see(self, liquid: SeenLiquid) -> str:
        """Stores an observed state of the first container's liquid, which the next step uses.

        Returns:
            why it is not used; empty: it is.
        """
        last = self._liquid_ns if self._seen is None else self._seen.stamp_ns
        found = refusal(liquid, self.model.modes, last)
        if not found and self._seen_cup:
            self._seen = liquid
        return found

    def wait_since(self, stamp_ns: int) -> None:
        """Sets since when the unknown wave of the start decays [ns]; 0: there is none."""
        self._since_ns = stamp_ns

    def stop(self) -> None:
        """Requests a stop of the motion from the next step on, which lasts until `release`."""
        self._reason = StopReason.REQUESTED

    def locate(self, places: Sequence[float]) -> str:
        """Compares measured positions (J,) of the joints; at rest, adopts them as the new start.

        Returns:
            why they make the next step a stop; empty: they do not.
        """
        measured = np.array(places, dtype=np.float64)
        doubt = self._carrier.doubt(measured, rests=self.rests)
        self._lost = bool(doubt)
        if self.rests and not doubt and self._carrier.differs(measured):
            self._nudge(self._carrier.way_to(measured))
            self._carrier.start_at(measured, self.place)
            self._joint_start = tuple(measured.tolist())
        return doubt

    def _nudge(self, way: float) -> None:
        """Adds the waves that others may have made by moving the resting container a way [m]."""
        if way <= TUNING.governor_nudged:
            return
        if self._made_ns < 0:
            self._since_ns = None
            return
        gains = np.array([cup.gains.max() for cup in self._cups])
        self._unknown.add(np.minimum(gains * way, self._unknown.largest), Cause.MOVED)

    def lose(self, *, lost: bool) -> None:
        """Sets whether the joints' positions are unknown, which makes the governor stop."""
        self._lost = lost

    def go_on(self, before: Governor) -> None:
        """Takes over the place of the container and that of its targets from a governor at rest.

        For another container, or another model of it, in the same robot: without this the next
        target would be taken for the present place. Joints know their places themselves.
        """
        if self.arm is None and before.arm is None:
            self._motion[layout.PLACE] = before.place
            self._origin = before._origin

    def release(self) -> bool:
        """Ends a requested stop if the container is at rest; returns whether it did."""
        if self._reason is StopReason.REQUESTED and self.rests:
            self._reason = StopReason.NONE
            self._command = None
        return self._reason is not StopReason.REQUESTED

    @property
    def rests(self) -> bool:
        """Whether the container is at rest: zero velocity and acceleration."""
        return not self._motion[: layout.PLACE].any()

    @property
    def commands(self) -> int:
        """Number of commands that `take` has received."""
        return self._commands

    @property
    def place(self) -> Array:
        """Position (D,): displacement from the start [m], or joint positions [rad or m]."""
        place: Array = self._motion[layout.PLACE].copy()
        return place

    @property
    def joints(self) -> Array:
        """The robot's joint velocities, accelerations and positions (3, J); J = 0: unknown."""
        return self._carrier.joints if self.arm is None else self._motion

    def idle(self, now_ns: int) -> Governed:
        """Returns the result to publish before the first command: the container is at rest."""
        self._told[:] = 0.0
        self._own[:] = 0.0
        if self._since_ns is None:
            self._since_ns = now_ns
        if self._since_ns:
            self._unknown.heights = self._unknown.waited((now_ns - self._since_ns) / SECOND)
            self._unknown.cause = Cause.START
        self._allow()
        told = self._governed(now_ns, share=0.0, safe=True)
        self._joint_start = ()
        return told._replace(state=GovernorState.RESTING)

    def step(self, now_ns: int) -> Governed:
        """Computes the container's motion for the next step.

        Args:
            now_ns: the present moment [ns].
        """
        self._steps += 1
        last, early = self._last, self._is_early(now_ns)
        self._compare(now_ns)
        self._look(now_ns)
        if early and last is not None:
            if self._sooner > 0.0:  # a clock that went back looks the same
                self._doubt_time(min(self._sooner, self.period), Cause.LATE)
                self._sooner = 0.0
            return last._replace(
                stamp_ns=now_ns, reason=self._reason, steps=self._steps, commands=self._commands,
                joint_start=(),
            )  # fmt: skip
        if self._made_ns < 0:
            self._begin(now_ns)
        else:
            self._make_up(now_ns)
        self._made_ns = now_ns
        self._due_ns += round(self.period * SECOND)
        self._past.add(now_ns, self._stores, self._chosen[int(self._table[0, layout.POINT])])
        if self._seen is not None:
            self._use(self._seen)
            self._seen = None
        self._allow()
        follow = self._reason is StopReason.NONE and self._command is not None
        wanted = self._velocity() if follow else np.zeros(self._motion.shape[1])
        self._felt[:] = self._chosen
        unsafe = kernel.govern(
            self._stores, self._stop, self._motion, self._state, wanted, follow, self._settings,
            self._bounds, self._table, self._joints, self._points, *self._carrier.arrays,
            self._ranks, self._chosen, self._told, self._answer,
        )  # fmt: skip
        share = float(self._answer[layout.SHARE]) if follow else 0.0
        told = self._governed(now_ns, share=share, safe=not unsafe)
        self._joint_start = ()
        state = GovernorState.RESTING if self.rests else GovernorState.STOPPING
        if follow:
            state = GovernorState.FOLLOWING if share == 1.0 else GovernorState.LIMITED
        self._last = told._replace(state=state)
        return self._last

    def _begin(self, now_ns: int) -> None:
        """Sets the unknown waves of the first step: the largest, decayed since the first call."""
        self._due_ns = now_ns
        if self._since_ns is None:
            self._since_ns = now_ns
        if self._since_ns:
            waited = self._unknown.waited((now_ns - self._since_ns) / SECOND)
            for cup, height in enumerate(waited.tolist()):
                self._unknown.bound(cup, height, Cause.START)

    def _is_early(self, now_ns: int) -> bool:
        """Whether the steps so far are early by a period; not where the clock goes back."""
        early = self._due_ns - now_ns >= TUNING.governor_missed * self.period * SECOND
        return early and now_ns > self._last_ns and not self.rests

    def _compare(self, now_ns: int) -> None:
        """Compares the time since the last step with the usual one: later or sooner [s]."""
        apart = (now_ns - self._last_ns) / SECOND
        if 0.0 < apart <= TUNING.governor_late * self.period:
            self._later = apart - self._usual_gap
            self._sooner = max(self._sooner, -self._later)
            self._usual_gap += self._usual_share * self._later

    def _make_up(self, now_ns: int) -> None:
        """Advances the liquid to the present; adds to the unknown wave what may be otherwise.

        A robot may hold its velocity while a step is late, or reach the next one later: what lies
        between is a displacement by the change of velocity in the delay. A clock that steps looks
        like a step later than usual: then nothing has been held, and the waves are behind. Where
        the time that has passed is not known the robot may have stopped, too.
        """
        points = self._table[:, layout.POINT].astype(np.int64)
        felt = 0.5 * (self._felt + self._chosen)[points]
        gap = (now_ns - self._made_ns) / SECOND
        known = 0.0 < gap <= TUNING.governor_late * self.period
        self._unknown.advance(gap if known else self.period, felt[:, 2].copy())
        lead = (self._due_ns - now_ns) / SECOND
        held = min(max(-lead, 0.0), self.timeout)
        if not known:
            lead, held = 0.0, min(max(gap - self.period, 0.0), self.timeout)
            self._doubt_time(gap, Cause.CLOCK)
        elif min(held, self._later) > 0.0:
            self._doubt_time(min(held, self._later), Cause.LATE)
        if held > 0.0:
            self._hold(held)
        if lead <= 0.0:
            self._due_ns, lead = now_ns, 0.0
        uneven = held + abs(lead - self._usual)
        if uneven > 0.0 and felt[:, :2].any():
            self._unknown.shift(self.period * uneven * felt[:, :2], Cause.LATE)
        self._usual += self._usual_share * (lead - self._usual)

    def _hold(self, seconds: float) -> None:
        """Advances motion and liquids by a time [s] in which the robot holds its velocity.

        Its acceleration is zero then, and before and behind that of the motion.
        """
        before = self._chosen.copy()
        self._feel(at_rate=False)
        liquids.hold(
            self._stores, self._motion, seconds, self._table, self._joints, self._points,
            *self._carrier.arrays, self._chosen,
        )  # fmt: skip
        self._chosen[:] = before
        self._feel(at_rate=True)
        self._state[layout.BOUND] = math.inf  # nobody has verified the stop from here

    def _feel(self, *, at_rate: bool) -> None:
        """Lets the liquids feel at once the motion's acceleration, or that of a steady speed."""
        if len(self._joints):
            motion = self._motion.copy()
            motion[layout.RATE] *= at_rate
            liquids.feel(self._joints, self._points, motion, self._chosen)
        else:
            self._chosen *= at_rate
        for number, store in enumerate(self._stores):
            row = self._table[number // layout.MODELS]
            felt = self._chosen[int(row[layout.POINT])]
            model_kernel.step(store[: int(row[layout.SIZE])], 0.0, *felt.tolist())

    def _doubt_time(self, seconds: float, cause: Cause) -> None:
        """Adds to the unknown wave what may be if a time [s] has not passed, or only in part."""
        turned = seconds if seconds > 0.0 else math.inf
        more = self._unknown.turned(turned)
        for cup in range(len(self._cups)):
            stores = self._stores[cup * layout.MODELS : (cup + 1) * layout.MODELS]
            size = int(self._table[cup, layout.SIZE])
            more[cup] += wave_heights(stores, size, seconds=turned).max()
        if not self.rests and not 0.0 < seconds <= self.timeout:
            gains = np.array([cup.gains.max() for cup in self._cups])
            omega = [cup.model.mode_constants()[0].natural_frequency for cup in self._cups]
            speed = float(np.linalg.norm(self._moved()[layout.VELOCITY]))
            more += gains * speed / np.array(omega)
        self._unknown.add(more, cause)

    def _allow(self) -> None:
        """Raises the heights that the motion is judged by to those of the unknown waves.

        At most up to a part of the limit, so that the container can move. In steps: a held stop
        that is safe stays so where they change a little. A stop is not made longer by a wave that
        has become unknown in it: that wave would be there all the same, and `safe` counts it.
        """
        if self._reason is not StopReason.NONE and not self.rests:
            return
        limit, extra = self._table[:, layout.LIMIT], self._table[:, layout.EXTRA]
        grain, most = TUNING.governor_grain * limit, TUNING.governor_unknown * limit
        heights = self._unknown.heights
        wanted = np.where(heights > 0.0, np.minimum(heights + grain, most), 0.0)
        kept = (np.minimum(heights, most) <= extra) & (extra <= wanted + grain) & (heights > 0.0)
        found = np.where(kept, extra, wanted)
        if (found > extra).any():
            self._state[layout.BOUND] = math.inf
        extra[:] = found

    def _look(self, now_ns: int) -> None:
        """Sets the reason to stop (bad or old command, late step, lost joints), or clears it."""
        late = not 0 < now_ns - self._last_ns <= TUNING.governor_late * self.period * SECOND
        late = late and self._last_ns > -(2**62)
        self._last_ns = now_ns
        if self._came:
            self._came, self._taken_ns = False, now_ns
        known = self._reason is not StopReason.JOINTS or self.rests
        if self._reason is not StopReason.REQUESTED and (self._lost or not known):
            self._command, self._reason = None, StopReason.JOINTS
            return
        reason = StopReason.NONE
        if self._command is not None:
            reason = self._refusal(self._command)
            if reason is not StopReason.NONE:
                told = self._reason is StopReason.REQUESTED
                self._reason = self._reason if told else reason
            elif now_ns - self._taken_ns > self.timeout * SECOND:
                reason = StopReason.SILENT
            elif late:
                reason = StopReason.LATE
        if reason is not StopReason.NONE:
            self._command = None
            if self._reason is StopReason.NONE:
                self._reason = reason
        elif self.rests and self._command is not None and self._reason != StopReason.REQUESTED:
            self._reason = StopReason.NONE

    def _refusal(self, command: Command) -> StopReason:
        """Returns why a command is refused: NONE if it is finite, plausible and complete."""
        if command.refused is not StopReason.NONE:
            return command.refused
        size, speed = self._motion.shape[1], math.hypot(*command.velocity)
        if TUNING.governor_fastest < speed < math.inf:
            return StopReason.FAST
        numbers = command.velocity if command.target is None else command.target
        usable = len(command.velocity) in (0, size) and len(numbers) == size and speed < math.inf
        if usable and command.target is not None:
            usable = math.hypot(*command.target) <= FARTHEST
            if self.arm is not None:
                usable = self.arm.usable(command.target)
        return StopReason.NONE if usable else StopReason.INVALID

    def _velocity(self) -> Array:
        """Returns the velocity (D,) to aim at; it is proportional to the distance to a target."""
        command, place = self._command, self._motion[layout.PLACE]
        assert command is not None
        wanted: Array = np.zeros(len(place))
        if command.velocity:
            wanted = np.array(command.velocity, dtype=np.float64)
        if command.target is None:
            return self._within(wanted)
        target = np.array(command.target)
        if self.arm is not None:
            target = np.clip(target, self._bounds[layout.LOWER], self._bounds[layout.UPPER])
        elif self._origin is None:
            self._origin = target - place
        origin = 0.0 if self._origin is None else self._origin
        return self._within(wanted + TUNING.governor_pull * (target - origin - place))

    def _within(self, velocity: Array) -> Array:
        """Limits velocities (D,) to the joints' maxima, and lower near the position limits."""
        if self.arm is None:
            return velocity
        place, slack = self._motion[layout.PLACE], TUNING.governor_slack
        low, high = self._bounds[layout.LOWER] - place, self._bounds[layout.UPPER] - place
        near = np.clip(velocity, TUNING.governor_pull * low, TUNING.governor_pull * high)
        fastest = (1.0 - slack) * self._bounds[layout.FASTEST]
        return np.clip(near, -fastest, fastest)

    def _settle(self) -> None:
        """Brings the liquids to rest in containers that are tilted at the start."""
        assert self.arm is not None
        liquids.feel(self._joints, self._points, self._motion, self._chosen)
        for number, store in enumerate(self._stores):
            cup = number // layout.MODELS
            row = self._table[cup]
            felt = self._chosen[int(row[layout.POINT])]
            own = store[: int(row[layout.SIZE])]
            containers.settle(own, felt, first_period(self._cups[cup].model))

    def _use(self, liquid: SeenLiquid) -> None:
        """Compares a past observed state with the first container's models; see `Witness`."""
        distance = self._witness.look(liquid, self._past, self._size)
        if math.isnan(distance):
            return
        self._liquid_ns = liquid.stamp_ns
        now = float(self._unknown.heights[0])
        if distance > now:
            most = float(self._unknown.largest[0]) + self.limits.height
            self._unknown.bound(0, min(distance, most), Cause.FUSED)
        elif self._witness.highest < now:
            self._unknown.bound(0, self._witness.highest, Cause.FUSED)

    def _governed(self, now_ns: int, *, share: float, safe: bool) -> Governed:
        """Creates the result of a step from the present motion and heights."""
        sent = 0 if self._command is None else self._command.stamp_ns
        # What is left of a held stop uses no more than all of it.
        looked, extra = self._told == self._told, self._table[:, layout.EXTRA]
        np.copyto(self._uses, self._told, where=looked)
        np.copyto(self._own, self._told[:, layout.PEAK] - extra, where=looked[:, layout.PEAK])
        unknown = self._unknown.heights
        peaks, limits = np.maximum(self._own, 0.0) + unknown, self._table[:, layout.LIMIT]
        uses = self._uses[:, layout.SLIP :].max(axis=1)
        # Unsafe by the height that an unknown wave may gain is still safe; so are waves that leave
        # more room than what is kept for the motion.
        safe = safe or bool(looked[:, layout.PEAK].all() and (uses <= 1.0).all())
        safe = safe and bool((peaks <= limits).all())
        safe = safe and not any(unknown[k] > extra[k] for k in self._loose)
        shares = np.maximum(uses, peaks / limits)
        worst = int(shares.argmax()) if len(self._cups) > 1 else 0
        peak, nominal = float(peaks[worst]), float(self._uses[worst, layout.NOMINAL])
        friction = tipping = math.nan
        if self._loose:
            friction, tipping = self._uses[self._loose, layout.SLIP :].max(axis=0).tolist()
        velocity, acceleration, position = self._moved()
        none = (math.nan,) * self._motion.shape[1]
        wanted = self._latest.velocity or none, self._latest.target or none
        follows = self._reason is StopReason.NONE and self._command is not None
        joints = tuple(map(tuple, self.joints.tolist())) if self.joints.size else ()
        return Governed(
            now_ns, velocity, acceleration, position, share, GovernorState.STOPPING, self._reason,
            safe, peak, peak - nominal,
            self._cups[worst].limits.height, float(self._answer[layout.REST]),
            (now_ns - sent) / SECOND if sent > 0 else math.nan,
            self._steps, self._commands, self._liquid_ns,
            self._cups[worst].name, friction, tipping, joints, wanted,
            self._carrier.refused_by(share) if follows else "",
            self._joint_start, float(unknown[worst]), str(self._unknown.cause),
            self._since_ns or 0,
        )  # fmt: skip

    def _moved(self) -> tuple[tuple[float, ...], ...]:
        """Returns velocity, acceleration and position of the container's origin, (3,) each."""
        moved = self._motion
        if self.arm is not None:
            moved = np.empty((3, AXES))
            tip(self._joints, self._motion, moved)
        return tuple(map(tuple, moved.tolist()))

    def stopped(self) -> list[Governed]:
        """Simulates a stop until the container is at rest; returns the result of each step.

        A copy of a governor tells so how it will stop.
        """
        self.stop()
        moved = [self.step(self._last_ns + round(self.period * SECOND))]
        while not self.rests and len(moved) < MOST_STEPS:
            moved.append(self.step(self._last_ns + round(self.period * SECOND)))
        return moved


def _settings(
    limits: PlanLimits, period: float, per_row: int, tail: float, reserve: float
) -> Array:
    spacing = per_row * period
    values = {
        layout.PERIOD: period, layout.SPACING: spacing, layout.SUBDIVISION: per_row,
        layout.RESERVE: reserve, layout.ACCELERATION: limits.acceleration,
        layout.JERK: limits.jerk, layout.TAIL: tail,
        layout.SHORTEST: 4.0 * spacing, layout.LONGEST: TUNING.governor_longest,
        layout.RATIO: TUNING.governor_ratio, layout.EARLY: TUNING.governor_early,
        layout.LATE: TUNING.governor_late_bump, layout.ENOUGH: TUNING.governor_enough,
        layout.HASTE: TUNING.governor_haste, layout.SPREAD: TUNING.governor_spread,
        layout.LEAST: TUNING.governor_least * period,
    }  # fmt: skip
    return np.array([values[place] for place in range(layout.SETTINGS)], dtype=np.float64)

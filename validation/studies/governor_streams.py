"""Counts streams in which a governed liquid exceeds its limit while the governor says *safe*.

    tools/run python validation/studies/governor_streams.py [--runs 600] [--half 1] [--docs]

A stream draws container, modes, damping, doubt, limits, rate and commands: steps, swings near
resonance, teleoperation, stops, targets. Its kind is what goes wrong besides. The liquids are
those of `independent_liquid`, at the limits of the doubt and inside; where the governor is told of
an observed state there is one, that which is observed. The robot follows each step within a
period, then holds its velocity. A governor that is killed leaves it to brake at its greatest
acceleration. *Way*: of the commanded one. Tuned on `--half 0`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import ROOT
from independent_liquid import Liquids, Vessel
from observer_accuracy import write_table
from seen_liquid import FAULTS, WatchedLiquid

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.core import Command, Governed, Governor, ModelDoubt, SeenLiquid
from slosh_model import Cylinder, Model, Rectangle
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.limits import PlanLimits

PAGE = ROOT / "docs" / "governor.md"
HEAD = (
    "streams with", "streams", "refused", "liquids", "above while safe", "highest while safe",
    "above at all", "safe, of the time", "way",
)  # fmt: skip
RATES = (20.0, 25.0, 40.0, 50.0, 100.0, 125.0, 200.0, 250.0, 500.0, 1000.0)
OFTEN = np.array([3.0, 2.0, 2.0, 4.0, 6.0, 3.0, 2.0, 2.0, 1.0, 1.0])
"""How often each rate is drawn."""
BEGIN = 10**13
"""Time of the first step [ns]."""
INSTANT = 1e-9
"""Times that differ by less are one [s]."""
MOST = 200
NOISE = 3e-4
"""Standard deviation of an observed height [m]."""


class Lie(NamedTuple):
    """What is wrong with an observed state.

    Attributes:
        stddev, factor: that are told in place of the true ones; NaN: the true ones.
        turned: complex factor of the state.
        late: by how much its stamp is [s].
        frozen: whether it stays what it was once.
    """

    stddev: float = math.nan
    factor: float = math.nan
    turned: complex = 1.0
    late: float = 0.0
    frozen: bool = False


LIES = {
    "an observer": Lie(),
    "its stddev −1": Lie(stddev=-1.0),
    "its factor 0": Lie(factor=0.0),
    "its factor 1.5": Lie(factor=1.5),
    "its stamps 0.1 s late": Lie(late=0.1),
    "its stamps 0.1 s early": Lie(late=-0.1),
    "its states mirrored": Lie(turned=-1.0),
    "its states turned": Lie(turned=1j),
    "its states at half scale": Lie(turned=0.5),
    "its states frozen": Lie(frozen=True),
    "its states NaN, 1e300": Lie(turned=complex(1e300, math.nan)),
}
PLAIN, UNEVEN, CLOCK = "nothing wrong", "late and left out steps", "steps of the clock"
NUMBERS, AGAIN, OTHER = "invalid numbers", "its container's limit changed", "another container"
KILLED, MOVING = "a governor killed and started", "liquid that moves at the start"
SMALL = "small steps of the clock"
CAMERAS = {f"observer: {name}": fault for name, fault in FAULTS.items()}
KINDS = (PLAIN, UNEVEN, CLOCK, NUMBERS, AGAIN, OTHER, KILLED, MOVING, *LIES, SMALL, *CAMERAS)


class Setting(NamedTuple):
    """A container with its governor's settings.

    Attributes:
        vessel, model: the container, for the independent liquid and for the governor.
        damping: ratio of every mode.
        limits, doubt, rate: of the governor [m, …, Hz].
    """

    vessel: Vessel
    model: Model
    damping: float
    limits: PlanLimits
    doubt: ModelDoubt
    rate: float

    def governor(self, *, at_rest: bool = False) -> Governor:
        """Creates the governor; unless the liquid is at rest it does not know it."""
        period = 1.0 / self.rate
        return Governor(self.model, self.limits, doubt=self.doubt, period=period, at_rest=at_rest)

    def liquids(self, rng: np.random.Generator, count: int) -> Liquids:
        """Creates liquids within the doubt: at its corners, then drawn ones."""
        e, d = self.doubt.frequency, self.doubt.damping
        corners = [(1.0 - e, 1.0 / d), (1.0 + e, 1.0 / d), (1.0, 1.0 / d), (1.0, 1.0)]
        drawn = [(1.0 + e * rng.uniform(-1.0, 1.0), d ** rng.uniform(-1.0, 1.0)) for _ in range(2)]
        factors = np.array([*corners, *drawn] if count > 1 else drawn[:1])
        return Liquids(self.vessel, self.damping, factors)


def drawn_setting(rng: np.random.Generator) -> Setting:
    """Draws a container and a governor's settings, all that its parameters allow."""
    modes = int(rng.choice([1, 1, 1, 2, 3, 5]))
    damping = math.exp(rng.uniform(math.log(0.002), math.log(0.05)))
    if rng.random() < 0.75:
        size = math.exp(rng.uniform(math.log(0.003), math.log(0.12)))
        vessel = Vessel(size * rng.uniform(0.3, 3.0), radius=size, modes=modes)
        model = Model(Cylinder(size, vessel.fill), damping_ratio=damping, modes=modes)
    else:
        width = math.exp(rng.uniform(math.log(0.01), math.log(0.3)))
        depth, fill = width * rng.uniform(0.4, 1.0), width * rng.uniform(0.2, 1.2)
        size, vessel = width / 2.0, Vessel(fill, width=width, depth=depth, modes=modes)
        model = Model(Rectangle(width, depth, fill), damping_ratio=damping, modes=modes)
    limits = PlanLimits(
        size * rng.uniform(0.08, 0.35), acceleration=rng.uniform(1.0, 9.5),
        jerk=math.exp(rng.uniform(math.log(20.0), math.log(400.0))),
    )  # fmt: skip
    doubt = ModelDoubt(rng.uniform(0.0, 0.1), rng.uniform(1.0, 4.0))
    if rng.random() < 0.5:
        doubt = ModelDoubt()
    rate = float(rng.choice(RATES, p=OFTEN / OFTEN.sum()))
    return Setting(vessel, model.spatial(), damping, limits, doubt, rate)


def drawn_commands(rng: np.random.Generator, period: float, rate: float) -> tuple[Array, Array]:
    """Draws times (N,) [s] and velocities (N, 3) [m/s] of commands near a liquid's period [s].

    They last for ten periods, but not for many more than MOST steps of the governor.
    """
    length = min(max(10.0 * period, 0.6), 2.5, max(MOST / rate, 0.4))
    t = np.arange(0.0, length, 1.0 / rng.choice([20.0, 50.0, 100.0]))
    scale = np.array([1.0, 1.0, 0.3 * (rng.random() < 0.3)])
    scale *= math.exp(rng.uniform(math.log(0.05), math.log(0.8)))
    if rng.random() < 0.2:
        scale[1:] = 0.0
    rows, at, before = np.zeros((len(t), 3)), 0, np.zeros(3)
    while at < len(t):
        until = at + max(int(rng.uniform(0.05, 0.4) * len(t)), 1)
        part = t[at:until, np.newaxis]
        goal = rng.normal(size=3) * scale
        swing = 2.0 * math.pi * rng.uniform(0.7, 1.3) / period * rng.choice([1.0, 1.0, 2.0])
        hand = np.cumsum(rng.normal(size=(len(part), 3)), axis=0) / math.sqrt(len(part))
        share = np.linspace(0.0, 1.0, len(part))[:, np.newaxis]
        choices = (
            goal + 0.0 * part, 0.0 * part * goal, goal * np.sin(swing * part),
            before + share * (goal - before), before + hand * scale,
            goal * np.sign(np.sin(swing * part)),
        )  # fmt: skip
        rows[at:until] = choices[int(rng.integers(len(choices)))]
        before, at = rows[min(until, len(t)) - 1], until
    return t, rows


class Robot:
    """A robot that reaches each commanded velocity within a period, then holds it.

    Attributes:
        t: present time [s].
        velocity, acceleration: (3,) [m/s, m/s²].
        way: that it has gone [m].
    """

    def __init__(self) -> None:
        self.t, self.way = 0.0, 0.0
        self.velocity, self.acceleration = np.zeros(3), np.zeros(3)
        self._pieces: list[tuple[float, Array, Array]] = []
        """Time of the end, accelerations at begin and end of what it is doing."""
        self._told = np.zeros(3)

    def command(self, moved: Governed, period: float) -> None:
        """Begins to follow a step of the governor."""
        # After a piece that has ended the governor goes on from its acceleration.
        begin = self.acceleration if self._pieces else self._told
        end = np.array(moved.acceleration)
        missing = np.array(moved.velocity) - self.velocity - 0.5 * period * (begin + end)
        extra = missing / period
        self._told = end
        self._pieces = [(self.t + period, begin + extra, end + extra)]

    def brake(self, most: float) -> None:
        """Begins to brake with a constant acceleration [m/s²]."""
        speed = float(np.linalg.norm(self.velocity))
        self._told = np.zeros(3)
        if speed > 0.0:
            against = -most / speed * self.velocity
            self._pieces = [(self.t + speed / most, against, against)]

    def until(self, t: float, liquids: Liquids) -> float:
        """Moves up to a time [s]; returns the greatest height of the liquids meanwhile [m]."""
        highest = 0.0
        while self.t < t:
            if self._pieces:
                end, a, b = self._pieces[0]
            else:
                end, a, b = math.inf, np.zeros(3), np.zeros(3)
            span = min(end, t) - self.t
            if t < end - INSTANT and self._pieces:
                b_here = a + (b - a) * (span / (end - self.t))
                self._pieces = [(end, b_here, b)]
            else:
                b_here = b
                self._pieces = []
            before = self.velocity
            self.velocity = before + 0.5 * span * (a + b_here)
            self.way += 0.5 * span * float(np.linalg.norm(before + self.velocity))
            self.acceleration = b_here
            highest = max(highest, liquids.move(span, a, b_here))
            self.t = min(end, t) if self._pieces or end < t - INSTANT else t
        return highest


class Told(NamedTuple):
    """What became of a stream.

    Attributes:
        refused: whether the governor refused its setting; then the rest is 0.
        liquids: that were moved.
        safe, any: greatest height while the governor said *safe*, and at any time, of the limit.
        share: of the time in which it said so.
        way: that was gone, of the commanded one; NaN: none was.
    """

    refused: float = 0.0
    liquids: float = 0.0
    safe: float = 0.0
    any: float = 0.0
    share: float = 0.0
    way: float = math.nan


class Stream:
    """A governor, a robot and liquids under a stream of commands.

    Args:
        kind: of KINDS.
        rng: draws all.

    Raises:
        SloshPlanError: the governor refuses the setting.
    """

    def __init__(self, kind: str, rng: np.random.Generator) -> None:
        self._rng, self._kind, self._lie = rng, kind, LIES.get(kind)
        self._setting = drawn_setting(rng)
        moves = kind == MOVING or (kind in CAMERAS and rng.random() < 0.5)
        self._governor = self._setting.governor(at_rest=not moves)
        self.count = 1 if kind in CAMERAS or self._lie else 6
        self._liquids = self._setting.liquids(rng, self.count)
        self._robot, self._safe, self._clock = Robot(), False, 0
        self._period = 1.0 / self._setting.rate
        self._t, self._rows = drawn_commands(rng, self._liquids.period, self._setting.rate)
        self._targets = rng.random() < 0.2
        self._places = np.cumsum(self._rows, axis=0) * (self._t[1] if len(self._t) > 1 else 0.0)
        self._seen: list[tuple[float, Array]] = []
        self.heights = [0.0, 0.0]
        self._times = [0.0, 0.0]
        self._watched: WatchedLiquid | None = None
        if kind in CAMERAS:
            self._watched = WatchedLiquid(
                self._setting.model, self._liquids, CAMERAS[kind], rng, self._setting.limits.height
            )
            self._watched.still(BEGIN, 0.5)
        if moves:
            self._disturb()
            self._wait()
        self._uneven = rng.random(3) if kind in (UNEVEN, SMALL) else np.zeros(3)

    def run(self) -> Told:
        """Runs the stream until the robot rests after its commands."""
        step, events = self._step, self._events()
        end, taken = float(self._t[-1]), 0
        while self._robot.t < 2.0 * end:
            t = self._robot.t
            if events and t >= events[0][0]:
                events.pop(0)[1]()
            while taken < len(self._t) and self._t[taken] <= t:
                self._take(taken)
                taken += 1
            moved = step()
            self._follow(self._pause())
            if taken == len(self._t) and moved.rest == 0.0 and self._governor.rests:
                break
        self._follow(2.0 * self._liquids.period)
        wanted = np.linalg.norm(self._rows, axis=1).sum() * self._t[1]
        way = self._robot.way / wanted if wanted > 0.0 else math.nan
        share = self._times[0] / sum(self._times)
        safe, anyway = self.heights
        return Told(0.0, self.count, safe, anyway, share, float(way))

    def _step(self) -> Governed:
        """Makes one step of the governor, as its node does."""
        governor, now = self._governor, self._now
        if self._lie is not None:
            self._see(self._lie)
        moved = governor.step(now) if governor.commands else governor.idle(now)
        self._safe = moved.safe
        self._robot.command(moved, self._period)
        return moved

    @property
    def _now(self) -> int:
        return BEGIN + round(self._robot.t * SECOND) + self._clock

    def _follow(self, seconds: float) -> None:
        """Moves robot and liquids on by a time [s]."""
        height = self._watch(seconds) if self._watched else self._move(seconds)
        part = height / self._setting.limits.height
        self.heights[1] = max(self.heights[1], part)
        self._times[not self._safe] += seconds
        if self._safe:
            self.heights[0] = max(self.heights[0], part)

    def _move(self, seconds: float) -> float:
        return self._robot.until(self._robot.t + seconds, self._liquids)

    def _watch(self, seconds: float) -> float:
        """Moves on by a time [s], in which an observer follows; returns the greatest height."""
        assert self._watched is not None
        count, highest = max(math.ceil(seconds / self._watched.every), 1), 0.0
        for _ in range(count):
            highest = max(highest, self._move(seconds / count))
            self._watched.follow(self._robot.t, self._now, self._robot.acceleration)
        while self._watched.states:
            self._governor.see(self._watched.states.popleft())
        return highest

    def _pause(self) -> float:
        """Draws the time until the next step [s]."""
        rng, (jitter, late, left_out) = self._rng, self._uneven
        if self._kind == SMALL:
            back = (rng.random() < 0.3 * jitter) * rng.uniform(0.05, 0.85) * left_out
            self._clock -= round(back * self._period * SECOND)
            return float(self._period * (1.0 + (rng.random() < 0.1 * late**3) * rng.random()))
        if self._kind != UNEVEN:
            return self._period
        delay = rng.uniform(0.0, 8.0) if rng.random() < 0.05 * late else 0.0
        apart = 1.0 + 0.4 * jitter * rng.uniform(-1.0, 1.0) + (rng.random() < 0.1 * left_out)
        return float(self._period * (apart + delay))

    def _take(self, number: int) -> None:
        """Sends a command to the governor; some have invalid numbers."""
        row = tuple(self._rows[number].tolist())
        target = tuple(self._places[number].tolist()) if self._targets else None
        if self._kind == NUMBERS and self._rng.random() < 0.03:
            bad = float(self._rng.choice([math.nan, math.inf, 1e300, -1e300, 25.0]))
            row, target = (bad, row[1], row[2]), target and (bad, target[1], target[2])
        command = Command(self._now, () if self._targets else row, target)
        self._governor.take(command)

    def _see(self, lie: Lie) -> None:
        """Tells the governor an observed state, 20 ms late, with noise."""
        liquids, rng = self._liquids, self._rng
        true = liquids.modal(0)
        self._seen.append((self._robot.t, true))
        if lie.frozen and len(self._seen) > 10:
            self._seen = self._seen[:10]
        past = [one for one in self._seen if one[0] <= self._robot.t - 0.02]
        if not past or (lie.frozen and len(self._seen) < 10):
            return
        t, modal = past[-1]
        noise = liquids.noise(min(NOISE, 0.02 * self._setting.limits.height))
        modal = modal + noise * rng.normal(size=modal.shape)
        with np.errstate(invalid="ignore", over="ignore"):
            place = (modal[:, 0] + 1j * modal[:, 1]) * lie.turned
            speed = (modal[:, 2] + 1j * modal[:, 3]) * lie.turned
        stamp = self._now - round((self._robot.t - t) * SECOND) + round(lie.late * SECOND)
        if lie.frozen:
            stamp = self._now - round(0.02 * SECOND)
        told = np.column_stack([place.real, place.imag, speed.real, speed.imag])
        stddev = NOISE if math.isnan(lie.stddev) else lie.stddev
        factor = liquids.frequency_factor if math.isnan(lie.factor) else lie.factor
        self._governor.see(SeenLiquid(stamp, told, stddev, factor, 0.0))

    def _events(self) -> list[tuple[float, Callable[[], None]]]:
        """Draws when what goes wrong: times [s] and what happens then."""
        rng, end = self._rng, float(self._t[-1])
        what = {CLOCK: self._turn_clock, AGAIN: self._tell_again, OTHER: self._exchange,
                KILLED: self._kill}.get(self._kind)  # fmt: skip
        if what is None:
            return []
        times = np.sort(rng.uniform(0.1, 0.9, size=int(rng.integers(1, 4)))) * end
        return [(float(t), what) for t in times]

    def _turn_clock(self) -> None:
        size = float(self._rng.choice([0.05, 0.3, 10.0, 1000.0])) * self._rng.choice([-1.0, 1.0])
        self._clock += round(size * SECOND)

    def _tell_again(self) -> None:
        """Stops, and begins anew at rest with another limit, as the node does."""
        self._stop()
        limits = self._setting.limits
        height = limits.height * self._rng.uniform(0.8, 1.1)
        self._setting = self._setting._replace(limits=replace(limits, height=height))
        self._governor = self._setting.governor()
        self._wait()

    def _stop(self) -> None:
        self._governor.stop()
        while not self._governor.rests and self._governor.commands:
            self._step()
            self._follow(self._period)

    def _exchange(self) -> None:
        """Stops; another container, whose liquid may move, takes the place of this one."""
        before = self._setting
        self._stop()
        for _ in range(20):
            try:
                setting = drawn_setting(self._rng)._replace(rate=before.rate)
                self._governor = setting.governor()
            except SloshPlanError:
                continue
            self._setting = setting
            self._liquids = setting.liquids(self._rng, self.count)
            self._disturb()
            self._wait()
            return

    def _kill(self) -> None:
        """Ends the governor; the robot brakes, and another governor starts later."""
        self._safe = False
        self._follow(min(0.1, 3.0 * self._period))
        most = self._setting.limits.acceleration
        self._robot.brake(most)
        least = float(np.linalg.norm(self._robot.velocity)) / most
        self._follow(least + self._rng.uniform(0.0, 6.0) * self._liquids.period)
        self._governor = self._setting.governor()
        self._wait()

    def _disturb(self) -> None:
        """Moves the liquid by a wave of up to the largest one."""
        rng = self._rng
        height = self._liquids.largest * rng.uniform(0.05, 1.0)
        self._liquids.disturb(height, rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.0, 6.3))

    def _wait(self) -> None:
        """Lets the liquid decay at rest under a governor that has begun, or not at all."""
        if self._rng.random() < 0.4:
            return
        seconds = self._liquids.period * math.exp(self._rng.uniform(0.0, math.log(300.0)))
        self._liquids.decay(seconds)
        self._governor.wait_since(self._now - round(seconds * SECOND))


def run(kind: str, seed: int) -> Told:
    """Runs one stream of a kind."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    try:
        stream = Stream(kind, rng)
    except SloshPlanError:
        return Told(refused=1.0)
    return stream.run()


def row(kind: str, runs: Array) -> str:
    """Formats the results (N, 6) of `run` as a table row."""
    refused, ran = int(runs[:, 0].sum()), runs[runs[:, 0] == 0.0]
    _, liquids, safe, anyway, share, way = ran.T
    return (
        f"| {kind} | {len(runs)} | {refused} | {int(liquids.sum())} | {int((safe > 1.0).sum())} "
        f"| {safe.max():.3f} | {int((anyway > 1.0).sum())} | {100 * np.mean(share):.0f} % "
        f"| {100 * np.nanmedian(way):.0f} % |"
    )


def main() -> int:
    """Runs all streams and writes the table; returns the exit code."""
    rows = [(partial(run, kind), partial(row, kind)) for kind in KINDS]
    return write_table(__doc__, "streams", HEAD, rows, PAGE)


if __name__ == "__main__":
    sys.exit(main())

"""Checks messages of a motion against themselves and against their neighbours.

Each check takes the messages in the order in which they came, live, from a recording and from a
table alike, and costs some additions per message:

- `ToAndFro`: two publishers on one topic, one of them late: single steps lead back although the
  motion leads on. A single publisher's do not, whatever its stamps say.
- `Dropouts`: velocities that are zero now and then.
- `Stairs`: values that are renewed at a lower rate than they are sent.
- `TwistCheck`: a velocity that is not the change of the pose beside it.
- `unstamped`: stamps that were never filled.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from slosh_base.files.nanoseconds import SECOND
from slosh_motion.checks.constancy import Vector
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.checks.input_faults import MIXED_INPUT
from slosh_motion.tuning import TUNING

UNSTAMPED_REMEDY = "the driver does not fill header.stamp; let it write the time of measurement"
_NOWHERE: Vector = (0.0, 0.0, 0.0)


class ToAndFro:
    """Finds two publishers on one topic, one of them late, by positions in order of arrival.

    Args:
        noun: what comes, in the plural.

    Attributes:
        found: whether the last motion went to and fro.
        raised: what was wrong at any time, with the remedy; None: nothing.
    """

    def __init__(self, noun: str) -> None:
        self.found = False
        self.raised: Doubt | None = None
        self._noun = noun
        # Of the last changes: where they began, those that led back, and those larger than all
        # later ones, whose first is the largest.
        self._places: deque[Vector] = deque(maxlen=TUNING.fro_window)
        self._backs: deque[tuple[int, float]] = deque()
        self._largest: deque[tuple[int, float]] = deque()
        self._count = 0
        self._last: Vector | None = None
        self._step = _NOWHERE
        self._turned = False  # whether the last step led back
        self._size = self._before = 0.0  # of the last two steps
        self._noise = self._finest = math.inf
        self._straight = 0

    def take(self, position: Vector) -> None:
        """Adds a position [m]."""
        last, self._last = self._last, position
        if last is None:
            return
        dx, dy, dz = position[0] - last[0], position[1] - last[1], position[2] - last[2]
        size, (bx, by, bz) = math.hypot(dx, dy, dz), self._step
        turns = dx * bx + dy * by + dz * bz < 0.0
        number = self._count = self._count + 1
        if turns and self._turned:
            back = min(self._size, max(size, self._before))
            if back > TUNING.fro_least:
                self._backs.append((number, back))
        self._turned, self._before, self._size = turns, self._size, size
        self._step = dx, dy, dz
        self._places.append(last)
        largest = self._largest
        while largest and largest[-1][1] <= size:
            largest.pop()
        largest.append((number, size))
        if 0.0 < size < self._finest:
            self._finest = size  # rounded positions flicker by this
        if number >= TUNING.fro_window:
            self._judge(number - TUNING.fro_window, math.dist(position, self._places[0]))

    def _judge(self, before: int, way: float) -> None:
        """Looks at the changes after the one with a number, which lead so far [m]."""
        backs, largest = self._backs, self._largest
        while backs and backs[0][0] <= before:
            backs.popleft()
        while largest[0][0] <= before:
            largest.popleft()
        if self._noise > largest[0][1]:
            self._noise = largest[0][1]  # the least of any time: what a tracker at rest does
        if way < TUNING.fro_way:
            return
        if len(backs) < TUNING.fro_turns:
            self._straight = self._straight + 1 if not backs else 0
            self.found = self.found and self._straight < TUNING.fro_over
            return
        self._straight = 0
        mean = sum(back for _, back in backs) / len(backs)
        if (
            mean > TUNING.fro_noises * max(self._noise, self._finest)
            and way > TUNING.fro_leads * mean
        ):
            self.found = True
            self.raised = Doubt(f"successive {self._noun} go to and fro: {MIXED_INPUT}")


class Dropouts:
    """Finds velocities that are zero now and then, although the frame moves on.

    A frame does not stop and go on within so few messages with such an acceleration.

    Args:
        noun: what comes, in the plural.
    """

    def __init__(self, noun: str) -> None:
        self._noun, self._count, self._zeros = noun, 0, 0
        self._speed, self._stamp_ns = 0.0, 0

    def take(self, stamp_ns: int, velocity: Vector) -> None:
        """Adds a velocity [m/s] with its stamp [ns]."""
        speed = math.hypot(*velocity)
        if speed == 0.0:
            self._zeros += 1
            return
        seconds = (stamp_ns - self._stamp_ns) * 1e-9
        slower = min(speed, self._speed)
        if 0 < self._zeros <= TUNING.drop_most and (
            2.0 * slower > max(TUNING.drop_acceleration * seconds, TUNING.drop_speed)
        ):
            self._count += self._zeros
        self._zeros, self._speed, self._stamp_ns = 0, speed, stamp_ns

    @property
    def raised(self) -> Doubt | None:
        """What was wrong at any time, with the remedy; None: nothing."""
        if not self._count:
            return None
        return Doubt(
            f"{self._count} of the {self._noun} are zero between others that are not: the driver "
            "sends zeros now and then, which are jolts; mend it"
        )


class Stairs:
    """Finds values that are renewed at a lower rate than they are sent.

    Args:
        noun: what comes, in the plural.
        least: change over the compared values that is a motion [m or m/s].

    Attributes:
        found: whether the last values rose in stairs.
        raised: what was wrong at any time, with the remedy; None: nothing.
    """

    def __init__(self, noun: str, least: float) -> None:
        self.found = False
        self.raised: Doubt | None = None
        self._noun, self._least = noun, least
        self._runs: deque[tuple[int, int, float, Sequence[float]]] = deque(
            maxlen=TUNING.stair_runs
        )
        self._values: Sequence[float] = ()
        self._since_ns = self._count = 0
        self._finest = math.inf

    def take(self, stamp_ns: int, values: Sequence[float]) -> None:
        """Adds the values of a message with its stamp [ns]."""
        if values == self._values:
            self._count += 1
            return
        if self._values:
            step = math.dist(values[:3], self._values[:3])
            if step > 0.0:
                self._finest = min(self._finest, step)
                self._runs.append((self._count, stamp_ns - self._since_ns, step, self._values))
                if len(self._runs) == TUNING.stair_runs:
                    self._judge(math.dist(values[:3], self._runs[0][3][:3]))
        self._values, self._since_ns, self._count = tuple(values), stamp_ns, 1

    def _judge(self, way: float) -> None:
        counts = sorted(run[0] for run in self._runs)
        held = sorted(run[1] for run in self._runs)[len(counts) // 2]
        typical = counts[len(counts) // 2]
        steps = [run[2] for run in self._runs]
        # A shake at a quarter of the rate has pairs, too, but leads nowhere. Rounding makes pairs
        # of what rests, and the motion after it the way: each stair must be part of it.
        if way <= self._least or sorted(steps)[1] < TUNING.stair_share * way:
            return
        regular = typical >= 2 and counts[0] >= typical - 1 and counts[-1] <= typical + 1
        coarse = sorted(steps)[len(steps) // 2] < TUNING.stair_quanta * self._finest
        if regular and not coarse and held > TUNING.stair_ns:
            self.found = True
            self.raised = Doubt(
                f"the {self._noun} are sent at {typical * SECOND / held:.3g} Hz and renewed at "
                f"{SECOND / held:.3g} Hz: they rise in stairs; send each value once, with the "
                "stamp of its measurement"
            )
        elif typical == 1:
            self.found = False


class TwistCheck:
    """Compares the twist of an Odometry message with the change of the pose in it.

    Over stretches of time the integral of the twist, in the axes of the moving frame and as it was
    sent, is compared with the way of the pose. A stretch in which the pose is corrected by a jump
    is one of several.

    Attributes:
        found: whether the last stretches show a wrong twist.
        raised: what was wrong at any time, without a remedy; None: nothing.
        pose_tells: whether it was shown that the pose is right where the twist is wrong.
    """

    def __init__(self) -> None:
        self.found = self.pose_tells = False
        self.raised: Doubt | None = None
        self._last: tuple[int, Vector, Vector] | None = None  # stamp, velocity turned, as sent
        self._start: tuple[int, Vector] | None = None
        self._turned = self._sent = _NOWHERE
        self._stretches: deque[tuple[float, float, float, float]] = deque(
            maxlen=TUNING.twist_stretches
        )

    def take(self, stamp_ns: int, position: Vector, turned: Vector, sent: Vector) -> None:
        """Adds a message.

        Args:
            stamp_ns: the moment [ns].
            position: of the moving frame [m].
            turned: the velocity, from the moving frame's axes to the parent's [m/s].
        """
        if not math.isfinite(sum(position) + sum(turned) + sum(sent)):
            return
        last, self._last = self._last, (stamp_ns, turned, sent)
        seconds = (stamp_ns - last[0]) * 1e-9 if last is not None else 0.0
        if last is None or self._start is None or not 0.0 < seconds < TUNING.twist_gap:
            self._start = stamp_ns, position
            self._turned = self._sent = _NOWHERE
            return
        self._turned = _integrated(self._turned, 0.5 * seconds, last[1], turned)
        self._sent = _integrated(self._sent, 0.5 * seconds, last[2], sent)
        if stamp_ns - self._start[0] >= TUNING.twist_ns:
            way = _difference(position, self._start[1])
            self._compare(way)
            self._start = stamp_ns, position
            self._turned = self._sent = _NOWHERE

    def _doubt(self) -> tuple[Doubt, bool] | None:
        """Returns what is wrong, and whether the pose is right; None: nothing is known."""
        bad = [row for row in self._stretches if _is_bad(*row)]
        if len(bad) < TUNING.twist_least or 2 * len(bad) < len(self._stretches):
            return None
        way, told, error, parents = (sum(column) for column in zip(*bad, strict=True))
        if told < TUNING.twist_nothing * way:
            text = (
                f"the twist of the odometry stays zero while its pose moves by {way:.2g} m: the "
                "driver does not fill it"
            )
            return Doubt(text), True
        if way < TUNING.twist_nothing * told:
            text = (
                f"the pose of the odometry stands while its twist moves by {told:.2g} m: the "
                "attitude is not known; turns are not seen"
            )
            return Doubt(text, wrong=False), False
        if parents < TUNING.twist_error * min(way, error):
            text = (
                "the twist of the odometry agrees with its pose in the axes of header.frame_id; "
                "it must have those of child_frame_id"
            )
            return Doubt(text), True
        text = (
            f"the twist of the odometry moves by {told:.2g} m where its pose moves by {way:.2g} "
            "m: unit, axes or clock of one of them is wrong"
        )
        return Doubt(text), False

    def _compare(self, way: Vector) -> None:
        """Adds a stretch: way, told way, and their differences turned and as sent [m]."""
        moved, told = math.hypot(*way), math.hypot(*self._turned)
        if max(moved, told) < TUNING.twist_way:
            return
        self._stretches.append(
            (moved, told, math.dist(way, self._turned), math.dist(way, self._sent))
        )
        found = self._doubt()
        self.found = found is not None and found[0].wrong
        if found is not None:
            self.raised, pose_tells = found
            self.pose_tells |= pose_tells


def _is_bad(way: float, told: float, turned: float, parents: float) -> bool:
    """Returns whether a stretch shows a wrong twist.

    Args:
        way: of the pose [m].
        told: way of the twist [m].
        turned: their difference, of the twist in the moving frame's axes [m].
        parents: the same of the twist in the parent's axes [m].
    """
    share = turned / max(way, told)
    better = parents < TUNING.twist_error * turned
    return share > TUNING.twist_error or (share > TUNING.twist_slight and better)


def unstamped(stamped: int, total: int, topic: str) -> str:
    """Returns why a recorded topic cannot be used, if no stamp was filled; else an empty text.

    Args:
        stamped: messages whose stamp is not 0.
    """
    if stamped or total < 2:
        return ""
    return f"all {total} messages of {topic} are stamped 0: {UNSTAMPED_REMEDY}, and record again"


def _integrated(total: Vector, half: float, before: Vector, now: Vector) -> Vector:
    return (
        total[0] + half * (before[0] + now[0]),
        total[1] + half * (before[1] + now[1]),
        total[2] + half * (before[2] + now[2]),
    )


def _difference(one: Vector, other: Vector) -> Vector:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]

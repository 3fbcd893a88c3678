"""Reads poses of the container (PoseStamped) and differentiates them twice.

`pose_filter` says how. A sample carries the stamp to which it applies, the centre
of the window: the estimate comes half a window late, but with no phase error.

Angular velocity and acceleration are found in the same way from the rotations that lead from the
centre's attitude to those of the window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_motion.checks.constancy import began_doubt, speed_at_start
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.checks.input_checks import PoseCheck
from slosh_motion.checks.message_checks import Stairs, ToAndFro
from slosh_motion.checks.stamp_checks import JitterCheck
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import (
    Base,
    Quaternion,
    SensorTransform,
    ToolPose,
    Vector,
    composed,
    yaw_of_quaternion,
)
from slosh_motion.inputs.gate import GateSettings, SampleGate, SampleVerdict, fault_of
from slosh_motion.inputs.kept_poses import NUMBERS, KeptPoses, Leap, leap_doubt
from slosh_motion.inputs.pose_filter import (
    CUBIC,
    FEWEST,
    PoseFilter,
    even_times,
    first_derivative,
    second_derivative,
    turning,
)
from slosh_motion.inputs.sampling import MEMORY, SECONDS_PER_NS, Modes, Sample, Sampling
from slosh_motion.inputs.sensor_inputs import CheckedInput, remembered
from slosh_motion.tuning import TUNING

MINIMUM_WINDOW = 2 * FEWEST + 1
_NO_LEAP = Leap(0.0, 0.0, 0.0)


class _Pose(NamedTuple):
    """A pose of the container.

    Attributes:
        stamp_ns: the moment [ns].
        place: position [m] and quaternion.
        now_ns: the time of arrival [ns]; None: not known.
    """

    stamp_ns: int
    place: tuple[Vector, Quaternion]
    now_ns: int | None

    @property
    def values(self) -> tuple[float, ...]:
        """Position and quaternion as numbers."""
        return (*self.place[0], *self.place[1])


class PoseInput(CheckedInput):
    """Converts poses in world axes to input samples.

    Args:
        settings: limits of the gate.
        window: length of the window [s]; 0.0: the longest that carries the modes. A whole number
            counts poses, odd, to which cubics are fitted, as old recordings have it.
        transform: container ← the frame whose pose is published.
        frame: name of the world's frame; poses in any other are dropped, but for those that name
            none; None: all are taken.
        any_frame: whether poses in other frames are taken, too, and that is told.
        checks: see `InputSettings`.
        noun: what comes, in the plural, for what is told of its rate.
        smoothing: half of the window [s], and by that the polynomial's degree; 0.0: as `window`.
        base: another frame in which poses come, and where it stands in the world; None: none.

    Attributes:
        sampling: knows their rate, and is told the modes that they must carry.
        jumps: of the tracker, so far.

    Raises:
        SloshMotionError: the window is negative; a count is even or too small.
    """

    check: PoseCheck
    ORDER = 2
    """Of the derivative of the vectors that come."""
    LARGEST = TUNING.farthest
    """Size up to which a vector is possible."""
    STAIR = TUNING.stair_way
    """Change of the vector that is a motion."""

    def __init__(
        self,
        settings: GateSettings,
        window: float = 0.0,
        transform: SensorTransform | None = None,
        frame: str | None = None,
        any_frame: bool = False,
        checks: bool | None = None,
        noun: str = "poses",
        smoothing: float = 0.0,
        base: Base | None = None,
    ) -> None:
        mount = transform or SensorTransform()
        super().__init__(PoseCheck(mount.matrix), checks)
        self._tool = ToolPose(mount)
        self._frame, self._any_frame = frame, any_frame or frame is None
        self._other_frame: str | None = None
        self._told = 0
        count = window if isinstance(window, int) else 0
        if isinstance(window, int) and (window < MINIMUM_WINDOW or window % 2 == 0):
            raise SloshMotionError(
                f"window = {window!r} must be odd and at least {MINIMUM_WINDOW}"
            )
        if not 0.0 <= window < math.inf:
            raise SloshMotionError(f"window = {window!r} s must be 0.0 or a positive duration")
        self.gate = SampleGate(settings)
        given = "smoothing" if smoothing else "pose_window" if window else ""
        remedy = f"set {given} to 0.0" if given else "use the input accel or imu"
        self.sampling = Sampling(noun, self._gain, remedy)
        self.jumps = 0
        self._noun = noun
        self._to_and_fro, self._stairs = ToAndFro(noun), Stairs(noun, self.STAIR)
        self._jitter = JitterCheck(noun, self.ORDER)
        self._leaps, self._largest = 0, _NO_LEAP
        self._aside: list[_Pose] = []  # leapt; whether they are used, the next ones tell
        self._count, self._seconds = count, 0.0 if count else float(window)
        self._poses = KeptPoses()
        self._at = count // 2  # the next centre
        self._restarted = True
        self._smoothing, self._base = smoothing, base
        self._filter = self._filter_of(())
        self._modes: Modes = ()
        self._interval_ns = self._reach_ns = self._wait_ns = 0
        self._misfit = 0.0, 0.0
        derivative = second_derivative if self.ORDER == 2 else first_derivative
        self._derivative, self._turning = derivative.load(), turning.load()
        self._even_times = even_times.load()

    def update(
        self,
        stamp_ns: int,
        position: tuple[float, float, float],
        quaternion: tuple[float, float, float, float],
        now_ns: int | None = None,
        frame: str = "",
    ) -> list[Sample]:
        """Returns the samples that a pose completes; their stamps lie half a window before it.

        None while the window fills; mostly one; several where poses come slowly.

        Args:
            stamp_ns: the moment [ns].
            position: of the frame that is published, in the world [m].
            quaternion: x, y, z, w, world ← that frame; of any length within LENGTHS.
            now_ns: the time of arrival [ns].
        """
        if self._base is not None and frame == self._base.frame:
            position, quaternion = composed(self._base.pose, (position, quaternion))
        elif frame != self._frame and self._strange(frame):
            return []
        fault = fault_of(position, self.LARGEST) or _fault_of_attitude(quaternion)
        if fault is not None:
            self.gate.judge(stamp_ns, None, now_ns, fault)
            return []
        self._look(stamp_ns, position, quaternion)
        pose = _Pose(stamp_ns, self._tool.container(position, quaternion), now_ns)
        leap = self._leap(pose)
        if leap is not None:
            self._largest = max(self._largest, leap)
            self._aside.append(pose)
            if len(self._aside) < TUNING.agreeing:
                return []
            pose = self._aside.pop()
        aside, self._aside = self._aside, []
        way = self._way(aside, pose) if leap is None else False
        self._leaps += 0 if way or leap is not None else len(aside)
        found: list[Sample] = []
        for one in aside:
            found += self._take(one, None if way else SampleVerdict.JUMP)
        return found + self._take(pose, None, jumped=leap is not None)

    def _take(
        self, pose: _Pose, fault: SampleVerdict | None, *, jumped: bool = False
    ) -> list[Sample]:
        """Returns the samples that a pose completes.

        Args:
            fault: what is wrong with it; None: nothing is known.
            jumped: whether a new motion begins with it.
        """
        stamp_ns, (position, quaternion), now_ns = pose
        verdict = self.gate.judge(stamp_ns, None, now_ns, fault)
        if verdict not in (SampleVerdict.USE, SampleVerdict.RESTART):
            return []
        restarted = verdict is SampleVerdict.RESTART
        doubtful = self.check.add(
            stamp_ns, self._place_of(stamp_ns, position), quaternion, restarted=restarted
        )
        doubtful = doubtful and self.flags
        jumped = jumped and not restarted
        self.jumps += jumped
        if restarted or jumped:
            self._poses.clear()
            self._at = self._count // 2
            self._restarted = True
        self.sampling.take(self.gate.interval_ns, restarted=restarted)
        self._poses.append(stamp_ns, (*position, *quaternion))
        found: list[Sample] = []
        while True:
            window = self._fixed_window() if self._count else self._window()
            if window is None:
                break
            found += self._samples(*window, doubtful=doubtful)
            self._at += 1
        for sample in found:
            self.check.faults.take(sample.stamp_ns, (sample.ax, sample.ay, sample.az))
        return found

    @property
    def delay(self) -> float:
        """Delay of the estimates [s], half the window; 0 if it is not yet known."""
        if self._count:
            return (self._count // 2) * self.sampling.seconds
        interval = self.sampling.seconds
        return self._filter.side(interval) * interval if interval else 0.0

    @property
    def memory(self) -> list[float]:
        """Returns the input reader's state as numbers for `take_up`, mainly the window's poses."""
        first = max(self._at - 1 - self._count // 2, 0) if self._count else 0
        rows = self._poses.rows(first)
        checked = self.checked_memory(self._poses.newest_ns if len(self._poses) else 0)
        if self._count:
            return [*rows, *checked]
        return [float(self._at), *self._misfit, *self.sampling.memory, *rows, *checked]

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Restores the reader's state from the numbers that `memory` returned.

        Raises:
            SloshMotionError: the memory is of another kind of input or another window.
        """
        memory = self.take_up_check(stamp_ns, memory)
        if self._count:
            self._poses.fill(stamp_ns, remembered(memory, (NUMBERS + 1) * self._count))
            self._at = self._count // 2 + 1
        else:
            begin = 3 + MEMORY
            rows = len(memory) - begin
            if rows < (NUMBERS + 1) * MINIMUM_WINDOW or rows % (NUMBERS + 1):
                raise SloshMotionError(
                    f"saved state of a pose input with {len(memory)} values: wrong number"
                )
            self._at, self._misfit = round(memory[0]), (memory[1], memory[2])
            self.sampling.take_up(memory[3:begin])
            self._poses.fill(stamp_ns, memory[begin:])
        self._restarted = False
        self.gate.go_on(stamp_ns, None)

    def warning(self) -> str | None:
        """Returns a warning with a remedy; None if nothing is wrong."""
        strange = self.gate.counts[SampleVerdict.WRONG_FRAME]
        new, self._told = strange - self._told, strange
        if new:
            return self.refusal()
        if self.jumps:
            return (
                f"{self.jumps} jumps in the {self._noun} that last: check the tracker, and that "
                "positions are in m"
            )
        return None

    def remark(self) -> str | None:
        """Returns a remark about an assumed coordinate frame; None if no frame is assumed."""
        if (
            self._frame is not None
            and self._other_frame is not None
            and not self.gate.counts[SampleVerdict.WRONG_FRAME]
        ):
            named = (
                f"in the frame {self._other_frame!r}" if self._other_frame else ("without a frame")
            )
            return f"poses {named} are assumed to be in the world's frame, z up"
        return None

    def refusal(self) -> str | None:
        """Returns why poses in a wrong coordinate frame were dropped; None if none were."""
        if not self.gate.counts[SampleVerdict.WRONG_FRAME]:
            return None
        return (
            f"poses in the frame {self._other_frame!r} are dropped: publish them in "
            f"{self._frame!r}, publish the transforms (/tf) that connect the two frames, or set "
            "world_frame to their frame if its z axis points up"
        )

    def _strange(self, frame: str) -> bool:
        """Returns whether a pose is dropped because it is in a wrong coordinate frame."""
        if self._other_frame is None or frame:
            self._other_frame = frame
        if self._any_frame or not frame:
            return False
        self.gate.refuse(SampleVerdict.WRONG_FRAME)
        return True

    def _place_of(self, stamp_ns: int, vector: Vector) -> Vector:
        """Returns the pose's position [m], as used by the plausibility check."""
        return vector

    def _look(
        self, stamp_ns: int, position: Vector, quaternion: tuple[float, float, float, float]
    ) -> None:
        """Checks a message against those before it."""
        self._to_and_fro.take(position)
        self._stairs.take(stamp_ns, (*position, *quaternion))
        self._jitter.take(stamp_ns, position)

    def _leap(self, pose: _Pose) -> Leap | None:
        """Returns the change to a pose to which the motion before does not lead; None: it does.

        Poses that leap are set aside; if so many follow each other, the motion is a new one.
        """
        poses = self._poses
        if not len(poses):
            return None
        if self._aside and Leap.between(self._aside[-1].values, pose.values, 0.0).is_small():
            return _NO_LEAP
        seconds = (pose.stamp_ns - poses.newest_ns) * SECONDS_PER_NS
        if not 0.0 < seconds <= self.gate.max_gap_ns * SECONDS_PER_NS:
            return None
        leap = Leap.between(poses.values[-1].tolist(), pose.values, seconds)
        beyond = not leap.is_small() and leap.is_beyond(poses.changes(), self.sampling.seconds)
        return leap if beyond else None

    def _way(self, aside: list[_Pose], pose: _Pose) -> bool:
        """Returns whether poses that were set aside lie on the way to the next one."""
        if not aside or not len(self._poses):
            return False
        places = [self._poses.values[-1].tolist(), *(one.values for one in aside), pose.values]
        return Leap.between(places[0], places[-1], 0.0).is_way_of(
            [Leap.between(*pair, 0.0) for pair in pairwise(places)]
        )

    def message_doubts(self) -> tuple[Doubt, ...]:
        """Returns what messages that contradict each other show."""
        leaps = leap_doubt(self._leaps, self._largest, self._noun) if self._leaps else None
        jitter = None
        if self._to_and_fro.raised is None and self._stairs.raised is None:  # they scatter, too
            modes = self.sampling.modes
            frequency = modes[0][1] if modes else TUNING.fastest_mode
            jitter = self._jitter.doubt(frequency, self.sampling.seconds)
        found = (self._to_and_fro.raised, self._stairs.raised, leaps, jitter)
        return tuple(doubt for doubt in found if doubt is not None)

    @property
    def contested(self) -> bool:
        """Whether successive messages show two publishers."""
        return self.flags and self._to_and_fro.found

    @property
    def contradicted(self) -> bool:
        """Whether values are renewed at a lower rate than they are sent."""
        return self.flags and self._stairs.found

    def _gain(self, frequency: float, interval: float) -> float:
        return self._filter_of(self.sampling.modes).gain(frequency, interval)

    def _filter_of(self, modes: Modes) -> PoseFilter:
        if self._smoothing:
            return PoseFilter.smoothing(modes, self._smoothing, self.ORDER)
        return PoseFilter.of(modes, self._seconds, self.ORDER)

    def _fixed_window(self) -> tuple[int, int] | None:
        """Returns first and end index of the fixed-length window, or None if it is incomplete."""
        side = self._count // 2
        # One more than the window stays, for the memory.
        self._at -= self._poses.forget(self._at - 1 - side)
        window = self._at - side, self._at + side + 1
        return window if window[1] <= len(self._poses) else None

    def _window(self) -> tuple[int, int] | None:
        """Returns first and end index of the next pose window, or None if it is incomplete."""
        self._choose()
        if not self._reach_ns:
            return None
        stamps = self._poses.stamps
        while self._at + FEWEST < len(stamps):
            centre = int(stamps[self._at])
            first = int(np.searchsorted(stamps, centre - self._reach_ns))
            first = max(min(first, self._at - FEWEST), 0)
            if not self._restarted:
                dropped = self._poses.forget(min(first, self._at - TUNING.clock_poses))
                if dropped:
                    self._at -= dropped
                    continue
            if int(stamps[-1]) - centre < self._wait_ns:
                return None
            if self._restarted and (self._at < FEWEST or centre - int(stamps[0]) < self._wait_ns):
                self._at += 1
                continue
            end = int(np.searchsorted(stamps, centre + self._reach_ns, side="right"))
            return first, max(end, self._at + FEWEST + 1)
        return None

    def _choose(self) -> None:
        """Selects the window's length for the current rate of poses and the sloshing modes."""
        sampling = self.sampling
        if sampling.interval_ns == self._interval_ns and sampling.modes is self._modes:
            return
        self._interval_ns, self._modes = sampling.interval_ns, sampling.modes
        self._filter = self._filter_of(self._modes)
        side = self._filter.side(sampling.seconds) if self._interval_ns else 0
        # A pose at the edge of the window is in it in spite of jitter.
        self._reach_ns = (2 * side + 1) * self._interval_ns // 2
        self._wait_ns = (2 * side - 1) * self._interval_ns // 2

    def _samples(self, first: int, end: int, *, doubtful: bool) -> list[Sample]:
        """Returns the input samples at and around the centre pose of a pose window."""
        stamps, values = self._poses.stamps, self._poses.values
        centre_ns = int(stamps[self._at])
        tau = np.asarray((stamps[first:end] - centre_ns) * SECONDS_PER_NS, dtype=np.float64)
        positions = np.ascontiguousarray(values[first:end, :3])
        attitudes = np.ascontiguousarray(values[first:end, 3:])
        terms, shift = CUBIC, 0.0
        if not self._count:
            terms = self._filter.terms(len(tau))
            tau, shift = self._put_in_time(first, end, tau, positions)
        found = []
        for offset_ns in (0,) if self._count else self._offsets():
            offset = shift + offset_ns * SECONDS_PER_NS
            ax, ay, az = self._derivative(tau, positions, terms, offset)
            pose = self._turning(tau, attitudes, terms, offset)
            attitude = pose[:4] if offset else values[self._at, 3:].tolist()
            restarted, self._restarted = self._restarted, False
            moving = self._beginning.open and self._began_moving(end)
            yaw = yaw_of_quaternion(*attitude)
            slow, stamp_ns = self.sampling.slow, centre_ns + offset_ns
            found.append(
                Sample(stamp_ns, ax, ay, az, yaw, restarted, pose, doubtful, slow, moving)
            )
        return found

    def _began_moving(self, end: int) -> bool:
        """Returns whether the poses up to an index move already at the first of them."""
        if end < TUNING.began_poses:
            return False
        self.assume_rest()
        stamps, values = self._poses.stamps[:end], self._poses.values[:end, :3]
        seconds = (stamps - stamps[0]) * SECONDS_PER_NS
        speed = speed_at_start(seconds, values, self.ORDER - 1)
        if speed and self.flags:
            self.began = began_doubt(f"{speed:.2g} m/s")
        return self.began is not None

    def _put_in_time(
        self, first: int, end: int, tau: Array, positions: Array
    ) -> tuple[Array, float]:
        """Returns times (N,) [s] of a window's poses, corrected for jitter of the stamps.

        A controller or a camera measures evenly, and its messages are often stamped when they
        arrive: then the motion is smoother at the ticks of an even clock. Others measure unevenly
        and stamp rightly: then it is smoother at the stamps. The better of both counts more.

        Args:
            tau: (N,) their stamps, from the centre's [s].
            positions: (N, 3) [m].

        Returns:
            and the centre's stamp from there [s].
        """
        stamps, ticks = self._poses.stamps, np.empty(len(tau))
        known = (stamps[:end] - stamps[self._at]) * SECONDS_PER_NS
        found = self._even_times(ticks, positions, known, first, self.sampling.seconds)
        stamped, even = (
            TUNING.clock_memory * old + new
            for old, new in zip(self._misfit, found[:2], strict=True)
        )
        self._misfit = stamped, even
        if not stamped > 0.0:
            return tau, 0.0
        share = 1.0 / (1.0 + (even / stamped) * (even / stamped))
        return tau + share * (ticks - tau), share * found[2]

    def _offsets(self) -> list[int]:
        """Returns the times of a window's output samples relative to its centre [ns]."""
        before, centre, after = self._poses.stamps[self._at - 1 : self._at + 2].tolist()
        parts = self._filter.parts(0.5 * (after - before) * SECONDS_PER_NS)
        side = parts // 2
        return [
            (centre - before) * k // parts if k < 0 else (after - centre) * k // parts
            for k in range(-side, side + 1)
        ]


def _fault_of_attitude(quaternion: tuple[float, float, float, float]) -> SampleVerdict | None:
    length = math.hypot(*quaternion)
    if TUNING.lengths[0] <= length <= TUNING.lengths[1]:
        return None
    return SampleVerdict.IMPOSSIBLE if math.isfinite(length) else SampleVerdict.NOT_FINITE

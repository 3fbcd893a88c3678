"""Converts accelerations of a moving frame to the container's origin by transforms.

The sensor's frame F and the container C are both in the tree of transforms. With u = x_C - x_F in
the world's axes, the container's origin is accelerated by

    a_C = R_WF a_F + ü,

where ü is the lever arm's share: of an arm r that is fixed in C it is R_WC (ω̇ × r + ω × (ω × r)).
Angular velocity and lever arm come out of the transforms' own motion, by the filter of poses
(`pose_filter`). The angular part of AccelStamped is not used: an angular velocity
integrated from it drifts, is not known at the start, and many drivers leave it at zero. So an
acceleration is answered half a window later, when the transforms around it are known.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.inputs.aligned import AlignedStreams, Lead, Values, clock_doubt
from slosh_motion.inputs.mounting import Quaternion, rotated
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.rotation import Vector
from slosh_motion.inputs.sample import Pose, Sample
from slosh_motion.inputs.transform_poses import Transform, TransformPoses, between
from slosh_motion.tuning import TUNING

_CONTAINER, _SENSOR = "container", "sensor"


class PlacedAcceleration(NamedTuple):
    """An acceleration of the container's origin, with its stamp and pose.

    Attributes:
        stamp_ns: of the sensor's message [ns].
        vector: in the world's axes, gravity excluded [m/s²].
        pose: how the container stands and turns then.
    """

    stamp_ns: int
    vector: Vector
    pose: Pose


class PlacedAccel:
    """Converts accelerations of a frame to the container's origin and to world axes.

    Args:
        world, container: names of their frames.
        frame: of the accelerations.
        arm: differentiates the lever arm; of its own.
        since_ns: moving transforms before this stamp are not used [ns]; 0: all are.

    Attributes:
        frame: as given.
        since_ns: stamp of the first moving transform that is used [ns]; 0: none has come.
    """

    def __init__(
        self, world: str, container: str, frame: str, arm: PoseInput, since_ns: int = 0
    ) -> None:
        self.frame, self.since_ns = frame, since_ns
        self._chains = {
            _CONTAINER: TransformPoses(world, container), _SENSOR: TransformPoses(world, frame),
        }  # fmt: skip
        self._pairs: AlignedStreams[str] = AlignedStreams(between, self._is_complete)
        self._arm, self._lead = arm, Lead()
        self._sensor: deque[tuple[int, Values]] = deque(maxlen=TUNING.kept_states)
        self._arms: deque[Sample] = deque(maxlen=TUNING.kept_states)
        self._waiting: deque[tuple[int, Vector]] = deque(maxlen=TUNING.kept_states)
        self._given = 0

    def take_transforms(
        self, transforms: Iterable[Transform], *, fixed: bool = False, at_ns: int | None = None
    ) -> list[PlacedAcceleration]:
        """Adds transforms; returns the accelerations that can be converted now, in order.

        Args:
            transforms: of the message.
            fixed: whether they hold for all time.
            at_ns: when the message arrived, or was recorded [ns]; None: not known.
        """
        listed = list(transforms)
        if not fixed and listed:
            self.since_ns = self.since_ns or listed[0].stamp_ns
            listed = [one for one in listed if one.stamp_ns >= self.since_ns]
        for key, chain in self._chains.items():
            for stamp_ns, position, quaternion in chain.take(listed, fixed=fixed, at_ns=at_ns):
                self._pairs.add(key, stamp_ns, (*position, *quaternion))
        for stamp_ns, both in self._pairs.rows():
            self._follow(stamp_ns, both[_CONTAINER], both[_SENSOR])
        return self._completed()

    def take(
        self, stamp_ns: int, vector: Vector, at_ns: int | None = None
    ) -> list[PlacedAcceleration]:
        """Adds an acceleration; returns those that can be converted now, in order.

        Args:
            stamp_ns: the moment [ns].
            vector: in the axes of its frame [m/s²].
            at_ns: when the message arrived, or was recorded [ns]; None: not known.
        """
        if at_ns is not None:
            self._lead.take(stamp_ns, at_ns)
        if self._waiting and stamp_ns < self._waiting[-1][0] - TUNING.set_back_ns:
            self._waiting.clear()
        self._waiting.append((stamp_ns, vector))
        return self._completed()

    def trouble(self) -> str:
        """Returns in one line why accelerations are not converted; empty if they are."""
        for chain in self._chains.values():
            text = chain.trouble(rest=True)
            if text:
                return f"accelerations in the frame {self.frame!r} need its lever arm: {text}"
        if not self._given and len(self._waiting) == TUNING.kept_states:
            return (
                f"accelerations in the frame {self.frame!r} wait for moving transforms that "
                "connect it with the world: publish them, or use the input imu or pose"
            )
        return ""

    def clock_doubt(self) -> Doubt | None:
        """Returns what the arrival shows of the clocks of the sensor and of the transforms."""
        leads: dict[str, Lead] = {}
        for chain in self._chains.values():
            leads |= chain.clocks()
        if self._lead.is_known:
            leads["the accelerations"] = self._lead
        return clock_doubt(leads)

    def facts(self) -> dict[str, str]:
        """Returns the state of the conversion by name, for the diagnostics."""
        chain = next(iter(self._chains[_SENSOR].facts().values()))
        return {"lever arm": f"from transforms: {chain}; {self._arm.delay:.3f} s later"}

    def _is_complete(self) -> bool:
        return len(self._pairs.keys) == len(self._chains)

    def _follow(self, stamp_ns: int, container: Values, sensor: Values) -> None:
        u = tuple(c - f for c, f in zip(container[:3], sensor[:3], strict=True))
        x, y, z, w = container[3:]
        self._sensor.append((stamp_ns, sensor))
        self._arms += self._arm.update(stamp_ns, (u[0], u[1], u[2]), (x, y, z, w))

    def _completed(self) -> list[PlacedAcceleration]:
        found = []
        while self._waiting and self._arms and self._waiting[0][0] <= self._arms[-1].stamp_ns:
            one = self._placed(*self._waiting.popleft())
            found += [one] if one is not None else []
        self._given += len(found)
        return found

    def _placed(self, stamp_ns: int, vector: Vector) -> PlacedAcceleration | None:
        """Converts one acceleration; returns None if the transforms have a gap at its stamp."""
        arms = _around(self._arms, stamp_ns)
        turn = _turn_at(self._sensor, stamp_ns)
        if arms is None or turn is None:
            return None
        before, after = arms
        apart = after.stamp_ns - before.stamp_ns
        share = (stamp_ns - before.stamp_ns) / apart if apart else 0.0
        x, y, z = (a + share * (b - a) for a, b in zip(before[1:4], after[1:4], strict=True))
        ax, ay, az = rotated(turn, vector)
        return PlacedAcceleration(stamp_ns, (ax + x, ay + y, az + z), _mixed(before, after, share))


def _around(arms: deque[Sample], stamp_ns: int) -> tuple[Sample, Sample] | None:
    """Returns the two transform samples around a stamp [ns]; drops earlier samples."""
    while len(arms) > 1 and arms[1].stamp_ns <= stamp_ns:
        arms.popleft()
    before = arms[0]
    after = arms[1] if len(arms) > 1 else before
    if before.stamp_ns > stamp_ns or (after.restarted and after.stamp_ns > stamp_ns):
        return None
    return (before, before) if before.stamp_ns == stamp_ns else (before, after)


def _turn_at(sensor: deque[tuple[int, Values]], stamp_ns: int) -> Quaternion | None:
    """Returns the sensor's attitude at a stamp, world ← sensor; drops earlier transforms."""
    while len(sensor) > 1 and sensor[1][0] <= stamp_ns:
        sensor.popleft()
    before = sensor[0]
    if before[0] > stamp_ns:
        return None
    values = before[1]
    if before[0] < stamp_ns:
        if len(sensor) < 2:
            return None
        after = sensor[1]
        share = (stamp_ns - before[0]) / (after[0] - before[0])
        values = between(before[1], after[1], share)
    x, y, z, w = values[3:]
    return x, y, z, w


def _mixed(before: Sample, after: Sample, share: float) -> Pose:
    """Interpolates the container's pose between two samples, with a unit quaternion."""
    one, other = before.pose, after.pose
    assert one is not None
    assert other is not None
    sign = 1.0 if sum(a * b for a, b in zip(one[:4], other[:4], strict=True)) >= 0.0 else -1.0
    turn = [a + share * (sign * b - a) for a, b in zip(one[:4], other[:4], strict=True)]
    size = math.hypot(*turn)
    x, y, z, w = (value / size for value in turn)
    rest = [a + share * (b - a) for a, b in zip(one[4:], other[4:], strict=True)]
    wx, wy, wz, dx, dy, dz = rest
    return x, y, z, w, wx, wy, wz, dx, dy, dz

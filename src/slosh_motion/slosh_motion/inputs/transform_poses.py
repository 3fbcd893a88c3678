"""Computes poses of the container from a tree of transforms (tf2_msgs/TFMessage).

The chain from the world to the container is found as the transforms come; what is fixed is kept,
what moves is brought to the moments of its slowest link (`slosh_motion.inputs.aligned`).

Accelerations of a frame that moves are converted to the container's origin.

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
from typing import Any, NamedTuple

from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.inputs.aligned import AlignedStreams, Lead, Values, clock_doubt
from slosh_motion.inputs.frames import (
    Quaternion,
    TimedPose,
    Transform,
    Vector,
    composed,
    rotated,
    stamp_of,
)
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import Pose, Sample
from slosh_motion.tuning import TUNING

POSED = "the pose"
"""Name of the frame that a pose tells, where its own frame moves: no frame is called so."""


class TransformPoses:
    """Computes poses of one frame relative to another from transforms.

    Args:
        since_ns: moving transforms before this stamp are not used [ns]; 0: those before all links
            of the chain have come, which a recording may hold although a node has not heard them.
            None: all are used.

    Attributes:
        since_ns: as given, or as it turned out; 0: links are still missing.
    """

    def __init__(self, world: str, container: str, since_ns: int | None = None) -> None:
        self.since_ns = since_ns
        self._early: deque[tuple[str, int, Values]] = deque(maxlen=TUNING.kept_states)
        self._is_past = since_ns is None
        self._world, self._container = world.lstrip("/"), container.lstrip("/")
        self._parents: dict[str, str] = {}
        self._fixed: dict[str, Transform] = {}
        self._changed = ""
        self._chain: tuple[str, ...] = ()
        self._streams: AlignedStreams[str] = AlignedStreams(between, self._is_complete)
        self._count = 0
        self._since_ns = 0
        self._newest_ns = 0

    def hear(self, message: Any, at_ns: int | None, *, fixed: bool = False) -> list[TimedPose]:
        """Adds a TFMessage of any reader, or a PoseStamped of a frame that moves; see `take`."""
        if hasattr(message, "transforms"):
            links = map(Transform.of_message, message.transforms)
            return self.take(links, fixed=fixed, at_ns=at_ns)
        p, q = message.pose.position, message.pose.orientation
        place, turn = (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)
        frame, stamp_ns = message.header.frame_id, stamp_of(message)
        return self.take([Transform(frame, POSED, stamp_ns, place, turn)], at_ns=at_ns)

    def take(
        self, transforms: Iterable[Transform], *, fixed: bool = False, at_ns: int | None = None
    ) -> list[TimedPose]:
        """Returns the poses that transforms complete, in order of time.

        Args:
            fixed: whether they hold for all time.
            at_ns: when the message arrived, or was recorded [ns]; None: not known.
        """
        fed = False
        for one in transforms:
            child, parent = one.child.lstrip("/"), one.parent.lstrip("/")
            if self._parents.get(child) != parent:
                self._parents[child] = parent
                self._find_chain()
            if fixed:
                before = self._fixed.get(child)
                if before is not None and before[3:] != one[3:]:
                    self._changed = child
                self._fixed[child] = one
            elif child not in self._fixed and at_ns is not None:
                self._streams.hear(child, one.stamp_ns, at_ns)
            if not fixed and child in self._chain and child not in self._fixed:
                self._newest_ns = max(self._newest_ns, one.stamp_ns)
                self._since_ns = self._since_ns or one.stamp_ns
                values = (*one.position, *one.quaternion)
                fed = self._feed(child, one.stamp_ns, values) or fed
        self._count += not fixed
        return [self._pose(*row) for row in self._streams.rows()] if fed else []

    def _feed(self, child: str, stamp_ns: int, values: Values) -> bool:
        """Stores a moving transform; returns whether it may complete poses."""
        if self._is_past or self.since_ns is None:
            self._streams.add(child, stamp_ns, values)
            return True
        if self.since_ns:
            if stamp_ns >= self.since_ns:
                self._streams.add(child, stamp_ns, values)
            # What comes later with an earlier stamp is of a clock that was set back.
            self._is_past = stamp_ns > self.since_ns + TUNING.set_back_ns
            return stamp_ns >= self.since_ns
        self._early.append((child, stamp_ns, values))
        firsts: dict[str, int] = {}
        for name, then_ns, *_ in self._early:
            firsts.setdefault(name, then_ns)
        if not all(one in self._fixed or one in firsts for one in self._chain):
            return False
        self.since_ns = max(firsts.values())
        early, self._early = list(self._early), deque()
        for one in early:
            self._feed(*one)
        return True

    def trouble(self, *, rest: bool = False) -> str:
        """Returns in one line why poses are missing or wrong; empty if no reason is known.

        Args:
            rest: whether a chain may rest for a long time.
        """
        if self._count < TUNING.first_states:
            return ""
        if not self._chain:
            return (
                f"the transforms do not connect {self._world!r} with {self._container!r}: "
                f"{self._container!r} {self._ends()}; set world_frame and container_frame to "
                "frames of one tree"
            )
        if self._changed in self._chain:
            return (
                f"the fixed transform of {self._changed!r} was published with two values, of "
                "which the last counts: stop one of its publishers, or publish what moves on /tf"
            )
        silent = self._streams.silent()
        if silent is not None:
            return f"no transform of {silent[0]!r} for {silent[1]:.1f} s"
        still = self._newest_ns - self._since_ns
        if not rest and not self._streams.moved and still > TUNING.still_ns:
            return (
                f"nothing has moved between {self._world!r} and {self._container!r} for "
                f"{still * 1e-9:.0f} s: {' → '.join((self._world, *reversed(self._chain)))}"
            )
        return ""

    def clock_doubt(self) -> Doubt | None:
        """Returns what the arrival of moving transforms shows of their publishers' clocks."""
        return clock_doubt(self.clocks())

    def clocks(self) -> dict[str, Lead]:
        """Returns by how much stamps lie after their arrival; see `AlignedStreams.clocks`."""

        def named(child: str) -> str:
            return "the poses" if child == POSED else f"the transforms of {child!r}"

        return self._streams.clocks(named)

    def facts(self) -> dict[str, str]:
        """Returns the chain of transforms as text, for the diagnostics."""
        chain = (self._world, *reversed(self._chain)) if self._chain else ("none",)
        return {"chain of transforms": " → ".join(chain)}

    def _ends(self) -> str:
        if self._container not in self._parents:
            return f"is no frame of theirs (they have {', '.join(self._parents):.200})"
        return f"hangs on {self._path(self._container)[-1]!r}"

    def _path(self, frame: str) -> list[str]:
        """Returns the frame and its ancestors up to the root."""
        found = [frame]
        while found[-1] in self._parents and self._parents[found[-1]] not in found:
            found.append(self._parents[found[-1]])
        return found

    def _find_chain(self) -> None:
        path = self._path(self._container)
        there = self._world in path
        chain = tuple(path[: path.index(self._world)]) if there else ()
        if chain != self._chain:
            self._chain = chain
            self._streams.forget()

    def _is_complete(self) -> bool:
        known = self._streams.keys
        return bool(self._chain) and all(c in self._fixed or c in known for c in self._chain)

    def _pose(self, stamp_ns: int, values: dict[str, Values]) -> TimedPose:
        position: Vector = (0.0, 0.0, 0.0)
        quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)
        for child in self._chain:  # from the container outwards
            fixed = self._fixed.get(child)
            if fixed is not None:
                outer = fixed.position, fixed.quaternion
            else:
                x, y, z, qx, qy, qz, qw = values[child]
                outer = (x, y, z), (qx, qy, qz, qw)
            position, quaternion = composed(outer, (position, quaternion))
        return TimedPose(stamp_ns, position, quaternion)


def between(one: Values, other: Values, share: float) -> Values:
    """Interpolates two transforms: position, and quaternion without normalisation."""
    same = sum(a * b for a, b in zip(one[3:], other[3:], strict=True)) >= 0.0
    signed = other if same else (*other[:3], *(-q for q in other[3:]))
    return tuple(a + share * (b - a) for a, b in zip(one, signed, strict=True))


_CONTAINER, _SENSOR = "container", "sensor"


class PlacedAcceleration(NamedTuple):
    """An acceleration of the container's origin, with its stamp and pose.

    Attributes:
        stamp_ns: of the sensor's message [ns].
        vector: in the world's axes, gravity excluded [m/s²].
    """

    stamp_ns: int
    vector: Vector
    pose: Pose


class PlacedAccel:
    """Converts accelerations of a frame to the container's origin and to world axes.

    Args:
        arm: differentiates the lever arm; of its own.
        since_ns: moving transforms before this stamp are not used [ns]; 0: all are.

    Attributes:
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

    def hear(
        self, message: Any, at_ns: int | None, *, fixed: bool = False
    ) -> list[PlacedAcceleration]:
        """Adds a TFMessage or an AccelStamped of any reader; see `take_transforms`, `take`."""
        if hasattr(message, "transforms"):
            links = map(Transform.of_message, message.transforms)
            return self.take_transforms(links, fixed=fixed, at_ns=at_ns)
        if message.header.frame_id != self.frame:
            return []
        a = message.accel.linear
        return self.take(stamp_of(message), (a.x, a.y, a.z), at_ns)

    def take_transforms(
        self, transforms: Iterable[Transform], *, fixed: bool = False, at_ns: int | None = None
    ) -> list[PlacedAcceleration]:
        """Adds transforms; returns the accelerations that can be converted now, in order.

        Args:
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

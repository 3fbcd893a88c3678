"""Computes poses of the container from a robot's joint states (sensor_msgs/JointState).

Each state gives the pose at its stamp by forward kinematics, which is exact; what differentiates
is the filter of poses (`slosh_motion.inputs.pose_filter`), the same for a tracker and for joints.
So names may come in any order, with joints of grippers among them, and from several publishers;
see `slosh_motion.inputs.aligned`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from slosh_base.files.nanoseconds import SECOND
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.inputs.aligned import AlignedStreams, Values, clock_doubt
from slosh_motion.inputs.frames import TimedPose, stamp_of
from slosh_motion.inputs.robot import Robot
from slosh_motion.inputs.sampling import SECONDS_PER_NS
from slosh_motion.tuning import TUNING

_Layout = tuple[tuple[str, ...], tuple[int, ...]]
"""Of names: the joints among them that carry the container, and where they stand."""


class JointPoses:
    """Converts joint states to poses of the container.

    Attributes:
        velocities: whether those of the messages agree with the positions.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._layouts: dict[tuple[str, ...], _Layout] = {}
        self._owners: dict[str, tuple[str, ...]] = {}
        self._streams: AlignedStreams[tuple[str, ...]] = AlignedStreams(
            _between, self._is_complete
        )
        self._seen: dict[str, None] = {}
        self._states = 0
        self._wrong = self._twice = ""
        self._unusable = self._first_ns = 0
        self.velocities = JointVelocities()

    def hear(self, message: Any, at_ns: int) -> list[TimedPose]:
        """Adds a JointState message of any reader; see `take`."""
        positions, velocities = message.position.tolist(), message.velocity.tolist()
        return self.take(stamp_of(message), message.name, positions, velocities, at_ns)

    def take(
        self,
        stamp_ns: int,
        names: Sequence[str],
        positions: Sequence[float],
        velocities: Sequence[float] = (),
        at_ns: int | None = None,
    ) -> list[TimedPose]:
        """Adds a joint state; returns the poses that are complete now, in order of time.

        Args:
            stamp_ns: the moment [ns].
            names: (J,) of the joints, in any order.
            positions: (J,) [rad or m]; empty: the message tells none.
            velocities: (J,) [rad/s or m/s]; empty: it tells none.
            at_ns: when the message arrived, or was recorded [ns]; None: not known.
        """
        known = self._layouts.get(tuple(names)) or self._layout(tuple(names))
        joints, places = known
        self._states += 1
        if not joints or not positions:
            return []
        if len(positions) != len(names):
            self._unusable += 1
            self._first_ns = self._first_ns or stamp_ns
            self._wrong = (
                f"a joint state has {len(positions)} positions for {len(names)} names: "
                f"{self._unusable} are not used, from {self._first_ns / SECOND:.3f} s on"
            )
            return []
        values = tuple([positions[place] for place in places])
        if len(velocities) == len(names):
            self.velocities.take(stamp_ns, values, [velocities[place] for place in places])
        if len(joints) == len(self._robot.carrying):  # as nearly always
            return [self._posed(stamp_ns, dict(zip(joints, values, strict=True)))]
        if at_ns is not None:
            self._streams.hear(joints, stamp_ns, at_ns)
        self._streams.add(joints, stamp_ns, values)
        return [
            self._posed(
                at_ns,
                {
                    joint: value
                    for own, at in found.items()
                    for joint, value in zip(own, at, strict=True)
                },
            )
            for at_ns, found in self._streams.rows()
        ]

    def trouble(self) -> str:
        """Returns why poses are missing or wrong, in one line; empty if no reason is known."""
        missing = [joint for joint in self._robot.carrying if joint not in self._owners]
        if missing and self._states >= TUNING.first_states:
            came = ", ".join(self._seen) or "no joint"
            return (
                f"the joint states lack {', '.join(missing)}, on which the container depends; "
                f"they hold {came:.200}"
            )
        silent = self._streams.silent()
        if silent is not None:
            return f"no joint states of {', '.join(silent[0])} for {silent[1]:.1f} s"
        return self._wrong or self._twice or self._robot.beyond

    def clock_doubt(self) -> Doubt | None:
        """Returns what the arrival of moving joints shows of their publishers' clocks."""
        clocks = self._streams.clocks(lambda names: f"the joint states of {', '.join(names)}")
        return clock_doubt(clocks)

    @property
    def groups(self) -> int:
        """Number of joint state publishers, told apart by the joint names they send."""
        return len(self._layouts)

    def facts(self) -> dict[str, str]:
        """Returns joint names and the error of joint velocities, for the diagnostics."""
        return {"joints": ", ".join(self._robot.carrying), **self.velocities.facts()}

    def _posed(self, stamp_ns: int, positions: dict[str, float]) -> TimedPose:
        return TimedPose(stamp_ns, *self._robot.pose(positions))

    def _is_complete(self) -> bool:
        known = set(self._owners.values())
        return len(self._owners) == len(self._robot.carrying) and known <= self._streams.keys

    def _layout(self, names: tuple[str, ...]) -> _Layout:
        """Selects the joints in a message that carry the container and have no other publisher."""
        self._seen.update(dict.fromkeys(names))
        joints = tuple(name for name in self._robot.carrying if name in names)
        taken = [j for j in joints if self._owners.get(j, joints) != joints]
        if len(joints) == len(self._robot.carrying) and not taken:
            self._owners.update(dict.fromkeys(joints, joints))
        elif taken:
            self._twice = (
                f"joint {taken[0]} is in joint states with different sets of joints: those "
                "received first are used"
            )
            joints = ()
        else:
            self._owners.update(dict.fromkeys(joints, joints))
        found = joints, tuple(names.index(joint) for joint in joints)
        if len(self._layouts) < TUNING.kept_states:
            self._layouts[names] = found
        return found


def _between(one: Values, other: Values, share: float) -> Values:
    """Interpolates joint positions; angles wrap at ±π."""
    found = []
    for a, b in zip(one, other, strict=True):
        step = b - a
        if abs(step) > math.pi:
            step = math.remainder(step, math.tau)
        found.append(a + share * step)
    return tuple(found)


class JointVelocities:
    """Compares joint velocities with position changes over intervals of TUNING.stretch_ns.

    Drivers report commanded, filtered, late or missing velocities, in other units, or zeros. So
    over stretches of time the mean velocity is compared with what the positions did: only what
    agrees there is a velocity. The estimator uses the positions alone, and tells what it found.
    """

    def __init__(self) -> None:
        self._start: tuple[int, Sequence[float]] | None = None
        self._last: tuple[int, Sequence[float]] | None = None
        self._sums: list[float] = []
        self._moved = self._missed = self._along = self._told = 0.0

    def take(self, stamp_ns: int, positions: Sequence[float], velocities: Sequence[float]) -> None:
        """Adds a joint state's positions [rad or m] and velocities [rad/s or m/s]."""
        last = self._last
        self._last = stamp_ns, velocities
        if self._start is None or last is None or len(last[1]) != len(velocities):
            self._start, self._sums = (stamp_ns, positions), [0.0] * len(positions)
            return
        seconds = (stamp_ns - last[0]) * SECONDS_PER_NS
        if not 0.0 < seconds < 0.1:
            self._start = None
            return
        sums = self._sums
        for k, (before, now) in enumerate(zip(last[1], velocities, strict=True)):
            sums[k] += 0.5 * seconds * (before + now)
        start_ns, begin = self._start
        if stamp_ns - start_ns >= TUNING.stretch_ns:
            for total, one, other in zip(sums, begin, positions, strict=True):
                self._moved += (other - one) ** 2
                self._missed += (other - one - total) ** 2
                self._along += (other - one) * total
                self._told += total * total
            self._start, self._sums = (stamp_ns, positions), [0.0] * len(positions)

    @property
    def error(self) -> float:
        """Relative error of the velocities, or NaN if it is unknown."""
        enough = self._moved > TUNING.compared**2
        return math.sqrt(self._missed / self._moved) if enough else math.nan

    def remark(self) -> str:
        """Returns that positions and velocities differ by a constant factor; empty if not.

        Velocities that are late, filtered or zeros are none such: they are common and not used.
        """
        if math.isnan(self.error) or self.error <= TUNING.agreeing_velocity:
            return ""
        factor = self._along / self._moved
        left = self._told - factor * factor * self._moved
        if left >= (TUNING.agreeing_velocity * factor) ** 2 * self._moved:
            return ""
        return (
            f"the joint velocities are {factor:.3g} times the change of the positions: the unit "
            "or sign of one of them is wrong; the positions are used"
        )

    def facts(self) -> dict[str, str]:
        """Returns how well velocities agree with positions, for the diagnostics."""
        if math.isnan(self.error):
            return {}
        agree = self.error <= TUNING.agreeing_velocity
        text = "agree with the positions" if agree else "do not agree with the positions"
        return {"joint velocities": f"not used; they {text} ({1e2 * self.error:.0f} % off)"}

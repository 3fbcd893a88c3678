"""Poses of the container (geometry_msgs/PoseStamped), differentiated twice.

The second derivative is that of the parabola that fits the positions of a sliding window best
(least squares; Savitzky and Golay's filter, for samples at any spacing). A cubic term is fitted
along: it changes nothing where the stamps are symmetric about the window's centre, and keeps the
answer that of the centre where they are not. The sample carries the centre's stamp: the estimate
comes half a window late, but with no phase error.

Angular velocity and acceleration are found in the same way from the rotations φ that lead from the
centre's attitude to those of the window, in the container's axes: at φ = 0 they are φ̇ and φ̈.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.types import UniTuple, float64

from slosh_estimator.checked_input import CheckedInput
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.gate import GateSettings, SampleGate, Verdict, fault_of
from slosh_estimator.mounting import SensorTransform, ToolPose
from slosh_estimator.rotation import Vector, yaw_of_quaternion
from slosh_estimator.sample import SECONDS, Sample
from slosh_estimator.state import remembered
from slosh_model.compilation import GIVEN_1, GIVEN_2, compiled, entry_point
from slosh_model.normal_equations import factorize, substitute
from slosh_report.input_checks import PoseCheck

MINIMUM_WINDOW = 5
MAXIMUM_SPEED = 20.0
"""A faster change between two poses is a jump of the tracker, not a motion [m/s]."""
FARTHEST = 1e4
"""No container is farther from the origin of its cell [m]."""
LENGTHS = (1e-3, 1e3)
"""Lengths that a quaternion may have."""


class _Pose(NamedTuple):
    stamp_ns: int
    position: Vector
    attitude: tuple[float, float, float, float]


class PoseInput(CheckedInput):
    """Takes poses in the world's axes.

    Args:
        settings: limits of the gate.
        window: samples of the sliding window, odd.
        transform: container ← the frame whose pose is published.
        frame: name of the world's frame; poses in any other are dropped, but for those that name
            none; None: all are taken.
        any_frame: whether poses in other frames are taken, too, and that is told.
        checks: see `InputSettings`.

    Raises:
        SloshEstimatorError: the window is even or too short.
    """

    check: PoseCheck

    def __init__(
        self,
        settings: GateSettings,
        window: int = 21,
        transform: SensorTransform | None = None,
        frame: str | None = None,
        any_frame: bool = False,
        checks: bool | None = None,
    ) -> None:
        mount = transform or SensorTransform()
        super().__init__(PoseCheck(mount.matrix), checks)
        self._tool = ToolPose(mount)
        self._frame, self._any_frame = frame, any_frame or frame is None
        self._other_frame: str | None = None
        self._told = 0
        if window < MINIMUM_WINDOW or window % 2 == 0:
            raise SloshEstimatorError(
                f"window = {window!r} must be odd and at least {MINIMUM_WINDOW}"
            )
        self.gate = SampleGate(settings)
        self.jumps = 0
        self._window: deque[_Pose] = deque(maxlen=window)
        self._tau = np.zeros(window)
        self._positions = np.zeros((window, 3))
        self._attitudes = np.zeros((window, 4))
        self._attitudes[:, 3] = 1.0
        self._restarted = True
        self._second_derivative, self._turning = second_derivative.load(), turning.load()

    def update(
        self,
        stamp_ns: int,
        position: tuple[float, float, float],
        quaternion: tuple[float, float, float, float],
        now_ns: int | None = None,
        frame: str = "",
    ) -> Sample | None:
        """The sample at the window's centre, or None while the window fills.

        Args:
            stamp_ns: the moment [ns].
            position: of the frame that is published, in the world [m].
            quaternion: x, y, z, w, world ← that frame; of any length within LENGTHS.
            now_ns: the time of arrival [ns].
            frame: in which the pose is given.
        """
        if frame != self._frame and self._strange(frame):
            return None
        fault = fault_of(position, FARTHEST) or _fault_of_attitude(quaternion)
        verdict = self.gate.judge(stamp_ns, None, now_ns, fault)
        if verdict not in (Verdict.USE, Verdict.RESTART):
            return None
        position, quaternion = self._tool.container(position, quaternion)
        restarted = verdict is Verdict.RESTART
        doubtful = self.check.add(stamp_ns, position, quaternion, restarted=restarted)
        jumped = verdict is Verdict.USE and self._jumped(stamp_ns, position)
        self.jumps += jumped
        if verdict is Verdict.RESTART or jumped:
            self._window.clear()
            self._restarted = True
        self._window.append(_Pose(stamp_ns, position, quaternion))
        if len(self._window) < (self._window.maxlen or 0):
            return None
        centre = self._window[len(self._window) // 2]
        self._fill(centre.stamp_ns)
        ax, ay, az = self._second_derivative(self._tau, self._positions)
        pose = self._turning(self._tau, self._attitudes)
        yaw = yaw_of_quaternion(*centre.attitude)
        restarted, self._restarted = self._restarted, False
        doubtful = doubtful and self.flags
        return Sample(centre.stamp_ns, ax, ay, az, yaw, restarted, pose, doubtful)

    @property
    def memory(self) -> list[float]:
        """What the next samples depend on, beside the last one's stamp: the window's poses."""
        newest = self._window[-1].stamp_ns if self._window else 0
        poses = [
            number
            for pose in self._window
            for number in (pose.stamp_ns - newest, *pose.position, *pose.attitude)
        ]
        return [*poses, *self.checked_memory(newest)]

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Goes on behind the message that another reader used last, with its memory.

        Raises:
            SloshEstimatorError: the memory is of another kind of input or another window.
        """
        memory = self.take_up_check(stamp_ns, memory)
        rows = np.reshape(remembered(memory, 8 * (self._window.maxlen or 0)), (-1, 8)).tolist()
        self._window.clear()
        for back, px, py, pz, qx, qy, qz, qw in rows:
            self._window.append(_Pose(stamp_ns + round(back), (px, py, pz), (qx, qy, qz, qw)))
        self._restarted = False
        self.gate.go_on(stamp_ns, None)

    def warning(self) -> str | None:
        """What the user should mend; None: nothing."""
        strange = self.gate.counts[Verdict.WRONG_FRAME]
        new, self._told = strange - self._told, strange
        if new:
            return self.refusal()
        if self.jumps:
            return (
                f"{self.jumps} jumps of more than {MAXIMUM_SPEED:g} m/s in the pose: a tracker "
                "that jumps, or positions that are not in m"
            )
        return None

    def remark(self) -> str | None:
        """What is worth a look; None: nothing."""
        if (
            self._frame is not None
            and self._other_frame is not None
            and not self.gate.counts[Verdict.WRONG_FRAME]
        ):
            named = f"in the frame {self._other_frame!r}" if self._other_frame else "without frame"
            return f"poses {named} are taken as those in the world's frame, z up"
        return None

    def refusal(self) -> str | None:
        """Why samples were refused by their frame; None: none was."""
        if not self.gate.counts[Verdict.WRONG_FRAME]:
            return None
        return (
            f"poses in the frame {self._other_frame!r} are dropped: publish them in "
            f"{self._frame!r}, or set world_frame to theirs if its z axis points up"
        )

    def _strange(self, frame: str) -> bool:
        """Whether a pose is refused for its frame."""
        if self._other_frame is None or frame:
            self._other_frame = frame
        if self._any_frame or not frame:
            return False
        self.gate.refuse(Verdict.WRONG_FRAME)
        return True

    def _jumped(self, stamp_ns: int, position: tuple[float, float, float]) -> bool:
        if not self._window:
            return False
        last = self._window[-1]
        seconds = (stamp_ns - last.stamp_ns) * SECONDS
        return math.dist(position, last.position) > MAXIMUM_SPEED * seconds

    def _fill(self, centre_ns: int) -> None:
        """The window as arrays."""
        tau, positions, attitudes = self._tau, self._positions, self._attitudes
        for row, pose in enumerate(self._window):
            tau[row] = (pose.stamp_ns - centre_ns) * SECONDS
            positions[row] = pose.position
            attitudes[row] = pose.attitude


def _fault_of_attitude(quaternion: tuple[float, float, float, float]) -> Verdict | None:
    length = math.hypot(*quaternion)
    if LENGTHS[0] <= length <= LENGTHS[1]:
        return None
    return Verdict.IMPOSSIBLE if math.isfinite(length) else Verdict.NOT_FINITE


@compiled
def _cubic(tau: Any, scale: float, values: Any) -> Any:
    """Coefficients (3, 4) of the least-squares cubics in tau/scale, about the centre's value."""
    centre = values[len(tau) // 2]
    normal = np.zeros((4, 4))
    right = np.zeros((3, 4))
    powers = np.ones(4)
    for i in range(len(tau)):
        for p in range(1, 4):
            powers[p] = powers[p - 1] * tau[i] / scale
        for p in range(4):
            for q in range(4):
                normal[p, q] += powers[p] * powers[q]
            for axis in range(3):
                right[axis, p] += powers[p] * (values[i, axis] - centre[axis])
    factorize(normal, 4)
    for axis in range(3):
        substitute(normal, 4, right[axis])
    return right


@compiled
def _reach(tau: Any) -> float:
    """The longest time from the centre [s]; it keeps the normal equations well conditioned."""
    reach = 0.0
    for one in tau:
        reach = max(reach, abs(one))
    return reach


@entry_point(UniTuple(float64, 3)(GIVEN_1, GIVEN_2))
def second_derivative(tau: Any, positions: Any) -> Any:
    """Second derivative at tau = 0 of the least-squares cubic.

    Args:
        tau: (N,) time from the centre [s].
        positions: (N, 3) [m].

    Returns:
        its three components [m/s²].
    """
    scale = _reach(tau)
    solution = _cubic(tau, scale, positions)
    factor = 2.0 / (scale * scale)
    return solution[0, 2] * factor, solution[1, 2] * factor, solution[2, 2] * factor


@entry_point(UniTuple(float64, 10)(GIVEN_1, GIVEN_2))
def turning(tau: Any, attitudes: Any) -> Any:
    """How a container stands and turns at tau = 0; see `slosh_estimator.sample.Pose`.

    Args:
        tau: (N,) time from the centre [s].
        attitudes: (N, 4) quaternions x, y, z, w, world ← container, of any length but zero.

    Returns:
        the centre's attitude, of length 1, angular velocity [rad/s] and acceleration [rad/s²].
    """
    centre = attitudes[len(tau) // 2]
    x, y, z, w = centre
    length = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x / length, y / length, z / length, w / length
    rotations = np.empty((len(tau), 3))
    for i in range(len(tau)):
        bx, by, bz, bw = attitudes[i]
        # The centre's conjugate times the other.
        rx, ry, rz = (
            w * bx - x * bw - y * bz + z * by,
            w * by - y * bw - z * bx + x * bz,
            w * bz - z * bw - x * by + y * bx,
        )
        rw = w * bw + x * bx + y * by + z * bz
        if rw < 0.0:
            rx, ry, rz, rw = -rx, -ry, -rz, -rw
        size = math.sqrt(rx * rx + ry * ry + rz * rz)
        factor = 2.0 * math.atan2(size, rw) / size if size > 0.0 else 0.0
        rotations[i, 0], rotations[i, 1], rotations[i, 2] = factor * rx, factor * ry, factor * rz
    scale = _reach(tau)
    solution = _cubic(tau, scale, rotations)
    second = 2.0 / (scale * scale)
    return (
        x, y, z, w, solution[0, 1] / scale, solution[1, 1] / scale, solution[2, 1] / scale,
        solution[0, 2] * second, solution[1, 2] * second, solution[2, 2] * second,
    )  # fmt: skip

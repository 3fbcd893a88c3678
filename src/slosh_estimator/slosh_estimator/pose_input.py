"""Poses of the container (geometry_msgs/PoseStamped), differentiated twice.

The second derivative is that of the parabola that fits the positions of a sliding window best (least
squares; Savitzky and Golay's filter, for samples at any spacing). It belongs to the window's centre
and carries that moment's stamp: the estimate comes half a window late, but with no phase error.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.gate import GateSettings, SampleGate, Verdict
from slosh_estimator.rotation import yaw_of_quaternion
from slosh_estimator.sample import SECONDS, Sample

MINIMUM_WINDOW = 5


class _Pose(NamedTuple):
    stamp_ns: int
    position: tuple[float, float, float]
    yaw: float


class PoseInput:
    """Takes poses in the world's axes.

    Args:
        settings: limits of the gate.
        window: samples of the sliding window, odd.

    Raises:
        SloshEstimatorError: the window is even or too short.
    """

    def __init__(self, settings: GateSettings, window: int = 21) -> None:
        if window < MINIMUM_WINDOW or window % 2 == 0:
            raise SloshEstimatorError(
                f"window = {window!r} must be odd and at least {MINIMUM_WINDOW}"
            )
        self.gate = SampleGate(settings)
        self._window: deque[_Pose] = deque(maxlen=window)
        self._restarted = True

    def update(
        self,
        stamp_ns: int,
        position: tuple[float, float, float],
        quaternion: tuple[float, float, float, float],
        now_ns: int | None = None,
    ) -> Sample | None:
        """The sample at the window's centre, or None while the window fills.

        Args:
            stamp_ns: the moment [ns].
            position: the container's origin in the world [m].
            quaternion: x, y, z, w, world ← container; of any length but zero.
            now_ns: the time of arrival [ns].
        """
        length = math.hypot(*quaternion)
        finite = math.isfinite(sum(position) + length) and length > 0.0
        verdict = self.gate.judge(stamp_ns, finite, now_ns)
        if verdict not in (Verdict.USE, Verdict.RESTART):
            return None
        if verdict is Verdict.RESTART:
            self._window.clear()
            self._restarted = True
        self._window.append(_Pose(stamp_ns, position, yaw_of_quaternion(*quaternion)))
        if len(self._window) < (self._window.maxlen or 0):
            return None
        centre = self._window[len(self._window) // 2]
        ax, ay, az = self._second_derivative(centre.stamp_ns)
        restarted, self._restarted = self._restarted, False
        return Sample(centre.stamp_ns, ax, ay, az, centre.yaw, restarted)

    def warning(self) -> str | None:
        """What the user should mend; None: nothing."""
        return None

    def _second_derivative(self, centre_ns: int) -> tuple[float, float, float]:
        tau = np.array([(pose.stamp_ns - centre_ns) * SECONDS for pose in self._window])
        positions = np.array([pose.position for pose in self._window])
        scale = float(np.max(np.abs(tau)))  # keeps the normal equations well conditioned
        relative = tau / scale
        basis = np.stack((np.ones_like(relative), relative, 0.5 * relative**2))
        solution = np.linalg.solve(basis @ basis.T, basis @ (positions - positions.mean(axis=0)))
        ax, ay, az = (solution[2] / scale**2).tolist()
        return ax, ay, az

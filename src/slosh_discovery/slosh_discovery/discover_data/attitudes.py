"""Attitude from the poses beside accelerations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from slosh_base.files.nanoseconds import SECOND
from slosh_model.interpolation import columns_at
from slosh_replay.recording.inputs import STAMP, stamps_of
from slosh_replay.recording.motion import FRAME, Motion

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

MAX_GAP_NS = SECOND // 10
"""Widest pair of poses between which an attitude is interpolated [ns]."""
TURN_NS = SECOND // 50
"""To each side of a pose, over which its angular velocity is a mean [ns]."""
_TURN = tuple(f"pose.orientation.{axis}" for axis in "xyzw")


class PoseAttitudes:
    """Takes PoseStamped messages of the container in the world's frame.

    Args:
        world: name of the world's frame.

    Attributes:
        fields: the columns that it takes.
    """

    fields = (*STAMP, FRAME, *_TURN)

    def __init__(self, world: str) -> None:
        self._world = world
        self._stamps: list[Stamps] = []
        self._turns: list[Array] = []

    def add(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Takes messages that follow each other."""
        turns = np.column_stack([columns[name] for name in _TURN])
        # A quaternion without a length is none; NaN compares false.
        usable = (columns[FRAME] == self._world) & (np.linalg.norm(turns, axis=1) > 0.0)
        self._stamps.append(stamps_of(columns)[usable])
        self._turns.append(turns[usable])

    def added_to(self, motion: Motion) -> Motion:
        """The motion with attitude and angular velocity, where poses lie around all of it."""
        if not self._stamps:
            return motion
        stamps, first = np.unique(np.concatenate(self._stamps), return_index=True)
        if not _cover(stamps, motion.stamps):
            return motion
        turns = np.concatenate(self._turns)[first]
        span = max(1, round(TURN_NS / float(np.median(np.diff(stamps)))))
        turning = angular_velocity(stamps, turns, span)
        at = np.clip(motion.stamps, stamps[0], stamps[-1]) - stamps[0]
        since = stamps - stamps[0]
        attitude = Slerp(since, Rotation.from_quat(turns))(at).as_quat()
        rates = columns_at(at, since, turning)
        return replace(motion, attitude=attitude, angular_velocity=rates)


def _cover(stamps: Stamps, wanted: Stamps) -> bool:
    """Whether there are stamps near all of the wanted ones."""
    if len(stamps) < 2:
        return False
    after = np.clip(np.searchsorted(stamps, wanted), 1, len(stamps) - 1)
    between = stamps[after] - stamps[after - 1]
    outside = np.maximum(stamps[0] - wanted, wanted - stamps[-1])
    return bool((between <= MAX_GAP_NS).all() and (outside <= MAX_GAP_NS).all())


def angular_velocity(stamps: Stamps, attitude: Array, span: int) -> Array:
    """Mean angular velocity about each sample, in the container's frame [rad/s]: (N, 3).

    Args:
        stamps: (N,) rising [ns].
        attitude: (N, 4) quaternions x, y, z, w, world ← container.
        span: samples to each side; fewer at the ends.
    """
    rows = np.arange(len(stamps))
    before, after = np.maximum(rows - span, 0), np.minimum(rows + span, len(rows) - 1)
    seconds = (stamps[after] - stamps[before])[:, np.newaxis] / SECOND
    turns = Rotation.from_quat(attitude)
    angles: Array = (turns[before].inv() * turns[after]).as_rotvec()
    return np.divide(angles, seconds, out=np.zeros_like(angles), where=seconds > 0.0)

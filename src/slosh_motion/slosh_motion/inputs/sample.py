"""Input samples of the estimator, the same for every sensor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_model.kernel import UPRIGHT

SECONDS_PER_NS = 1e-9
Pose = tuple[float, float, float, float, float, float, float, float, float, float]
"""How a container stands and turns: its attitude as a quaternion x, y, z, w, world ← container,
its angular velocity [rad/s] and its angular acceleration [rad/s²] in its own axes."""


class Sample(NamedTuple):
    """One input sample of the models: stamp, acceleration and attitude.

    A named tuple, because a thousand are made each second.

    Attributes:
        stamp_ns: the moment [ns].
        ax, ay, az: acceleration, gravity excluded [m/s²], in axes that are parallel to the
            container's but do not follow its yaw: the liquid in a round one does not either.
        yaw: angle of the container's x axis in these axes [rad].
        restarted: True for the first sample and after a gap: nothing links it to those before.
        pose: how the container stands and turns; None: upright, and it does not turn. Where the
            acceleration holds gravity's share along a tilted floor already, the attitude is that
            of the yaw alone.
        doubtful: whether what is measured cannot be what it is said to be.
        slow: whether the input comes too slowly to carry the sloshing modes.
        moving: whether it shows that the container moved already when the input began.
    """

    stamp_ns: int
    ax: float
    ay: float
    az: float
    yaw: float = 0.0
    restarted: bool = False
    pose: Pose | None = None
    doubtful: bool = False
    slow: bool = False
    moving: bool = False


class Samples(NamedTuple):
    """N input samples as columns; see Sample.

    Attributes:
        stamps: (N,) [ns].
        accelerations: (N, 3) [m/s²].
        yaws: (N,) [rad].
        restarted: (N,) whether nothing links a sample to those before.
        poses: (N, POSE_COUNT) as in Sample; None: upright throughout.
        doubtful, slow, moving: (N,) as in Sample; None: none of them.
    """

    stamps: NDArray[np.int64]
    accelerations: NDArray[np.float64]
    yaws: NDArray[np.float64]
    restarted: NDArray[np.bool_]
    poses: NDArray[np.float64] | None = None
    doubtful: NDArray[np.bool_] | None = None
    slow: NDArray[np.bool_] | None = None
    moving: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, samples: Sequence[Sample]) -> Samples:
        """Combines single input samples to columns."""
        values = np.array([sample[1:5] for sample in samples], dtype=np.float64).reshape(-1, 4)
        return cls(
            np.array([sample.stamp_ns for sample in samples], dtype=np.int64),
            np.ascontiguousarray(values[:, :3]),
            values[:, 3].copy(),
            np.array([sample.restarted for sample in samples], dtype=bool),
            _poses(samples),
            np.array([sample.doubtful for sample in samples], dtype=bool),
            np.array([sample.slow for sample in samples], dtype=bool),
            np.array([sample.moving for sample in samples], dtype=bool),
        )

    def rows(self, chosen: NDArray[np.bool_]) -> Samples:
        """Returns the samples that a mask (N,) selects."""
        return Samples(
            self.stamps[chosen], self.accelerations[chosen], self.yaws[chosen],
            self.restarted[chosen],
            None if self.poses is None else self.poses[chosen],
            None if self.doubtful is None else self.doubtful[chosen],
            None if self.slow is None else self.slow[chosen],
            None if self.moving is None else self.moving[chosen],
        )  # fmt: skip

    def one(self, index: int) -> Sample:
        """Returns the input sample at an index."""
        ax, ay, az = self.accelerations[index].tolist()
        return Sample(
            int(self.stamps[index]), ax, ay, az, float(self.yaws[index]),
            bool(self.restarted[index]),
            None if self.poses is None else tuple(self.poses[index].tolist()),
            self.doubtful is not None and bool(self.doubtful[index]),
            self.slow is not None and bool(self.slow[index]),
            self.moving is not None and bool(self.moving[index]),
        )  # fmt: skip


def _poses(samples: Sequence[Sample]) -> NDArray[np.float64] | None:
    if all(sample.pose is None for sample in samples):
        return None
    return np.array([sample.pose or UPRIGHT for sample in samples], dtype=np.float64)

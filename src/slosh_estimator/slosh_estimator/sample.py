"""Input samples of the estimator, however they were measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SECONDS = 1e-9  # of a nanosecond


class Sample(NamedTuple):
    """What drives the models at one moment.

    A named tuple, because a thousand are made each second.

    Attributes:
        stamp_ns: the moment [ns].
        ax, ay, az: acceleration, gravity excluded [m/s²], in axes that are parallel to the
            container's but do not follow its yaw: the liquid in a round one does not either.
        yaw: angle of the container's x axis in these axes [rad].
        restarted: True for the first sample and after a gap: nothing links it to those before.
    """

    stamp_ns: int
    ax: float
    ay: float
    az: float
    yaw: float = 0.0
    restarted: bool = False


class Samples(NamedTuple):
    """N samples as columns; see Sample.

    Attributes:
        stamps: (N,) [ns].
        accelerations: (N, 3) [m/s²].
        yaws: (N,) [rad].
        restarted: (N,) whether nothing links a sample to those before.
    """

    stamps: NDArray[np.int64]
    accelerations: NDArray[np.float64]
    yaws: NDArray[np.float64]
    restarted: NDArray[np.bool_]

    @classmethod
    def of(cls, samples: Sequence[Sample]) -> Samples:
        """The columns of single samples."""
        values = np.array([sample[1:5] for sample in samples], dtype=np.float64).reshape(-1, 4)
        return cls(
            np.array([sample.stamp_ns for sample in samples], dtype=np.int64),
            np.ascontiguousarray(values[:, :3]),
            values[:, 3].copy(),
            np.array([sample.restarted for sample in samples], dtype=bool),
        )

    def one(self, index: int) -> Sample:
        """A single one of them."""
        ax, ay, az = self.accelerations[index].tolist()
        return Sample(
            int(self.stamps[index]), ax, ay, az, float(self.yaws[index]),
            bool(self.restarted[index]),
        )  # fmt: skip

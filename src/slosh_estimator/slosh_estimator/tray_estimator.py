"""Estimates the liquid in all containers of a tray except the first, from one motion input."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_estimator.estimator import Estimate, Estimates, Estimator
from slosh_model.model import Model
from slosh_model.tray import Tray
from slosh_motion.inputs.sampling import Sample, Samples

_MSH, _AZIMUTH = 0, 1


class TrayEstimate(NamedTuple):
    """Estimates of all containers of a tray for one sample.

    Attributes:
        msh, azimuth: of each, by the nonlinear model [m, rad].
        flags: of each, bits of EstimateFlag.
        worst: which is nearest to its limit.
        each: all that is estimated of each container.
        delays: of each, how late a camera's measurement is [s].
    """

    msh: list[float]
    azimuth: list[float]
    flags: list[int]
    worst: int
    each: list[Estimate]
    delays: list[float]


class TrayEstimates(NamedTuple):
    """Estimates of K containers for N samples.

    Attributes:
        msh, azimuth: (N, K) by the nonlinear model [m, rad].
        flags: (N, K) bits of EstimateFlag.
        worst: (N,) which container is nearest to its limit.
        linear_msh: (N, K) by the linear model [m].
        readings: (N, K, 2) what a camera reads of the heights of L and of NL [m].
        delays: (N, K) by how much a camera's measurement is late [ns].
    """

    msh: Array
    azimuth: Array
    flags: Integers
    worst: NDArray[np.int64]
    linear_msh: Array
    readings: Array
    delays: Integers


class TrayEstimator:
    """Estimates all containers of a tray except the first one.

    Each is driven by the acceleration of its own place: the model's lever arm adds what a turning
    tray adds there.

    Args:
        tray: the tray.
        prepare: makes of a container's model the one that runs.
        at_rest: whether the liquid is still when the first sample comes.

    Attributes:
        tray: the tray, with what its places hold now.
        others: the estimators of the containers behind the first.
    """

    def __init__(
        self, tray: Tray, prepare: Callable[[Model], Model] = lambda model: model, *,
        at_rest: bool = True,
    ) -> None:  # fmt: skip
        self._prepare = prepare
        models = [prepare(one.placed) for one in tray.containers[1:]]
        self.others = [Estimator(model, at_rest=at_rest) for model in models]
        for other, one in zip(self.others, tray.containers[1:], strict=True):
            other.empty = one.empty
        self._carry(tray)

    def _carry(self, tray: Tray) -> None:
        self.tray, self._bounds = tray, tray.bounds.tolist()

    def change(self, tray: Tray, index: int, *, fresh: bool) -> None:
        """Replaces the container in one tray place; other containers' estimates continue.

        Args:
            tray: with the other container.
            index: of its place, from 0; the estimator of the first is changed by its owner.
            fresh: see `Estimator.load_model`.

        Raises:
            SloshModelError: the compiled code does not do what the model's equations say.
        """
        if index:
            one = tray.containers[index]
            self.others[index - 1].load_model(
                self._prepare(one.placed), fresh=fresh, empty=one.empty
            )
        self._carry(tray)

    def reset(self) -> None:
        """Resets all containers to rest; see `Estimator.reset`."""
        for other in self.others:
            other.reset()

    def update(self, sample: Sample, first: Estimate) -> TrayEstimate:
        """Processes a sample; returns all containers' estimates, the first one as passed in."""
        estimates = [first, *(other.update(sample) for other in self.others)]
        msh = [one.nonlinear.msh for one in estimates]
        shares = [
            height / bound if height == height else -1.0
            for height, bound in zip(msh, self._bounds, strict=True)
        ]
        return TrayEstimate(
            msh,
            [one.nonlinear.azimuth for one in estimates],
            [one.flags for one in estimates],
            shares.index(max(shares)),
            estimates,
            [0.0, *(other.reading_delay(sample.stamp_ns) for other in self.others)],
        )

    def update_many(self, samples: Samples, first: Estimates) -> TrayEstimates:
        """Processes N samples; gives exactly the same results as `update`."""
        estimates = [first, *(other.update_many(samples) for other in self.others)]
        heights = np.stack([one.heights[:, 1] for one in estimates], axis=1)
        shares = np.nan_to_num(heights[:, :, _MSH] / self.tray.bounds, nan=-1.0)
        late = [other.reading_delays(samples.stamps) for other in self.others]
        return TrayEstimates(
            heights[:, :, _MSH],
            heights[:, :, _AZIMUTH],
            np.stack([one.flags for one in estimates], axis=1),
            np.argmax(shares, axis=1),
            np.stack([one.heights[:, 0, _MSH] for one in estimates], axis=1),
            np.stack([one.as_read for one in estimates], axis=1),
            np.rint(np.stack([np.zeros(len(samples.stamps)), *late], axis=1) * 1e9).astype(
                np.int64
            ),
        )

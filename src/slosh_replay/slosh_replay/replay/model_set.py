"""Runs four estimators: the recorded model and its 2D or 3D variant, linear and nonlinear.

Their estimates are interpolated to the stamps of images.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_estimator.estimator import Estimates, Estimator
from slosh_estimator.sight import UNSOUND
from slosh_estimator.state import EstimatorState
from slosh_model.model import Model
from slosh_motion.inputs.sampling import Samples

_MSH, _AZIMUTH = 0, 1
T = TypeVar("T")

MAX_GAP_NS = 50_000_000
"""Widest pair of estimates between which is interpolated."""


class ModelSetEstimates(NamedTuple):
    """Heights estimated by the recorded model and its variants for N samples.

    Attributes:
        own: the model's own, as the node publishes them.
        heights: all four models': 2D-L, 3D-L, 2D-NL, 3D-NL.
    """

    own: Estimates
    heights: ModelHeights


class ModelSet:
    """Runs estimators with four models in parallel: 2D and 3D, linear and nonlinear.

    Args:
        model: container, liquid and effects; the one that was or would be loaded live.
        at_rest: whether the liquid is still at the first sample.
    """

    def __init__(self, model: Model, *, at_rest: bool = True) -> None:
        self._begin(model, at_rest=at_rest)

    @property
    def model(self) -> Model:
        """The model that was loaded last."""
        return self._own.model

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the models, in the order of the columns of heights."""
        pairs = [estimator.names for estimator in self._in_order(self._own, self._twin)]
        return tuple(pair[surface] for surface in (0, 1) for pair in pairs)

    @property
    def own(self) -> tuple[int, int]:
        """Column indices of the loaded model's linear and nonlinear variant."""
        return (1, 3) if _is_spatial(self.model) else (0, 2)

    @property
    def own_names(self) -> tuple[str, str]:
        """Names of the loaded model's linear and nonlinear variant."""
        return self._own.names

    def restart(self, *, at_rest: bool = True) -> None:
        """Restarts all estimators with the same models; an empty gripper stays empty."""
        empty = self._own.empty
        self._begin(self.model, at_rest=at_rest)
        self._own.empty = self._twin.empty = empty

    def take_up(self, state: EstimatorState) -> None:
        """Restores a state that the live estimator recorded.

        The twin goes on from it, too: how far it would have been elsewhere nobody knows, and that
        dies out.

        Raises:
            SloshEstimatorError: the state is one of another model or version.
        """
        self._own.take_up(state)
        self._twin.take_up(state)

    def load_model(self, model: Model, *, fresh: bool = False, empty: bool = False) -> None:
        """Replaces the model, as the node's services do; an equal model is reset.

        See `Estimator.load_model`.
        """
        self._own.load_model(model, fresh=fresh, empty=empty)
        self._twin.load_model(_twin(model), fresh=fresh, empty=empty)

    def empty(self) -> None:
        """Declares that the gripper is empty from the start."""
        self._own.empty = self._twin.empty = True

    def update_many(self, samples: Samples) -> ModelSetEstimates:
        """Processes input samples and returns the estimates of all models."""
        own, twin = self._own.update_many(samples), self._twin.update_many(samples)
        both = self._in_order(own, twin)
        columns = [part.heights[:, surface, _MSH] for surface in (0, 1) for part in both]
        readings = [part.as_read[:, surface] for surface in (0, 1) for part in both]
        heights = ModelHeights(
            own.stamps,
            np.column_stack(columns),
            own.heights[:, 1, _AZIMUTH],
            own.flags | twin.flags,
            np.column_stack(readings),
            self._delays(own.stamps),
            own.accelerations,
        )
        return ModelSetEstimates(own, heights)

    def _delays(self, stamps: NDArray[np.int64]) -> NDArray[np.int64]:
        """Returns the modelled delays (N,) [ns] of measurements at stamps."""
        return np.rint(self._own.reading_delays(stamps) * 1e9).astype(np.int64)

    def _begin(self, model: Model, *, at_rest: bool) -> None:
        self._own = Estimator(model, at_rest=at_rest)
        self._twin = Estimator(_twin(model), at_rest=at_rest)

    def _in_order(self, own: T, twin: T) -> tuple[T, T]:
        """Returns the planar (2D) model's value, then the spatial (3D) model's value."""
        return (twin, own) if _is_spatial(self.model) else (own, twin)


def _is_spatial(model: Model) -> bool:
    return model.has("vertical_acceleration")


def _twin(model: Model) -> Model:
    return model.planar() if _is_spatial(model) else model.spatial()


class ModelHeights(NamedTuple):
    """Heights of every model at the stamps of the input.

    Attributes:
        stamps: (M,) increasing [ns].
        heights: (M, K) [m].
        azimuth: (M,) of the last model [rad].
        flags: (M,) bits of EstimateFlag.
        readings: (M, K) what a sensor reads of the heights [m]; None: the heights.
        delays: (M,) by how much a measurement comes late [ns]; None: it does not.
        accelerations: (M, 3) that drove the models [m/s²]; None: not kept.
        tray: (M, C) nonlinear height of each container of a tray [m]; None: there is none.
    """

    stamps: Integers
    heights: Array
    azimuth: Array
    flags: Integers
    readings: Array | None = None
    delays: Integers | None = None
    accelerations: Array | None = None
    tray: Array | None = None

    @property
    def as_read(self) -> Array:
        """Heights [m] as a sensor measures them, one column per model."""
        return self.heights if self.readings is None else self.readings


class AtImages(NamedTuple):
    """Heights of every model at the stamps of N images; NaN without an estimate.

    Attributes:
        heights: (N, K) as a sensor reads them, linear between the two estimates around what the
            image shows [m].
        azimuth: (N,) of the estimate before it [rad].
        usable: (N,) whether the estimates come from a known state.
    """

    heights: Array
    azimuth: Array
    usable: NDArray[np.bool_]


def at_images(estimates: ModelHeights, stamps: Integers) -> AtImages:
    """Interpolates estimates at the stamps of images; NaN outside the series and in gaps.

    Args:
        estimates: at least one.
        stamps: (N,) [ns].
    """
    last = len(estimates.stamps) - 1
    if estimates.delays is not None:
        origin = estimates.stamps[0]
        late = np.interp(
            (stamps - origin).astype(float),
            (estimates.stamps + estimates.delays - origin).astype(float),
            estimates.delays.astype(float),
        )
        stamps = stamps - np.rint(late).astype(np.int64)
    after = np.searchsorted(estimates.stamps, stamps)
    exact = (after <= last) & (estimates.stamps[np.minimum(after, last)] == stamps)
    before = np.clip(np.where(exact, after, after - 1), 0, last)
    after = np.clip(after, 0, last)
    width = estimates.stamps[after] - estimates.stamps[before]
    share = (stamps - estimates.stamps[before]) / np.maximum(width, 1)
    low, high = estimates.as_read[before], estimates.as_read[after]
    heights = low + np.where(width > 0, share, 0.0)[:, None] * (high - low)
    outside = (stamps < estimates.stamps[0]) | (stamps > estimates.stamps[-1])
    none = outside | (width > MAX_GAP_NS)
    heights[none] = np.nan
    flags = estimates.flags[before] | estimates.flags[after]
    azimuth = np.where(none, np.nan, estimates.azimuth[before])
    return AtImages(heights, azimuth, (flags & UNSOUND) == 0)

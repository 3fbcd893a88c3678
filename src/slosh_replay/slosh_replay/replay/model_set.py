"""The recorded model beside its planar or spatial twin, each with its L and its NL twin."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from slosh_estimator.estimator import Estimates, Estimator
from slosh_estimator.sample import Samples
from slosh_estimator.state import EstimatorState
from slosh_model.model import Model
from slosh_replay.replay.at_images import ModelHeights

_MSH, _AZIMUTH = 0, 1
T = TypeVar("T")


class ModelSetEstimates(NamedTuple):
    """Answers to N samples.

    Attributes:
        own: the model's own, as the node publishes them.
        heights: all four models': 2D-L, 3D-L, 2D-NL, 3D-NL.
    """

    own: Estimates
    heights: ModelHeights


class ModelSet:
    """Runs the four models side by side.

    Args:
        model: container, liquid and effects; the one that was or would be loaded live.
        at_rest: whether the liquid is still at the first sample.
    """

    def __init__(self, model: Model, *, at_rest: bool = True) -> None:
        self._begin(model, at_rest=at_rest)

    @property
    def model(self) -> Model:
        """The model that is loaded."""
        return self._own.model

    @property
    def names(self) -> tuple[str, ...]:
        """Of the models, in the order of the heights."""
        pairs = [estimator.names for estimator in self._in_order(self._own, self._twin)]
        return tuple(pair[surface] for surface in (0, 1) for pair in pairs)

    @property
    def own(self) -> tuple[int, int]:
        """Which of the heights are those of the loaded model's L and NL twin."""
        return (1, 3) if _is_spatial(self.model) else (0, 2)

    @property
    def own_names(self) -> tuple[str, str]:
        """Names of the loaded model's L and NL twin."""
        return self._own.names

    def restart(self, *, at_rest: bool = True) -> None:
        """A new estimator with the same model."""
        self._begin(self.model, at_rest=at_rest)

    def take_up(self, state: EstimatorState) -> None:
        """Goes on from a state of the live estimator.

        The twin goes on from it, too: how far it would have been elsewhere nobody knows, and that
        dies out.

        Raises:
            SloshEstimatorError: the state is one of another model or version.
        """
        self._own.take_up(state)
        self._twin.take_up(state)

    def load_model(self, model: Model) -> None:
        """Replaces the model, as the node's service does; the same one: as its reset does."""
        self._own.load_model(model)
        self._twin.load_model(_twin(model))

    def update_many(self, samples: Samples) -> ModelSetEstimates:
        """Takes samples."""
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
        """(N,) by how much the measurements of these moments come late [ns]."""
        return np.rint(self._own.reading_delays(stamps) * 1e9).astype(np.int64)

    def _begin(self, model: Model, *, at_rest: bool) -> None:
        self._own = Estimator(model, at_rest=at_rest)
        self._twin = Estimator(_twin(model), at_rest=at_rest)

    def _in_order(self, own: T, twin: T) -> tuple[T, T]:
        """What is the planar model's, then the spatial one's."""
        return (twin, own) if _is_spatial(self.model) else (own, twin)


def _is_spatial(model: Model) -> bool:
    return model.has("vertical_acceleration")


def _twin(model: Model) -> Model:
    return model.planar() if _is_spatial(model) else model.spatial()

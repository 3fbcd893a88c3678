"""The recorded model beside its planar or spatial twin, each with its L and its NL twin."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slosh_bag.replay.at_images import ModelHeights
from slosh_estimator.estimator import Estimates, Estimator
from slosh_estimator.sample import Samples
from slosh_model.model import Model

_MSH, _AZIMUTH = 0, 1


class BankEstimates(NamedTuple):
    """Answers to N samples.

    Attributes:
        own: the model's own, as the node publishes them.
        heights: all four models': 2D-L, 3D-L, 2D-NL, 3D-NL.
    """

    own: Estimates
    heights: ModelHeights


class EstimatorBank:
    """Runs the four models side by side.

    Args:
        model: container, liquid and effects; the one that was or would be loaded live.
    """

    def __init__(self, model: Model) -> None:
        self._load(model)

    @property
    def model(self) -> Model:
        """The model that is loaded."""
        return self._own.model

    @property
    def names(self) -> tuple[str, ...]:
        """Of the models, in the order of the heights."""
        pairs = [estimator.names for estimator in (self._planar, self._spatial)]
        return tuple(pair[surface] for surface in (0, 1) for pair in pairs)

    @property
    def own(self) -> tuple[int, int]:
        """Which of the heights are those of the loaded model's L and NL twin."""
        return (1, 3) if self._own is self._spatial else (0, 2)

    @property
    def own_names(self) -> tuple[str, str]:
        """Names of the loaded model's L and NL twin."""
        return self._own.names

    def restart(self) -> None:
        """A new estimator with the same model."""
        self._load(self.model)

    def load_model(self, model: Model) -> None:
        """Replaces the model; the next sample starts from rest."""
        own = self._own
        if own.model == model:
            own.reset()
            self._twin.reset()
            return
        self._load(model)

    def update_many(self, samples: Samples) -> BankEstimates:
        """Takes samples."""
        own, twin = self._own.update_many(samples), self._twin.update_many(samples)
        planar, spatial = (twin, own) if self._own is self._spatial else (own, twin)
        columns = [
            part.heights[:, surface, _MSH] for surface in (0, 1) for part in (planar, spatial)
        ]
        readings = [part.as_read[:, surface] for surface in (0, 1) for part in (planar, spatial)]
        delay_ns = round(self._own.reading_delay * 1e9)
        heights = ModelHeights(
            own.stamps,
            np.column_stack(columns),
            own.heights[:, 1, _AZIMUTH],
            own.flags | twin.flags,
            np.column_stack(readings),
            np.full(len(own.stamps), delay_ns, dtype=np.int64),
        )
        return BankEstimates(own, heights)

    def _load(self, model: Model) -> None:
        spatial = model.has("vertical_acceleration")
        self._own = Estimator(model)
        self._twin = Estimator(model.planar() if spatial else model.spatial())
        self._planar, self._spatial = (
            (self._twin, self._own) if spatial else (self._own, self._twin)
        )

"""Computes what a sensor measures from the heights of a model."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from slosh_base.types import Array
from slosh_model import kernel
from slosh_model.effects.registry import READING_MEMORY_COUNT
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.simulate import Inputs, State, effect_parameters, simulate

Elapsed = TypeVar("Elapsed", float, Array)


def measured_heights(
    model: Model,
    response: Response,
    azimuths: ArrayLike | None = None,
    rest: float | None = None,
) -> Array:
    """Applies the measurement effects of a model to its heights.

    A delay is left out: it shifts the times at which the heights are read.

    >>> import slosh
    >>> from slosh_model import measured_heights, read_model
    >>> model = read_model("cup/model.yaml")
    >>> heights = measured_heights(model, slosh.simulate(model, "move.csv"))
    >>> heights.shape
    (3001, 1)

    Args:
        model: the model.
        response: its response from rest.
        azimuths: (K,) where the height on the wall is read, from the container's +x [rad]; None:
            the maximum over the wall.
        rest: when the liquid was at rest [s]; None: at the response's first moment.

    Returns:
        (N, K), or (N, 1) of the maximum [m].
    """
    started = 0.0 if rest is None else float(response.t[0]) - rest
    places = np.array([np.nan]) if azimuths is None else np.atleast_1d(np.asarray(azimuths))
    heights = np.column_stack([response.sh_x, response.sh_y])
    container = model.container
    reaches, cornered, corners = np.array(container.reaches), container.cornered, container.corners
    parameters, fill = _read_with(model)
    read = np.empty((len(places), len(response.t)))
    for azimuth, row in zip(places.tolist(), read, strict=True):
        memory = np.zeros(READING_MEMORY_COUNT)
        kernel.read_many(
            response.t, started, heights, azimuth, reaches, fill, cornered, corners, parameters,
            memory, row,
        )  # fmt: skip
    return read.T


@lru_cache(maxsize=64)
def _read_with(model: Model) -> tuple[Array, float]:
    """Returns the parameters of a model's measurement effects, and the fill height [m]; cached."""
    parameters = effect_parameters(model)
    parameters.setflags(write=False)
    return parameters, model.mode_constants()[0].container.fill_height


def remembers(model: Model) -> bool:
    """Returns whether a measurement depends on earlier measurements.

    >>> from slosh_model import read_model
    >>> remembers(read_model("cup/model.yaml"))
    False
    """
    return any(effect.reading_memory for effect, _ in model.uses("reading"))


class ReadingClock(NamedTuple):
    """Offset and rate of the measurement's clock relative to the inputs' clock.

    Attributes:
        offset: by how much a measurement comes late at the motion's start [s].
        rate: by how much that grows per second of the inputs' clock [1].
    """

    offset: float
    rate: float

    @property
    def same(self) -> bool:
        """Whether the measurement's clock equals the inputs' clock."""
        return self.offset == 0.0 and self.rate == 0.0

    def delay(self, elapsed: Elapsed) -> Elapsed:
        """Returns by how much a measurement's stamp is later than the measured state [s].

        Args:
            elapsed: of the moment, or (N,) of moments, from the motion's start, on the inputs'
                clock [s].
        """
        return self.offset + self.rate * elapsed

    def moments(self, times: Array, start: float) -> Array:
        """Converts stamps of measured heights to times on the inputs' clock [s].

        Args:
            times: stamps of heights [s].
            start: of the motion, on the inputs' clock [s].
        """
        if self.rate == 0.0:
            return times - self.offset
        return np.asarray(start + (times - start - self.offset) / (1.0 + self.rate))


def reading_clock(model: Model) -> ReadingClock:
    """Returns the clock of the measured heights that a model assumes.

    >>> from slosh_model import read_model
    >>> reading_clock(read_model("cup/model.yaml")) == ReadingClock(0.0, 0.0)
    True
    """
    late = rate = 0.0
    for effect, parameters in model.uses("delay"):
        assert effect.delay is not None  # it was asked for
        late += effect.delay(parameters)
        rate += 0.0 if effect.drift is None else effect.drift(parameters)
    return ReadingClock(late, rate)


def predicted_heights(
    model: Model,
    inputs: Inputs,
    times: ArrayLike,
    azimuths: ArrayLike | None = None,
    state: State | None = None,
) -> Array:
    """Predicts the heights that a sensor measures at given times, with all modelled effects.

    >>> import numpy as np
    >>> from slosh_model import Inputs, predicted_heights, read_model
    >>> t = np.arange(1001) / 1000.0  # s
    >>> inputs = Inputs(t, np.outer(np.sin(9.0 * t), [1.0, 0.0, 0.0]))  # m/s²
    >>> model = read_model("cup/model.yaml")
    >>> predicted_heights(model, inputs, [0.5, 1.0]).shape
    (2, 1)

    Args:
        model: the model.
        inputs: the container's motion.
        times: (M,) on the inputs' clock, not decreasing [s]. Before the motion the liquid rests;
            after it the last acceleration stays.
        azimuths: (K,) from the container's +x [rad]; None: the maximum over the wall.
        state: of the liquid when the motion begins; None: at rest.

    Returns:
        (M, K), or (M, 1) of the maximum [m].

    Raises:
        SloshModelError: times that are not finite or decrease, or no solution.
    """
    moments = np.asarray(times, dtype=np.float64)
    moments = reading_clock(model).moments(moments, float(inputs.t[0]))
    if moments.ndim != 1 or not np.isfinite(moments).all() or np.any(np.diff(moments) < 0.0):
        raise SloshModelError("times must be a row of finite numbers that do not decrease")
    moments = np.maximum(moments, inputs.t[0])
    merged = with_moments(inputs, moments)
    response, _ = simulate(model, merged, state)
    rows = np.searchsorted(merged.t, moments)
    heights: Array = measured_heights(model, response, azimuths)[rows]
    return heights


def with_moments(inputs: Inputs, moments: Array) -> Inputs:
    """Returns the motion with additional samples at given times.

    Args:
        inputs: the motion.
        moments: (M,) not before its first sample [s]; after its last the values stay.

    >>> inputs = Inputs(np.array([0.0, 1.0]), np.zeros((2, 3)))
    >>> with_moments(inputs, np.array([0.5])).t.tolist()  # s
    [0.0, 0.5, 1.0]
    """
    t = np.union1d(inputs.t, moments)
    return inputs if len(t) == len(inputs.t) else inputs.resampled(t)

"""Prepares measured motions so that a model's responses to all of them are computed fast.

The inputs are taken at the moments of the measured heights and a few between them, averaged where
they were sampled more densely. Heights that were sampled very densely, or at very many azimuths,
are thinned: what is left says the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_discovery.discover.colour import Whitening, neighbours_in
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.noise import estimate_noise
from slosh_discovery.discover.tuning import TUNING
from slosh_model.batch import wall_heights
from slosh_model.effects.base import Stage
from slosh_model.effects.registry import EFFECTS
from slosh_model.interpolation import columns_at
from slosh_model.measure import ReadingClock, measured_heights, reading_clock, remembers
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.simulate import Inputs

LONGEST_STEP = TUNING.input_spacing * (1.0 + 1e-6)
"""Of the integrator: one step leads from input to input, however their spacing is rounded."""
MOST_AZIMUTHS = 8


@dataclass(frozen=True, slots=True, eq=False)
class HeightNoise:
    """Height noise that is correlated in time or differs between samples.

    Attributes:
        correlation: of the part that remembers, between neighbouring samples.
        stddev: (M,) of that part [m].
        forgotten: (M, K) variance of the part that does not, as of stamps that jitter [m²].
    """

    correlation: float
    stddev: Array
    forgotten: Array


@dataclass(frozen=True, slots=True, eq=False)
class SharedNoise:
    """Correlated noise in addition to white noise of unit variance: covariance I + L Lᵀ.

    Attributes:
        directions: (N, R) orthonormal, in which it lies.
        variances: (R,) there.
    """

    directions: Array
    variances: Array

    @classmethod
    def of(cls, columns: Array) -> SharedNoise:
        """Creates correlated noise with the covariance L Lᵀ from a matrix L."""
        directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        matters = sizes**2 > TUNING.least_shared
        return cls(np.ascontiguousarray(directions[:, matters]), sizes[matters] ** 2)

    def removed(self, values: Array) -> Array:
        """Whitens correlated noise to unit variance, in one series or each column of an array."""
        return self._scaled(values, 1.0 / np.sqrt(1.0 + self.variances) - 1.0)

    def added(self, white: Array) -> Array:
        """Converts whitened values back; the inverse of `removed`."""
        return self._scaled(white, np.sqrt(1.0 + self.variances) - 1.0)

    def expected(self, values: Array) -> Array:
        """Returns the expected correlated part (N,) of values that also have white noise."""
        share = self.variances / (1.0 + self.variances)
        return np.asarray(self.directions @ (share * (self.directions.T @ values)))

    def _scaled(self, values: Array, added: Array) -> Array:
        along = self.directions.T @ values
        factors = added if values.ndim == 1 else added[:, np.newaxis]
        return np.asarray(values + self.directions @ (factors * along))


@dataclass(frozen=True, slots=True, eq=False)
class PreparedMotion:
    """A measured motion prepared for comparison with many models.

    Attributes:
        motion: the motion.
        noise: standard deviation of one height [m], root mean square over all of them; at least
            what the sensor claims.
        t: (M,) the heights' times [s].
        azimuths: (K,) [rad]; None: maximum over the wall.
        heights: (M, K) measured, NaN: no sample [m].
        kept: (M, K) where there is a sample, and no outlier.
        coarse: the inputs at the heights' times and between them.
        rows: (M,) of the heights in `coarse`.
        fine: the inputs on a fine grid, for heights read at other times.
        law: of the noise; None: it is white and everywhere the same.
        steady: share of the noise's variance that the sensor claims but that does not change
            from sample to sample: an error of its calibration.
        driven: (M, K, R) columns L of what the inputs' noise does to the heights, of the
            covariance L Lᵀ [m]; None: nothing to speak of.
        blur: (M, K) variance of what the inputs' noise does beside that, as a wave's height is no
            linear function of it [m²]; None: none.
    """

    motion: MeasuredMotion
    noise: float
    t: Array
    azimuths: Array | None
    heights: Array
    kept: NDArray[np.bool_]
    coarse: Inputs
    rows: NDArray[np.int64]
    fine: Inputs
    law: HeightNoise | None = None
    steady: float = 0.0
    driven: Array | None = None
    blur: Array | None = None
    _whitening: Whitening | None = field(init=False, default=None)
    _scale: Array = field(init=False)
    _shared: SharedNoise | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._take_law()
        if self.driven is not None:
            columns = self.driven[self.kept]
            if not self.motion.level_known:  # residuals lose their mean, too
                columns = columns - columns.mean(axis=0)
            object.__setattr__(self, "_shared", SharedNoise.of(self._of_sensor(columns)))

    def _take_law(self) -> None:
        blur = None if self.blur is None else self.blur[self.kept]
        if self.law is None:
            square = np.array(self.noise**2) if blur is None else self.noise**2 + blur
            object.__setattr__(self, "_scale", np.sqrt(square))
            return
        scale = np.broadcast_to(self.law.stddev[:, np.newaxis], self.kept.shape)[self.kept]
        whitening = Whitening.of(
            neighbours_in(self.t, self.kept),
            1.0,
            self.law.correlation,
            (self.law.forgotten[self.kept] + (0.0 if blur is None else blur)) / scale**2,
        )
        object.__setattr__(self, "_scale", scale)
        object.__setattr__(self, "_whitening", whitening)

    def in_noises(self, difference: Array) -> Array:
        """Whitens differences (N,) [m] of the used heights to unit variance."""
        white = self._of_sensor(difference)
        return white if self._shared is None else self._shared.removed(white)

    def _of_sensor(self, difference: Array) -> Array:
        """Whitens one or several series of height differences [m] with the sensor's noise only."""
        scale = (
            self._scale if difference.ndim == 1 or not self._scale.ndim else self._scale[:, None]
        )
        relative = difference / scale
        return relative if self._whitening is None else self._whitening.applied(relative)

    def of_inputs(self, difference: Array) -> Array:
        """Returns the part (N,) of height differences [m] probably due to input noise."""
        if self._shared is None:
            return np.zeros_like(difference)
        return self._undone(self._shared.expected(self._of_sensor(difference)))

    @property
    def slow_share(self) -> float:
        """Fraction of the noise variance (without the inputs' noise) correlated in time."""
        blurred = 0.0
        if self.blur is not None:
            blur = self.blur[self.kept]
            blurred = float(np.mean(blur / (blur + self.noise**2)))
        return 1.0 - (1.0 - self.steady) * (1.0 - blurred)

    @property
    def driven_rms(self) -> float:
        """Root mean square effect of the inputs' noise on the used heights [m]."""
        if self.driven is None:
            return 0.0
        return float(np.sqrt(np.mean(np.sum(self.driven[self.kept] ** 2, axis=1))))

    def in_metres(self, residual: Array) -> Array:
        """Converts whitened differences back to (N,) [m]; the inverse of `in_noises`."""
        return self._undone(residual if self._shared is None else self._shared.added(residual))

    def _undone(self, white: Array) -> Array:
        relative = white if self._whitening is None else self._whitening.undone(white)
        return np.asarray(relative * self._scale)

    def laid(self, values: Array) -> Array:
        """Returns the values as an array (times, azimuths), with NaN for the unused heights."""
        laid = np.full(self.kept.shape, np.nan)
        laid[self.kept] = values
        return laid

    def simulate(self, model: Model) -> Answer | None:
        """Returns the model's response, or None if the solution is not finite."""
        return simulate_all([(model, self)])[0]

    def inputs_for(self, model: Model) -> Inputs:
        """Returns the inputs on the time grid that the model's response needs: coarse or fine."""
        shifted = not (self.motion.same_clock and reading_clock(model).same)
        return self.fine if shifted else self.coarse

    def answer(self, model: Model, inputs: Inputs, heights: Array) -> Answer | None:
        """Creates the response from the liquid's heights (N, 2) at the times of the inputs."""
        if not np.isfinite(heights).all():
            return None
        read: _Reader | None = _Reader(model, self.azimuths, float(inputs.t[0]))
        if remembers(model):
            response = Response(inputs.t, heights[:, 0], heights[:, 1], np.empty((0, 0, 4)))
            heights, read = measured_heights(model, response, self.azimuths), None
        rows = self.rows if inputs is self.coarse else None
        return Answer(inputs.t, heights, rows, reading_clock(model), read)


@dataclass(frozen=True, slots=True, eq=False)
class _Reader:
    """Function that converts the liquid's heights to measured heights at given times."""

    model: Model
    azimuths: Array | None
    rest: float

    def __call__(self, t: Array, liquid: Array) -> Array:
        nothing = np.empty((len(t), 0, 4))
        response = Response(t, liquid[:, 0], liquid[:, 1], nothing)
        return measured_heights(self.model, response, self.azimuths, self.rest)


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """A model's response to a motion, which can be evaluated at the measured times.

    Attributes:
        t: (N,) the inputs' times [s].
        heights: (N, 2) of the liquid at +x and +y, or (N, K) as read [m].
        rows: (M,) of the measured times in t; None: they lie between.
        clock: of the measurement, by the model.
        read: makes what is read out of the liquid's heights; None: `heights` is that.
    """

    t: Array
    heights: Array
    rows: NDArray[np.int64] | None
    clock: ReadingClock
    read: _Reader | None

    def at(self, times: Array, clock_offset: float) -> Array:
        """Returns the heights (times, azimuths) [m] at times of the measurement's clock."""
        moments = self.clock.moments(times - clock_offset, float(self.t[0]))
        if self.rows is None:
            taken = columns_at(moments, self.t, self.heights)
        else:
            taken = self.heights[self.rows]
        return taken if self.read is None else self.read(moments, taken)


def simulate_all(pairs: Sequence[tuple[Model, PreparedMotion]]) -> list[Answer | None]:
    """Simulates pairs of model and motion; returns the response of each pair."""
    if not pairs:
        return []
    inputs = [motion.inputs_for(model) for model, motion in pairs]
    liquids = _liquids([model for model, _ in pairs])
    keys = [(id(liquid), id(given)) for liquid, given in zip(liquids, inputs, strict=True)]
    distinct = dict(zip(keys, zip(liquids, inputs, strict=True), strict=True))
    liquid_heights = heights_of_liquids(
        [liquid for liquid, _ in distinct.values()], [given for _, given in distinct.values()]
    )
    rows = dict(zip(distinct, liquid_heights, strict=True))
    return [
        motion.answer(model, given, rows[key])
        for (model, motion), given, key in zip(pairs, inputs, keys, strict=True)
    ]


def heights_of_liquids(models: Sequence[Model], inputs: Sequence[Inputs]) -> list[Array]:
    """Returns the liquid's heights (N, 2) [m] at +x and +y for each pair of model and inputs."""
    # The search runs a fit per thread already.
    return wall_heights(models, inputs, max_step=LONGEST_STEP, threads=1)


def _liquids(models: Sequence[Model]) -> list[Model]:
    """Returns each model without its sensor effects; models that are then equal share one object.

    Many motions share one model, and a model's hash goes through all of its parameters.
    """
    equal: dict[Model, Model] = {}
    liquids: dict[int, Model] = {}
    for model in models:
        if id(model) not in liquids:
            liquid = liquid_alone(model)
            liquids[id(model)] = equal.setdefault(liquid, liquid)
    return [liquids[id(model)] for model in models]


def liquid_alone(model: Model) -> Model:
    """Returns the model without the modelled effects that act on the measurement only."""
    kept = tuple(use for use in model.effects if EFFECTS[use.name].stages != (Stage.MEASUREMENT,))
    return model if len(kept) == len(model.effects) else replace(model, effects=kept)


def prepare(
    motion: MeasuredMotion, others: Sequence[MeasuredMotion] = (), noise: float | None = None
) -> PreparedMotion:
    """Prepares a measured motion (time grid, noise) for fast comparison with models.

    Args:
        motion: the motion.
        others: motions among which repeats tell about the noise.
        noise: standard deviation of one height [m]; None: estimated.
    """
    heights, azimuths = motion.heights, motion.eta_azimuth if motion.eta is not None else None
    if azimuths is not None and len(azimuths) > MOST_AZIMUTHS:
        columns = np.linspace(0, len(azimuths), MOST_AZIMUTHS, endpoint=False).astype(np.int64)
        azimuths, heights = azimuths[columns], heights[:, columns]
    used = _thinned(motion.t, np.asarray(np.isfinite(heights).any(axis=1)))
    t, heights = motion.t[used], heights[used]
    seen = estimate_noise(motion, others).stddev if noise is None else noise
    noise = max(seen, claimed_noise(motion)) if noise is None else noise
    inside = t[(t >= motion.inputs.t[0])] if motion.same_clock else np.zeros(0)
    coarse = _resampled(motion.inputs, inside, TUNING.input_spacing)
    return PreparedMotion(
        motion=motion,
        noise=noise,
        t=t,
        azimuths=azimuths,
        heights=heights,
        kept=np.isfinite(heights),
        coarse=coarse,
        rows=np.searchsorted(coarse.t, np.maximum(t, coarse.t[0])).clip(max=len(coarse.t) - 1),
        fine=_resampled(motion.inputs, np.zeros(0), TUNING.fine_spacing),
        steady=1.0 - (seen / noise) ** 2,
    )


def claimed_noise(motion: MeasuredMotion) -> float:
    """Returns the median of the standard deviations that the sensor states [m]; 0 if unknown."""
    claims = np.empty(0) if motion.stddev is None else motion.stddev
    known = claims[np.isfinite(claims) & (claims > 0.0)]
    return float(np.median(known)) if len(known) else 0.0


def _thinned(t: Array, present: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Returns the indices of measured heights that are at least SAMPLE_SPACING apart."""
    rows = np.flatnonzero(present)
    if len(rows) < 2 or float(np.median(np.diff(t[rows]))) >= TUNING.sample_spacing:
        return rows
    slots = np.floor((t[rows] - t[rows[0]]) / TUNING.sample_spacing + 1e-6)
    return rows[np.flatnonzero(np.diff(slots, prepend=-1.0) > 0.0)]


def _resampled(inputs: Inputs, moments: Array, spacing: float) -> Inputs:
    """Resamples the inputs at given times and on a finer grid between them."""
    end = max(float(inputs.t[-1]), float(moments[-1]) if len(moments) else -np.inf)
    if len(moments) > 1:
        marks = np.unique(np.concatenate([moments, [inputs.t[0], end]]))
        # As many between two marks as keep the spacing.
        counts = np.maximum(np.ceil(np.diff(marks) / spacing).astype(np.int64), 1)
        parts = [
            np.linspace(start, stop, n, endpoint=False)
            for start, stop, n in zip(marks[:-1], marks[1:], counts, strict=True)
        ]
        t = np.concatenate([*parts, [end]])
    else:
        count = max(int(np.ceil((end - inputs.t[0]) / spacing)), 1)
        t = np.linspace(inputs.t[0], end, count + 1)
    return inputs.resampled(t, _averaged(inputs.t, inputs.acceleration, t, spacing))


def _averaged(t: Array, values: Array, moments: Array, width: float) -> Array:
    """Interpolates values at given times, averaged over `width` [s] if the samples are dense."""
    if len(t) < 3 or float(np.median(np.diff(t))) > 0.5 * width:
        return columns_at(moments, t, values)
    steps = np.diff(t)[:, np.newaxis]
    integral = np.vstack(
        [np.zeros(3), np.cumsum(0.5 * (values[1:] + values[:-1]) * steps, axis=0)]
    )
    low = np.clip(moments - 0.5 * width, t[0], t[-1])
    high = np.clip(moments + 0.5 * width, t[0], t[-1])
    span = np.maximum(high - low, 1e-9)
    averaged = (columns_at(high, t, integral) - columns_at(low, t, integral)) / span[:, np.newaxis]
    averaged[high - low < 0.25 * width] = values[-1]
    return averaged

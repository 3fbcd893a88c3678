"""Estimates a sensor's noise: autocorrelation, outliers and time stamp jitter.

Stamps that jitter by τ are white noise of the size τ |dη/dt|, large where the liquid moves fast.
That tells them from noise that remembers, and both together are the likeliest that the residual
shows. Outliers stand out from what all other samples foretell of theirs.

A wrong model's residual remembers, too. But what a liquid can do lies below LIQUID_BAND. So the
noise must be likely above it, where a series of cosines has taken up whatever lies below
(restricted likelihood); where it is not, the noise is what it is there, and the rest is what the
model lacks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from slosh_base.types import Array
from slosh_discovery.discover.colour import Neighbours, Whitening
from slosh_discovery.discover.differences import robust_scale
from slosh_discovery.discover.problem import HeightNoise, PreparedMotion, claimed_noise
from slosh_discovery.discover.tuning import TUNING

Mask = NDArray[np.bool_]

LONGEST = 400
"""A part of a series that is looked at together [samples]."""
COLUMNS = 3
"""So many azimuths tell of the colour."""
ROUNDS = 5
"""Of outliers and colour."""


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Noise of a height sensor: size, correlation, jitter and outliers.

    Attributes:
        stddev: of the part that remembers [m]; where the sensor claims its own, in that's median.
        correlation: of that of neighbouring samples.
        jitter: standard deviation of the stamps [s].
        outliers: share of the samples that are outliers.
        claims: whether the sensor's own claims say which samples are noisier than others.
    """

    stddev: float
    correlation: float
    jitter: float
    outliers: float
    claims: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Leftovers:
    """Residuals of a model for one motion, measured minus predicted heights.

    Attributes:
        motion: the motion.
        residual: (M, K) measured minus predicted [m]; NaN: no sample.
        speed: (M, K) rate of the predicted heights [m/s].
    """

    motion: PreparedMotion
    residual: Array
    speed: Array

    @classmethod
    def of(cls, motion: PreparedMotion, predicted: Array) -> Leftovers:
        """Creates the residual of a motion from its predicted heights (times, azimuths) [m].

        A still level that is not known goes together like nothing else, and is no noise. Nor is
        what the inputs' noise most likely does.
        """
        residual = np.where(np.isfinite(motion.heights), motion.heights - predicted, np.nan)
        if not motion.motion.level_known:
            residual -= float(np.nanmedian(residual))
        if motion.driven is not None:
            residual[motion.kept] -= motion.of_inputs(residual[motion.kept])
        return cls(motion, residual, np.gradient(predicted, motion.t, axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """One continuous part of the residual at one azimuth.

    Attributes:
        places: (N, 2) of the samples in the motion's (M, K).
        residual: (N,) [m], relative to what the sensor claims.
        speed_square: (N,) of the heights [m²/s²], likewise.
        t: (N,) [s].
    """

    places: NDArray[np.int64]
    residual: Array
    speed_square: Array
    t: Array

    def without(self, struck: Mask) -> _Part:
        return replace(
            self,
            places=self.places[~struck],
            residual=self.residual[~struck],
            speed_square=self.speed_square[~struck],
            t=self.t[~struck],
        )

    def neighbours(self, spacing: float) -> Neighbours:
        lags = np.maximum(np.round(np.diff(self.t, prepend=self.t[0]) / spacing), 1)
        before = np.arange(-1, len(self.t) - 1)
        return Neighbours(before, lags.astype(np.int64), before + 1)


@dataclass(frozen=True, slots=True)
class _Shape:
    """Autocorrelation of a noise, and the variance ratio of stamp jitter to correlated noise.

    Attributes:
        correlation: of the part that remembers, between neighbouring samples.
        ratio: variance of the stamps to that of the part that remembers [s²/m²].
    """

    correlation: float
    ratio: float

    def near(self, other: _Shape) -> bool:
        """Returns whether two noises have practically the same correlation and jitter ratio."""
        sizes = math.sqrt(self.ratio), math.sqrt(other.ratio)
        return abs(self.correlation - other.correlation) < TUNING.steady and (
            abs(sizes[0] - sizes[1]) <= TUNING.steady * max(sizes)
        )


_PLAIN, _SMOOTH = _Shape(0.0, 0.0), _Shape(0.9, 0.0)
_Likelihood = Callable[[Sequence[_Part], _Shape], tuple[float, float]]


def estimate_sensor(leftovers: Sequence[Leftovers]) -> SensorNoise | None:
    """Estimates the sensor noise from residuals of several motions, or None if it is white.

    Args:
        leftovers: of motions that one sensor has measured.
    """
    claims = _claims_hold(leftovers)
    parts = [part for one in leftovers for part in _parts(one, COLUMNS, claims=claims)]
    if not parts:
        return None
    shape, clean = _PLAIN, parts
    for _ in range(ROUNDS):
        size = robust_scale(np.concatenate([_deviations(part, shape) for part in clean]))
        clean = [part.without(_outliers(part, size, shape)) for part in parts]
        before, shape = shape, _most_likely(clean, shape, _likelihood)
        if shape.near(before):
            break
    _, size = _likelihood(clean, shape)
    above = _most_likely(clean, shape, _likelihood_above)
    likelihood, size_above = _likelihood_above(clean, above)
    against = likelihood - _likelihood_above(clean, shape)[0]
    # A wrong model adds to what is slow. Where the residual has less of that than the noise above
    # the band foretells, nothing was added: ever slower noises differ but little up there.
    added = _slow_part(size_above, above) < _slow_part(size, shape)
    # What goes together too strongly for a noise is noise and something slow.
    if (against > TUNING.contradicted and added) or abs(shape.correlation) > TUNING.slowest:
        shape, size = above, size_above
    outliers = 1.0 - sum(len(part.t) for part in clean) / sum(len(part.t) for part in parts)
    gained = _likelihood_above(clean, shape)[0] - _likelihood_above(clean, _PLAIN)[0]
    asked = max(TUNING.sure_colour, TUNING.worth_colour * sum(len(part.t) for part in clean))
    plain = gained < asked and _spikes(parts) <= TUNING.few_spikes
    believed = claims or _seen_in_differences(clean, size, shape, leftovers)
    if (plain and not claims) or not believed or abs(shape.correlation) > TUNING.slowest:
        return None
    return SensorNoise(size, shape.correlation, math.sqrt(shape.ratio) * size, outliers, claims)


def _slow_part(size: float, shape: _Shape) -> float:
    """Returns the low-frequency spectral density [m²] of the correlated noise, up to a factor."""
    return size**2 * (1.0 + shape.correlation) / (1.0 - shape.correlation)


def _spikes(parts: Sequence[_Part]) -> float:
    """Returns the fraction of samples whose value is far from neighbouring samples' values."""
    off = np.abs(np.concatenate([_deviations(part, _SMOOTH) for part in parts]))
    return float(np.mean(off > TUNING.spike * robust_scale(off)))


def _seen_in_differences(
    parts: Sequence[_Part], size: float, shape: _Shape, leftovers: Sequence[Leftovers]
) -> bool:
    """Returns whether high-order differences of the heights agree with an estimated noise.

    A smooth series without noise goes together like nothing else: what is left there is all the
    model's. Differences of a high order know, as they see the noise near half the sampling rate.
    """
    speed = np.mean(np.concatenate([part.speed_square for part in parts]))
    rough = (1.0 - shape.correlation) / (1.0 + shape.correlation) + shape.ratio * float(speed)
    seen = float(np.median([one.motion.noise for one in leftovers]))
    return size * math.sqrt(rough) < TUNING.rougher * seen


def alike(one: SensorNoise | None, other: SensorNoise | None) -> bool:
    """Returns whether two sensor noises are practically equal."""
    if one is None or other is None:
        return one is other
    return (
        abs(one.correlation - other.correlation) < TUNING.alike_noise
        and abs(math.log(one.stddev / other.stddev)) < TUNING.alike_noise
        and abs(one.jitter - other.jitter) < TUNING.alike_noise * max(one.jitter, other.jitter)
    )


def dressed(one: Leftovers, sensor: SensorNoise) -> PreparedMotion:
    """Returns the motion without outliers, with the estimated noise model of its sensor."""
    motion = one.motion
    kept = np.isfinite(motion.heights)
    shape = _Shape(sensor.correlation, (sensor.jitter / sensor.stddev) ** 2)
    squares = []
    for part in _parts(one, kept.shape[1], claims=sensor.claims):
        struck = _outliers(part, sensor.stddev, shape)
        kept[tuple(part.places[struck].T)] = False
        squares.append(part.residual[struck] ** 2)
    forgotten = (sensor.jitter * one.speed) ** 2
    # What is claimed beside what is seen from sample to sample is an error that stays.
    least = claimed_noise(motion.motion)
    size = max(sensor.stddev, least)
    stddev = size * (_claimed(motion) if sensor.claims else np.ones(len(motion.t)))
    whole = np.isfinite(motion.heights)
    outlying = float(np.sum(np.concatenate(squares))) if squares else 0.0
    total = float(np.sum((forgotten + stddev[:, np.newaxis] ** 2)[kept])) + outlying
    return replace(
        motion,
        noise=math.sqrt(total / int(whole.sum())),
        kept=kept,
        law=HeightNoise(sensor.correlation, stddev, forgotten),
        steady=1.0 - (sensor.stddev / size) ** 2,
    )


def _claimed(motion: PreparedMotion) -> Array:
    """Returns the sensor's stated noise (M,) relative to its median; 1 where unknown."""
    stddev = motion.motion.stddev
    if stddev is None:
        return np.ones(len(motion.t))
    claimed = stddev[np.searchsorted(motion.motion.t, motion.t)]
    usual = float(np.nanmedian(claimed)) if np.isfinite(claimed).any() else 0.0
    if not usual > 0.0:
        return np.ones(len(motion.t))
    return np.where(np.isfinite(claimed) & (claimed > 0.0), claimed, usual) / usual


def _claims_hold(leftovers: Sequence[Leftovers]) -> bool:
    """Returns whether the scatter of the heights agrees with the noise that the sensor states."""
    bends, sizes = [], []
    for one in leftovers:
        claimed = _claimed(one.motion)
        residual = one.residual[:, 0]
        bends.append(residual[1:-1] - 0.5 * (residual[:-2] + residual[2:]))
        sizes.append(np.sqrt(claimed[1:-1] ** 2 + 0.25 * (claimed[:-2] ** 2 + claimed[2:] ** 2)))
    size, bend = np.concatenate(sizes), np.abs(np.concatenate(bends))
    size, bend = size[np.isfinite(bend)], bend[np.isfinite(bend)]
    if len(bend) < TUNING.least_samples or np.ptp(size) < TUNING.varied * float(np.median(size)):
        return False
    # The likelihood of two-sided exponentials, which outliers do not rule.
    gain = math.log(float(np.mean(bend)) / float(np.mean(bend / size))) - float(
        np.mean(np.log(size))
    )
    return gain * len(bend) > TUNING.sure_colour


def _parts(one: Leftovers, most: int, *, claims: bool) -> Iterator[_Part]:
    count = one.residual.shape[1]
    columns = np.unique(np.linspace(0, count, min(most, count), endpoint=False).astype(int))
    claimed = _claimed(one.motion) if claims else np.ones(len(one.motion.t))
    for column in columns.tolist():
        rows = np.flatnonzero(np.isfinite(one.residual[:, column]))
        for chunk in np.array_split(rows, max(math.ceil(len(rows) / LONGEST), 1)):
            if len(chunk) >= 2 * TUNING.least_samples:
                yield _Part(
                    np.column_stack([chunk, np.full(len(chunk), column)]),
                    one.residual[chunk, column] / claimed[chunk],
                    (one.speed[chunk, column] / claimed[chunk]) ** 2,
                    one.motion.t[chunk],
                )


def _spacing(part: _Part) -> float:
    return float(np.median(np.diff(part.t)))


def _liquid(part: _Part) -> Array:
    """Returns cosine functions, one per column, that model motions of the liquid in residuals."""
    span = float(part.t[-1] - part.t[0])
    highest = min(TUNING.liquid_band, TUNING.band_share / _spacing(part))
    count = min(int(2.0 * highest * span) + 1, len(part.t) // 2)
    phase = math.pi * (part.t - part.t[0]) / max(span, 1e-9)
    return np.asarray(np.cos(phase[:, np.newaxis] * np.arange(count)))


def _whitening(part: _Part, shape: _Shape) -> Whitening:
    """Creates the whitening filter for a noise whose standard deviation is 1."""
    neighbours = part.neighbours(_spacing(part))
    return Whitening.of(neighbours, 1.0, shape.correlation, shape.ratio * part.speed_square)


def _likelihood(parts: Sequence[_Part], shape: _Shape) -> tuple[float, float]:
    """Returns the log likelihood of a noise shape, and its most probable size [m]."""
    square, volume = 0.0, 0.0
    for part in parts:
        whitening = _whitening(part, shape)
        square += float(np.sum(whitening.applied(part.residual) ** 2))
        volume += float(np.sum(np.log(whitening.spread)))
    return _of_size(square, sum(len(part.t) for part in parts), volume)


def _likelihood_above(parts: Sequence[_Part], shape: _Shape) -> tuple[float, float]:
    """Returns log likelihood and size [m] of the noise above the liquid's frequencies."""
    degrees, square, volume = 0, 0.0, 0.0
    for part in parts:
        whitening = _whitening(part, shape)
        both = whitening.applied(np.column_stack([_liquid(part), part.residual]))
        liquid, residual = both[:, :-1], both[:, -1]
        normal = liquid.T @ liquid
        normal += 1e-9 * np.trace(normal) / len(normal) * np.eye(len(normal))
        root = np.linalg.cholesky(normal)
        explained = solve_triangular(root, liquid.T @ residual, lower=True, check_finite=False)
        square += float(residual @ residual - explained @ explained)
        degrees += len(residual) - len(normal)
        volume += float(np.sum(np.log(whitening.spread)) + np.sum(np.log(np.diag(root))))
    return _of_size(square, degrees, volume)


def _of_size(square: float, degrees: int, volume: float) -> tuple[float, float]:
    size = math.sqrt(max(square, 1e-300) / max(degrees, 1))
    return -degrees * math.log(size) - volume, size


def _most_likely(parts: Sequence[_Part], start: _Shape, likelihood: _Likelihood) -> _Shape:
    """Returns the noise shape for which the residuals have the largest likelihood."""
    speed = math.sqrt(float(np.mean(np.concatenate([part.speed_square for part in parts]))))
    _, size = likelihood(parts, _PLAIN)
    most = TUNING.largest_jitter / size

    def shape_of(x: Array) -> _Shape:
        # By the jitter's standard deviation over the other noise's, at the usual speed.
        ratio = min(math.exp(float(x[1])) / speed, most) if speed > 0.0 else 0.0
        return _Shape(TUNING.strongest_colour * math.tanh(float(x[0])), ratio**2)

    def missed(x: Array) -> float:
        # Where the residuals tell nothing, neighbours go together a little, and more seldom much.
        return 0.5 * float(x[0] / TUNING.common_colour) ** 2 - likelihood(parts, shape_of(x))[0]

    share = math.log(max(math.sqrt(start.ratio) * speed, 0.1))
    centre = np.clip([math.atanh(start.correlation / TUNING.strongest_colour), share], -2.0, 2.0)
    found = minimize(
        missed,
        centre,
        method="Nelder-Mead",
        bounds=[(-2.5, 2.5), (-6.0, 4.0)],
        options={
            "initial_simplex": centre + np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 1.5]]),
            "xatol": 0.03,
            "fatol": 0.1,
            "maxfev": 50,
        },
    )
    return shape_of(found.x)


def _deviations(part: _Part, shape: _Shape) -> Array:
    """Returns deviations (N,) [m] of samples from their prediction by all other samples."""
    score, root = _whitening(part, shape).foretold(part.residual)
    return np.asarray(score / root)


def _outliers(part: _Part, size: float, shape: _Shape) -> Mask:
    """Returns a mask (N,) of outliers, found one after another from the largest."""
    struck = np.zeros(len(part.t), dtype=np.bool_)
    left = part
    while len(left.t) >= 2 * TUNING.least_samples:
        off = np.abs(_deviations(left, shape)) / size
        peaks = [
            i
            for i in np.flatnonzero(off > TUNING.outlier).tolist()
            if off[i] >= off[max(i - TUNING.shadow, 0) : i + TUNING.shadow + 1].max()
        ]
        if not peaks:
            break
        struck[np.flatnonzero(~struck)[peaks]] = True
        left = part.without(struck)
    return struck

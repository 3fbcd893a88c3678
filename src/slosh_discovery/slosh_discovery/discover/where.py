"""Locates the model's error: residuals grouped by time, phase, amplitude and motion.

Each partition (time, phase, amplitude, direction, frequency) divides every measured sample, so its
shares of the base model's squared residual add up to 1. The inputs are no partition: for each, how
far the residual's size follows it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slosh_base.types import Array
from slosh_discovery.discover.finding import NAN, MotionFinding, WhereRow, WorstMoment
from slosh_discovery.discover.input_series import InputSeries
from slosh_discovery.discover.noise import even_grid
from slosh_discovery.discover.tuning import TUNING
from slosh_model.model import Model
from slosh_model.simulate import simulate

Labels = NDArray[np.str_]

QUARTERS = ("first quarter", "second quarter", "third quarter", "last quarter")
PHASES = ("before the motion", "motion", "dwell")
STILL_WATER = "no wave predicted"


@dataclass(frozen=True, slots=True, eq=False)
class _Residual:
    """Residuals of one motion before and after the discovery.

    Attributes:
        finding: the motion.
        before, after: (M, K) measured minus model [m]; NaN: no sample.
        inputs: the container's motion at the measured samples.
    """

    finding: MotionFinding
    before: Array
    after: Array
    inputs: InputSeries


def where(findings: Sequence[MotionFinding], model: Model) -> tuple[WhereRow, ...]:
    """Returns the rms residual by time, phase, amplitude, direction, frequency and input.

    In a row by frequency, `before` and `after` are the band's part of the whole residual's rms
    (their squares add up); in the other partitions the rms over the samples of that part.

    Args:
        findings: motions with the answers of the models before and after.
        model: the base model; its modes give the bands, its prediction the directions.

    Returns:
        rows, partition by partition; parts without samples are left out.
    """
    residuals = [_residual_of(finding) for finding in findings]
    if not any(np.isfinite(residual.before).any() for residual in residuals):
        return ()
    highest = max(float(np.nanmax(each.finding.motion.peak_heights)) for each in residuals)
    step = _round_step(max(highest, 1e-6) / TUNING.amplitude_bins)
    return (
        *_partition("time", residuals, _time_labels, QUARTERS),
        *_partition("phase", residuals, _phase_labels, PHASES),
        *_partition(
            "amplitude",
            residuals,
            lambda residual: _amplitude_labels(residual, step),
            [_bin_label(k, step) for k in range(math.floor(max(highest, 0.0) / step) + 1)],
        ),
        *_partition(
            "direction",
            residuals,
            lambda residual: _direction_labels(residual, model),
            [*(_sector_label(k) for k in range(TUNING.sectors)), STILL_WATER],
        ),
        *_frequency_rows(residuals, model),
        *_input_rows(residuals, model),
    )


def worst_moments(findings: Sequence[MotionFinding], count: int = 6) -> tuple[WorstMoment, ...]:
    """Returns the times of the base model's largest residuals, the largest first.

    A moment's disagreement is the median over three samples, so that an outlier is none.

    Args:
        findings: motions with the answers of the models before and after.
        count: how many at most; they are WORST_SEPARATION apart within a motion.
    """
    moments = [moment for each in findings for moment in _worst_of(each, count)]
    moments.sort(key=lambda pair: -pair[0])
    return tuple(moment for _, moment in moments[:count])


def _residual_of(finding: MotionFinding) -> _Residual:
    motion = finding.motion
    return _Residual(
        finding,
        motion.heights - finding.before_heights,
        motion.heights - finding.after_heights,
        InputSeries.at(motion.inputs, motion.t - finding.clock_offset),
    )


def _partition(
    by: str,
    residuals: Sequence[_Residual],
    labels_of: Callable[[_Residual], Labels],
    order: Sequence[str],
) -> Iterator[WhereRow]:
    labels = [labels_of(residual) for residual in residuals]
    total = sum(float(np.nansum(residual.before**2)) for residual in residuals)
    for label in order:
        chosen = [names == label for names in labels]
        pairs = list(zip(residuals, chosen, strict=True))
        before = np.concatenate([each.before[rows].ravel() for each, rows in pairs])
        after = np.concatenate([each.after[rows].ravel() for each, rows in pairs])
        kept = np.isfinite(before) & np.isfinite(after)
        if not kept.any():
            continue
        samples = sum(
            int(np.isfinite(each.before[rows]).any(axis=1).sum()) for each, rows in pairs
        )
        share = float(np.sum(before[kept] ** 2)) / total if total > 0.0 else NAN
        yield WhereRow(by, label, _rms(before[kept]), _rms(after[kept]), share, samples)


def _time_labels(residual: _Residual) -> Labels:
    t = residual.finding.motion.t
    part = np.floor(4.0 * (t - t[0]) / (t[-1] - t[0])).astype(int)
    labels: Labels = np.array(QUARTERS)[np.clip(part, 0, 3)]
    return labels


def _phase_labels(residual: _Residual) -> Labels:
    t = residual.inputs.t
    start, end = residual.inputs.span
    return np.array(PHASES)[np.where(t < start, 0, np.where(t <= end, 1, 2))]


def _amplitude_labels(residual: _Residual, step: float) -> Labels:
    peaks = residual.finding.motion.peak_heights
    bins = np.floor(np.maximum(np.nan_to_num(peaks), 0.0) / step).astype(int)
    labels: Labels = np.array([_bin_label(k, step) for k in range(int(bins.max()) + 1)])[bins]
    return labels


def _bin_label(k: int, step: float) -> str:
    low, high = f"{1e3 * k * step:g}", f"{1e3 * (k + 1) * step:g}"
    return f"below {high} mm" if k == 0 else f"{low} … {high} mm"


def _round_step(size: float) -> float:
    """Rounds up to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(size))
    return next((k * power for k in (1.0, 2.0, 5.0) if k * power >= size), 10.0 * power)


def _direction_labels(residual: _Residual, model: Model) -> Labels:
    inputs = residual.finding.motion.inputs
    response, _ = simulate(model, inputs)
    x = np.interp(residual.inputs.t, inputs.t, response.sh_x)
    y = np.interp(residual.inputs.t, inputs.t, response.sh_y)
    sector = (
        np.round(np.arctan2(y, x) / (2.0 * math.pi / TUNING.sectors)).astype(int) % TUNING.sectors
    )
    names = np.array([_sector_label(k) for k in range(TUNING.sectors)])[sector]
    size = np.hypot(x, y)
    return np.where(size > TUNING.least_wave * float(size.max(initial=0.0)), names, STILL_WATER)


def _sector_label(k: int) -> str:
    axis = {0: " (+x)", 90: " (+y)", 180: " (−x)", 270: " (−y)"}
    degrees = k * 360 // TUNING.sectors
    return f"crest at {degrees}°{axis.get(degrees, '')}"


def frequency_bands(model: Model) -> tuple[tuple[str, float, float], ...]:
    """Returns bands around the liquid's characteristic frequencies: label, from, to [Hz]."""
    first = model.mode_frequency(1) / (2.0 * math.pi)
    second = model.mode_frequency(2) / (2.0 * math.pi)
    centres = sorted([(first, "ω₁"), (2.0 * first, "2ω₁"), (second, "ω₂")])
    edge = TUNING.low_band * first
    bands = [(f"near 0 (below {edge:.1f} Hz)", 0.0, edge)]
    for k, (centre, name) in enumerate(centres):
        low, high = max(centre - TUNING.band * first, bands[-1][2]), centre + TUNING.band * first
        if k + 1 < len(centres):
            high = min(high, 0.5 * (centre + centres[k + 1][0]))
        bands.append((f"near {name} ({low:.1f} … {high:.1f} Hz)", low, high))
    return tuple(bands)


def _frequency_rows(residuals: Sequence[_Residual], model: Model) -> Iterator[WhereRow]:
    bands = frequency_bands(model)
    energies = np.zeros((len(bands) + 1, 2))
    values, samples = 0, 0
    for residual in residuals:
        t = residual.finding.motion.t
        finite = np.isfinite(residual.before) & np.isfinite(residual.after)
        values += int(finite.sum())
        samples += int(finite.any(axis=1).sum())
        for column, series in enumerate((residual.before, residual.after)):
            energies[:, column] += _band_energies(t, np.where(finite, series, np.nan), bands)
    total = float(energies[:, 0].sum())
    names = [*(label for label, _, _ in bands), "other frequencies"]
    for name, (before, after) in zip(names, energies.tolist(), strict=True):
        share = before / total if total > 0.0 else NAN
        rms = math.sqrt(before / values), math.sqrt(after / values)
        yield WhereRow("frequency", name, *rms, share, samples)


def _band_energies(t: Array, series: Array, bands: Sequence[tuple[str, float, float]]) -> Array:
    """Returns the energy of a series in each frequency band and outside all bands."""
    grid = np.nan_to_num(even_grid(t, series))
    spectrum = np.sum(np.abs(np.fft.fft(grid, axis=0)) ** 2, axis=1) / len(grid)
    frequency = np.abs(np.fft.fftfreq(len(grid), float(np.median(np.diff(t)))))
    # Against samples that fell on one place of the grid: all that was measured counts.
    spectrum *= float(np.nansum(series**2)) / max(float(spectrum.sum()), 1e-300)
    parts = [
        float(spectrum[(frequency >= low) & (frequency < high)].sum()) for _, low, high in bands
    ]
    return np.array([*parts, max(float(spectrum.sum()) - sum(parts), 0.0)])


def _input_rows(residuals: Sequence[_Residual], model: Model) -> Iterator[WhereRow]:
    period = 2.0 * math.pi / model.mode_frequency(1)
    before = [_envelope(each, _row_rms(each.before), period) for each in residuals]
    after = [_envelope(each, _row_rms(each.after), period) for each in residuals]
    series = [residual.inputs.quantities() for residual in residuals]
    samples = sum(int(np.isfinite(envelope).sum()) for envelope in before)
    for name in series[0]:
        quantity = [
            _envelope(each, values[name], period)
            for each, values in zip(residuals, series, strict=True)
        ]
        joined = np.concatenate(quantity)
        if not joined.max() > joined.min() + 1e-9:
            continue  # it never acts: nothing to follow
        yield WhereRow(
            "input",
            name,
            _following(np.concatenate(before), joined),
            _following(np.concatenate(after), joined),
            NAN,
            samples,
        )


def _envelope(residual: _Residual, series: Array, period: float) -> Array:
    """Returns a residual's running rms (M,) over one oscillation period; NaN if not measured."""
    spacing = float(np.median(np.diff(residual.finding.motion.t)))
    width = max(round(period / spacing), 1)
    present = np.isfinite(series)
    squares = ndimage.uniform_filter1d(np.where(present, series, 0.0) ** 2, width, mode="nearest")
    counts = ndimage.uniform_filter1d(present.astype(float), width, mode="nearest")
    mean = np.maximum(squares, 0.0) / np.maximum(counts, 0.5 / width)
    return np.where(present, np.sqrt(mean), np.nan)


def _following(envelope: Array, quantity: Array) -> float:
    """Returns the correlation of a residual's size with another quantity, at least 0."""
    kept = np.isfinite(envelope) & np.isfinite(quantity)
    one, two = envelope[kept], quantity[kept]
    if len(one) < 3 or not (one.std() > 0.0 and two.std() > 0.0):
        return 0.0
    return min(max(float(np.corrcoef(one, two)[0, 1]), 0.0), 1.0)


def _worst_of(finding: MotionFinding, count: int) -> list[tuple[float, WorstMoment]]:
    motion = finding.motion
    residual = np.abs(motion.heights - finding.before_heights)
    steady = _median_of_three(residual)
    found: list[tuple[float, WorstMoment]] = []
    free: NDArray[np.bool_] = np.asarray(np.isfinite(steady).any(axis=1))
    while free.any() and len(found) < count:
        sizes = np.where(free, np.nan_to_num(steady).max(axis=1), -1.0)
        row = int(np.argmax(sizes))
        column = int(np.nanargmax(steady[row]))
        moment = WorstMoment(
            motion.name,
            float(motion.t[row]),
            float(motion.heights[row, column]),
            float(finding.before_heights[row, column]),
            float(finding.after_heights[row, column]),
        )
        found.append((float(sizes[row]), moment))
        free = free & (np.abs(motion.t - motion.t[row]) >= TUNING.worst_separation)
    return found


def _median_of_three(size: Array) -> Array:
    """Returns the running median of three samples; NaN where nothing was measured."""
    padded = np.pad(np.nan_to_num(size), ((1, 1), (0, 0)), mode="edge")
    middle = np.median(np.stack([padded[:-2], padded[1:-1], padded[2:]]), axis=0)
    return np.where(np.isfinite(size), middle, np.nan)


def _row_rms(values: Array) -> Array:
    counts = np.isfinite(values).sum(axis=1)
    squares = np.nansum(values**2, axis=1) / np.maximum(counts, 1)
    return np.where(counts > 0, np.sqrt(squares), np.nan)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))

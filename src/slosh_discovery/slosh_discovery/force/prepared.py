"""Resamples motion and force to one grid, below the vibration frequency of arm and sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_dilation
from scipy.signal import butter, sosfiltfilt

from slosh_base.types import Array
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.force.record import ForceRecord
from slosh_discovery.force.tuning import TUNING
from slosh_model.constants import GRAVITY
from slosh_model.model import Model
from slosh_model.simulate import Inputs

Mask = NDArray[np.bool_]
ORDER = 3
"""Of the low-pass filter, which runs both ways and so delays nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedForce:
    """The data of a force fit: N samples of the time grid, n of which are fitted.

    Attributes:
        inputs: the motion on the grid, whose first container axes are level.
        drive: (N, 3) specific force of the container less its rest, in its axes [m/s²].
        force: (n, 3) as measured, below the cutoff [N].
        rows: (n,) of the grid.
        usable: (n,) whether a force was measured there.
        moving: (n,) whether the container moves.
        offsets: (n, L) what the sensor's zero may follow: constant, drift, a step per motion.
        band: second-order sections of the low-pass filter.
        gain: factor by which sparse samples of force and motion lower the wave's force, at least.
        notes: what was left out, a sentence each.
    """

    inputs: Inputs
    drive: Array
    force: Array
    rows: NDArray[np.int64]
    usable: Mask
    moving: Mask
    offsets: Array
    band: Array
    gain: float
    notes: tuple[str, ...]

    def below_cutoff(self, values: Array) -> Array:
        """Returns values (N,) low-pass filtered below the cutoff frequency."""
        return np.asarray(sosfiltfilt(self.band, values, axis=0), dtype=np.float64)

    def at(self, values: Array, delay: float) -> Array:
        """Interpolates values at the fitted times minus the sensor's delay [s]."""
        t = self.inputs.t
        wanted = t[self.rows] - delay
        return np.column_stack([np.interp(wanted, t, column) for column in values.T])


def prepared(record: ForceRecord, model: Model) -> PreparedForce:
    """Resamples and filters a force record for the fit.

    Raises:
        SloshDiscoveryError: no motion, no force, or too little of both; one line.
    """
    frequency = model.mode_frequency(1) / (2.0 * math.pi)
    t, force, notes = _checked(record)
    t, force = renewed(t, force, notes)
    gain = _sampling_gain(record, t, frequency, notes)
    inputs = _on_grid(record, t, frequency)
    drive = _drive(record.name, inputs)
    moving = _moving(record.name, drive)
    grid = inputs.t
    filled = np.column_stack([np.interp(grid, t, column) for column in force.T])
    usable = _measured(record.name, t, grid, notes)
    saturated = _saturated(record.name, force, notes)
    hidden = np.interp(grid, t, saturated.astype(np.float64)) > 0.0
    share = float(np.mean(hidden[moving]))
    if share > TUNING.most_hidden:
        raise SloshDiscoveryError(
            f"{record.name}: the sensor is clipped during {100.0 * share:.0f} % of the motion: "
            f"{notes[-1].partition(':')[0]}; take a sensor with a larger range, or move slower"
        )
    usable &= ~hidden
    cutoff = TUNING.cutoff * frequency
    smear = round(TUNING.rate / cutoff)
    usable = ~binary_dilation(~usable, iterations=smear) if not usable.all() else usable
    if not usable.any():
        raise SloshDiscoveryError(f"{record.name}: no part of the force is usable")
    band = butter(ORDER, cutoff, fs=TUNING.rate, output="sos")
    every = max(1, int(TUNING.rate / (TUNING.rows_per_cutoff * cutoff)))
    rows = np.arange(0, len(grid), every)
    slow = np.asarray(sosfiltfilt(band, filled, axis=0), dtype=np.float64)
    return PreparedForce(
        inputs, drive, slow[rows], rows, usable[rows], moving[rows],
        _offsets(moving)[rows], band, gain, tuple(notes),
    )  # fmt: skip


def _checked(record: ForceRecord) -> tuple[Array, Array, list[str]]:
    """Returns valid times and forces in the order of time, and notes on the omitted ones."""
    name, notes = record.name, []
    finite = np.isfinite(record.force).all(axis=1) & np.isfinite(record.t)
    if np.count_nonzero(finite) < 2:
        raise SloshDiscoveryError(f"{name}: the force holds no numbers (fx, fy, fz in N)")
    if not finite.all():
        notes.append(f"{np.count_nonzero(~finite)} forces are no numbers (NaN) and are left out")
    t, force = record.t[finite], record.force[finite]
    back = np.diff(t) <= 0.0
    if back.any():
        at = float(t[int(np.argmax(back))])
        t, places = np.unique(t, return_index=True)
        force = force[places]
        notes.append(f"{np.count_nonzero(back)} times of the force repeat or go back, first at "
                     f"{at:.3f} s: sorted")  # fmt: skip
    if not np.ptp(force, axis=0).any():
        raise SloshDiscoveryError(
            f"{name}: the force never changes: the sensor is dead, or the wrong topic was read"
        )
    return t, force, notes


def renewed(t: Array, force: Array, notes: list[str]) -> tuple[Array, Array]:
    """Leaves out the repeats of a force that is sent more often than it is measured.

    Held values are stairs to a fit, and at their peaks look like a saturated sensor.

    Args:
        t, force: (K,) [s] and (K, 3) [N].
        notes: gets a sentence where values are left out.
    """
    fresh = np.concatenate([[True], np.diff(force, axis=0).any(axis=1)])
    begins = np.flatnonzero(fresh)
    runs = np.diff(begins)
    if len(runs) < 2:
        return t, force
    short, usual, long = np.quantile(runs, [0.25, 0.5, 0.75])
    if usual < 2 or long - short > 1:  # of a coarse sensor, which stands still at rest
        return t, force
    # A value that stayed the same by chance was measured again at its time.
    since = np.arange(len(t)) - begins[np.cumsum(fresh) - 1]
    kept = since % round(float(usual)) == 0
    own, sent = 1.0 / np.median(np.diff(t[kept])), 1.0 / np.median(np.diff(t))
    notes.append(
        f"the force is measured at {own:.4g} Hz and sent at {sent:.4g} Hz: its repeats are left "
        "out"
    )
    return t[kept], force[kept]


def _sampling_gain(record: ForceRecord, t: Array, frequency: float, notes: list[str]) -> float:
    """Returns the factor of the wave's force that linear interpolation leaves, at least.

    Between samples at the rate r it is sinc²(f/r) for a wave of the frequency f [Hz].
    """
    gain, enough = 1.0, math.ceil(TUNING.samples_per_wave * frequency)
    for what, times in (("force", t), ("motion", record.inputs.t)):
        rate = 1.0 / float(np.median(np.diff(times)))
        remedy = f"the wave has {frequency:.3g} Hz: record the {what} at {enough} Hz or more"
        if rate < TUNING.least_samples * frequency:
            raise SloshDiscoveryError(f"{record.name}: the {what} has {rate:.3g} Hz and {remedy}")
        own = float(np.sinc(frequency / rate)) ** 2
        if own < TUNING.least_gain:
            notes.append(
                f"the {what} has {rate:.3g} Hz and {remedy}; the sloshing mass may be up to "
                f"{100.0 * (1.0 / own - 1.0):.0f} % wrong, which its interval contains"
            )
        gain = min(gain, own)
    return gain


def _on_grid(record: ForceRecord, t: Array, frequency: float) -> Inputs:
    motion = record.inputs
    start, end = max(motion.t[0], t[0]), min(motion.t[-1], t[-1])
    if end - start < TUNING.least_periods / frequency:
        raise SloshDiscoveryError(
            f"{record.name}: motion and force overlap for {max(end - start, 0.0):.2f} s; "
            f"{TUNING.least_periods:g} natural periods are {TUNING.least_periods / frequency:.2f} "
            "s: their clocks differ, or the record is too short"
        )
    grid = start + np.arange(int((end - start) * TUNING.rate) + 1) / TUNING.rate
    acceleration = np.column_stack([np.interp(grid, motion.t, a) for a in motion.acceleration.T])
    if motion.attitude is None:
        return Inputs(grid, acceleration)
    attitude = _continuous(motion.attitude)
    turned = np.column_stack([np.interp(grid, motion.t, q) for q in attitude.T])
    turned /= np.linalg.norm(turned, axis=1)[:, None]
    if rotations(turned[:1])[0, 2, 2] < math.cos(TUNING.tilt):
        turned = _levelled(turned)  # the link is no container: its axes are the world's at first
    if rotations(turned)[:, 2, 2].min() < math.cos(TUNING.tilt):
        raise SloshDiscoveryError(
            f"{record.name}: the container tilts by more than {math.degrees(TUNING.tilt):.0f}°: "
            "the force tells its modes only while it is upright"
        )
    return Inputs(grid, acceleration, turned)


def _continuous(attitude: Array) -> Array:
    """Returns quaternions with signs chosen so that consecutive ones do not jump."""
    unit = attitude / np.linalg.norm(attitude, axis=1)[:, None]
    flips = np.einsum("ij,ij->i", unit[1:], unit[:-1]) < 0.0
    signs = np.concatenate([[1.0], np.where(np.cumsum(flips) % 2, -1.0, 1.0)])
    return np.asarray(unit * signs[:, None])


def _levelled(attitude: Array) -> Array:
    """Returns attitudes (N, 4) relative to the first attitude."""
    x0, y0, z0, w0 = -attitude[0, 0], -attitude[0, 1], -attitude[0, 2], attitude[0, 3]
    x, y, z, w = attitude.T
    return np.column_stack([
        w * x0 + x * w0 + y * z0 - z * y0,
        w * y0 - x * z0 + y * w0 + z * x0,
        w * z0 + x * y0 - y * x0 + z * w0,
        w * w0 - x * x0 - y * y0 - z * z0,
    ])  # fmt: skip


def rotations(attitude: Array) -> Array:
    """Returns rotation matrices (N, 3, 3), world ← container, of unit quaternions (N, 4)."""
    x, y, z, w = attitude.T
    return np.moveaxis(
        np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]), 2, 0,
    )  # fmt: skip


def _drive(name: str, inputs: Inputs) -> Array:
    up = np.array([0.0, 0.0, GRAVITY])
    drive = inputs.acceleration + up
    if inputs.attitude is not None:
        drive = np.einsum("nij,ni->nj", rotations(inputs.attitude), drive)
    drive = np.asarray(drive - up, dtype=np.float64)
    peak = float(np.abs(drive[:, :2]).max())
    if peak < TUNING.least_peak:
        raise SloshDiscoveryError(
            f"{name}: the container does not move (peak of its acceleration {peak:.2g} m/s²): "
            "the force then tells no sloshing mass; record a motion and 10 s of rest behind it"
        )
    return drive


def _moving(name: str, drive: Array) -> Mask:
    size = np.linalg.norm(drive, axis=1)
    moving = size > TUNING.moving * size.max()
    pause = np.ones(max(1, round(TUNING.pause * TUNING.rate)), dtype=bool)
    padded = np.pad(moving, len(pause))
    moving = binary_closing(padded, pause)[len(pause) : -len(pause)]
    late = round(TUNING.ringing * TUNING.rate)
    return np.asarray(binary_dilation(moving, iterations=late), dtype=np.bool_)


def _offsets(moving: Mask) -> Array:
    """Returns columns that model sensor offsets: constant, drift, and a ramp for each motion."""
    count = len(moving)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], moving.astype(np.int8), [0]])))
    columns = [np.ones(count), np.linspace(-1.0, 1.0, count)]
    for start, end in edges.reshape(-1, 2)[: TUNING.most_offsets]:
        if end < count and start > 0:  # a rest before and behind it
            columns.append(np.clip((np.arange(count) - start) / (end - start), 0.0, 1.0))
    return np.column_stack(columns)


def _measured(name: str, t: Array, grid: Array, notes: list[str]) -> Mask:
    """Returns a mask (N,) of grid times around which the force was sampled."""
    steps = np.diff(t)
    gaps = np.flatnonzero(steps > max(TUNING.longest_gap, 3.0 * float(np.median(steps))))
    usable = np.ones(len(grid), dtype=np.bool_)
    for place in gaps:
        usable &= (grid <= t[place]) | (grid >= t[place + 1])
    if len(gaps):
        notes.append(
            f"{len(gaps)} gaps in the force, the longest {steps[gaps].max():.2f} s at "
            f"{t[gaps[np.argmax(steps[gaps])]]:.2f} s: left out"
        )
    return usable


def _saturated(name: str, force: Array, notes: list[str]) -> Mask:
    """Returns a mask (K,) of samples at which a channel of the sensor is saturated."""
    found = np.zeros(len(force), dtype=np.bool_)
    swing = np.abs(force - np.median(force, axis=0)).max()
    for axis, column in zip("xyz", force.T, strict=True):
        for limit in (column.max(), column.min()):
            at = column == limit
            edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(np.int8), [0]])))
            runs = edges.reshape(-1, 2)
            longest = int((runs[:, 1] - runs[:, 0]).max())
            far = abs(limit - np.median(column)) > TUNING.flat_share * swing
            if longest >= TUNING.flat and far and not np.median(at):
                found |= at
                notes.append(
                    f"f{axis} stands at {limit:.4g} N for up to {longest} samples: the sensor is "
                    "saturated there, which is left out"
                )
    return found

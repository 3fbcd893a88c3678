"""Brings the data of a sensor and a motion to one time axis with equal smoothing.

Both sides are averaged by three boxes in turn, so that what a pose's filter has smoothed already,
and a sensor's vibration, do not matter. The motion is told in the container's own axes first.

What the narrowest boxes take away of white noise bounds what they leave; wider ones leave less by
their widths, and far less of the noise of poses, which accelerations have at high frequencies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, BoolArray, Integers
from slosh_model.constants import GRAVITY
from slosh_motion.mounting.tuning import TUNING

BOXES = 3
ACCELERATION, UP, RATE, ARM = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 18)
"""Columns of a motion: acceleration, gravity's reaction [m/s²], angular velocity [rad/s], and the
matrix (3, 3) by which a place [m] in the container is accelerated beyond its origin."""
COLUMNS = 18


class SensorColumns(NamedTuple):
    """A sensor's samples as received: stamps, specific force, angular velocity.

    Attributes:
        stamps: (N,) rising [ns].
        force: (N, 3) in its own axes and unit.
        rate: (N, 3) angular velocity; NaN: not known.
    """

    stamps: Integers
    force: Array
    rate: Array


class MotionColumns(NamedTuple):
    """Samples of the container's motion: stamps, acceleration, attitude.

    Attributes:
        stamps: (N,) rising [ns].
        acceleration: (N, 3) of its origin, gravity excluded, in the world's axes [m/s²].
        attitude: (N, 4) quaternions x, y, z, w, world ← container, of length 1.
        rate: (N, 3) angular velocity in its own axes [rad/s].
        turning: (N, 3) angular acceleration in its own axes [rad/s²].
    """

    stamps: Integers
    acceleration: Array
    attitude: Array
    rate: Array
    turning: Array


class Aligned(NamedTuple):
    """A sensor's readings and the container's motion on one time axis.

    Attributes:
        motion: (N, COLUMNS).
        force, rate: (N + 2 lags, 3): a row lies `lags` rows behind that of the motion.
        known: (N + 2 lags,) whether the sensor's row is known.
        used: (N,) whether the motion's row is known.
        lags: rows of the sensor before and behind the motion.
        noise: mean square of the noise of the motion's accelerations, at most [m²/s⁴].
    """

    motion: Array
    force: Array
    rate: Array
    known: BoolArray
    used: BoolArray
    lags: int
    noise: float


def sensor_columns(motion: MotionColumns, *, in_world: bool = False) -> Array:
    """Returns a motion as columns (N, COLUMNS) that can be compared with sensor readings.

    Args:
        motion: of the container.
        in_world: in the world's axes, for a sensor that reports in these.
    """
    count = len(motion.stamps)
    found = np.zeros((count, COLUMNS))
    found[:, UP] = (0.0, 0.0, GRAVITY)
    found[:, RATE] = motion.rate
    if in_world:
        found[:, ACCELERATION] = motion.acceleration
        return found
    turn = matrices(motion.attitude)
    found[:, ACCELERATION] = np.einsum("nij,ni->nj", turn, motion.acceleration)
    found[:, UP] = GRAVITY * turn[:, 2]
    spin = crosses(motion.rate)
    found[:, ARM] = (crosses(motion.turning) + spin @ spin).reshape(count, 9)
    return found


def aligned(
    sensor: SensorColumns, stamps: Integers, motion: Array, begin: int, end: int
) -> tuple[Aligned, ...]:
    """Aligns a sensor and a motion between two stamps, for each smoothing width.

    Args:
        sensor: at least two samples.
        stamps: (N,) of the motion, at least two [ns].
        motion: (N, COLUMNS) as `sensor_columns` gives it.
        begin, end: the moments [ns].
    """
    lags = round(TUNING.farthest_lag / TUNING.step)
    count = max(int((end - begin) * 1e-9 / TUNING.step), 1)
    at: Array = (np.arange(-lags, count + lags, dtype=np.float64) + 0.5) * TUNING.step
    own, other = (sensor.stamps - begin) / SECOND, (stamps - begin) / SECOND
    values = np.column_stack([sensor.force, np.nan_to_num(sensor.rate)])
    turns = np.interp(at, own, np.isfinite(sensor.rate).all(axis=1).astype(np.float64)) == 1.0
    inner = at[lags : lags + count]
    known, used = _reached(own, at), _reached(other, inner)
    raw = [np.interp(inner, other, column) for column in motion[:, ACCELERATION].T]
    found: list[Aligned] = []
    for box in TUNING.boxes:
        heard, moved = smoothed(own, values, at, box), smoothed(other, motion, inner, box)
        heard[~turns, 3:] = np.nan
        if found:
            noise = found[0].noise * TUNING.boxes[0] / box
        else:
            off = (moved[:, ACCELERATION] - np.stack(raw, axis=1))[used]
            noise = float(np.mean(np.sum(off * off, axis=1))) if len(off) else 0.0
        found.append(Aligned(moved, heard[:, :3], heard[:, 3:], known, used, lags, noise))
    return tuple(found)


def smoothed(t: Array, values: Array, at: Array, box: float) -> Array:
    """Resamples each column at evenly spaced times, smoothed by three moving averages.

    By three boxes of a width [s].
    """
    reach = round(0.5 * BOXES * box / TUNING.step) + 1
    step = at[1] - at[0] if len(at) > 1 else TUNING.step
    before = at[0] + step * np.arange(-reach, 0)
    behind = at[-1] + step * np.arange(1, reach + 1)
    wide = np.concatenate([before, at, behind])
    sums = np.zeros_like(values)
    sums[1:] = np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t)[:, None], axis=0)
    low = np.clip(wide - 0.5 * box, t[0], t[-1])
    high = np.clip(wide + 0.5 * box, t[0], t[-1])
    width = np.maximum(high - low, 1e-9)
    kernel = np.ones(round(box / TUNING.step))
    kernel = np.convolve(kernel, kernel) / len(kernel) ** 2
    found = np.empty((len(at), values.shape[1]))
    for place, (column, total) in enumerate(zip(values.T, sums.T, strict=True)):
        mean = (np.interp(high, t, total) - np.interp(low, t, total)) / width
        edge = high - low < 1e-6
        mean[edge] = np.interp(wide[edge], t, column)
        found[:, place] = np.convolve(mean, kernel, "same")[reach:-reach]
    return found


def _reached(t: Array, at: Array) -> BoolArray:
    """Returns which times (M,) have samples close enough on both sides."""
    after = np.searchsorted(t, at)
    inside = (after > 0) & (after < len(t))
    right = np.clip(after, 1, len(t) - 1)
    reached: BoolArray = inside & (t[right] - t[right - 1] <= TUNING.gap)
    return reached


def matrices(quaternions: Array) -> Array:
    """Returns rotation matrices (N, 3, 3) of quaternions x, y, z, w (N, 4) of any length."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w),
        2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w),
        2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip
    found: Array = np.stack(rows, axis=1).reshape(-1, 3, 3)
    return found


def crosses(vectors: Array) -> Array:
    """Returns the cross-product matrices (N, 3, 3) of vectors (N, 3): [v]× u = v × u."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    found: Array = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return found

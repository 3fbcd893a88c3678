"""Rotations of a mounting, and a sensor and a motion on one time axis with equal smoothing.

Both sides are averaged by three boxes in turn, so that what a pose's filter has smoothed already,
and a sensor's vibration, do not matter. The motion is told in the container's own axes first.

What the narrowest boxes take away of white noise bounds what they leave; wider ones leave less by
their widths, and far less of the noise of poses, which accelerations have at high frequencies.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, BoolArray, Integers
from slosh_model.constants import GRAVITY
from slosh_motion.mounting.tuning import TUNING

_NAMES = ("x", "y", "z")


def nearest(matrix: Array, handed: float = 1.0) -> Array:
    """Returns the orthogonal matrix (3, 3) with determinant `handed` nearest to a matrix.

    By singular values (Kabsch 1976).
    """
    left, _, right = np.linalg.svd(matrix)
    sign = handed * np.sign(np.linalg.det(left) * np.linalg.det(right))
    found: Array = left @ np.diag([1.0, 1.0, sign]) @ right
    return found


def rotation_vector(matrix: Array) -> Array:
    """Returns the rotation vector (3,) of a rotation matrix, with an angle in [0, π]."""
    skew = 0.5 * np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    sine, cosine = float(np.linalg.norm(skew)), 0.5 * (float(np.trace(matrix)) - 1.0)
    angle = math.atan2(sine, cosine)
    if sine > 1e-6:
        along: Array = skew * (angle / sine)
        return along
    if cosine > 0.0:
        return np.asarray(skew)
    # Half a turn: the axis is the column of (M + 1) / 2 that is longest.
    axes = 0.5 * (matrix + np.eye(3))
    column = axes[:, int(np.argmax(np.diag(axes)))]
    half: Array = column / np.linalg.norm(column) * math.pi
    return half


def exponential(turn: Array) -> Array:
    """Returns the rotation matrix (3, 3) of a rotation vector (3,) (Rodrigues)."""
    angle = float(np.linalg.norm(turn))
    x, y, z = turn
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine = math.sin(angle) / angle if angle > 1e-12 else 1.0
    half = 2.0 * (math.sin(0.5 * angle) / angle) ** 2 if angle > 1e-12 else 0.5
    found: Array = np.eye(3) + sine * cross + half * cross @ cross
    return found


def axis_rotations() -> list[Array]:
    """Returns the 24 rotation matrices (3, 3) that map coordinate axes to coordinate axes."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if np.linalg.det(matrix) > 0.0:
                found.append(matrix)
    return found


def snapped(rotation: Array, within: float) -> Array:
    """Returns the nearest of the 24 axis rotations if within an angle [rad], else the input."""
    near = max(axis_rotations(), key=lambda one: float(np.sum(one * rotation)))
    away = float(np.linalg.norm(rotation_vector(near.T @ rotation)))
    return near if away <= within else rotation


def axes_in_words(rotation: Array) -> str:
    """Describes along which axes of the container the axes of the sensor point.

    Args:
        rotation: (3, 3) sensor ← container, each row one of the sensor's axes.
    """
    found = []
    for row in rotation:
        place = int(np.argmax(np.abs(row)))
        found.append(f"{'+' if row[place] > 0.0 else '-'}{_NAMES[place]}")
    return ", ".join(found)


def axis_in_words(direction: Array) -> str:
    """Describes a line's direction by the axis within 25° of it, or else by its components."""
    place = int(np.argmax(np.abs(direction)))
    if abs(direction[place]) > math.cos(math.radians(25.0)) * float(np.linalg.norm(direction)):
        return _NAMES[place]
    told = direction / np.linalg.norm(direction) * math.copysign(1.0, direction[place])
    return "({:.1f}, {:.1f}, {:.1f})".format(*(told + 0.0))


def roll_pitch_yaw(matrix: Array) -> tuple[float, float, float]:
    """Returns the fixed-axis angles roll, pitch, yaw [rad] of Rz(yaw) Ry(pitch) Rx(roll)."""
    sine = -float(matrix[2, 0])
    if abs(sine) > 1.0 - 1e-9:  # upright: roll and yaw turn about one axis
        turn = math.atan2(-float(matrix[0, 1]), float(matrix[1, 1]))
        return 0.0, math.copysign(0.5 * math.pi, sine), _short(turn)
    return (
        _short(math.atan2(float(matrix[2, 1]), float(matrix[2, 2]))),
        math.asin(sine),
        _short(math.atan2(float(matrix[1, 0]), float(matrix[0, 0]))),
    )


def _short(angle: float) -> float:
    """Returns an angle with -π replaced by π."""
    return math.pi if math.isclose(angle, -math.pi, abs_tol=1e-9) else angle


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

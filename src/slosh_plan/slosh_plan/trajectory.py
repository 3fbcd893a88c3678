"""A planned motion of the container, sampled over time."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from slosh_base.types import Array
from slosh_model.errors import SloshModelError
from slosh_model.gaps import row_spacing
from slosh_model.simulate import Inputs
from slosh_plan.errors import SloshPlanError

MOST_POINTS = 200_000
"""200 s at 1 kHz: a motion, not a recording."""
LONGEST = 600.0
"""Longest motion [s]."""
GAP = 0.1
"""An interval between two samples that is longer than this [s],"""
GAP_SHARE = 10.0
"""and than so many usual ones (their median), is a gap."""
GREATEST_ACCELERATION = 1e3
"""[m/s²]; more is a unit mistaken for another."""
FARTHEST = 1e4
"""No container is farther from the origin of its cell [m]."""
QUATERNION_LENGTHS = (0.9, 1.1)
PEAK_SPACING = 0.001
"""Heights are told so often [s]: between two of them a peak of 3 Hz hides 5e-5 of itself."""
POSE_SPACING = 0.002
"""Between poses that are farther apart [s] the attitude is interpolated."""
_WIDTHS = {"acceleration": "xyz", "attitude": "xyzw", "angular_velocity": "xyz", "position": "xyz"}


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """A motion of the container from rest, with piecewise linear acceleration.

    >>> import numpy as np
    >>> from slosh_plan import Trajectory
    >>> t = np.arange(1001) / 1000.0  # s
    >>> move = Trajectory(t, np.outer(np.sin(9.0 * t), [1.0, 0.0, 0.0]), name="push")  # m/s²
    >>> float(move.t[-1])
    1.0

    Attributes:
        t: (N,) time [s], strictly increasing, at least two.
        acceleration: (N, 3) of the container's origin, world's axes, gravity excluded [m/s²].
        attitude: (N, 4) quaternion x, y, z, w, world ← container; None: upright throughout.
        angular_velocity: (N, 3) in the container's frame [rad/s]; None: the attitude's change.
        position: (N, 3) of the container's origin in the world [m]; None: not given.
        name: for messages and tables.
        rows: longest interval between given samples while it moves [s]; NaN: that of `t`.

    Raises:
        SloshPlanError: what cannot be such a motion: array, row and value in one line.
    """

    t: Array
    acceleration: Array
    attitude: Array | None = None
    angular_velocity: Array | None = None
    position: Array | None = None
    name: str = "trajectory"
    rows: float = math.nan

    def __post_init__(self) -> None:
        t = _numbers(self.name, "t", self.t)
        if t.ndim != 1:
            raise SloshPlanError(f"{self.name}: t has the shape {t.shape}, expected one row")
        _check_count(self.name, len(t))
        object.__setattr__(self, "t", t)
        for array, columns in _WIDTHS.items():
            if getattr(self, array) is not None:
                value = _numbers(self.name, array, getattr(self, array))
                _check_values(self.name, array, value, (len(t), len(columns)), columns)
                object.__setattr__(self, array, value)
        _check_times(self.name, t)
        _check_sizes(self)

    @classmethod
    def from_poses(
        cls,
        t: ArrayLike,
        position: ArrayLike,
        attitude: ArrayLike | None = None,
        name: str = "trajectory",
    ) -> Trajectory:
        """Creates a motion through poses, from rest to rest.

        The positions are joined by the cubic spline that rests at both ends: its acceleration is
        continuous and linear between the poses, which is what the simulation takes; nothing is
        smoothed. Attitudes are joined by a spline, too, sampled every POSE_SPACING.

        Args:
            t: (N,) [s], at least three.
            position: (N, 3) of the container's origin in the world [m].
            attitude: (N, 4) quaternion x, y, z, w, world ← container; None: upright.
            name: for messages.

        Raises:
            SloshPlanError: as the class; fewer than three poses, which tell no acceleration.
        """
        # The same checks as of accelerations, before anything is computed with the values.
        count = np.size(t)
        given = cls(
            np.asarray(t), np.zeros((count, 3)), _optional(attitude), None, np.asarray(position),
            name,
        )  # fmt: skip
        if count < 3:
            raise SloshPlanError(
                f"{name}: {count} poses do not determine the acceleration; give at least 3"
            )
        assert given.position is not None
        spline = scipy.interpolate.CubicSpline(given.t, given.position, bc_type="clamped")
        if given.attitude is None:
            return replace(given, acceleration=spline(given.t, 2))
        moments = dense(given.t, POSE_SPACING)
        rows = row_spacing(given.t, spline(given.t, 2))
        poses = scipy.spatial.transform.Rotation.from_quat(given.attitude)
        turns = scipy.spatial.transform.RotationSpline(given.t, poses)
        return cls(
            moments, spline(moments, 2), turns(moments).as_quat(), turns(moments, 1),
            spline(moments), name, rows,
        )  # fmt: skip

    @property
    def spacing(self) -> float:
        """Longest interval between given samples while the motion is not at rest [s]."""
        return self.rows if self.rows > 0.0 else row_spacing(self.t, self.acceleration)

    @property
    def duration(self) -> float:
        """Duration from the motion's first to its last sample [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def turns(self) -> bool:
        """Whether the motion contains the attitude of the container."""
        return self.attitude is not None or self.angular_velocity is not None

    def scaled(self, factor: float) -> Trajectory:
        """Returns the motion along the same path, slowed by `factor`.

        Positions and attitudes stay, times are stretched: ẍ goes with 1/factor², ω with 1/factor.
        Differentiating the stretched positions gives the same accelerations.

        Raises:
            SloshPlanError: a factor that is not positive.
        """
        if not (math.isfinite(factor) and factor > 0.0):
            raise SloshPlanError(f"time scale {factor!r} must be positive")
        rate = self.angular_velocity
        values = {
            "t": self.t[0] + (self.t - self.t[0]) * factor,
            "acceleration": self.acceleration / factor**2,
            "rows": self.rows * factor,
            "angular_velocity": None if rate is None else rate / factor,
        }
        # Checked already: a stretched motion has no other gaps, and thousands are made of one.
        other = object.__new__(Trajectory)
        for entry in fields(self):
            object.__setattr__(
                other, entry.name, values.get(entry.name, getattr(self, entry.name))
            )
        return other

    def after_rest(self, seconds: float) -> Trajectory:
        """Returns the motion preceded by a rest of given duration [s].

        Raises:
            SloshPlanError: it gets too long.
        """
        # As often as the motion's own samples: no interval of either is a gap beside the other's.
        count = max(math.ceil(seconds / float(np.median(np.diff(self.t)))), 1)
        before = self.t[0] - seconds * np.arange(count, 0, -1) / count

        def rested(values: Array | None, still: bool = False) -> Array | None:
            if values is None:
                return None
            first = np.zeros_like(values[0]) if still else values[0]
            return np.concatenate((np.tile(first, (count, 1)), values))

        moved = np.concatenate((np.zeros((count, 3)), self.acceleration))
        return replace(
            self, t=np.concatenate((before, self.t)), acceleration=moved,
            attitude=rested(self.attitude), position=rested(self.position),
            angular_velocity=rested(self.angular_velocity, still=True),
        )  # fmt: skip

    def inputs(self, horizon: float = 0.0, spacing: float = PEAK_SPACING) -> Inputs:
        """Returns simulation inputs: the motion, then rest for `horizon` [s].

        Args:
            horizon: how long it rests.
            spacing: of the samples at most [s]; between those of the motion the acceleration is
                linear.

        Raises:
            SloshPlanError: the simulation does not take it.
        """
        try:
            given = Inputs(self.t, self.acceleration, self.attitude, self.angular_velocity)
            return rested(given, horizon, spacing)
        except SloshModelError as error:
            raise SloshPlanError(f"{self.name}: {error}") from None


def rested(given: Inputs, horizon: float = 0.0, spacing: float = PEAK_SPACING) -> Inputs:
    """Returns a motion, sampled at least every `spacing` [s], then at rest for `horizon` [s].

    Raises:
        SloshModelError: the simulation does not take it.
    """
    t, acceleration = given.t, given.acceleration
    attitude, rate = given.attitude, given.angular_velocity
    if horizon > 0.0:
        count = math.ceil(horizon / spacing)
        t = np.concatenate((t, t[-1] + horizon / count * np.arange(1, count + 1)))
        acceleration = np.concatenate((acceleration, np.zeros((count, 3))))
        if attitude is not None:
            attitude = np.concatenate((attitude, np.tile(attitude[-1], (count, 1))))
        if rate is not None:
            rate = np.concatenate((rate, np.zeros((count, 3))))
        given = Inputs(t, acceleration, attitude, rate)
    moments = dense(given.t, spacing)
    return given if len(moments) == len(t) else given.resampled(moments)


def _optional(value: ArrayLike | None) -> Array | None:
    return None if value is None else np.asarray(value)


def _numbers(name: str, array: str, value: ArrayLike) -> Array:
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise SloshPlanError(f"{name}: {array} is not an array of numbers") from None
    numbers.setflags(write=False)
    return numbers


def _check_count(name: str, count: int) -> None:
    if count < 2:
        points = f"{count} point" if count == 1 else f"{count} points"
        raise SloshPlanError(f"{name}: {points}: a motion needs at least 2")
    if count > MOST_POINTS:
        raise SloshPlanError(
            f"{name}: {count} points are more than {MOST_POINTS}; split the motion or remove "
            "points"
        )


def _check_values(
    name: str, array: str, value: Array, shape: tuple[int, int], columns: str
) -> None:
    if value.shape != shape:
        raise SloshPlanError(f"{name}: {array} has the shape {value.shape}, expected {shape}")
    bad = np.argwhere(~np.isfinite(value))
    if len(bad):
        row, column = bad[0]
        raise SloshPlanError(
            f"{name}: {array}[{row}].{columns[column]} = {value[row, column]} is not finite"
        )


def _check_times(name: str, t: Array) -> None:
    if not np.isfinite(t).all():
        row = int(np.argmin(np.isfinite(t)))
        raise SloshPlanError(f"{name}: t[{row}] = {t[row]} is not finite")
    if t[0] == t[-1]:
        raise SloshPlanError(f"{name}: the motion lasts 0 s: its first and last time are equal")
    intervals = np.diff(t)
    late = np.flatnonzero(intervals <= 0.0)
    if len(late):
        row = int(late[0]) + 1
        how = "repeats" if t[row] == t[row - 1] else "comes before"
        raise SloshPlanError(
            f"{name}: t[{row}] = {t[row]:.9g} s {how} t[{row - 1}] = {t[row - 1]:.9g} s; "
            "time must increase"
        )
    if t[-1] - t[0] > LONGEST:
        raise SloshPlanError(
            f"{name}: the motion lasts {t[-1] - t[0]:.6g} s, more than {LONGEST:g} s; cut it"
        )
    usual = float(np.median(intervals))
    row = int(np.argmax(intervals))
    if intervals[row] > max(GAP, GAP_SHARE * usual):
        raise SloshPlanError(
            f"{name}: a gap: {intervals[row]:.3g} s between t[{row}] = {t[row]:.9g} s and the "
            f"next, usual are {usual:.3g} s; fill it in"
        )


def _check_sizes(trajectory: Trajectory) -> None:
    name = trajectory.name
    for array, limit, unit in (
        ("position", FARTHEST, "m"),
        ("acceleration", GREATEST_ACCELERATION, "m/s²"),
    ):
        value = getattr(trajectory, array)
        if value is not None and np.abs(value).max() > limit:
            row = int(np.argmax(np.abs(value).max(axis=1)))
            most = np.abs(value[row]).max()
            raise SloshPlanError(
                f"{name}: {array}[{row}] reaches {most:.4g} {unit}, more than {limit:g} {unit}: "
                "another unit? Are the poses at rest at both ends?"
            )
    if trajectory.attitude is not None:
        length = np.linalg.norm(trajectory.attitude, axis=1)
        wrong = (length < QUATERNION_LENGTHS[0]) | (length > QUATERNION_LENGTHS[1])
        if wrong.any():
            row = int(np.argmax(wrong))
            raise SloshPlanError(
                f"{name}: attitude[{row}] has the length {length[row]:.4g}; a quaternion must "
                "have the length 1"
            )


def dense(t: Array, spacing: float) -> Array:
    """Inserts further sample times where given times are more than `spacing` apart [s].

    >>> dense(np.array([0.0, 0.5, 1.5]), spacing=0.5).tolist()  # s
    [0.0, 0.5, 1.0, 1.5]
    """
    counts = np.maximum(np.ceil(np.diff(t) / spacing - 1e-3).astype(int), 1)
    if counts.max() == 1:
        return t
    first = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(counts.sum()) - first) / np.repeat(counts, counts)
    inner = np.repeat(t[:-1], counts) + share * np.repeat(np.diff(t), counts)
    return np.concatenate((inner, t[-1:]))

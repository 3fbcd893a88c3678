"""Judges the mounting of a sensor: right, wrong with a remedy, or not known."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_motion.mounting.columns import (
    axes_in_words,
    axis_in_words,
    roll_pitch_yaw,
    rotation_vector,
    snapped,
)
from slosh_motion.mounting.mounting_fit import MountingFit
from slosh_motion.mounting.refinement import unmirrored
from slosh_motion.mounting.tuning import TUNING

UNITS: Mapping[str, float] = {"g": 1.0 / GRAVITY, "mm/s²": 1000.0, "cm/s²": 100.0}
"""Gain of an acceleration in a unit."""
TURN_UNITS: Mapping[str, float] = {
    "degrees/s": math.degrees(1.0), "rpm": 30.0 / math.pi, "mrad/s": 1000.0,
}  # fmt: skip
"""Gain of an angular velocity in a unit."""
_AXES = ("x", "y", "z")
_NOISY = "anything: the motion is too small for its noise; move faster, or publish it finer"


class Expected(NamedTuple):
    """The mounting of a sensor as it is configured, to be compared with the fitted one.

    Attributes:
        rotation: (3, 3) container ← sensor.
        to_origin: (3,) from the sensor to the container's origin, in the container's axes [m].
        gravity: whether it reports specific forces, which contain gravity.
        arm: whether its place is a part of its mounting.
        name: of the sensor and of what it is compared with, for sentences.
    """

    rotation: Array
    to_origin: Array
    gravity: bool
    arm: bool = True
    name: str = "the sensor"


class MountingVerdict(NamedTuple):
    """Result of a mounting check: faults, remarks, the fit and the measured rotation.

    Attributes:
        wrong: what is wrong, with the remedy, a clause each; empty: nothing is known to be.
        unseen: what the motion did not show.
        sensor_rotation: roll, pitch, yaw [rad] of container ← sensor as measured.
        error: standard error of the rotation, about the axis where it is largest [rad].
    """

    wrong: tuple[str, ...]
    remarks: tuple[str, ...]
    unseen: tuple[str, ...]
    fit: MountingFit
    sensor_rotation: tuple[float, float, float]
    error: float


def judge(fit: MountingFit, expected: Expected) -> MountingVerdict:
    """Compares the fitted mounting with the configured one."""
    told = expected.rotation.T
    mirrored = np.linalg.det(fit.rotation) < 0.0
    rotation = unmirrored(fit.rotation, told) if mirrored else fit.rotation
    errors, axes = _errors(fit.covariance)
    near = snapped(
        rotation,
        max(TUNING.snapped, TUNING.sure * float(errors[errors < TUNING.unseen].max(initial=0.0))),
    )
    angles = roll_pitch_yaw(near.T)
    if fit.clear < TUNING.clear and fit.explained < TUNING.enough:
        return MountingVerdict((), (), (_NOISY,), fit, angles, float(errors.max()))
    if not _same_motion(fit):
        another = (_another_motion(fit),)
        return MountingVerdict(another, (), (), fit, angles, float(errors.max()))
    wrong = [
        *_scale(fit, expected), *_gravity(fit, expected), *_mirror(fit, rotation, mirrored),
        *_turned(fit, rotation, near, told, mirrored=mirrored), *_rates(fit),
    ]  # fmt: skip
    return MountingVerdict(
        tuple(wrong), tuple(_remarks(fit, expected)), tuple(_unseen(fit, errors, axes)), fit,
        angles, float(errors.max()),
    )  # fmt: skip


def _errors(covariance: Array) -> tuple[Array, Array]:
    """Returns standard errors (3,) [rad] about principal axes, and these axes as columns."""
    values, axes = np.linalg.eigh(covariance)
    return np.sqrt(np.maximum(values, 0.0)), axes


def _same_motion(fit: MountingFit) -> bool:
    """Returns whether the sensor shows the container's motion at all."""
    return fit.explained >= TUNING.explained and fit.gain > TUNING.sure * fit.gain_error


def _another_motion(fit: MountingFit) -> str:
    share = f"{100.0 * max(fit.explained, 0.0):.0f} %"
    return (
        f"no mounting, unit or delay up to {TUNING.farthest_lag:g} s explains it (at best {share} "
        "of the motion): it is fixed to another body, stamped by another clock, or faulty"
    )


def _scale(fit: MountingFit, expected: Expected) -> Iterator[str]:
    unit = unit_of(fit)
    if unit == "":
        return
    if unit is not None:
        yield f"it is in {unit}: publish m/s² ({_factor(UNITS[unit])})"
        return
    yield (
        f"its acceleration is {fit.gain:.3g} ± {fit.gain_error:.2g} times the motion's: another "
        "unit or a wrong scale; publish m/s²"
    )


def unit_of(fit: MountingFit) -> str | None:
    """Returns the unit of the sensor's accelerations: empty for m/s², None if it is unknown.

    Noise in the motion makes the gain small by the part that is not explained, noise of the
    sensor makes it large by the same: the true one lies between.
    """
    slack = TUNING.sure * fit.gain_error
    least, most = fit.gain - slack, (fit.gain + slack) / max(fit.explained, TUNING.explained)
    if least <= 1.0 + TUNING.gain and most >= 1.0 - TUNING.gain:
        return ""
    for name, own in UNITS.items():
        if least <= (1.0 + TUNING.unit) * own and most >= (1.0 - TUNING.unit) * own:
            return name
    return None


def _unit(gain: float, units: Mapping[str, float]) -> str:
    """Returns the unit that corresponds to a sensor's gain; empty if no unit does."""
    for name, own in units.items():
        if abs(gain / own - 1.0) <= TUNING.unit:
            return name
    return ""


def _factor(gain: float) -> str:
    """Describes the factor that corrects values with a wrong gain."""
    if gain < 1.0:
        return f"{1.0 / gain:.4g} times as much"
    return f"divided by {gain:.4g}"


def _gravity(fit: MountingFit, expected: Expected) -> Iterator[str]:
    """Yields what is wrong with gravity in the readings, and its remedy."""
    unit = unit_of(fit)
    scale = fit.gain if unit is None else UNITS.get(unit, 1.0)
    part, slack = fit.gravity / scale, TUNING.sure * fit.gravity_error / scale
    right = 1.0 if expected.gravity else 0.0
    if abs(part - right) <= TUNING.gravity + slack:
        return
    reads = f"{part * GRAVITY:.2f} m/s² of gravity"
    if expected.gravity:
        if abs(part) <= TUNING.gravity + slack:
            yield (
                "gravity is left out: publish it as REP-145 says (+9.81 m/s² at rest), or use the "
                "input accel"
            )
        elif part < 0.0:
            yield "gravity has the wrong sign against the motion: publish specific force (REP-145)"
        else:
            yield f"it contains {reads}, not 9.81: publish it as REP-145 says"
        return
    subtracted = (scale - 1.0) / scale
    if scale < 1.0 and abs(part - subtracted) <= TUNING.gravity * abs(subtracted):
        yield "9.81 was subtracted from it in that unit: convert it first"
    elif abs(part - 1.0) <= TUNING.gravity + slack:
        yield "gravity is contained: subtract it, or publish imu"
    elif abs(part + 1.0) <= TUNING.gravity + slack:
        yield "gravity is contained with the other sign, or was subtracted twice"
    else:
        yield f"it contains {reads}: subtract it"


def _mirror(fit: MountingFit, rotation: Array, mirrored: bool) -> Iterator[str]:
    if mirrored:
        flip = np.diag(fit.rotation @ rotation.T)
        axis = _AXES[int(np.argmin(flip))]
        yield f"its axes are left-handed: reverse the sign of its {axis}"


def _turned(
    fit: MountingFit, rotation: Array, near: Array, told: Array, *, mirrored: bool
) -> Iterator[str]:
    away = rotation_vector(told.T @ rotation)
    angle = float(np.linalg.norm(away))
    if angle <= TUNING.turned:
        return
    along = away / angle
    # Half a turn is the same about both directions: what is measured is its line.
    error = math.sqrt(float(along @ fit.covariance @ along))
    if angle <= TUNING.sure * error or error > TUNING.unseen:
        return
    is_axis = not np.array_equal(near, rotation)
    where = (
        f"its x, y, z point along the container's {axes_in_words(near)}"
        if is_axis
        else f"it is turned by {math.degrees(angle):.1f}°"
    )
    then = "then " if mirrored else ""
    numbers = "[{:.4f}, {:.4f}, {:.4f}]".format(*(a + 0.0 for a in roll_pitch_yaw(near.T)))
    yield f"{where} (± {math.degrees(error):.1f}°): {then}set sensor_rotation to {numbers}"


def _rates(fit: MountingFit) -> Iterator[str]:
    turn = fit.turn
    if turn is None or turn.gain < TUNING.gain:
        return
    unit = _unit(turn.gain, TURN_UNITS)
    if unit:
        yield f"its angular velocity is in {unit}: publish rad/s ({_factor(TURN_UNITS[unit])})"
    elif abs(turn.gain - 1.0) > 2.0 * TUNING.gain:
        yield f"its angular velocity is {turn.gain:.2g} times the motion's: publish rad/s"
    if not turn.agrees:
        axes = axes_in_words(turn.rotation)
        left = " (left-handed)" if np.linalg.det(turn.rotation) < 0.0 else ""
        yield (
            f"its angular velocity has other axes than its acceleration: x, y, z along the "
            f"container's {axes}{left}; publish both in one frame"
        )


def _remarks(fit: MountingFit, expected: Expected) -> Iterator[str]:
    if abs(fit.lag) > TUNING.late + TUNING.sure * fit.lag_error:
        late = "late" if fit.lag > 0.0 else "early"
        yield (
            f"it is {1e3 * abs(fit.lag):.0f} ± {1e3 * fit.lag_error:.0f} ms {late}: stamp both "
            "when they are measured, by one clock"
        )
    if fit.turn is not None and fit.turn.gain < TUNING.gain:
        yield (
            "its angular velocity is 0 while the container turns: publish it, or say that there "
            "is none (covariance[0] = -1)"
        )
    if not expected.arm or not np.isfinite(fit.arm).all():
        return
    off = np.abs(fit.arm + expected.to_origin)
    seen = fit.arm_error < 0.5 * TUNING.arm
    if (seen & (off > TUNING.arm_off + TUNING.sure * fit.arm_error)).any():
        numbers = "[{:.2f}, {:.2f}, {:.2f}]".format(*(-fit.arm + 0.0))
        yield f"its place in the container differs: sensor_to_origin is about {numbers}"


def _unseen(fit: MountingFit, errors: Array, axes: Array) -> Iterator[str]:
    hidden = np.flatnonzero(errors > TUNING.unseen)
    if len(hidden) == 1:
        axis = axis_in_words(axes[:, hidden[0]])
        yield (
            f"a turn about the container's {axis}: nothing moved across it; move along another "
            "axis"
        )
    elif len(hidden):
        yield "how it is turned: the motion was too small"
    if fit.turn is None:
        yield (
            "unit and axes of an angular velocity, and the lever arm: the container hardly turned"
        )

"""Compiled equations of motion and their integration, used by all models."""

from __future__ import annotations

import math

from numba.types import Tuple, boolean, float64, void

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    CHANGED_3,
    GIVEN_1,
    GIVEN_2,
    compiled,
    entry_point,
)
from slosh_model.chains import all_drives, all_modulations, all_readings, all_terms
from slosh_model.constants import GRAVITY
from slosh_model.effects.base import SETTLING
from slosh_model.indices import (
    AX,
    AY,
    AZ,
    DAMPING,
    FREQUENCY,
    FREQUENCY_RATIO,
    GAIN,
    GAIN_Y,
    QW,
    QX,
    QY,
    QZ,
    TURN,
    X,
    Y,
)
from slosh_model.layout import records
from slosh_model.outline_wall import azimuth_at_corners, highest_at_corners, place_at_corners
from slosh_model.tank_wall import place_on_wall

UPRIGHT = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The pose of a container that stands upright and does not turn."""

_SETTLING_TURNS = 200
_TWO_PI = 2.0 * math.pi


@compiled
def modal_acceleration(mode, elapsed, q, inputs, parameters):  # type: ignore[no-untyped-def]
    """Computes the acceleration q̈ of one mode (DL22, eqs. (11), (12), (14), (15))."""
    mode = all_modulations(mode, elapsed, parameters)
    omega, zeta = mode[FREQUENCY], mode[DAMPING]
    omega_y = omega * mode[FREQUENCY_RATIO]
    x, y, vx, vy = q
    gx, gy, mxx, mxy, myy = all_terms(mode, elapsed, q, inputs, parameters)
    fx = gx - 2.0 * zeta * omega * vx - omega * omega * x - inputs[AX]
    fy = gy - 2.0 * zeta * omega_y * vy - omega_y * omega_y * y - inputs[AY]
    mxx += 1.0
    myy += 1.0
    inverse = 1.0 / (mxx * myy - mxy * mxy)
    return inverse * (myy * fx - mxy * fy), inverse * (mxx * fy - mxy * fx)


@compiled
def in_axes(inputs, axes):  # type: ignore[no-untyped-def]
    """Rotates the inputs from container axes to modal axes, by the angle `axes` [rad]."""
    if axes == 0.0:
        return inputs
    ax, ay, az, turn = inputs
    c, s = math.cos(axes), math.sin(axes)
    return c * ax + s * ay, c * ay - s * ax, az, turn - axes


@compiled
def along_mode(inputs, x, y):  # type: ignore[no-untyped-def]
    """Returns the inputs' part along the direction (x, y) of a mode; (0, 0) keeps all inputs."""
    if x == 0.0 and y == 0.0:
        return inputs
    share = x * inputs[AX] + y * inputs[AY]
    return x * share, y * share, inputs[AZ], inputs[TURN]


@compiled
def between(u0, u1, share):  # type: ignore[no-untyped-def]
    """Interpolates linearly between two inputs; `share` is in [0, 1]."""
    return (
        u0[0] + share * (u1[0] - u0[0]),
        u0[1] + share * (u1[1] - u0[1]),
        u0[2] + share * (u1[2] - u0[2]),
        u0[3] + share * (u1[3] - u0[3]),
    )


@compiled
def runge_kutta_step(mode, q, u0, u1, step, elapsed, parameters):  # type: ignore[no-untyped-def]
    """Makes one Runge-Kutta step of a mode; u0 and u1 are the inputs at its start and end."""
    x, y, vx, vy = q
    half = 0.5 * step
    middle = between(u0, u1, 0.5)
    ax1, ay1 = modal_acceleration(mode, elapsed, q, u0, parameters)
    vx2, vy2 = vx + half * ax1, vy + half * ay1
    q2 = (x + half * vx, y + half * vy, vx2, vy2)
    ax2, ay2 = modal_acceleration(mode, elapsed + half, q2, middle, parameters)
    vx3, vy3 = vx + half * ax2, vy + half * ay2
    q3 = (x + half * vx2, y + half * vy2, vx3, vy3)
    ax3, ay3 = modal_acceleration(mode, elapsed + half, q3, middle, parameters)
    vx4, vy4 = vx + step * ax3, vy + step * ay3
    q4 = (x + step * vx3, y + step * vy3, vx4, vy4)
    ax4, ay4 = modal_acceleration(mode, elapsed + step, q4, u1, parameters)
    sixth = step / 6.0
    return (
        x + sixth * (vx + 2.0 * vx2 + 2.0 * vx3 + vx4),
        y + sixth * (vy + 2.0 * vy2 + 2.0 * vy3 + vy4),
        vx + sixth * (ax1 + 2.0 * ax2 + 2.0 * ax3 + ax4),
        vy + sixth * (ay1 + 2.0 * ay2 + 2.0 * ay3 + ay4),
    )


@compiled
def constants_of(mode):  # type: ignore[no-untyped-def]
    """Returns the constants of a mode that the effects use."""
    return (
        mode["natural_frequency"], mode["damping_ratio"], mode["curvature"], mode["radius"],
        mode["height_gain"], mode["xi"], mode["fill_height"], mode["frequency_ratio"],
        mode["radius_y"], mode["height_gain_y"],
    )  # fmt: skip


@compiled
def _hold(run, inputs):  # type: ignore[no-untyped-def]
    run["ax"], run["ay"], run["az"], run["turn"] = inputs


@compiled
def _settle(run, modes, pose):  # type: ignore[no-untyped-def]
    """Sets the liquid to rest in the attitude of the container at the first sample.

    That is the origin but for a container that is tilted. The container stands: whatever it does
    in the first sample begins there. By fixed-point iteration: each turn goes to where the linear
    spring alone would hold the rest of the force.
    """
    still = (pose[QX], pose[QY], pose[QZ], pose[QW], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    parameters = run["parameters"]
    inputs = all_drives(
        SETTLING, (0.0, 0.0, 0.0, run["yaw"]), still, run["drive_memory"], parameters
    )
    inputs = in_axes(inputs, run["axes"])
    _hold(run, inputs)
    if inputs[AX] == 0.0 and inputs[AY] == 0.0:
        return
    for n in range(modes.shape[0]):
        mode, constants = modes[n], constants_of(modes[n])
        along = along_mode(inputs, mode["along_x"], mode["along_y"])
        x, y = 0.0, 0.0
        stiffness_x = constants[FREQUENCY] * constants[FREQUENCY]
        stiffness_y = stiffness_x * constants[FREQUENCY_RATIO] * constants[FREQUENCY_RATIO]
        for _ in range(_SETTLING_TURNS):
            q = (x, y, 0.0, 0.0)
            ax, ay = modal_acceleration(constants, run["elapsed"], q, along, parameters)
            x += ax / stiffness_x
            y += ay / stiffness_y
        mode["x"], mode["y"] = x, y


@compiled
def unwrapped(angle, before):  # type: ignore[no-untyped-def]
    """Returns an angle [rad] that is less than half a turn from the previous one."""
    return angle + _TWO_PI * math.floor((before - angle) / _TWO_PI + 0.5)


@compiled
def lightness(lift, az):  # type: ignore[no-untyped-def]
    """Returns g divided by the effective gravity, which counts as at least g/2.

    Args:
        lift: 1 where the vertical acceleration acts, else 0.
        az: vertical acceleration [m/s²].
    """
    return GRAVITY / max(GRAVITY + lift * az, 0.5 * GRAVITY)


@compiled
def advance(run, modes, ax, ay, az, yaw, pose, dt):  # type: ignore[no-untyped-def]
    """Integrates all modes from the previous to the new input, in place.

    Args:
        run: the model, a record of `layout.RUN`; changed.
        modes: (modes,) records of `layout.MODE`; changed.
        ax, ay, az: the new input [m/s²].
        yaw: angle of the container's x axis in the input's axes [rad].
        pose: see `indices`.
        dt: time between the two inputs [s]; 0 only takes the new input. Ignored at the first.

    Returns:
        wall height along the modal x and y axes [m], and the angle of the container's x axis in
        them [rad].
    """
    if run["started"] == 0.0:
        run["started"], run["yaw"] = 1.0, yaw
        _settle(run, modes, pose)
        dt = 0.0
    if yaw != run["yaw"]:
        yaw = unwrapped(yaw, run["yaw"])
        run["yaw"] = yaw
    parameters, elapsed = run["parameters"], run["elapsed"]
    old = (run["ax"], run["ay"], run["az"], run["turn"])
    new = all_drives(max(dt, 0.0), (ax, ay, az, yaw), pose, run["drive_memory"], parameters)
    new = in_axes(new, run["axes"])
    _hold(run, new)
    run["elapsed"] = elapsed + dt
    count = math.ceil(dt / run["max_step"]) if dt > 0.0 else 0
    height_x = height_y = 0.0
    for n in range(modes.shape[0]):
        mode, constants = modes[n], constants_of(modes[n])
        q = (mode["x"], mode["y"], mode["vx"], mode["vy"])
        along_x, along_y = mode["along_x"], mode["along_y"]
        u0 = along_mode(old, along_x, along_y)
        for i in range(count):
            u1 = along_mode(between(old, new, (i + 1) / count), along_x, along_y)
            moment = elapsed + dt * (i / count)
            q = runge_kutta_step(constants, q, u0, u1, dt / count, moment, parameters)
            u0 = u1
        mode["x"], mode["y"], mode["vx"], mode["vy"] = q
        now = all_modulations(constants, run["elapsed"], parameters)
        height_x += now[GAIN] * q[X]
        height_y += now[GAIN_Y] * q[Y]
    light = lightness(run["lift"], new[AZ])
    height_x -= run["static_height"] * light * new[AX]
    height_y -= run["static_height_y"] * light * new[AY]
    return height_x, height_y, new[TURN]


@compiled
def turned(height_x, height_y, angle):  # type: ignore[no-untyped-def]
    """Rotates liquid heights from the axes of the modes to the axes of the container."""
    if angle == 0.0:
        return height_x, height_y
    c, s = math.cos(angle), math.sin(angle)
    return c * height_x + s * height_y, c * height_y - s * height_x


@compiled
def pose_at(poses, i):  # type: ignore[no-untyped-def]
    """Returns a row of poses (N, POSE_COUNT), or an upright pose if there are none."""
    if poses.shape[0] == 0:
        return UPRIGHT
    row = poses[i]
    return (row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9])


@entry_point(Tuple((float64, float64))(CHANGED_1, float64, float64, float64, float64))
def step(store, dt, ax, ay, az):  # type: ignore[no-untyped-def]
    """Advances an upright container by one input; returns the liquid heights at the wall [m]."""
    runs, modes = records(store)
    height_x, height_y, angle = advance(runs[0], modes, ax, ay, az, 0.0, UPRIGHT, dt)
    return turned(height_x, height_y, angle)


@entry_point(void(CHANGED_1, GIVEN_1, GIVEN_2, GIVEN_1, GIVEN_2, CHANGED_3, CHANGED_2))
def advance_many(  # type: ignore[no-untyped-def]
    store, intervals, inputs, yaws, poses, history, heights
):
    """Integrates all modes over many inputs in place; see `advance`.

    Args:
        store: the model, as `layout.records` divides it; changed.
        intervals: (N,) time from the input before [s].
        inputs: (N, 3) acceleration [m/s²].
        yaws: (N,) [rad].
        poses: (N, POSE_COUNT), or (0, POSE_COUNT) for an upright container.
        history: (N, modes, 4) receives the modal state after each input.
        heights: (N, 2) receives the wall heights at the container's +x and +y [m].
    """
    runs, modes = records(store)
    for i in range(intervals.shape[0]):
        ax, ay, az = inputs[i, 0], inputs[i, 1], inputs[i, 2]
        height_x, height_y, angle = advance(
            runs[0], modes, ax, ay, az, yaws[i], pose_at(poses, i), intervals[i]
        )
        heights[i, 0], heights[i, 1] = turned(height_x, height_y, angle)
        for n in range(modes.shape[0]):
            mode = modes[n]
            history[i, n, 0], history[i, n, 1] = mode["x"], mode["y"]
            history[i, n, 2], history[i, n, 3] = mode["vx"], mode["vy"]


@compiled
def corner_height(height_x, height_y):  # type: ignore[no-untyped-def]
    """Returns the maximum height [m] of a plane surface in a container with corners."""
    return abs(height_x) + abs(height_y)


@compiled
def corner_azimuth(height_x, height_y, radius_x, radius_y):  # type: ignore[no-untyped-def]
    """Returns the azimuth [rad] of the maximum height: a corner, or the middle of a side."""
    x = 0.0 if height_x == 0.0 else math.copysign(radius_x, height_x)
    y = 0.0 if height_y == 0.0 else math.copysign(radius_y, height_y)
    return math.atan2(y, x)


@compiled
def highest_on_wall(run, height_x, height_y):  # type: ignore[no-untyped-def]
    """Returns the maximum liquid height [m] on the wall of a running model's container.

    Args:
        run: its record of `layout.RUN`.
        height_x, height_y: wall heights at the container's +x and +y [m].
    """
    if run["corner_count"] != 0.0:
        return highest_at_corners(run["corners"], int(run["corner_count"]), height_x, height_y)
    if run["cornered"] != 0.0:
        return corner_height(height_x, height_y)
    return math.sqrt(height_x * height_x + height_y * height_y)


@compiled
def highest_and_azimuth(run, first, height_x, height_y):  # type: ignore[no-untyped-def]
    """Returns the maximum height at the wall [m] and its azimuth [rad] in a running model.

    Args:
        run, first: the model's records of `layout.RUN` and, of its first mode, `layout.MODE`.
        height_x, height_y: wall heights at the container's +x and +y [m].
    """
    reach_x, reach_y = first["radius"], first["radius_y"]
    azimuth = math.atan2(height_y, height_x)
    if run["corner_count"] != 0.0:
        corners, count = run["corners"], int(run["corner_count"])
        azimuth = azimuth_at_corners(corners, count, height_x, height_y, reach_x, reach_y)
    elif run["cornered"] != 0.0:
        azimuth = corner_azimuth(height_x, height_y, reach_x, reach_y)
    return highest_on_wall(run, height_x, height_y), azimuth


@compiled
def wall_place(azimuth, cornered, reaches, corners):  # type: ignore[no-untyped-def]
    """Returns the wall position in a direction from the axis, relative to the half widths.

    Args:
        azimuth: the direction [rad].
        cornered: whether the wall is a rectangle, where it has no corners of its own.
        reaches: (2,) R along x and along y [m].
        corners: (K, 2) of the wall over any outline; none: a rectangle or round.
    """
    if corners.shape[0] > 0:
        return place_at_corners(azimuth, corners, corners.shape[0], reaches[0], reaches[1])
    if cornered:
        return place_on_wall(azimuth, reaches[0], reaches[1])
    return math.cos(azimuth), math.sin(azimuth)


@entry_point(
    void(
        GIVEN_1, float64, GIVEN_2, float64, GIVEN_1, float64, boolean, GIVEN_2, GIVEN_1,
        CHANGED_1, CHANGED_1,
    )
)  # fmt: skip
def read_many(  # type: ignore[no-untyped-def]
    t, started, heights, azimuth, reaches, fill, cornered, corners, parameters, memory, read
):
    """Computes the heights [m] that a sensor measures at one azimuth, or as maximum over the wall.

    Args:
        t: (N,) [s].
        started: time since rest at t[0] [s].
        heights: (N, 2) at the container's +x and +y [m].
        azimuth: [rad]; NaN: the maximum over the wall.
        reaches: (2,) R along x and along y [m].
        fill: h [m].
        cornered: whether the wall is a rectangle, not a circle.
        corners: (K, 2) of the wall over any outline; none: as `cornered` says.
        parameters: as in `advance`.
        memory: (READING_MEMORY_COUNT,) zeros at the start; changed.
        read: (N,) receives the heights [m].
    """
    radius, radius_y = reaches[0], reaches[1]
    c, s = wall_place(azimuth, cornered, reaches, corners)
    count = corners.shape[0]
    for i in range(t.shape[0]):
        height_x, height_y = heights[i, 0], heights[i, 1]
        if count > 0:
            eta = highest_at_corners(corners, count, height_x, height_y)
        elif cornered:
            eta = corner_height(height_x, height_y)
        else:
            eta = math.hypot(height_x, height_y)
        if azimuth == azimuth:
            eta = c * height_x + s * height_y
        dt = t[i] - t[i - 1] if i > 0 else 0.0
        wall = (
            height_x, height_y, azimuth, radius, started + t[i] - t[0], fill, radius_y,
            1.0 if cornered else 0.0,
        )  # fmt: skip
        read[i] = all_readings(dt, eta, wall, memory, parameters)

"""Compiled adjoint of the integration, for gradients by the acceleration samples.

Reverse mode through the very steps of `kernel.advance`: each Runge-Kutta stage's acceleration is
the kernel's own, its partial derivatives are those of the equations with `vertical_acceleration`
and `surface_nonlinearity` (DL22, eqs. (11), (12), (14), (15)).
"""

from __future__ import annotations

import math

from numba.types import float64, void

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    GIVEN_1,
    GIVEN_2,
    compiled,
    entry_point,
)
from slosh_model.chains import all_modulations
from slosh_model.constants import GRAVITY
from slosh_model.indices import (
    AX,
    AY,
    AZ,
    CURVATURE,
    DAMPING,
    FREQUENCY,
    FREQUENCY_RATIO,
    GAIN,
    GAIN_Y,
    RADIUS,
    VX,
    VY,
    X,
    Y,
)
from slosh_model.kernel import (
    between,
    constants_of,
    lightness,
    modal_acceleration,
    runge_kutta_step,
)
from slosh_model.layout import records


@compiled
def _pulled_back(mode, moment, q, u, parameters, lift, alpha, k):  # type: ignore[no-untyped-def]
    """Returns the adjoint of one Runge-Kutta stage: Jᵀ k by the state and the acceleration.

    Args:
        mode: constants.
        moment: time since rest [s].
        q, u: state and input of the stage.
        parameters: of the effects.
        lift: 1 where the vertical acceleration acts.
        alpha: of the cubic spring; negative: the mass slides on a plane.
        k: (4,) cotangent of q̇.

    Returns:
        cotangents of x, y, vx, vy and of the acceleration's x, y, z.
    """
    ax, ay = modal_acceleration(mode, moment, q, u, parameters)
    omega, zeta, radius = mode[FREQUENCY], mode[DAMPING], mode[RADIUS]
    omega_y = omega * mode[FREQUENCY_RATIO]
    stiff_x, stiff_y = omega * omega, omega_y * omega_y
    raised = 1.0 + lift * u[AZ] / GRAVITY
    c2 = mode[CURVATURE] * mode[CURVATURE] if alpha >= 0.0 else 0.0
    spring = stiff_x * alpha if alpha >= 0.0 else 0.0
    xr, yr = q[X] / radius, q[Y] / radius
    vx, vy = q[VX], q[VY]
    mxx, mxy, myy = 1.0 + c2 * xr * xr, c2 * xr * yr, 1.0 + c2 * yr * yr
    inverse = 1.0 / (mxx * myy - mxy * mxy)
    # q̈ = M⁻¹ f, so that kᵀ dq̈ = (M⁻¹ k)ᵀ (df − dM q̈), M symmetric.
    fx = inverse * (myy * k[VX] - mxy * k[VY])
    fy = inverse * (mxx * k[VY] - mxy * k[VX])
    drag = 2.0 * zeta * omega * c2
    radial = drag * (xr * vx + yr * vy) + c2 * (vx * vx + vy * vy) / radius
    radial += spring * (xr * xr + yr * yr) * radius
    # Of radial, which f holds times −(xr, yr).
    along = fx * xr + fy * yr
    radial_x = drag * vx / radius + 2.0 * spring * xr
    radial_y = drag * vy / radius + 2.0 * spring * yr
    radial_vx = drag * xr + 2.0 * c2 * vx / radius
    radial_vy = drag * yr + 2.0 * c2 * vy / radius
    # Of M: Mxx by x is 2 c² xr/R, Mxy by x is c² yr/R.
    m = c2 / radius
    mass_x = m * (2.0 * xr * ax * fx + yr * (ay * fx + ax * fy))
    mass_y = m * (2.0 * yr * ay * fy + xr * (ay * fx + ax * fy))
    return (
        -along * radial_x - fx * (radial / radius + stiff_x * raised) - mass_x,
        -along * radial_y - fy * (radial / radius + stiff_y * raised) - mass_y,
        k[X] - along * radial_vx - 2.0 * zeta * omega * fx,
        k[Y] - along * radial_vy - 2.0 * zeta * omega_y * fy,
        -fx,
        -fy,
        -lift / GRAVITY * (stiff_x * q[X] * fx + stiff_y * q[Y] * fy),
    )


@compiled
def _moved(q, k, step):  # type: ignore[no-untyped-def]
    return q[0] + step * k[0], q[1] + step * k[1], q[2] + step * k[2], q[3] + step * k[3]


@compiled
def _step_back(mode, q, u0, u1, step, moment, parameters, lift, alpha, after):  # type: ignore[no-untyped-def]
    """Computes the adjoint of one Runge-Kutta step.

    Args:
        after: (4,) cotangent of the state after the step; the others as there.

    Returns:
        cotangents of the state before it (4,), and of the accelerations at its ends, (3,) each.
    """
    half, middle = 0.5 * step, between(u0, u1, 0.5)
    ax1, ay1 = modal_acceleration(mode, moment, q, u0, parameters)
    q2 = _moved(q, (q[VX], q[VY], ax1, ay1), half)
    ax2, ay2 = modal_acceleration(mode, moment + half, q2, middle, parameters)
    q3 = _moved(q, (q2[VX], q2[VY], ax2, ay2), half)
    ax3, ay3 = modal_acceleration(mode, moment + half, q3, middle, parameters)
    q4 = _moved(q, (q3[VX], q3[VY], ax3, ay3), step)
    zero = (0.0, 0.0, 0.0, 0.0)
    k4 = _moved(zero, after, step / 6.0)
    g4 = _pulled_back(mode, moment + step, q4, u1, parameters, lift, alpha, k4)
    k3 = _moved(_moved(zero, after, step / 3.0), g4, step)
    g3 = _pulled_back(mode, moment + half, q3, middle, parameters, lift, alpha, k3)
    k2 = _moved(_moved(zero, after, step / 3.0), g3, half)
    g2 = _pulled_back(mode, moment + half, q2, middle, parameters, lift, alpha, k2)
    k1 = _moved(_moved(zero, after, step / 6.0), g2, half)
    g1 = _pulled_back(mode, moment, q, u0, parameters, lift, alpha, k1)
    return (
        after[0] + g1[0] + g2[0] + g3[0] + g4[0],
        after[1] + g1[1] + g2[1] + g3[1] + g4[1],
        after[2] + g1[2] + g2[2] + g3[2] + g4[2],
        after[3] + g1[3] + g2[3] + g3[3] + g4[3],
        g1[4] + 0.5 * (g2[4] + g3[4]),
        g1[5] + 0.5 * (g2[5] + g3[5]),
        g1[6] + 0.5 * (g2[6] + g3[6]),
        g4[4] + 0.5 * (g2[4] + g3[4]),
        g4[5] + 0.5 * (g2[5] + g3[5]),
        g4[6] + 0.5 * (g2[6] + g3[6]),
    )


@compiled
def _pull_back_static(run, inputs, weights, gradient):  # type: ignore[no-untyped-def]
    """Adds the gradient of the quasi-static part of the heights."""
    static_x, static_y, lift = run["static_height"], run["static_height_y"], run["lift"]
    for i in range(inputs.shape[0]):
        light = lightness(lift, inputs[i, AZ])
        fx, fy = static_x * weights[i, 0] * light, static_y * weights[i, 1] * light
        gradient[i, AX] -= fx
        gradient[i, AY] -= fy
        if light < 2.0:
            along = fx * inputs[i, AX] + fy * inputs[i, AY]
            gradient[i, AZ] += lift * light / GRAVITY * along


@compiled
def _input_at(inputs, i):  # type: ignore[no-untyped-def]
    return inputs[i, 0], inputs[i, 1], inputs[i, 2], 0.0


@entry_point(void(CHANGED_1, GIVEN_1, GIVEN_2, GIVEN_2, float64, float64, CHANGED_2, CHANGED_2))
def pull_back(store, intervals, inputs, weights, lift, alpha, states, gradient):  # type: ignore[no-untyped-def]
    """Adds the gradient of Σ weights · heights by the inputs, for an upright container.

    Args:
        store: the model before its first sample, as `layout.records` divides it.
        intervals: (N,) time from the input before [s]; the first is ignored.
        inputs: (N, 3) acceleration [m/s²].
        weights: (N, 2) of the heights at +x and +y [1].
        lift: 1 where the vertical acceleration acts, else 0.
        alpha: of the cubic spring; negative: the mass slides on a plane.
        states: (S, 4) room for the state before each of all sub-steps.
        gradient: (N, 3) is added to [m per m/s²].
    """
    runs, modes = records(store)
    parameters, max_step = runs[0]["parameters"], runs[0]["max_step"]
    _pull_back_static(runs[0], inputs, weights, gradient)
    for n in range(modes.shape[0]):
        mode = all_modulations(constants_of(modes[n]), 0.0, parameters)
        q, place, elapsed = (0.0, 0.0, 0.0, 0.0), 0, 0.0
        for i in range(1, inputs.shape[0]):
            count, old, new = (
                math.ceil(intervals[i] / max_step),
                _input_at(inputs, i - 1),
                _input_at(inputs, i),
            )
            u0, step = old, intervals[i] / count
            for j in range(count):
                states[place, 0], states[place, 1], states[place, 2], states[place, 3] = q
                place += 1
                u1 = between(old, new, (j + 1) / count)
                q = runge_kutta_step(mode, q, u0, u1, step, elapsed + step * j, parameters)
                u0 = u1
            elapsed += intervals[i]
        back = (0.0, 0.0, 0.0, 0.0)
        for i in range(inputs.shape[0] - 1, 0, -1):
            back = (
                back[0] + mode[GAIN] * weights[i, 0], back[1] + mode[GAIN_Y] * weights[i, 1],
                back[2], back[3],
            )  # fmt: skip
            elapsed -= intervals[i]
            count, old, new = (
                math.ceil(intervals[i] / max_step),
                _input_at(inputs, i - 1),
                _input_at(inputs, i),
            )
            step = intervals[i] / count
            for j in range(count - 1, -1, -1):
                place -= 1
                q = (states[place, 0], states[place, 1], states[place, 2], states[place, 3])
                u0, u1 = between(old, new, j / count), between(old, new, (j + 1) / count)
                found = _step_back(
                    mode, q, u0, u1, step, elapsed + step * j, parameters, lift, alpha, back
                )
                back = (found[0], found[1], found[2], found[3])
                share, rest = j / count, (j + 1) / count
                for axis in range(3):
                    first, last = found[4 + axis], found[7 + axis]
                    gradient[i - 1, axis] += (1.0 - share) * first + (1.0 - rest) * last
                    gradient[i, axis] += share * first + rest * last

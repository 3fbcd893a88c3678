"""The compiled equations of motion and their integration.

One kernel serves every model: the terms of all effects are chained at import, and a switch in the
flat parameter array says which of them are on. Whatever a term reads comes in tuples, which cost
nothing in compiled code and can grow without a change to the terms that are there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from slosh_model.compile_cache import use_compile_cache
from slosh_model.effects.base import compiled
from slosh_model.effects.registry import EFFECTS, TERM_SLOTS

use_compile_cache()


@compiled
def _no_term(mode, elapsed, q, inputs, parameters):  # type: ignore[no-untyped-def]
    return 0.0, 0.0, 0.0, 0.0, 0.0


@compiled
def _no_parameters(parameters):  # type: ignore[no-untyped-def]
    return ()


def _reader(first: int, count: int) -> Any:
    """A compiled function that takes `count` parameters from the flat array, as a tuple."""
    if count == 0:
        return _no_parameters
    others = _reader(first + 1, count - 1)

    @compiled
    def read(parameters):  # type: ignore[no-untyped-def]
        return (parameters[first], *others(parameters))

    return read


def _chain(before: Any, term: Any, slot: int, count: int) -> Any:
    """A compiled function that adds one effect's term to those before it."""
    read = _reader(slot + 1, count)

    @compiled
    def chained(mode, elapsed, q, inputs, parameters):  # type: ignore[no-untyped-def]
        fx, fy, mxx, mxy, myy = before(mode, elapsed, q, inputs, parameters)
        if parameters[slot] == 0.0:
            return fx, fy, mxx, mxy, myy
        gx, gy, nxx, nxy, nyy = term(mode, elapsed, q, inputs, read(parameters))
        return fx + gx, fy + gy, mxx + nxx, mxy + nxy, myy + nyy

    return chained


def _all_terms() -> Any:
    total: Any = _no_term
    for name, slot in TERM_SLOTS.items():
        effect = EFFECTS[name]
        total = _chain(total, effect.term, slot, len(effect.parameters))
    return total


_terms = _all_terms()


@compiled
def _acceleration(mode, elapsed, q, inputs, parameters):  # type: ignore[no-untyped-def]
    """q̈ of one mode from (I + m) q̈ = f (DL22, eqs. (11), (12), (14), (15)), 2×2 in closed form."""
    omega, zeta = mode[0], mode[1]
    x, y, vx, vy = q
    gx, gy, mxx, mxy, myy = _terms(mode, elapsed, q, inputs, parameters)
    fx = gx - 2.0 * zeta * omega * vx - omega * omega * x - inputs[0]
    fy = gy - 2.0 * zeta * omega * vy - omega * omega * y - inputs[1]
    mxx += 1.0
    myy += 1.0
    inverse = 1.0 / (mxx * myy - mxy * mxy)
    return inverse * (myy * fx - mxy * fy), inverse * (mxx * fy - mxy * fx)


@compiled
def _between(u0, u1, share):  # type: ignore[no-untyped-def]
    """The input at a share of the way from u0 to u1."""
    return (
        u0[0] + share * (u1[0] - u0[0]),
        u0[1] + share * (u1[1] - u0[1]),
        u0[2] + share * (u1[2] - u0[2]),
    )


@compiled
def _runge_kutta_step(mode, q, u0, u1, step, elapsed, parameters):  # type: ignore[no-untyped-def]
    """One classical Runge-Kutta step of one mode; u0, u1: the input at its two ends."""
    x, y, vx, vy = q
    half = 0.5 * step
    middle = _between(u0, u1, 0.5)
    ax1, ay1 = _acceleration(mode, elapsed, q, u0, parameters)
    vx2, vy2 = vx + half * ax1, vy + half * ay1
    q2 = (x + half * vx, y + half * vy, vx2, vy2)
    ax2, ay2 = _acceleration(mode, elapsed + half, q2, middle, parameters)
    vx3, vy3 = vx + half * ax2, vy + half * ay2
    q3 = (x + half * vx2, y + half * vy2, vx3, vy3)
    ax3, ay3 = _acceleration(mode, elapsed + half, q3, middle, parameters)
    vx4, vy4 = vx + step * ax3, vy + step * ay3
    q4 = (x + step * vx3, y + step * vy3, vx4, vy4)
    ax4, ay4 = _acceleration(mode, elapsed + step, q4, u1, parameters)
    sixth = step / 6.0
    return (
        x + sixth * (vx + 2.0 * vx2 + 2.0 * vx3 + vx4),
        y + sixth * (vy + 2.0 * vy2 + 2.0 * vy3 + vy4),
        vx + sixth * (ax1 + 2.0 * ax2 + 2.0 * ax3 + ax4),
        vy + sixth * (ay1 + 2.0 * ay2 + 2.0 * ay3 + ay4),
    )


@njit(cache=True, error_model="numpy")
def advance(modal, modes, parameters, held, ax, ay, az, dt, max_step):  # type: ignore[no-untyped-def]
    """Integrates all modes from the held input to the new one, in place.

    Args:
        modal: (modes, 4) x, y, vx, vy [m, m/s]; changed.
        modes: (modes, 5) ω [rad/s], ζ, C, R [m], wall height per displacement [1].
        parameters: (PARAMETER_COUNT,) switches and parameters of the effects.
        held: (4,) the last input's ax, ay, az [m/s²] and the time since rest [s]; changed.
        ax, ay, az: the new input [m/s²].
        dt: time between the two inputs [s]; 0 only takes the new input.
        max_step: longest sub-step [s].

    Returns:
        wall height at the container's +x and +y side [m].
    """
    old, new, elapsed = (held[0], held[1], held[2]), (ax, ay, az), held[3]
    held[0], held[1], held[2], held[3] = ax, ay, az, elapsed + dt
    count = math.ceil(dt / max_step) if dt > 0.0 else 0
    height_x = height_y = 0.0
    for n in range(modal.shape[0]):
        mode = (modes[n, 0], modes[n, 1], modes[n, 2], modes[n, 3])
        q = (modal[n, 0], modal[n, 1], modal[n, 2], modal[n, 3])
        for i in range(count):
            u0, u1 = _between(old, new, i / count), _between(old, new, (i + 1) / count)
            moment = elapsed + dt * (i / count)
            q = _runge_kutta_step(mode, q, u0, u1, dt / count, moment, parameters)
        modal[n, 0], modal[n, 1], modal[n, 2], modal[n, 3] = q
        height_x += modes[n, 4] * q[0]
        height_y += modes[n, 4] * q[1]
    return height_x, height_y


@njit(cache=True, error_model="numpy")
def advance_many(  # type: ignore[no-untyped-def]
    modal, modes, parameters, held, intervals, inputs, max_step, history, heights
):
    """`advance` over many inputs.

    Args:
        intervals: (N,) time from the input before [s].
        inputs: (N, 3) acceleration [m/s²].
        history: (N, modes, 4) receives the modal state after each input.
        heights: (N, 2) receives the wall heights at +x and +y [m].
    """
    for i in range(intervals.shape[0]):
        ax, ay, az = inputs[i, 0], inputs[i, 1], inputs[i, 2]
        heights[i, 0], heights[i, 1] = advance(
            modal, modes, parameters, held, ax, ay, az, intervals[i], max_step
        )
        for n in range(modal.shape[0]):
            for k in range(4):
                history[i, n, k] = modal[n, k]


def empty_held_input() -> np.ndarray[Any, np.dtype[np.float64]]:
    """A held input before the first sample."""
    return np.zeros(4)

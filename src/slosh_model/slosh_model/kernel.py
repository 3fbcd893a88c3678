"""The compiled equations of motion and their integration.

One kernel serves every model: the terms of all effects are chained at import, and a switch in the
flat parameter array says which of them are on.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from slosh_model.compile_cache import use_compile_cache
from slosh_model.effects.registry import EFFECTS, TERM_SLOTS

use_compile_cache()


@njit
def _no_term(mode, x, y, vx, vy, ax, ay, az, elapsed, parameters):  # type: ignore[no-untyped-def]
    return 0.0, 0.0, 0.0, 0.0, 0.0


def _chain(before: Any, term: Any, slot: int, count: int) -> Any:
    """A compiled function that adds one effect's term to those before it."""
    first, last = slot + 1, slot + 1 + count

    @njit
    def chained(mode, x, y, vx, vy, ax, ay, az, elapsed, parameters):  # type: ignore[no-untyped-def]
        fx, fy, mxx, mxy, myy = before(mode, x, y, vx, vy, ax, ay, az, elapsed, parameters)
        if parameters[slot] == 0.0:
            return fx, fy, mxx, mxy, myy
        own = parameters[first:last]
        gx, gy, nxx, nxy, nyy = term(mode, x, y, vx, vy, ax, ay, az, elapsed, own)
        return fx + gx, fy + gy, mxx + nxx, mxy + nxy, myy + nyy

    return chained


def _all_terms() -> Any:
    total: Any = _no_term
    for name, slot in TERM_SLOTS.items():
        effect = EFFECTS[name]
        total = _chain(total, effect.term, slot, len(effect.parameters))
    return total


_terms = _all_terms()


@njit
def _acceleration(mode, x, y, vx, vy, ax, ay, az, elapsed, parameters):  # type: ignore[no-untyped-def]
    """q̈ of one mode from (I + m) q̈ = f (DL22, eqs. (11), (12), (14), (15)), 2×2 in closed form."""
    omega, zeta = mode[0], mode[1]
    gx, gy, mxx, mxy, myy = _terms(mode, x, y, vx, vy, ax, ay, az, elapsed, parameters)
    fx = gx - 2.0 * zeta * omega * vx - omega * omega * x - ax
    fy = gy - 2.0 * zeta * omega * vy - omega * omega * y - ay
    mxx += 1.0
    myy += 1.0
    determinant = mxx * myy - mxy * mxy
    return (myy * fx - mxy * fy) / determinant, (mxx * fy - mxy * fx) / determinant


@njit
def _runge_kutta_step(mode, state, u0, u1, step, elapsed, parameters):  # type: ignore[no-untyped-def]
    """One classical Runge-Kutta step of one mode; u0, u1: acceleration at its two ends."""
    x, y, vx, vy = state
    half = 0.5 * step
    mx, my, mz = 0.5 * (u0[0] + u1[0]), 0.5 * (u0[1] + u1[1]), 0.5 * (u0[2] + u1[2])
    middle, end = elapsed + half, elapsed + step
    ax1, ay1 = _acceleration(mode, x, y, vx, vy, u0[0], u0[1], u0[2], elapsed, parameters)
    vx2, vy2 = vx + half * ax1, vy + half * ay1
    ax2, ay2 = _acceleration(
        mode, x + half * vx, y + half * vy, vx2, vy2, mx, my, mz, middle, parameters
    )
    vx3, vy3 = vx + half * ax2, vy + half * ay2
    ax3, ay3 = _acceleration(
        mode, x + half * vx2, y + half * vy2, vx3, vy3, mx, my, mz, middle, parameters
    )
    vx4, vy4 = vx + step * ax3, vy + step * ay3
    ax4, ay4 = _acceleration(
        mode, x + step * vx3, y + step * vy3, vx4, vy4, u1[0], u1[1], u1[2], end, parameters
    )
    sixth = step / 6.0
    return (
        x + sixth * (vx + 2.0 * vx2 + 2.0 * vx3 + vx4),
        y + sixth * (vy + 2.0 * vy2 + 2.0 * vy3 + vy4),
        vx + sixth * (ax1 + 2.0 * ax2 + 2.0 * ax3 + ax4),
        vy + sixth * (ay1 + 2.0 * ay2 + 2.0 * ay3 + ay4),
    )


@njit(cache=True)
def advance(modal, modes, gains, parameters, held, ax, ay, az, dt, max_step):  # type: ignore[no-untyped-def]
    """Integrates all modes from the held input to the new one, in place.

    Args:
        modal: (modes, 4) x, y, vx, vy [m, m/s]; changed.
        modes: (modes, 4) ω [rad/s], ζ, C, R [m].
        gains: (modes,) wall height per displacement [1].
        parameters: (PARAMETER_COUNT,) switches and parameters of the effects.
        held: (4,) the last input's ax, ay, az [m/s²] and the time since rest [s]; changed.
        ax, ay, az: the new input [m/s²].
        dt: time between the two inputs [s]; 0 only takes the new input.
        max_step: longest sub-step [s].

    Returns:
        wall height at the container's +x and +y side [m].
    """
    if dt > 0.0:
        count = math.ceil(dt / max_step)
        step = dt / count
        for i in range(count):
            a, b = i / count, (i + 1) / count
            u0 = (
                held[0] + a * (ax - held[0]),
                held[1] + a * (ay - held[1]),
                held[2] + a * (az - held[2]),
            )
            u1 = (
                held[0] + b * (ax - held[0]),
                held[1] + b * (ay - held[1]),
                held[2] + b * (az - held[2]),
            )
            elapsed = held[3] + a * dt
            for n in range(modal.shape[0]):
                state = (modal[n, 0], modal[n, 1], modal[n, 2], modal[n, 3])
                x, y, vx, vy = _runge_kutta_step(
                    modes[n], state, u0, u1, step, elapsed, parameters
                )
                modal[n, 0], modal[n, 1], modal[n, 2], modal[n, 3] = x, y, vx, vy
    held[0], held[1], held[2] = ax, ay, az
    held[3] += dt
    height_x = height_y = 0.0
    for n in range(modal.shape[0]):
        height_x += gains[n] * modal[n, 0]
        height_y += gains[n] * modal[n, 1]
    return height_x, height_y


@njit(cache=True)
def advance_many(  # type: ignore[no-untyped-def]
    modal, modes, gains, parameters, held, intervals, inputs, max_step, history, heights
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
            modal, modes, gains, parameters, held, ax, ay, az, intervals[i], max_step
        )
        history[i] = modal


def empty_held_input() -> np.ndarray[Any, np.dtype[np.float64]]:
    """A held input before the first sample."""
    return np.zeros(4)

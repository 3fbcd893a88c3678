"""Second-order waves at the wall of a rectangular container.

Places on the wall are (c, s), x and y in units of half the width and half the depth. The first
modes are f = sin(πc/2) and g = sin(πs/2); their squares hold the modes (2, 0) and (0, 2), and
their product is the mode (1, 1).
"""

from __future__ import annotations

import math

from slosh_base.compiled.compilation import compiled
from slosh_model.bound_waves import advance_bound, swing

_PLACES = 32  # so many steps along a side, where the highest place is looked for


@compiled
def place_on_wall(azimuth, reach_x, reach_y):  # type: ignore[no-untyped-def]
    """Returns the wall position in a direction from the axis, relative to the half widths.

    Args:
        azimuth: the direction [rad].
        reach_x, reach_y: half the width and half the depth [m].
    """
    c, s = math.cos(azimuth) / reach_x, math.sin(azimuth) / reach_y
    distance = 1.0 / max(abs(c), abs(s))
    return c * distance, s * distance


@compiled
def _advance_double(memory, at, p, u, wave, fill, damping, dt):  # type: ignore[no-untyped-def]
    """Advances the second-order mode with twice the wave number of the first one."""
    k, first = wave
    rate = 2.0 * k * math.tanh(2.0 * k * fill)
    rise = 0.5 * (2.0 * k * k - rate * first) * p * u
    push = 0.25 * (k * k + first * first) * u * u
    advance_bound(memory, at, rise, push, swing(rate, damping, dt))


@compiled
def _wave(reach, fill):  # type: ignore[no-untyped-def]
    """Returns wave number k and K = k tanh(kh) [1/m] of the first mode along an axis."""
    k = 0.5 * math.pi / reach
    return k, k * math.tanh(k * fill)


@compiled
def advance_tank(memory, at, place, moved, reaches, fill, damping, dt):  # type: ignore[no-untyped-def]
    """Advances the second-order modes (2, 0), (0, 2) and (1, 1) over a time step.

    Args:
        memory: elevation and potential of each, one behind the other from `at` on; changed.
        at: where.
        place: the first modes' heights at the walls in the interval's middle, along x and y [m].
        moved: by how much these changed over the interval [m].
        reaches: half the width and half the depth [m].
        fill: h [m].
        damping: ζ of the bound modes.
        dt: the interval [s].
    """
    wave_x, wave_y = _wave(reaches[0], fill), _wave(reaches[1], fill)
    kx, first_x = wave_x
    ky, first_y = wave_y
    px, py = place
    # The potentials at the still level, by how fast the heights change.
    ux, uy = moved[0] / (first_x * dt), moved[1] / (first_y * dt)
    _advance_double(memory, at, px, ux, wave_x, fill, damping, dt)
    _advance_double(memory, at + 2, py, uy, wave_y, fill, damping, dt)
    k = math.sqrt(kx * kx + ky * ky)
    rate = k * math.tanh(k * fill)
    rise = px * uy * (ky * ky - rate * first_y) + py * ux * (kx * kx - rate * first_x)
    push = first_x * first_y * ux * uy
    advance_bound(memory, at + 4, rise, push, swing(rate, damping, dt))


@compiled
def bound_height(double_x, double_y, product, c, s):  # type: ignore[no-untyped-def]
    """Returns the height of the second-order modes at a wall position [m]."""
    f, g = math.sin(0.5 * math.pi * c), math.sin(0.5 * math.pi * s)
    return double_x * (2.0 * f * f - 1.0) + double_y * (2.0 * g * g - 1.0) + product * f * g


@compiled
def highest_on_wall(x, y, double_x, double_y, product):  # type: ignore[no-untyped-def]
    """Returns the maximum height at the wall [m] of a plane wave with the second-order modes.

    Looked for at `_PLACES` steps along each side: at most 0.5 % of a bound mode is lost.
    """
    best = -math.inf
    for i in range(_PLACES + 1):
        c = 2.0 * i / _PLACES - 1.0
        f = math.sin(0.5 * math.pi * c)
        square = 2.0 * f * f - 1.0
        across, along = y + product * f, x + product * f
        # Along the sides at ±y, then along those at ±x.
        best = max(best, c * x + abs(across) + double_x * square + double_y)
        best = max(best, c * y + abs(along) + double_y * square + double_x)
    return best

"""Effect: the first mode drives second-order waves, so that crests are higher than troughs."""

from __future__ import annotations

import math

from slosh_model.bound_waves import advance_bound, swing
from slosh_model.containers import RECTANGULAR, ROUND
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import (
    WALL_AZIMUTH,
    WALL_CORNERED,
    WALL_FILL,
    WALL_RADIUS,
    WALL_RADIUS_Y,
    WALL_X,
    WALL_Y,
)
from slosh_model.tank_wall import advance_tank, bound_height, highest_on_wall, place_on_wall

FIRST = 1.8411837813406595
"""Root of J₁′: the first mode's wave number, in units of 1/R."""
AXISYMMETRIC, DOUBLE = 3.8317059702075125, 3.0542369282271404
"""The same of the modes (0, 1) and (2, 1): roots of J₀′ and J₂′."""
OVERLAP_AXISYMMETRIC, OVERLAP_DOUBLE = 0.14451578634458237, 0.5040802760553215
"""½ ∫ r s f² dr / ∫ r s² dr over 0 … 1: how much of f², the first mode's radial shape squared,
lies in the radial shape s of either; shapes are 1 at the wall."""

_X, _Y, _BEGUN, _MODES = range(4)  # of the memory: the wall's heights before; then three modes
_ANGLES = 16  # around the wall, where the highest place is looked for
_NEAR = math.pi / _ANGLES  # so far from the best place the highest may be
_REFINED = 4


@compiled
def _advance(memory, at, along, square, k, overlap, radius, fill, damping, dt):  # type: ignore[no-untyped-def]
    """Advances one second-order mode of a cylinder over a time step."""
    first = FIRST * math.tanh(FIRST * fill / radius)
    rate = k * math.tanh(k * fill / radius)
    rise = overlap * (0.5 * k * k - rate * first) / (radius * radius)
    push = 0.5 * overlap * (0.5 * k * k - FIRST * FIRST + first * first) / (radius * radius)
    advance_bound(memory, at, rise * along, push * square, swing(rate / radius, damping, dt))


@compiled
def _wall(x, y, mean, double_c, double_s, azimuth):  # type: ignore[no-untyped-def]
    """Returns height, slope and curvature of the surface at an azimuth on the wall."""
    c, s = math.cos(azimuth), math.sin(azimuth)
    c2, s2 = c * c - s * s, 2.0 * c * s
    first, second = x * c + y * s, double_c * c2 + double_s * s2
    slope = y * c - x * s + 2.0 * (double_s * c2 - double_c * s2)
    return mean + first + second, slope, -first - 4.0 * second


@compiled
def _to_the_crest(slope, curvature):  # type: ignore[no-untyped-def]
    """Returns a Newton step towards a maximum [rad], limited in size."""
    return max(-_NEAR, min(slope / max(-curvature, 1e-12), _NEAR))


@compiled
def _highest(x, y, mean, double_c, double_s):  # type: ignore[no-untyped-def]
    """Returns the maximum height at the wall [m], by Newton's method from the best grid point."""
    start = math.atan2(y, x)
    most, place = -math.inf, start
    for k in range(_ANGLES):
        azimuth = start + 2.0 * math.pi * k / _ANGLES
        height, slope, curvature = _wall(x, y, mean, double_c, double_s, azimuth)
        step = _to_the_crest(slope, curvature)
        promise = height + step * (slope + 0.5 * step * curvature)
        if promise > most:
            most, place = promise, azimuth
    best = -math.inf
    for _ in range(_REFINED):
        height, slope, curvature = _wall(x, y, mean, double_c, double_s, place)
        best = max(best, height)
        place += _to_the_crest(slope, curvature)
    return best


@compiled
def _advance_cylinder(memory, place, moved, wall, damping, dt):  # type: ignore[no-untyped-def]
    """Advances the axisymmetric mode and both parts of the cos 2φ mode over a time step."""
    radius, fill = wall[WALL_RADIUS], wall[WALL_FILL]
    px, py = place
    # The first mode's potential at the still level, by how fast the wall's height changes.
    share = radius / (FIRST * math.tanh(FIRST * fill / radius) * dt)
    ux, uy = share * moved[0], share * moved[1]
    along, square = px * ux + py * uy, ux * ux + uy * uy
    k, overlap = AXISYMMETRIC, OVERLAP_AXISYMMETRIC
    _advance(memory, _MODES, along, square, k, overlap, radius, fill, damping, dt)
    along, square = px * ux - py * uy, ux * ux - uy * uy
    k, overlap = DOUBLE, OVERLAP_DOUBLE
    _advance(memory, _MODES + 2, along, square, k, overlap, radius, fill, damping, dt)
    along, square = px * uy + py * ux, 2.0 * ux * uy
    _advance(memory, _MODES + 4, along, square, k, overlap, radius, fill, damping, dt)


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    x, y, cornered = wall[WALL_X], wall[WALL_Y], wall[WALL_CORNERED] != 0.0
    if dt > 0.0 and memory[_BEGUN] != 0.0:
        place = (0.5 * (x + memory[_X]), 0.5 * (y + memory[_Y]))
        moved = (x - memory[_X], y - memory[_Y])
        if cornered:
            reaches = (wall[WALL_RADIUS], wall[WALL_RADIUS_Y])
            advance_tank(memory, _MODES, place, moved, reaches, wall[WALL_FILL], p[1], dt)
        else:
            _advance_cylinder(memory, place, moved, wall, p[1], dt)
    memory[_X], memory[_Y], memory[_BEGUN] = x, y, 1.0
    b0, b1, b2 = p[0] * memory[_MODES], p[0] * memory[_MODES + 2], p[0] * memory[_MODES + 4]
    azimuth = wall[WALL_AZIMUTH]
    if cornered and azimuth == azimuth:
        c, s = place_on_wall(azimuth, wall[WALL_RADIUS], wall[WALL_RADIUS_Y])
        return eta + bound_height(b0, b1, b2, c, s)
    if cornered:
        return eta + highest_on_wall(x, y, b0, b1, b2) - abs(x) - abs(y)
    if azimuth == azimuth:
        height, _, _ = _wall(0.0, 0.0, b0, b1, b2, azimuth)
        return eta + height
    return eta + _highest(x, y, b0, b1, b2) - math.sqrt(x * x + y * y)


EFFECT = Effect(
    name="bound_modes",
    title="waves bound to the first mode",
    meaning="A high wave drags a mean rise and a double wave along, which sharpen its crests.",
    stages=(Stage.MEASUREMENT,),
    equation=(
        r"\eta \to \eta + \kappa\,(b_0 + b_c\cos2\varphi + b_s\sin2\varphi),\quad"
        r" \dot b = k_sT_s\,c + \alpha_s\,\eta_1\psi_1,\quad"
        r" \dot c = -g\,b - 2\zeta\omega_s c + \beta_s\,\psi_1^2,\quad"
        r" \psi_1 = \dot\eta_1/(k_1T_1)"
    ),
    source=(
        r"second order of potential flow, $\alpha_s = I_s(\frac12k_s^2 - k_sT_sk_1T_1)$, "
        r"$\beta_s = \frac12I_s(\frac12k_s^2 - k_1^2 + k_1^2T_1^2)$, $T = \tanh kh$: in a "
        "cylinder the modes (0, 1) and (2, 1) of Lukovsky 1990; Faltinsen, Lukovsky & Timokha, J. "
        r"Fluid Mech. 804, 2016; in a rectangle, with $I_s = \frac12$, the second mode of "
        "Faltinsen, Rognebakke, Lukovsky & Timokha, J. Fluid Mech. 407, 2000"
    ),
    sections=(ROUND, RECTANGULAR),
    instead="leave the effect out",
    parameters=(
        Parameter(
            name="kappa",
            unit="1",
            lower=0.0,
            upper=3.0,
            neutral=0.0,
            description="share of the theory's; less in waves so high that the second order ends",
            default=1.0,
            plausible=(0.0, 1.5),
            spread=0.3,  # between waves of a tenth and of half the radius
            expected=1.0,
            starts=(0.9,),
        ),
        Parameter(
            name="damping_ratio",
            unit="1",
            lower=0.0,
            upper=0.9,
            neutral=None,
            description="damping ratio of the bound modes when they swing by themselves",
            default=0.1,
            plausible=(0.0, 0.4),
            starts=(0.1,),
        ),
    ),
    order=5,  # before what a sensor makes of it
    reading=_reading,
    reading_memory=9,
)

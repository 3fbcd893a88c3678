"""The first mode drives a mean rise and a double wave: crests sharper than troughs."""

from __future__ import annotations

import math

from slosh_model.constants import GRAVITY
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import WALL_AZIMUTH, WALL_FILL, WALL_RADIUS, WALL_X, WALL_Y

FIRST = 1.8411837813406595
"""Root of J₁′: the first mode's wave number, in units of 1/R."""
AXISYMMETRIC, DOUBLE = 3.8317059702075125, 3.0542369282271404
"""The same of the modes (0, 1) and (2, 1): roots of J₀′ and J₂′."""
OVERLAP_AXISYMMETRIC, OVERLAP_DOUBLE = 0.14451578634458237, 0.5040802760553215
"""½ ∫ r s f² dr / ∫ r s² dr over 0 … 1: how much of f², the first mode's radial shape squared,
lies in the radial shape s of either; shapes are 1 at the wall."""

_X, _Y, _BEGUN, _MODES = range(4)  # of the memory: the wall's heights before; then the modes
_ANGLES = 16  # around the wall, where the highest place is looked for
_NEAR = math.pi / _ANGLES  # so far from the best place the highest may be
_REFINED = 4


@compiled
def _driven(k, overlap, radius, fill, damping, dt):  # type: ignore[no-untyped-def]
    """What takes a mode over an interval: its drives' factors, rate, and propagator.

    Elevation b and potential c follow ḃ = K c + u, ċ = -g b - 2ζω c + w with constant u, w.
    """
    first = FIRST * math.tanh(FIRST * fill / radius)
    rate = k * math.tanh(k * fill / radius)
    rise = overlap * (0.5 * k * k - rate * first) / (radius * radius)
    push = 0.5 * overlap * (0.5 * k * k - FIRST * FIRST + first * first) / (radius * radius)
    rate /= radius
    omega = math.sqrt(GRAVITY * rate)
    swing = omega * math.sqrt(1.0 - damping * damping)
    decay = math.exp(-damping * omega * dt)
    c, s = decay * math.cos(swing * dt), decay * math.sin(swing * dt) / swing
    return rise, push, rate, 2.0 * damping * omega, c, s


@compiled
def _advance(memory, at, along, square, driven):  # type: ignore[no-untyped-def]
    """Takes one mode over the interval, about the place where its constant drive holds it."""
    rise, push, rate, drag, c, s = driven
    potential = -rise * along / rate
    elevation = (push * square - drag * potential) / GRAVITY
    b, p = memory[at] - elevation, memory[at + 1] - potential
    half = 0.5 * drag
    memory[at] = elevation + (c + half * s) * b + rate * s * p
    memory[at + 1] = potential + (c - half * s) * p - GRAVITY * s * b


@compiled
def _wall(x, y, mean, double_c, double_s, azimuth):  # type: ignore[no-untyped-def]
    """Height at an azimuth, its slope and its curvature by the azimuth."""
    c, s = math.cos(azimuth), math.sin(azimuth)
    c2, s2 = c * c - s * s, 2.0 * c * s
    first, second = x * c + y * s, double_c * c2 + double_s * s2
    slope = y * c - x * s + 2.0 * (double_s * c2 - double_c * s2)
    return mean + first + second, slope, -first - 4.0 * second


@compiled
def _to_the_crest(slope, curvature):  # type: ignore[no-untyped-def]
    """Newton's step towards a maximum, not beyond half the way to the next place [rad]."""
    return max(-_NEAR, min(slope / max(-curvature, 1e-12), _NEAR))


@compiled
def _highest(x, y, mean, double_c, double_s):  # type: ignore[no-untyped-def]
    """The maximum over the wall [m]: from the place that promises most, by Newton's method."""
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
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    x, y, radius, fill = wall[WALL_X], wall[WALL_Y], wall[WALL_RADIUS], wall[WALL_FILL]
    if dt > 0.0 and memory[_BEGUN] != 0.0:
        px, py = 0.5 * (x + memory[_X]), 0.5 * (y + memory[_Y])
        # The first mode's potential at the still level, by how fast the wall's height changes.
        share = radius / (FIRST * math.tanh(FIRST * fill / radius) * dt)
        ux, uy = share * (x - memory[_X]), share * (y - memory[_Y])
        mean = _driven(AXISYMMETRIC, OVERLAP_AXISYMMETRIC, radius, fill, p[1], dt)
        _advance(memory, _MODES, px * ux + py * uy, ux * ux + uy * uy, mean)
        double = _driven(DOUBLE, OVERLAP_DOUBLE, radius, fill, p[1], dt)
        _advance(memory, _MODES + 2, px * ux - py * uy, ux * ux - uy * uy, double)
        _advance(memory, _MODES + 4, px * uy + py * ux, 2.0 * ux * uy, double)
    memory[_X], memory[_Y], memory[_BEGUN] = x, y, 1.0
    rise, double_c, double_s = (
        p[0] * memory[_MODES], p[0] * memory[_MODES + 2], p[0] * memory[_MODES + 4],
    )  # fmt: skip
    azimuth = wall[WALL_AZIMUTH]
    if azimuth == azimuth:
        height, _, _ = _wall(0.0, 0.0, rise, double_c, double_s, azimuth)
        return eta + height
    return eta + _highest(x, y, rise, double_c, double_s) - math.sqrt(x * x + y * y)


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
        r"$\beta_s = \frac12I_s(\frac12k_s^2 - k_1^2 + k_1^2T_1^2)$, $T = \tanh kh$: the modes "
        "(0, 1) and (2, 1) of Lukovsky 1990; Faltinsen, Lukovsky & Timokha, J. Fluid Mech. 804, "
        "2016"
    ),
    shapes=("cylinder",),
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

"""Second-order waves driven by the first mode, as oscillators with stepwise constant force.

Elevation b and potential c of such a mode follow ḃ = K c + u, ċ = -g b - 2ζω c + w, with u and w
constant over an interval and K = ω²/g.
"""

from __future__ import annotations

import math

from slosh_base.compiled.compilation import compiled
from slosh_model.constants import GRAVITY


@compiled
def swing(rate, damping, dt):  # type: ignore[no-untyped-def]
    """Returns the coefficients that advance a free second-order wave by a time step dt.

    Args:
        rate: K [1/m].
        damping: ζ, below 1.
        dt: the interval [s].
    """
    omega = math.sqrt(GRAVITY * rate)
    damped = omega * math.sqrt(1.0 - damping * damping)
    decay = math.exp(-damping * omega * dt)
    c, s = decay * math.cos(damped * dt), decay * math.sin(damped * dt) / damped
    return rate, 2.0 * damping * omega, c, s


@compiled
def advance_bound(memory, at, rise, push, swung):  # type: ignore[no-untyped-def]
    """Advances a second-order mode over a time step under constant forces.

    Args:
        memory: b [m] and c [m²/s] at the places `at` and `at + 1`; changed.
        at: where.
        rise: u [m/s].
        push: w [m²/s²].
        swung: of `swing`.
    """
    rate, drag, c, s = swung
    potential = -rise / rate
    elevation = (push - drag * potential) / GRAVITY
    b, p = memory[at] - elevation, memory[at + 1] - potential
    half = 0.5 * drag
    memory[at] = elevation + (c + half * s) * b + rate * s * p
    memory[at + 1] = potential + (c - half * s) * p - GRAVITY * s * b

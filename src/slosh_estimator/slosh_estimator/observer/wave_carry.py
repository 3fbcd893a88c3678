"""Propagates a large correction of the wave to the newest input by nonlinear equations.

A wave that the camera shows and the model did not know is corrected by its whole height. Its
frequency is not that of a small wave, so that the linear transition would turn its phase wrongly
over the latency of the camera. So the wave is integrated again from the measurement's moment, with
and without the correction; their difference is added to the states that are there.
"""

from __future__ import annotations

import math

from slosh_base.compiled.compilation import compiled
from slosh_estimator.observer.layout import (
    AX,
    AY,
    AZ,
    DAMPING,
    FREQUENCY,
    HEIGHT_X,
    HEIGHT_Y,
    MODES,
    OMEGA,
    TIME,
    TURN,
)
from slosh_estimator.observer.layout import GAIN as GAIN_OF
from slosh_estimator.observer.propagation import change_mode
from slosh_model.chains import all_modulations
from slosh_model.indices import GAIN, GAIN_Y, VX, VY, X, Y
from slosh_model.kernel import between, constants_of, runge_kutta_step
from slosh_model.layout import records


@compiled
def correction_size(blocks, mean):  # type: ignore[no-untyped-def]
    """Returns the height of the wave that a correction adds [m]."""
    total = 0.0
    for k in range(blocks.shape[0]):
        gain, rate = blocks[k, GAIN_OF], blocks[k, OMEGA]
        total += gain * gain * (mean[2 * k] ** 2 + (mean[2 * k + 1] / rate) ** 2)
    return math.sqrt(total)


@compiled
def _input(row):  # type: ignore[no-untyped-def]
    return row[AX], row[AY], row[AZ], row[TURN]


@compiled
def _added(row, n, moves, old, new):  # type: ignore[no-untyped-def]
    """Adds a change of a mode's state to a stored row, and updates the row's heights."""
    at = MODES + 4 * n
    x, y = row[at], row[at + 2]
    row[at] += moves[X]
    row[at + 1] += moves[VX]
    row[at + 2] += moves[Y]
    row[at + 3] += moves[VY]
    row[HEIGHT_X] += new[GAIN] * row[at] - old[GAIN] * x
    row[HEIGHT_Y] += new[GAIN_Y] * row[at + 2] - old[GAIN_Y] * y


@compiled
def _integrated(constants, q, u0, u1, dt, moment, run):  # type: ignore[no-untyped-def]
    """Integrates a mode over a time dt, with the sub-steps of `kernel.advance`."""
    count = math.ceil(dt / run["max_step"]) if dt > 0.0 else 0
    before = u0
    for i in range(count):
        after = between(u0, u1, (i + 1) / count)
        now = moment + dt * (i / count)
        q = runge_kutta_step(constants, q, before, after, dt / count, now, run["parameters"])
        before = after
    return q


@compiled
def carry_wave(store, ring, at, last, mean, moment):  # type: ignore[no-untyped-def]
    """Adds a correction of state, ω and ζ at a past time to all later stored rows.

    Args:
        store: the model; changed.
        ring: past states; changed.
        at, last: counts of the row before the moment and of the newest one.
        mean: the correction at the moment: q and q̇ of each block, then ε and κ.
        moment: of it [s].
    """
    runs, modes = records(store)
    run, kept, states = runs[0], ring.shape[0], 4 * modes.shape[0]
    newest, parameters = ring[last % kept, TIME], run["parameters"]
    one, two = ring[at % kept], ring[min(at + 1, last) % kept]
    whole = two[TIME] - one[TIME]
    share = (moment - one[TIME]) / whole if whole > 0.0 else 0.0
    for n in range(modes.shape[0]):
        old = constants_of(modes[n])
        change_mode(modes[n], mean[states + FREQUENCY], mean[states + DAMPING])
        new = constants_of(modes[n])
        place = MODES + 4 * n
        x = one[place] + share * (two[place] - one[place])
        vx = one[place + 1] + share * (two[place + 1] - one[place + 1])
        y = one[place + 2] + share * (two[place + 2] - one[place + 2])
        vy = one[place + 3] + share * (two[place + 3] - one[place + 3])
        q = (x, y, vx, vy)
        c = mean[4 * n : 4 * n + 4]
        changed = (x + c[0], y + c[2], vx + c[1], vy + c[3])
        begin, u0 = moment, between(_input(one), _input(two), share)
        moved = (c[0], c[2], c[1], c[3])
        elapsed = run["elapsed"] - (newest - begin)
        if one[TIME] == moment:
            gains = all_modulations(old, elapsed, parameters)
            _added(one, n, moved, gains, all_modulations(new, elapsed, parameters))
        for row in range(at, last):
            two_now = ring[(row + 1) % kept]
            dt, u1 = two_now[TIME] - begin, _input(two_now)
            elapsed = run["elapsed"] - (newest - begin)
            q = _integrated(old, q, u0, u1, dt, elapsed, run)
            changed = _integrated(new, changed, u0, u1, dt, elapsed, run)
            begin, u0 = two_now[TIME], u1
            moved = (
                changed[X] - q[X], changed[Y] - q[Y], changed[VX] - q[VX], changed[VY] - q[VY],
            )  # fmt: skip
            gains = all_modulations(old, elapsed + dt, parameters)
            _added(two_now, n, moved, gains, all_modulations(new, elapsed + dt, parameters))

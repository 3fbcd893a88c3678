"""The smallest wave that a liquid has, and its growth under vertical acceleration.

Vertical acceleration changes the stiffness of every mode, q̈ + 2ζωq̇ + ω²(1 + z̈/g)q = 0, Mathieu's
equation. Near z̈ = a cos 2ωt waves grow where a exceeds 4ζg (Ibrahim, Liquid Sloshing Dynamics,
2005, ch. 6). An exact zero never leaves zero, so a simulation from rest shows nothing of it;
a liquid that is at rest for the eye has a wave.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_model.batch import wall_heights
from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.model import VERTICAL, Model
from slosh_model.simulate import MAXIMUM_STEP, Inputs, State

LEAST_WAVE = 1e-5
"""Height [m] of every mode's wave in a liquid at rest: what the vibration of a floor or a robot
leaves. It is a tenth of what is told and seen."""
SEEN = 1e-4
"""Heights are told to this [m]; a least wave that stays lower counts as nothing."""

MOST = 1e150
"""Stands for a height that left the finite numbers [m]."""


class GrowingWaves(NamedTuple):
    """Smallest waves that the vertical acceleration of a motion makes visible.

    Attributes:
        factor: by which the smallest wave grows.
        starts: (modes, 4) each: the smallest waves at the start, in the phase from which they
            grow highest, along x and along y of the modes' axes; either sign is as likely.
    """

    factor: float
    starts: tuple[Array, ...]


def growth_text(factor: float) -> str:
    """Describes how vertical acceleration makes the smallest wave grow; empty for 1.

    >>> growth_text(120.0)
    'vertical acceleration near twice a natural frequency: a wave of 10 µm at rest grows'
    """
    if factor <= 1.0:
        return ""
    return (
        "vertical acceleration near twice a natural frequency: a wave of "
        f"{1e6 * LEAST_WAVE:.0f} µm at rest grows"
    )


def growing_waves(
    models: Model | Sequence[Model], motions: Sequence[Inputs], max_step: float = MAXIMUM_STEP
) -> list[GrowingWaves | None]:
    """Returns the smallest waves that grow in each of many motions; None where none is seen.

    >>> import numpy as np
    >>> from slosh_model import Inputs, read_model
    >>> t = np.arange(4001) / 100.0  # s
    >>> shaken = np.outer(np.cos(2.0 * 21.17 * t), [0.0, 0.0, 1.0])  # m/s²
    >>> (found,) = growing_waves(read_model("cup/model.yaml"), [Inputs(t, shaken)])
    >>> found.factor > 100.0
    True

    Args:
        models: the model of all motions, or one of each; vertical acceleration acts in any case.
        motions: the motions.
        max_step: of the integration [s].
    """
    each = [models] * len(motions) if isinstance(models, Model) else list(models)
    found: list[GrowingWaves | None] = [None] * len(motions)
    rates = {id(model): _rates(model) for model in each}
    lifts = {id(motion): _lift(motion) for motion in motions}
    groups: dict[int, list[int]] = {}
    for place, (model, motion) in enumerate(zip(each, motions, strict=True)):
        if _may_grow(rates[id(model)], lifts[id(motion)]):
            groups.setdefault(id(model), []).append(place)
    for places in groups.values():
        vertical = [_vertical(motions[at]) for at in places]
        grown = _grown(each[places[0]].linear().spatial(), vertical, max_step)
        for place, one in zip(places, grown, strict=True):
            found[place] = one
    return found


def _rates(model: Model) -> Array:
    """Returns how fast each mode's wave grows at most by vertical acceleration, and decays.

    V = (q̇ + ζωq)² + ω²(1 − ζ²)q² changes by at most (ω |z̈|/(g √(1 − ζ²)) − 2ζω) V a second; a
    wave's height by half of the exponent.

    Returns:
        (modes and directions, 2) growth by |z̈| [s/m] and decay [1/s]; the latter is 0 where an
        effect may change the damping.
    """
    counts, found = _plain(model), []
    for mode in model.mode_constants():
        for axis in (X_AXIS, Y_AXIS):
            one = mode.along(axis)
            omega, zeta = one.natural_frequency, min(one.damping_ratio, 0.9)
            found.append((0.5 * omega / GRAVITY / math.sqrt(1.0 - zeta**2), zeta * omega * counts))
    return np.array(found)


def _plain(model: Model) -> bool:
    """Whether no effect of a model changes its damping, or drives it without an acceleration."""
    known = {VERTICAL, model.container.nonlinear_effect, "gravity_tilt", "second_mode"}
    return all(use.name in known for use in model.effects)


def undriven(model: Model, motion: Inputs) -> bool:
    """Whether a liquid at rest stays at rest in a motion, but for its smallest wave."""
    return _plain(model) and not (len(motion.poses) or motion.acceleration[:, :2].any())


def _lift(motion: Inputs) -> tuple[Array, Array]:
    """Returns ∫|z̈| dt [m/s] up to each sample but the first, and the times since then [s]."""
    lift = np.abs(motion.acceleration[:, 2])
    if not lift.any():
        return np.zeros(1), np.zeros(1)
    parts = 0.5 * (lift[1:] + lift[:-1]) * np.diff(motion.t)
    return np.cumsum(parts), motion.t[1:] - motion.t[0]


def _may_grow(rates: Array, lift: tuple[Array, Array]) -> bool:
    """Whether the smallest wave may become visible, by a bound that holds for any motion."""
    pushed, since = lift
    if pushed[-1] == 0.0:
        return False
    longest = float(np.diff(pushed, prepend=0.0).max())
    for grows, decays in rates:
        # Within an interval a wave is not higher than without its damping.
        exponent = float((grows * pushed - decays * since).max()) + grows * longest
        # The first factor is that of V at the start by the wave's own.
        if 1.01 * math.exp(min(exponent, 100.0)) > SEEN / LEAST_WAVE:
            return True
    return False


def _vertical(motion: Inputs) -> Inputs:
    """Returns the vertical part of a motion, of an upright container, from time 0."""
    return Inputs(motion.t - motion.t[0], motion.acceleration * [0.0, 0.0, 1.0])


def _grown(model: Model, motions: list[Inputs], max_step: float) -> list[GrowingWaves | None]:
    modes = model.mode_constants()
    starts = np.zeros((len(motions), 2, len(modes), 4))
    factors = np.zeros(len(motions))
    (first,) = wall_heights(model, motions[:1], max_step=max_step)
    forced = first.any()  # by an effect such as a tilt of the floor
    rest = wall_heights(model, motions, max_step=max_step) if forced else [np.zeros(2)]
    rest *= 1 if forced else len(motions)
    round_ = _alike(model)
    for axis in (X_AXIS,) if round_ else (X_AXIS, Y_AXIS):
        for n, (mode, gain) in enumerate(zip(modes, model.height_gains(modes, axis), strict=True)):
            if gain == 0.0:
                continue
            size = LEAST_WAVE / abs(gain)
            values = np.array([size, size * mode.along(axis).natural_frequency])
            pair = [
                _responses(model, motions, (n, column, value), rest, max_step)
                for column, value in zip((axis, 2 + axis), values, strict=True)
            ]
            for at, (moved, pushed) in enumerate(zip(*pair, strict=True)):
                # Of all phases the highest at a moment is cos φ of one and sin φ of the other.
                heights = np.hypot(np.linalg.norm(moved, axis=1), np.linalg.norm(pushed, axis=1))
                top = int(np.argmax(heights))
                factors[at] = max(factors[at], heights[top] / LEAST_WAVE)
                both = np.array([moved[top], pushed[top]])
                share = both @ both[np.argmax(np.abs(both).max(axis=1))]
                length = float(np.linalg.norm(share))
                if 0.0 < length < np.inf:
                    starts[at, axis, n, [axis, 2 + axis]] = share / length * values
    if round_:
        starts[:, 1] = starts[:, 0][..., [1, 0, 3, 2]]
    return [
        GrowingWaves(float(factor), tuple(pair)) if factor * LEAST_WAVE > SEEN else None
        for factor, pair in zip(factors, starts, strict=True)
    ]


def _alike(model: Model) -> bool:
    """Whether waves along x and along y are alike, as in a round container."""
    constants = model.mode_constants()
    gains = (model.height_gains(constants, axis) for axis in (X_AXIS, Y_AXIS))
    return (
        not model.container.one_directional
        and all(
            one.along(Y_AXIS).natural_frequency == one.along(X_AXIS).natural_frequency
            for one in constants
        )
        and len(set(gains)) == 1
    )


def _responses(
    model: Model,
    motions: list[Inputs],
    place: tuple[int, int, float],
    rest: list[Array],
    max_step: float,
) -> list[Array]:
    """Returns heights (N, 2) [m] of the liquid that begins with one value of its modal state."""
    n, column, value = place
    modal = np.zeros((model.mode_count, 4))
    modal[n, column] = value
    begun = State(0.0, modal, np.zeros(4))
    found = wall_heights(model, motions, state=begun, max_step=max_step)
    return [
        np.nan_to_num(one - still, nan=MOST, posinf=MOST, neginf=-MOST)
        for one, still in zip(found, rest, strict=True)
    ]

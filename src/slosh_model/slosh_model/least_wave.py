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
from slosh_model.model import Model
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
    model: Model, motions: Sequence[Inputs], max_step: float = MAXIMUM_STEP
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
        model: the model; vertical acceleration acts in any case.
        motions: the motions.
        max_step: of the integration [s].
    """
    found: list[GrowingWaves | None] = [None] * len(motions)
    places = [at for at, one in enumerate(motions) if _may_grow(model, one)]
    if places:
        vertical = [_vertical(motions[at]) for at in places]
        grown = _grown(model.linear().spatial(), vertical, max_step)
        found = [grown[places.index(at)] if at in places else None for at in range(len(motions))]
    return found


def _may_grow(model: Model, motion: Inputs) -> bool:
    """Whether the smallest wave may become visible, by a bound that holds for any motion.

    The energy E = q̇² + ω²q² rises by at most ω |z̈|/g E a second.
    """
    lift = np.abs(motion.acceleration[:, 2])
    if not lift.any():
        return False
    rate = 0.5 * max(mode.natural_frequency for mode in model.mode_constants()) / GRAVITY
    exponent = rate * float((0.5 * (lift[1:] + lift[:-1]) * np.diff(motion.t)).sum())
    return exponent > math.log(SEEN / LEAST_WAVE)


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

"""Where a search starts: a motion by a known law, with the liquid's answer to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slosh_model import Inputs, Model, simulate
from slosh_plan.planning.interval import CHAIN
from slosh_plan.planning.known_laws import Scaled, leg_durations
from slosh_plan.planning.optimise import LegGuess, Search
from slosh_plan.planning.path import Path

Array = NDArray[np.float64]


def guess_of(
    model: Model, path: Path, start: Scaled, search: Search, factor: float
) -> tuple[LegGuess, ...]:
    """A motion by a law as the start of a search.

    Args:
        model: the model.
        path: the path.
        start: the motion by the law.
        search: whose nodes the guess has.
        factor: by which the start is slower; the liquid's answer stays as it was.
    """
    motion, layout = start.found.motion, search.layout
    modal = simulate(model, Inputs(motion.t, motion.acceleration))[0].modal[:, 0]
    durations = leg_durations(path, motion.duration)
    legs, begin = [], 0.0
    laws = start.known.laws(motion.duration)
    for law, duration, count in zip(laws, durations, search.counts, strict=True):

        def liquid(t: Array, begin: float = begin) -> Array:
            return np.column_stack([np.interp(begin + t, motion.t, one) for one in modal.T])

        t = np.linspace(0.0, duration, count + 1)
        s, v, a = law(t)
        states = np.zeros((count + 1, layout.size))
        states[:, :CHAIN] = np.column_stack([s, v / factor, a / factor**2])
        states[:, layout.liquid] = liquid(t)
        controls = np.zeros((count, layout.driven))
        controls[:, 0] = np.diff(a) / (duration / count) / factor**3
        middles = liquid(t[:-1] + 0.5 * duration / count)
        legs.append(LegGuess(factor * duration, states, controls, middles))
        begin += duration
    return tuple(legs)


def upright_guess(legs: Sequence[LegGuess], search: Search) -> tuple[LegGuess, ...]:
    """The motion of an upright container as the start of a search of one that tilts."""
    layout = search.layout
    found = []
    for leg, count in zip(legs, search.counts, strict=True):
        old = np.linspace(0.0, 1.0, len(leg.states))
        t = np.linspace(0.0, 1.0, count + 1)
        middle = 0.5 * (t[1:] + t[:-1])
        liquid = leg.states[:, CHAIN:]
        states, controls = np.zeros((count + 1, layout.size)), np.zeros((count, layout.driven))
        states[:, :CHAIN] = _at(t, old, leg.states[:, :CHAIN])
        states[:, layout.liquid] = _at(t, old, liquid)
        which = np.minimum((middle * len(leg.controls)).astype(int), len(leg.controls) - 1)
        controls[:, 0] = leg.controls[which, 0]
        found.append(LegGuess(leg.duration, states, controls, _at(middle, old, liquid)))
    return tuple(found)


def _at(t: Array, times: Array, columns: Array) -> Array:
    return np.column_stack([np.interp(t, times, column) for column in columns.T])

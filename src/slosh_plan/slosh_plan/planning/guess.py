"""Where a search starts: a motion by a known law, with the liquid's answer to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slosh_model import Inputs, Model, simulate
from slosh_plan.planning.known_laws import Scaled, UnitLaw, leg_durations
from slosh_plan.planning.optimise import Guess
from slosh_plan.planning.path import Path
from slosh_plan.planning.time_law import scaled_law


def guess_of(
    model: Model, path: Path, law: UnitLaw, start: Scaled, counts: Sequence[int], factor: float
) -> Guess:
    """A motion by a law as the start of a search.

    Args:
        model: the model.
        path: the path.
        law: the law.
        start: the motion by the law.
        counts: intervals of each leg.
        factor: by which the start is slower; the liquid's answer stays as it was.
    """
    motion = start.found.motion
    modal = simulate(model, Inputs(motion.t, motion.acceleration))[0].modal[:, 0]
    durations = leg_durations(path, motion.duration)
    states, jerks, begin = [], [], 0.0
    for leg, duration, count in zip(path.legs, durations, counts, strict=True):
        t = np.linspace(0.0, duration, count + 1)
        s, v, a = scaled_law(law, leg, duration)(t)
        liquid = [np.interp(begin + t, motion.t, column) for column in modal.T]
        states.append(np.column_stack([s, v / factor, a / factor**2, *liquid]))
        jerks.append(np.diff(a) / (duration / count) / factor**3)
        begin += duration
    return Guess(tuple(factor * duration for duration in durations), tuple(states), tuple(jerks))

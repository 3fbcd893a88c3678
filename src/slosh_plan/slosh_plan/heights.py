"""Computes the sloshing heights of many motions at once, and their maxima."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_model.batch import wall_heights
from slosh_model.containers import Container
from slosh_model.errors import SloshModelError
from slosh_model.least_wave import growing_waves, undriven
from slosh_model.model import Model
from slosh_model.simulate import MAXIMUM_STEP, Inputs
from slosh_plan.errors import SloshPlanError
from slosh_plan.start import begun

PERIODS = 3.0
"""Usual horizon after a motion, in periods of the first mode: what follows is lower."""


@dataclass(frozen=True, slots=True)
class Extremes:
    """Maximum wave heights [m] during and after a motion.

    Attributes:
        peak: greatest MSH [m]; infinite where the model has left its range.
        peak_time: when [s].
        azimuth: where on the wall, from the container's +x [rad].
        residual: greatest MSH after the motion's end [m].
        last: the same within the last period of the horizon [m].
        growth: by which vertical acceleration makes the smallest wave grow; 1: not visibly.
    """

    peak: float
    peak_time: float
    azimuth: float
    residual: float
    last: float
    growth: float = 1.0


def first_period(model: Model) -> float:
    """Returns the period of the first sloshing mode [s]."""
    return 2.0 * math.pi / model.mode_constants()[0].natural_frequency


def usual_horizon(model: Model) -> float:
    """Returns how long a prediction continues after a motion's end by default [s]."""
    return PERIODS * first_period(model)


def all_extremes(
    model: Model,
    inputs: Sequence[Inputs],
    ends: Sequence[float],
    modal: Array | None,
    *,
    max_step: float = MAXIMUM_STEP,
) -> list[Extremes]:
    """Computes the maximum wave heights [m] during and after each of many motions.

    Args:
        model: the model.
        inputs: motions with what follows them.
        ends: when each motion ends [s].
        modal: (modes, 4) how the liquid stands when each begins; None: at rest.
        max_step: of the integration [s].

    Raises:
        SloshPlanError: the state of another model.
    """
    period = first_period(model)
    try:
        found = highest(model, inputs, modal, max_step=max_step)
    except SloshModelError as error:
        raise SloshPlanError(str(error)) from None
    return [
        replace(_extremes(motion.t, one.heights, end, period, model.container), growth=one.growth)
        for motion, one, end in zip(inputs, found, ends, strict=True)
    ]


class Highest(NamedTuple):
    """Heights of the liquid in a motion, from the smallest wave that makes them highest.

    Attributes:
        heights: (N, 2) at the container's +x and +y [m].
        growth: by which the smallest wave grows; 1: not visibly, the liquid starts without it.
        start: (modes, 4) of the liquid; None: at rest.
    """

    heights: Array
    growth: float
    start: Array | None


def highest(
    model: Model,
    inputs: Sequence[Inputs],
    modal: Array | None = None,
    *,
    max_step: float = MAXIMUM_STEP,
) -> list[Highest]:
    """Computes the heights of many motions, each from the worst of the smallest waves.

    Args:
        model: the model; to a motion whose vertical acceleration makes waves grow, the effect of
            vertical acceleration is added if it is missing.
        inputs: the motions.
        modal: (modes, 4) how the liquid stands when each begins; None: at rest.
        max_step: of the integration [s].

    Raises:
        SloshModelError, SloshPlanError: as of `wall_heights`; the state of another model.
    """
    heights = _heights(model, inputs, modal, max_step)
    found = [Highest(one, 1.0, modal) for one in heights]
    waves = growing_waves(model, inputs, max_step)
    for place, (motion, one) in enumerate(zip(inputs, waves, strict=True)):
        if one is None:
            continue
        spatial, still = model.spatial(), np.zeros((model.mode_count, 4))
        # Without a forced wave both signs are alike.
        signs = (1.0, -1.0) if motion.acceleration[:, :2].any() or modal is not None else (1.0,)
        for wave in (still, *(sign * wave for wave in one.starts for sign in signs)):
            start = wave + (still if modal is None else modal)
            (other,) = _heights(spatial, [motion], start, max_step)
            if wave is still or _peak(model, other) > _peak(model, found[place].heights):
                found[place] = Highest(other, one.factor, start)
    return found


def highest_of_each(models: Sequence[Model], motion: Inputs) -> list[Array]:
    """Computes the heights of one motion with many models, from the smallest waves that grow.

    Args:
        models: that differ in their parameters.
        motion: the motion, of a liquid at rest.

    Returns:
        (N, 2) at the container's +x and +y [m], of each model.

    Raises:
        SloshModelError: as of `wall_heights`.
    """
    found = wall_heights(models, motion)
    waves = growing_waves(models, [motion] * len(models))
    for place, (model, one) in enumerate(zip(models, waves, strict=True)):
        if one is not None:
            found[place] = highest(model, [motion])[0].heights
    return found


def _peak(model: Model, heights: Array) -> float:
    """Returns the greatest height [m]; infinity where the solution left the finite numbers."""
    return float(np.nan_to_num(msh_of(model.container, heights), nan=np.inf).max())


def _heights(
    model: Model, inputs: Sequence[Inputs], modal: Array | None, max_step: float
) -> list[Array]:
    """Computes the heights (N, 2) [m] of each motion, in batches of equal initial state."""
    groups: dict[float, list[int]] = {}
    answers: dict[int, Array] = {}
    for place, motion in enumerate(inputs):
        if modal is None and undriven(model, motion):
            answers[place] = np.zeros((len(motion.t), 2))
            continue
        t = 0.0 if modal is None else float(motion.t[0])
        groups.setdefault(t, []).append(place)
    for t, places in groups.items():
        state = begun(model, modal, t)
        chosen = [inputs[place] for place in places]
        found = wall_heights(model, chosen, state=state, max_step=max_step)
        answers.update(zip(places, found, strict=True))
    return [answers[place] for place in range(len(inputs))]


def msh_of(container: Container, heights: Array) -> Array:
    """Returns the maximum sloshing heights (N,) [m] from heights (N, 2) at +x and +y."""
    return container.msh(heights[:, 0], heights[:, 1])


def _extremes(
    t: Array, heights: Array, end: float, period: float, container: Container
) -> Extremes:
    msh = msh_of(container, heights)
    if not math.isfinite(float(msh.sum())):
        lost = float(t[int(np.argmin(np.isfinite(msh)))])
        return Extremes(math.inf, lost, math.nan, math.inf, math.inf)
    top = int(np.argmax(msh))
    azimuth = float(container.azimuth(heights[top, 0], heights[top, 1]))
    after = int(np.searchsorted(t, end, side="left"))
    tail = int(np.searchsorted(t, max(end, t[-1] - period), side="left"))
    return Extremes(
        float(msh[top]), float(t[top]), azimuth, float(msh[after:].max()),
        float(msh[tail:].max()),
    )  # fmt: skip

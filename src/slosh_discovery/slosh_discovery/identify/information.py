"""Finds which parameters the motions identify, and motions that would identify all others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.colour import Colour
from slosh_discovery.discover.problem import LONGEST_STEP
from slosh_discovery.discover.separating_families import (
    FAMILIES,
    CandidateMotion,
    inputs_of,
    text_of,
)
from slosh_discovery.identify.fitting import information
from slosh_discovery.identify.problem import STEP, Problem
from slosh_discovery.identify.tuning import TUNING
from slosh_model.batch import wall_heights
from slosh_model.measure import measured_heights
from slosh_model.response import Response
from slosh_model.simulate import Inputs

FREQUENCIES = (0.4, 0.8, 1.0)
"""Of the motions that are tried, relative to the natural frequency,"""
ACCELERATIONS = (1.0, 4.0)
"""and their greatest accelerations [m/s²]."""


@dataclass(frozen=True, slots=True, eq=False)
class Unidentified:
    """A parameter that the motions do not determine, with the reason.

    Attributes:
        name: of the parameter; it keeps its value.
        with_others: those from which the motions cannot tell it apart; empty: no motion moves it.
        error: its standard error from these motions, relative to what is known without them.
        help: the motion that would tell of it, in words; empty: none in the list does.
        inputs: of that motion.
        helped: the error with it.
    """

    name: str
    with_others: tuple[str, ...]
    error: float
    help: str = ""
    inputs: Inputs | None = None
    helped: float = float("nan")


def unidentified(
    problem: Problem, vector: Array, colour: Colour
) -> tuple[tuple[str, ...], list[Unidentified]]:
    """Splits the parameters into identified and unidentified ones.

    The one that takes the largest part in the least known direction is held, of equals the one
    named last, until what is left is known.

    Args:
        problem: the data and what is free.
        vector: (V,) about where the fit is.
        colour: of the noise.

    Returns:
        the names of the parameters that can be fitted, and the others.
    """
    widths = problem.widths[: len(problem.parameters)]
    known = information(problem, vector, colour) * np.outer(widths, widths)
    names = [parameter.name for parameter in problem.parameters]
    left = list(range(len(names)))
    held: list[tuple[int, tuple[str, ...], float]] = []
    while left:
        values, vectors = np.linalg.eigh(known[np.ix_(left, left)])
        if values[0] * TUNING.unknown**2 >= 1.0:
            break
        shares = np.abs(vectors[:, 0])
        worst = len(left) - 1 - int(np.argmax(shares[::-1] > shares.max() - 1e-3))
        others = tuple(
            names[left[i]] for i in np.flatnonzero(shares > TUNING.involved) if i != worst
        )
        error = float(1.0 / np.sqrt(max(values[0], 1e-300)))
        held.append((left[worst], others, error))
        del left[worst]
    candidates = list(_candidates(problem, vector, colour)) if held else []
    return tuple(names[i] for i in left), [
        _with_help(Unidentified(names[place], others, error), known, [*left, place], candidates)
        for place, others, error in held
    ]


def _with_help(
    missing: Unidentified,
    known: Array,
    places: Sequence[int],
    candidates: Sequence[tuple[CandidateMotion, Inputs, Array]],
) -> Unidentified:
    """Returns an unidentified parameter together with a motion that would identify it.

    Args:
        missing: the parameter.
        known: (P, P) what the data tell.
        places: of the parameter and of those that are fitted.
        candidates: motions with what each would tell.
    """
    part = np.ix_(places, places)
    found = []
    for motion, inputs, gained in candidates:
        least = max(float(np.linalg.eigvalsh((known + gained)[part])[0]), 1e-300)
        found.append((float(1.0 / np.sqrt(least)), motion, inputs))
    best = min((entry[0] for entry in found), default=np.inf)
    if best > TUNING.unknown:
        return missing
    helped, motion, inputs = next(entry for entry in found if entry[0] <= TUNING.enough * best)
    return replace(missing, help=text_of(motion), inputs=inputs, helped=helped)


def _candidates(
    problem: Problem, vector: Array, colour: Colour
) -> Iterator[tuple[CandidateMotion, Inputs, Array]]:
    """Yields candidate motions with the information matrix (P, P) that each would add."""
    model = problem.model_at(vector)
    if model is None:
        return
    first = model.mode_frequency(1) / (2.0 * np.pi)
    for family, share, acceleration in product(FAMILIES, FREQUENCIES, ACCELERATIONS):
        motion = CandidateMotion(family, share * first, acceleration)
        inputs = inputs_of(motion)
        jacobian = _answers_change(problem, vector, inputs)
        if jacobian is not None:
            spacing = float(np.median(np.diff(inputs.t)))
            coloured = (1.0 - colour.memory) / (1.0 + colour.memory)
            weight = TUNING.samples * spacing * coloured / colour.stddev**2
            yield motion, inputs, weight * jacobian.T @ jacobian


def _answers_change(problem: Problem, vector: Array, inputs: Inputs) -> Array | None:
    """Returns height changes [m] per parameter, each varied by its prior width, or None."""
    azimuths = problem.trials[0].prepared.azimuths
    columns = []
    for place, parameter in enumerate(problem.parameters):
        heights, ends = [], []
        for sign in (1.0, -1.0):
            moved = vector.copy()
            value = moved[place] + sign * STEP * parameter.width
            moved[place] = min(max(value, parameter.lower), parameter.upper)
            model = problem.model_at(moved)
            if model is None:
                return None
            (liquid,) = wall_heights(model, inputs, max_step=LONGEST_STEP)
            response = Response(inputs.t, liquid[:, 0], liquid[:, 1], np.empty((0, 0, 4)))
            heights.append(measured_heights(model, response, azimuths).ravel())
            ends.append(float(moved[place]))
        change = (heights[0] - heights[1]) / (ends[0] - ends[1])
        columns.append(parameter.width * change)
    jacobian = np.column_stack(columns)
    return jacobian if np.isfinite(jacobian).all() else None

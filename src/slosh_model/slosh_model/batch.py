"""Many models or motions at once: the answers of `simulate`, in a small part of the time."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_model import batch_kernel, kernel
from slosh_model.errors import SloshModelError
from slosh_model.lane_rows import LANES
from slosh_model.layout import divided
from slosh_model.model import Model
from slosh_model.simulate import MAXIMUM_STEP, Inputs, store_of

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

VECTOR = 8
"""Lanes that a processor works on at once, or a multiple of that."""
FEWEST = 4
"""Fewer simulations are faster one by one."""


class _Simulation(NamedTuple):
    """One of many: its place among them, and the times between its inputs [s]."""

    place: int
    model: Model
    inputs: Inputs
    intervals: Array


def wall_heights(
    models: Model | Sequence[Model],
    inputs: Inputs | Sequence[Inputs],
    *,
    max_step: float = MAXIMUM_STEP,
    threads: int | None = None,
) -> list[Array]:
    """Wall heights of many simulations from rest, the bits of `simulate`.

    Fastest where many models have the same effects and the motions are about equally long.

    Args:
        models: one for all motions, or one for each.
        inputs: one for all models, or one for each.
        max_step: longest sub-step [s].
        threads: how many work at a time; None: one per processor.

    Returns:
        for each simulation (N, 2) signed height on the wall at the container's +x and +y [m]; not
        finite from where a solution has left the finite numbers.

    Raises:
        SloshModelError: numbers of models and inputs that do not fit.
    """
    simulations = _simulations(models, inputs)
    workers = threads or len(os.sched_getaffinity(0))
    share = -(-len(simulations) // workers)
    blocks = list(_blocks(simulations, min(LANES, max(share, VECTOR)), max_step))
    found: dict[int, Array] = {}

    def run(block: list[_Simulation]) -> None:
        for simulation, heights in zip(block, _run(block, max_step), strict=True):
            found[simulation.place] = heights

    if workers == 1 or len(blocks) == 1:
        for block in blocks:
            run(block)
    else:
        with ThreadPoolExecutor(workers) as executor:
            list(executor.map(run, blocks))
    return [found[place] for place in range(len(simulations))]


def _simulations(
    models: Model | Sequence[Model], inputs: Inputs | Sequence[Inputs]
) -> list[_Simulation]:
    given_models = [models] if isinstance(models, Model) else list(models)
    given_inputs = [inputs] if isinstance(inputs, Inputs) else list(inputs)
    total = max(len(given_models), len(given_inputs))
    for name, count in (("models", len(given_models)), ("inputs", len(given_inputs))):
        if count not in (1, total):
            raise SloshModelError(f"{count} {name} for {total} simulations: give one, or as many")
    intervals = {id(one): np.diff(one.t) for one in given_inputs}
    every_model = given_models * (total if len(given_models) == 1 else 1)
    every_input = given_inputs * (total if len(given_inputs) == 1 else 1)
    return [
        _Simulation(place, model, one, intervals[id(one)])
        for place, (model, one) in enumerate(zip(every_model, every_input, strict=True))
    ]


def _counts(intervals: Array, max_step: float) -> Counts:
    """How many sub-steps each of them takes."""
    return np.ceil(intervals / max_step).astype(np.int64)


def _blocks(
    simulations: Sequence[_Simulation], size: int, max_step: float
) -> Iterator[list[_Simulation]]:
    """Simulations that go through the kernel together: alike, and at most `size` of them."""
    groups: dict[object, list[_Simulation]] = {}
    for one in simulations:
        effects = frozenset(use.name for use in one.model.effects)
        # Where each input is one sub-step away, motions of any length and spacing are alike.
        single = one.intervals.max(initial=0.0) <= max_step
        counts = b"" if single else _counts(one.intervals, max_step).tobytes()
        key = (effects, one.model.modes, len(one.inputs.poses) > 0, counts)
        groups.setdefault(key, []).append(one)
    for group in groups.values():
        group.sort(key=lambda one: len(one.intervals))
        for at in range(0, len(group), size):
            yield group[at : at + size]


def _run(block: Sequence[_Simulation], max_step: float) -> list[Array]:
    distinct = {id(one.model): one.model for one in block}
    stores = {key: store_of(model, max_step) for key, model in distinct.items()}
    if len(block) < FEWEST:
        return [
            _one_by_one(stores[id(one.model)].copy(), one.inputs, len(one.inputs.t))
            for one in block
        ]
    # Lanes without a simulation of their own repeat the last one: whole vectors are faster.
    lanes = [*block, *([block[-1]] * (-len(block) % VECTOR))]
    packed = np.stack([stores[id(one.model)] for one in lanes])
    longest = max(lanes, key=lambda one: len(one.intervals))
    heights = np.empty((len(lanes), len(longest.inputs.t), 2))
    for store, one, row in zip(packed, lanes, heights, strict=True):
        row[:1] = _one_by_one(store, one.inputs, 1)
    rows, model = len(longest.intervals), block[0].model
    batch_kernel.advance_block(
        packed,
        _counts(longest.intervals, max_step),
        _stacked([one.intervals for one in lanes], rows, last=False),
        _stacked([one.inputs.acceleration[1:] for one in lanes], rows),
        _stacked([one.inputs.yaws[1:] for one in lanes], rows),
        _stacked([one.inputs.poses[1:] for one in lanes], rows if len(one.inputs.poses) else 0),
        bool(model.uses("drive")),
        bool(model.uses("modulation")),
        heights[:, 1:],
    )
    return [row[: len(one.inputs.t)] for row, one in zip(heights, block, strict=False)]


def _one_by_one(store: Array, motion: Inputs, count: int) -> Array:
    """Heights (count, 2) of the first inputs; changes the store."""
    heights = np.empty((count, 2))
    kernel.advance_many(
        store, np.diff(motion.t[:count], prepend=motion.t[:1]), motion.acceleration[:count],
        motion.yaws[:count], motion.poses[:count],
        np.empty((count, len(divided(store)[1]), 4)), heights,
    )  # fmt: skip
    return heights


def _stacked(arrays: Sequence[Array], rows: int, *, last: bool = True) -> Array:
    """(K, rows, …): each array, then its last row (or zeros) again and again."""
    padded = np.empty((len(arrays), rows, *arrays[0].shape[1:]))
    for target, array in zip(padded, arrays, strict=True):
        count = len(array)
        target[:count] = array
        if count < rows:
            target[count:] = array[-1] if last and count else 0.0
    return padded

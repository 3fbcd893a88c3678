"""Simulates many models or motions at once, with the same results as `simulate`."""

from __future__ import annotations

import math
import os
from collections.abc import Hashable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import accumulate, pairwise
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_model import batch_kernel, kernel
from slosh_model.errors import SloshModelError
from slosh_model.indices import POSE_COUNT
from slosh_model.lane_rows import LANES
from slosh_model.layout import divided
from slosh_model.model import Model
from slosh_model.simulate import MAXIMUM_STEP, Inputs, Simulator, State

Counts = NDArray[np.int64]
T = TypeVar("T")

VECTOR = 8
"""Lanes that a processor works on at once, or a multiple of that."""
FEWEST = 4
"""Fewer simulations are faster one by one."""
_ZERO = np.zeros(1)


class _Simulations(NamedTuple):
    """A batch of simulations; each list has one entry per simulation.

    Lists, not an object for each: thousands of those would wake the garbage collector.

    Attributes:
        models, inputs: as given.
        intervals: (N - 1,) the times between the inputs [s], one array for motions of one pace.
    """

    models: list[Model]
    inputs: list[Inputs]
    intervals: list[Array]

    def turn(self, place: int) -> bool:
        """Returns whether the container tilts or turns in a simulation."""
        return len(self.inputs[place].poses) > 0


Block = list[int]
"""Places of simulations that go through the kernel together."""


def wall_heights(
    models: Model | Sequence[Model],
    inputs: Inputs | Sequence[Inputs],
    *,
    state: State | None = None,
    max_step: float = MAXIMUM_STEP,
    threads: int | None = None,
) -> list[Array]:
    """Computes liquid heights [m] at the wall for many simulations, exactly as `simulate` does.

    Fastest where many models have the same effects and the motions are about equally long.

    >>> import numpy as np
    >>> from slosh_model import Inputs, read_model, wall_heights
    >>> t = np.arange(1001) / 1000.0  # s
    >>> push = np.outer(np.sin(9.0 * t), [1.0, 0.0, 0.0])  # m/s²
    >>> model = read_model("cup/model.yaml")
    >>> slow, fast = wall_heights(model, [Inputs(t, push), Inputs(t, 2.0 * push)])
    >>> slow.shape
    (1001, 2)

    Args:
        models: one for all motions, or one for each.
        inputs: one for all models, or one for each.
        state: where all start, at the time of their first samples; None: at rest.
        max_step: longest sub-step [s].
        threads: how many work at a time; None: one per processor.

    Returns:
        for each simulation (N, 2) signed height on the wall at the container's +x and +y [m]; not
        finite from where a solution has left the finite numbers.

    Raises:
        SloshModelError: numbers of models and inputs that do not fit, or a state that does not.
    """
    simulations = _simulations(models, inputs)
    _check_start(simulations, state)
    total = len(simulations.models)
    workers = threads or len(os.sched_getaffinity(0))
    share = -(-total // workers)
    blocks = list(_blocks(simulations, min(LANES, max(share, VECTOR)), max_step))
    distinct = {id(one): one for one in simulations.models}
    stores = {key: _store(model, state, max_step) for key, model in distinct.items()}
    found: dict[int, Array] = {}

    def run(block: Block, room: Array) -> None:
        packed = np.stack([stores[id(simulations.models[place])] for place in block])
        _run(simulations, block, packed, max_step, room)
        for place, heights in zip(block, room, strict=True):
            found[place] = heights[: len(simulations.inputs[place].t)]

    # One large array for all answers: the system hands out large pages, many times faster.
    rooms = _rooms([(len(block), len(simulations.inputs[block[-1]].t), 2) for block in blocks])
    if workers == 1 or len(blocks) == 1:
        for block, room in zip(blocks, rooms, strict=True):
            run(block, room)
    else:
        with ThreadPoolExecutor(workers) as executor:
            list(executor.map(run, blocks, rooms))
    return [found[place] for place in range(total)]


def _simulations(
    models: Model | Sequence[Model], inputs: Inputs | Sequence[Inputs]
) -> _Simulations:
    given_models = [models] if isinstance(models, Model) else list(models)
    given_inputs = [inputs] if isinstance(inputs, Inputs) else list(inputs)
    total = max(len(given_models), len(given_inputs))
    for name, count in (("models", len(given_models)), ("inputs", len(given_inputs))):
        if count not in (1, total):
            raise SloshModelError(f"{count} {name} for {total} simulations: give one, or as many")
    every_input = given_inputs * (total if len(given_inputs) == 1 else 1)
    return _Simulations(
        given_models * (total if len(given_models) == 1 else 1),
        every_input,
        list(_intervals(every_input)),
    )


def _check_start(simulations: _Simulations, state: State | None) -> None:
    for one in simulations.inputs if state is not None else ():
        if state is not None and one.t[0] != state.t:
            raise SloshModelError(
                f"a motion starts at {one.t[0]:.9g} s, the state is of {state.t:.9g} s"
            )


def _store(model: Model, state: State | None, max_step: float) -> Array:
    """Returns the array of a model's constants and state before its first sample."""
    simulator = Simulator(model, max_step=max_step)
    simulator.start(state, 0.0 if state is None else state.t)
    return simulator.store


def _intervals(inputs: Iterable[Inputs]) -> Iterator[Array]:
    """Yields the time steps of each motion, as one shared array for motions with equal times."""
    t, intervals = np.empty(0), np.empty(0)
    for one in inputs:
        if one.t is not t and not (len(one.t) == len(t) and (one.t == t).all()):
            intervals = np.diff(one.t)
        t = one.t
        yield intervals


def _counts(intervals: Array, max_step: float) -> Counts:
    """Returns the number of integration steps between consecutive inputs."""
    return np.ceil(intervals / max_step).astype(np.int64)


def _pace(intervals: Array, max_step: float) -> bytes:
    """Returns a key by which motions with equal numbers of integration steps are grouped.

    Where each input is one sub-step away, motions of any length and spacing are alike.
    """
    single = intervals.max(initial=0.0) <= max_step
    return b"" if single else _counts(intervals, max_step).tobytes()


def _blocks(simulations: _Simulations, size: int, max_step: float) -> Iterator[Block]:
    """Groups simulations with equal effects into blocks of limited size, sorted by length.

    Blocks of some size are filled up to whole vectors, which are faster, with the last one.
    """
    effects = {
        id(one): (
            frozenset(use.name for use in one.effects),
            one.mode_count,
            one.container.one_directional,
        )
        for one in simulations.models
    }
    paces = {id(one): _pace(one, max_step) for one in simulations.intervals}
    groups: dict[Hashable, Block] = {}
    for place, (model, intervals) in enumerate(
        zip(simulations.models, simulations.intervals, strict=True)
    ):
        key = (effects[id(model)], paces[id(intervals)], simulations.turn(place))
        groups.setdefault(key, []).append(place)
    for group in groups.values():
        group.sort(key=lambda place: len(simulations.intervals[place]))
        for at in range(0, len(group), size):
            block = group[at : at + size]
            yield block + block[-1:] * (-len(block) % VECTOR if len(block) >= FEWEST else 0)


def _rooms(shapes: Sequence[tuple[int, ...]]) -> list[Array]:
    """Allocates uninitialised arrays of given shapes in one memory block."""
    ends = [0, *accumulate(map(math.prod, shapes))]
    whole = np.empty(ends[-1])
    return [
        whole[start:end].reshape(shape)
        for (start, end), shape in zip(pairwise(ends), shapes, strict=True)
    ]


def _run(
    simulations: _Simulations, block: Block, stores: Array, max_step: float, heights: Array
) -> None:
    """Computes the liquid heights [m] at the wall for a block of simulations."""
    motions = [simulations.inputs[place] for place in block]
    intervals = [simulations.intervals[place] for place in block]
    if len(block) < FEWEST:
        for lane, motion in enumerate(motions):
            _one_by_one(stores[lane], intervals[lane], motion, heights[lane, : len(motion.t)])
        return
    nothing = np.empty(0)
    for lane, motion in enumerate(motions):
        _one_by_one(stores[lane], nothing, motion, heights[lane, :1])
    model, count = simulations.models[block[0]], heights.shape[1]
    spacings, interval_rows = _distinct(intervals)
    moved, input_rows = _distinct(motions)
    turned = moved if simulations.turn(block[0]) else []
    batch_kernel.advance_block(
        stores, _counts(intervals[-1], max_step), interval_rows, input_rows,
        _stacked(spacings, (count - 1,), last=False),
        _stacked([one.acceleration for one in moved], (count, 3)),
        _stacked([one.yaws for one in turned], (count,)),
        _stacked([one.poses for one in turned], (count, POSE_COUNT)),
        bool(model.uses("drive")), bool(model.uses("modulation")), heights,
    )  # fmt: skip


def _one_by_one(store: Array, intervals: Array, motion: Inputs, heights: Array) -> None:
    """Computes the heights of the first inputs one by one; changes the model's state array."""
    count = len(heights)
    before = _ZERO if count == 1 else np.concatenate((_ZERO, intervals))
    history = np.empty((count, len(divided(store)[1]), 4))
    kernel.advance_many(
        store, before, motion.acceleration[:count], motion.yaws[:count], motion.poses[:count],
        history, heights,
    )  # fmt: skip


def _distinct(lanes: Sequence[T]) -> tuple[list[T], Counts]:
    """Returns the distinct objects of a list, and the index among them for each entry."""
    rows: dict[int, int] = {}
    which = [rows.setdefault(id(one), len(rows)) for one in lanes]
    return [lanes[which.index(row)] for row in range(len(rows))], np.array(which)


def _stacked(arrays: Sequence[Array], shape: tuple[int, ...], *, last: bool = True) -> Array:
    """Stacks arrays along a new first axis, padded with the last row or zeros to one shape."""
    padded = np.empty((len(arrays), *shape))
    for target, array in zip(padded, arrays, strict=True):
        count = len(array)
        target[:count] = array
        if count < len(target):
            target[count:] = array[-1] if last else 0.0
    return padded

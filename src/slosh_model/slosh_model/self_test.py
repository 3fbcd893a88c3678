"""Compares compiled code with plain Python for the same equations, within milliseconds.

Whatever a cache, a compiler or a processor has made of the kernel: the first time that a process
loads a compiled function, it runs it beside its own source, with every effect, and does not work
where the two differ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from slosh_base.compiled.compilation import EntryPoint, uncompiled
from slosh_base.compiled.compile_cache import cache_folder
from slosh_base.types import Array
from slosh_model import batch_kernel, kernel
from slosh_model.effects.base import Effect
from slosh_model.effects.registry import BY_HOOK, READING_MEMORY_COUNT
from slosh_model.errors import SloshModelError
from slosh_model.layout import divided
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs, effect_parameters, store_of

TOLERANCE, LEAST = 1e-9, 1e-13
"""Relative to the value, and to the largest one beside it: what cancels is known no better. The
elementary functions of two libraries differ by 1e-16."""
SAMPLES = 24
REFERENCES = (Model(Cylinder(0.05, 0.07)), Model(Rectangle(0.07, 0.05, 0.06)))


def compare(entry: EntryPoint, *arguments: Any) -> None:
    """Runs a compiled function and its Python source, and raises an error if they differ.

    Raises:
        SloshModelError: they return, or leave in the arguments, different numbers.
    """
    compiled, plain = (
        _outcome(function, arguments) for function in (entry.load(), uncompiled(entry))
    )
    for one, other in zip(compiled, plain, strict=True):
        _check_equal(entry, one.ravel(), other.ravel())


def reference_models() -> Iterator[Model]:
    """Yields a model of each container shape, without and with all effects on the liquid."""
    for model in REFERENCES:
        every = model
        for effect in _effects("drive", "modulation", "term", "static_share"):
            if effect.fits(model.container.section):
                every = every.with_effect(effect.name, **example_parameters(effect))
        yield model
        yield every


def example_parameters(effect: Effect) -> dict[str, float]:
    """Returns parameters with which an effect changes the result."""
    values = {}
    for parameter in effect.parameters:
        lower, upper = parameter.plausible or (parameter.lower, parameter.upper)
        value = lower + 0.6 * (upper - lower)
        values[parameter.name] = value if parameter.choices is None else parameter.choices[-1]
    return values


@cache
def reference_motion() -> Inputs:
    """Returns a short motion with varying acceleration, tilt, yaw and sample spacing."""
    rows = np.arange(SAMPLES)
    t = 0.003 * rows + 0.001 * np.sin(rows)
    acceleration = np.column_stack([2.0 * np.sin(40 * t), 1.5 - 30.0 * t, np.cos(50 * t) - 0.5])
    attitude = np.column_stack(
        [0.1 * np.sin(30 * t), 0.2 * np.cos(20 * t), 3.0 * t, np.ones(SAMPLES)]
    )
    # Otherwise it would come from the attitude by a part of SciPy, whose import takes longer than
    # all of the test.
    angular_velocity = np.column_stack(
        [6.0 * np.cos(30 * t), -8.0 * np.sin(20 * t), 6.0 - 20.0 * t]
    )
    return Inputs(t, acceleration, attitude, angular_velocity)


def _check_advance_many() -> None:
    motion = reference_motion()
    for model in reference_models():
        store, modes = store_of(model), len(model.mode_constants())
        compare(
            kernel.advance_many, store, np.diff(motion.t, prepend=motion.t[0]),
            motion.acceleration, motion.yaws, motion.poses, np.zeros((SAMPLES, modes, 4)),
            np.zeros((SAMPLES, 2)),
        )  # fmt: skip


def _check_step() -> None:
    for model in reference_models():
        store = store_of(model)
        divided(store)[0]["started"] = 1.0  # else the first sample only begins
        compare(kernel.step, store, 0.002, 1.0, -2.0, 0.5)


def _check_read_many() -> None:
    t = reference_motion().t
    heights = 0.01 * np.column_stack([np.sin(60 * t), np.cos(45 * t)])
    for model, effect in product(REFERENCES, _effects("reading")):
        if not effect.fits(model.container.section):
            continue
        parameters = effect_parameters(
            model.with_effect(effect.name, **example_parameters(effect))
        )
        reaches, cornered = np.array(model.container.reaches), model.container.cornered
        fill, corners = model.container.fill_height, model.container.corners
        for azimuth in (np.nan, 0.4):
            memory, read = np.zeros(max(READING_MEMORY_COUNT, 1)), np.zeros(len(t))
            compare(
                kernel.read_many, t, 0.5, heights, azimuth, reaches, fill, cornered, corners,
                parameters, memory, read,
            )  # fmt: skip


def _check_advance_block() -> None:
    motion, lanes, count = reference_motion(), 2, 7
    once = np.zeros(lanes, dtype=np.int64)
    for model in reference_models():
        stores = np.stack([store_of(model)] * lanes)
        compare(
            batch_kernel.advance_block, stores, np.full(count - 1, 2), once, once,
            *(
                array[np.newaxis].copy()
                for array in (
                    np.diff(motion.t)[: count - 1], motion.acceleration[:count],
                    motion.yaws[:count], motion.poses[:count],
                )
            ),
            bool(model.uses("drive")), bool(model.uses("modulation")),
            np.zeros((lanes, count, 2)),
        )  # fmt: skip


kernel.advance_many.check_with(_check_advance_many)
kernel.step.check_with(_check_step)
kernel.read_many.check_with(_check_read_many)
batch_kernel.advance_block.check_with(_check_advance_block)


def _outcome(function: Callable[..., Any], arguments: Sequence[Any]) -> list[Array]:
    """Returns a function's result, and its array arguments after the call."""
    given = [one.copy() if isinstance(one, np.ndarray) else one for one in arguments]
    with np.errstate(all="ignore"):
        returned = function(*given)
    values = [] if returned is None else [np.asarray(returned, dtype=np.float64)]
    return [*values, *(one for one in given if isinstance(one, np.ndarray))]


def _effects(*hooks: str) -> Iterator[Effect]:
    named = {effect.name: effect for hook in hooks for effect in BY_HOOK[hook]}
    return iter(named.values())


def _check_equal(entry: EntryPoint, compiled: Array, plain: Array) -> None:
    scale = float(np.nanmax(np.abs(plain), initial=1e-12))
    close = np.isclose(compiled, plain, rtol=TOLERANCE, atol=LEAST * scale, equal_nan=True)
    if not close.all():
        at = int(np.argmin(close))
        raise SloshModelError(
            f"self-test: the compiled {entry.name} gives {compiled[at]:.9g} where its "
            f"equations give {plain[at]:.9g}: the compiled code in {cache_folder()} does not "
            "belong to this program; delete that folder and start again"
        )

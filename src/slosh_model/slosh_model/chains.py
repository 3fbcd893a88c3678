"""Chains the compiled hooks of all effects at import; switches say which of them are on.

One compiled function serves every model: a switch in the flat parameter array stands before each
effect's parameters. An effect that is off costs one comparison.
"""

from __future__ import annotations

from typing import Any

from slosh_model.effects.base import compiled
from slosh_model.effects.registry import BY_HOOK, DRIVE_MEMORY, READING_MEMORY, SLOTS


@compiled
def _no_parameters(parameters):  # type: ignore[no-untyped-def]
    return ()


def _reader(first: int, count: int) -> Any:
    """A compiled function that takes `count` parameters from the flat array, as a tuple."""
    if count == 0:
        return _no_parameters
    others = _reader(first + 1, count - 1)

    @compiled
    def read(parameters):  # type: ignore[no-untyped-def]
        return (parameters[first], *others(parameters))

    return read


@compiled
def _no_term(mode, elapsed, q, inputs, parameters):  # type: ignore[no-untyped-def]
    return 0.0, 0.0, 0.0, 0.0, 0.0


def _add_term(before: Any, term: Any, slot: int, read: Any) -> Any:
    @compiled
    def chained(mode, elapsed, q, inputs, parameters):  # type: ignore[no-untyped-def]
        fx, fy, mxx, mxy, myy = before(mode, elapsed, q, inputs, parameters)
        if parameters[slot] == 0.0:
            return fx, fy, mxx, mxy, myy
        gx, gy, nxx, nxy, nyy = term(mode, elapsed, q, inputs, read(parameters))
        return fx + gx, fy + gy, mxx + nxx, mxy + nxy, myy + nyy

    return chained


@compiled
def _same_mode(mode, elapsed, parameters):  # type: ignore[no-untyped-def]
    return mode


def _add_modulation(before: Any, modulation: Any, slot: int, read: Any) -> Any:
    @compiled
    def chained(mode, elapsed, parameters):  # type: ignore[no-untyped-def]
        changed = before(mode, elapsed, parameters)
        if parameters[slot] == 0.0:
            return changed
        return modulation(changed, elapsed, read(parameters))

    return chained


@compiled
def _same_value(dt, value, around, memory, parameters):  # type: ignore[no-untyped-def]
    return value


def _add_change(before: Any, change: Any, slot: int, read: Any, first: int, count: int) -> Any:
    """For the hooks that change a value as it passes, and may remember: drive and reading."""
    end = first + count

    @compiled
    def chained(dt, value, around, memory, parameters):  # type: ignore[no-untyped-def]
        changed = before(dt, value, around, memory, parameters)
        if parameters[slot] == 0.0:
            return changed
        return change(dt, changed, around, memory[first:end], read(parameters))

    return chained


def _chain(hook: str, start: Any, add: Any, memory: Any = None) -> Any:
    total = start
    for effect in BY_HOOK[hook]:
        slot = SLOTS[effect.name]
        read = _reader(slot + 1, len(effect.parameters))
        place = (memory[effect.name], getattr(effect, f"{hook}_memory")) if memory else ()
        total = add(total, getattr(effect, hook), slot, read, *place)
    return total


all_terms = _chain("term", _no_term, _add_term)
all_modulations = _chain("modulation", _same_mode, _add_modulation)
all_drives = _chain("drive", _same_value, _add_change, DRIVE_MEMORY)
all_readings = _chain("reading", _same_value, _add_change, READING_MEMORY)

"""Combines the equations of all modelled effects into compiled functions.

Their source is generated, flat: a switch in the flat parameter array stands before each effect's
parameters, and an effect that is off costs one comparison. So one compiled kernel serves every
model. `print(slosh_model.chains.SOURCE)` shows it.
"""

from __future__ import annotations

import linecache
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from slosh_base.compiled.compilation import compiled
from slosh_model.effects.base import Effect
from slosh_model.effects.registry import BY_HOOK, DRIVE_MEMORY, READING_MEMORY, SLOTS


def compile_generated(
    module: str, source: str, hooks: Iterable[str]
) -> dict[str, Callable[..., Any]]:
    """Compiles generated source code and returns its functions by name.

    Args:
        module: name of the module that generated it.
        source: functions, each of which may call those before it; they call an effect's hook by
            the names of both, joined by an underscore.
        hooks: the hooks that it calls.
    """
    file = f"<{module}, generated>"
    code = compile(source, file, "exec")
    names: dict[str, Any] = {"__name__": module}
    for hook in hooks:
        names |= {f"{effect.name}_{hook}": getattr(effect, hook) for effect in BY_HOOK[hook]}
    # So that an error in it shows the line.
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    exec(code, names)
    # In the source's order: what a function calls is compiled before it.
    functions = {}
    for name in code.co_names:
        names[name] = functions[name] = compiled(names[name])
    return functions


def own_memory(effect: Effect, hook: str, memory: Mapping[str, int], array: str) -> str:
    """Returns the source expression that slices an effect's states from the state array."""
    start, count = memory[effect.name], getattr(effect, f"{hook}_memory")
    return f"{array}{start}:{start + count}]" if count else "()"


def _call(effect: Effect, hook: str, arguments: str) -> str:
    first = SLOTS[effect.name] + 1
    taken = "".join(f"p[{first + k}], " for k in range(len(effect.parameters)))
    return f"{effect.name}_{hook}({arguments}, ({taken}))"


def _switched(effect: Effect, *lines: str) -> list[str]:
    return [
        f"    if p[{SLOTS[effect.name]}] != 0.0:",
        *(f"        {line}" for line in lines),
    ]


def _terms() -> list[str]:
    lines = [
        "def all_terms(mode, elapsed, q, inputs, p):",
        "    fx = fy = mxx = mxy = myy = 0.0",
    ]
    for effect in BY_HOOK["term"]:
        lines += _switched(
            effect,
            f"gx, gy, nxx, nxy, nyy = {_call(effect, 'term', 'mode, elapsed, q, inputs')}",
            "fx, fy, mxx, mxy, myy = fx + gx, fy + gy, mxx + nxx, mxy + nxy, myy + nyy",
        )
    return [*lines, "    return fx, fy, mxx, mxy, myy"]


def _modulations() -> list[str]:
    lines = ["def all_modulations(mode, elapsed, p):"]
    for effect in BY_HOOK["modulation"]:
        lines += _switched(effect, f"mode = {_call(effect, 'modulation', 'mode, elapsed')}")
    return [*lines, "    return mode"]


def _changes(hook: str, around: str, memory: Mapping[str, int]) -> list[str]:
    """Generates source code that applies the effects of one kind to a value in turn."""
    lines = [f"def all_{hook}s(dt, value, {around}, memory, p):"]
    for effect in BY_HOOK[hook]:
        own = own_memory(effect, hook, memory, "memory[")
        lines += _switched(effect, f"value = {_call(effect, hook, f'dt, value, {around}, {own}')}")
    return [*lines, "    return value"]


SOURCE = "\n".join(
    [
        *_terms(),
        "",
        *_modulations(),
        "",
        *_changes("drive", "pose", DRIVE_MEMORY),
        "",
        *_changes("reading", "wall", READING_MEMORY),
        "",
    ]
)
"""What is compiled; p is the flat array of switches and parameters."""

_functions = compile_generated(__name__, SOURCE, ("term", "modulation", "drive", "reading"))
all_terms = _functions["all_terms"]
all_modulations = _functions["all_modulations"]
all_drives = _functions["all_drives"]
all_readings = _functions["all_readings"]

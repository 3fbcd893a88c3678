"""Registry of all effects, and the positions of their parameters in compiled code."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType

from slosh_base.files.nearest import did_you_mean
from slosh_model import effects
from slosh_model.effects.base import Effect
from slosh_model.errors import SloshModelError


def _collect() -> Mapping[str, Effect]:
    found: dict[str, Effect] = {}
    for module in sorted(pkgutil.iter_modules(effects.__path__), key=lambda module: module.name):
        if module.name in ("base", "registry"):
            continue
        effect = importlib.import_module(f"{effects.__name__}.{module.name}").EFFECT
        found[effect.name] = effect
    return MappingProxyType(found)


EFFECTS: Mapping[str, Effect] = _collect()
"""Every effect by name, in alphabetical order."""

COMPILED_HOOKS = ("drive", "modulation", "term", "reading")


def _in_order(hook: str) -> tuple[Effect, ...]:
    having = (effect for effect in EFFECTS.values() if getattr(effect, hook) is not None)
    return tuple(sorted(having, key=lambda effect: (effect.order, effect.name)))


BY_HOOK: Mapping[str, tuple[Effect, ...]] = MappingProxyType(
    {
        hook: _in_order(hook)
        for hook in (*COMPILED_HOOKS, "modes", "height_gain", "static_share", "delay")
    }
)
"""The effects that have a hook, in the order in which they act."""


def _starts(sizes: Mapping[str, int]) -> tuple[Mapping[str, int], int]:
    """Returns the start index of each named part of a flat array, and the array's length."""
    starts: dict[str, int] = {}
    end = 0
    for name, size in sizes.items():
        starts[name] = end
        end += size
    return MappingProxyType(starts), end


# The slot of each compiled effect's switch in the flat parameter array; its parameters follow.
SLOTS, PARAMETER_COUNT = _starts(
    {
        effect.name: 1 + len(effect.parameters)
        for effect in EFFECTS.values()
        if any(getattr(effect, hook) is not None for hook in COMPILED_HOOKS)
    }
)
# Where each effect's memory begins.
DRIVE_MEMORY, DRIVE_MEMORY_COUNT = _starts(
    {effect.name: effect.drive_memory for effect in BY_HOOK["drive"]}
)
READING_MEMORY, READING_MEMORY_COUNT = _starts(
    {effect.name: effect.reading_memory for effect in BY_HOOK["reading"]}
)


def find_effect(name: str) -> Effect:
    """Returns the effect with a name such as `fill_level`.

    Raises:
        SloshModelError: there is none; the text lists the names.
    """
    try:
        return EFFECTS[name]
    except (KeyError, TypeError):
        known = ", ".join(EFFECTS)
        meant = did_you_mean(str(name), EFFECTS)
        raise SloshModelError(
            f"unknown effect {name!r:.60} (known: {known}){meant}", ("name",)
        ) from None

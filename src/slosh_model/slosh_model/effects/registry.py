"""Collects the effects of this folder and lays out their parameters for the compiled kernel."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType

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

# Effects with a term in the equations of motion, each with the slot of its switch in the kernel's
# flat parameter array; its parameters follow the switch.
TERM_SLOTS: Mapping[str, int] = MappingProxyType(
    {
        effect.name: sum(
            1 + len(other.parameters)
            for other in EFFECTS.values()
            if other.term is not None and other.name < effect.name
        )
        for effect in EFFECTS.values()
        if effect.term is not None
    }
)
PARAMETER_COUNT = sum(1 + len(EFFECTS[name].parameters) for name in TERM_SLOTS)


def find_effect(name: str) -> Effect:
    """The effect of that name.

    Raises:
        SloshModelError: there is none; the text lists the names.
    """
    try:
        return EFFECTS[name]
    except (KeyError, TypeError):
        known = ", ".join(EFFECTS)
        raise SloshModelError(f"unknown effect {name!r} (known: {known})") from None

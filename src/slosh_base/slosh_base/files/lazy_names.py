"""Imports a package's public names when they are first used.

A node that imports one module of a package does not load what the others need.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Creates the `__getattr__` function of a package that imports names on demand (PEP 562).

    Args:
        package: its `__name__`.
        modules: by public name the module, in the package, that defines it.
    """

    def load(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{modules[name]}"), name)

    return load

"""Converts Python values to JSON-compatible values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Converts dataclasses to dicts, arrays to lists and NumPy numbers to Python numbers.

    Args:
        value: a dataclass, a mapping, a sequence, an array (N,) of numbers, an enumeration's
            member, a text, a number, a truth value, None, or these within each other.

    Returns:
        what `json.dumps` takes, fields and keys in their order; a number that is not finite, which
        JSON cannot say, is None.
    """
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, np.ndarray):
        return [_known(entry) for entry in value.tolist()]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return _known(value)
    if is_dataclass(value):
        return {entry.name: plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(entry) for entry in value]
    return value


def _known(number: float) -> float | None:
    return number if math.isfinite(number) else None

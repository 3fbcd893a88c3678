"""Tuning numbers with units and meanings; their values come from measurements.

A room keeps them in its module `tuning` as one frozen dataclass, whose only instance is TUNING.
Compiled functions need them under names of their own module, bound when it is imported.
"""

from __future__ import annotations

from dataclasses import field
from typing import TypeVar

Value = TypeVar("Value")


def number(value: Value, unit: str, meaning: str) -> Value:
    """Makes a field of a package's tuning numbers.

    Args:
        value: a number, or a tuple of numbers that are moved together.
        unit: "1" where it has none.
        meaning: what the number is, in one sentence.

    Returns:
        The dataclass field; to the type checker it is its default.
    """
    made: Value = field(default=value, metadata={"unit": unit, "meaning": meaning})
    return made

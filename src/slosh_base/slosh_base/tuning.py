"""Tuning parameters with units and descriptions.

A room keeps them in its module `tuning` as one frozen dataclass, whose only instance is TUNING.
Compiled functions need them under names of their own module, bound when it is imported.
"""

from __future__ import annotations

from dataclasses import field
from typing import TypeVar

Value = TypeVar("Value")


def number(value: Value, unit: str, meaning: str) -> Value:
    """Creates a dataclass field for a tuning parameter, with unit and description.

    Args:
        value: a number, or a tuple of numbers that are moved together.
        unit: "1" where it has none.
        meaning: what the number is, in one sentence.

    Returns:
        The dataclass field; to the type checker it is its default.
    """
    made: Value = field(default=value, metadata={"unit": unit, "meaning": meaning})
    return made

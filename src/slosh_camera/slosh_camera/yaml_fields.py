"""Checked values of a YAML document; every error names the file and the key."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from slosh_camera.errors import SloshCameraError


def mapping(value: object, source: str, key: str) -> Mapping[str, Any]:
    """The value, refused where it is not a mapping."""
    if not isinstance(value, Mapping):
        raise SloshCameraError(f"{source}: {key}: is not a mapping of keys to values")
    return value


def check_keys(
    block: Mapping[str, Any],
    required: tuple[str, ...],
    optional: tuple[str, ...],
    source: str,
    prefix: str,
) -> None:
    """Refuse unknown and missing keys; `prefix` is the block's own place in the file."""
    for key in block:
        if key not in required and key not in optional:
            known = ", ".join((*required, *optional))
            raise SloshCameraError(f"{source}: {prefix}{key}: unknown key, known are {known}")
    for key in required:
        if key not in block:
            raise SloshCameraError(f"{source}: {prefix}{key}: is missing")


def number(value: object, source: str, key: str) -> float:
    """The value as a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SloshCameraError(f"{source}: {key}: {value!r} is not a number")
    if not math.isfinite(value):
        raise SloshCameraError(f"{source}: {key}: {value} is not a finite number")
    return float(value)


def integer(block: Mapping[str, Any], key: str, source: str, prefix: str) -> int:
    """The block's value as a whole number."""
    value = block[key]
    if isinstance(value, bool) or not isinstance(value, int):
        raise SloshCameraError(f"{source}: {prefix}{key}: {value!r} is not a whole number")
    return value


def numbers(
    block: Mapping[str, Any], key: str, count: int, source: str, prefix: str
) -> list[float]:
    """The block's value as a list of so many finite numbers."""
    values = block[key]
    if not isinstance(values, list) or len(values) != count:
        raise SloshCameraError(f"{source}: {prefix}{key}: must be a list of {count} numbers")
    return [number(value, source, f"{prefix}{key}") for value in values]

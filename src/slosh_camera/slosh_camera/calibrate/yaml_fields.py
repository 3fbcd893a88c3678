"""Checked values of a YAML document; every error names the file and the key."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from slosh_camera.errors import SloshCameraError
from slosh_model.bounded_yaml import load_yaml


def read_text(path: str | Path) -> str:
    """The text of a file."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "is not UTF-8 text"
        raise SloshCameraError(f"{path}: cannot be read: {reason}") from error


def parse_document(text: str, source: str) -> Mapping[str, Any]:
    """The keys and values of a YAML text."""
    try:
        document = load_yaml(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" at line {mark.line + 1}" if mark is not None else ""
        raise SloshCameraError(f"{source}: is not valid YAML{where}") from error
    return mapping(document, source, "the file")


def camera_name(root: Mapping[str, Any], source: str) -> str:
    """Name of the camera that a file describes."""
    name = root.get("camera_name", "camera")
    if not isinstance(name, str):
        raise SloshCameraError(f"{source}: camera_name: {name!r} is not a text")
    return name


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

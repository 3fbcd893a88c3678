"""Checked values of a YAML document; errors name file, line and key."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError, YamlError
from slosh_base.files.file_version import CAMERA, parse_versioned
from slosh_base.files.nearest import did_you_mean
from slosh_base.files.yaml_document import LONGEST, YamlDocument, shown
from slosh_camera.errors import SloshCameraError


def read_file(path: str | Path) -> str:
    """Reads a text file and returns its content."""
    try:
        return read_text(path, LONGEST)
    except TextFileError as error:
        raise SloshCameraError(f"{path}: cannot be read: {error.reason}") from error


def parse_mapping(text: str, source: str) -> YamlDocument:
    """Parses a camera's file of any version, whose value is a mapping."""
    try:
        document = parse_versioned(text, source, CAMERA)
    except YamlError as error:
        raise SloshCameraError(str(error)) from error
    if not isinstance(document.value, Mapping):
        raise SloshCameraError(f"{source}: the file: is not a mapping of keys to values")
    return document


def camera_name(document: YamlDocument) -> str:
    """Returns the camera's name in a calibration file."""
    name = document.value.get("camera_name", "camera")
    if not isinstance(name, str):
        raise SloshCameraError(f"{place(document, 'camera_name')}: {shown(name)} is not a text")
    return name


def place(source: YamlDocument, prefix: str, key: str = "") -> str:
    """Returns file, line and key of a YAML value as text, for error messages."""
    above = prefix.rstrip(".").split(".") if prefix else []
    return source.at(*above, *([key] if key else []))


def mapping(value: object, source: YamlDocument, key: str) -> Mapping[str, Any]:
    """Returns a YAML value if it is a mapping, otherwise raises an error."""
    if not isinstance(value, Mapping):
        raise SloshCameraError(f"{place(source, key)}: is not a mapping of keys to values")
    return value


def check_keys(
    block: Mapping[str, Any],
    required: tuple[str, ...],
    optional: tuple[str, ...],
    source: YamlDocument,
    prefix: str,
) -> None:
    """Raises an error for unknown or missing keys of a YAML block."""
    for key in block:
        if key not in required and key not in optional:
            known = ", ".join((*required, *optional))
            meant = did_you_mean(key, (*required, *optional))
            raise SloshCameraError(
                f"{place(source, prefix, key)}: unknown key, known are {known}{meant}"
            )
    for key in required:
        if key not in block:
            raise SloshCameraError(f"{place(source, prefix, key)}: is missing")


def number(value: object, source: YamlDocument, key: str) -> float:
    """Returns a YAML value as a finite number, otherwise raises an error."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SloshCameraError(f"{place(source, key)}: {shown(value)} is not a number")
    try:
        finite = math.isfinite(value)
    except OverflowError:
        finite = False
    if not finite:
        raise SloshCameraError(f"{place(source, key)}: {shown(value)} is not a finite number")
    return float(value)


def integer(block: Mapping[str, Any], key: str, source: YamlDocument, prefix: str) -> int:
    """Returns the value of a YAML key as an integer, otherwise raises an error."""
    value = block[key]
    if isinstance(value, bool) or not isinstance(value, int):
        raise SloshCameraError(
            f"{place(source, prefix, key)}: {shown(value)} is not a whole number"
        )
    return value


def numbers(
    block: Mapping[str, Any], key: str, count: int, source: YamlDocument, prefix: str
) -> list[float]:
    """Returns the value of a YAML key as a list of finite numbers of a given length."""
    values = block[key]
    if not isinstance(values, list) or len(values) != count:
        raise SloshCameraError(f"{place(source, prefix, key)}: must be a list of {count} numbers")
    return [number(value, source, f"{prefix}{key}") for value in values]

"""Reads intrinsic camera parameters from a ROS camera_calibration file or a camera.yaml."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError, YamlError
from slosh_base.files.file_version import CAMERA, parse_versioned
from slosh_base.files.nearest import did_you_mean
from slosh_base.files.yaml_document import LONGEST, YamlDocument, shown
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera, camera_from_info
from slosh_camera.optics.lens import EQUIDISTANT, PLUMB_BOB, lens_parameters

_NEEDED = ("image_width", "image_height", "camera_matrix", "distortion_coefficients")


@dataclass(frozen=True, slots=True, eq=False)
class KnownCamera:
    """Camera and container that are known before the pose is calibrated.

    Attributes:
        container: numbers of the container by their key in camera.yaml; empty: none are there.
    """

    camera: PinholeCamera
    name: str
    container: Mapping[str, float]


def read_known_camera(path: str | Path) -> KnownCamera:
    """Reads the camera entries, and the container entries if present, from a file.

    Args:
        path: file of ROS camera_calibration, or a camera.yaml.

    Raises:
        SloshCameraError: the file cannot be read or a value cannot be used; the message names
            the file and the key.
    """
    source = parse_mapping(read_file(path), str(path))
    root = source.value
    for key in _NEEDED:
        if key not in root:
            raise SloshCameraError(f"{place(source, key)}: is missing")
    name = camera_name(source)
    return KnownCamera(camera_of(root, source), name, _container(root, source))


def camera_of_view(width: int, height: int, field_of_view: float) -> PinholeCamera:
    """Creates a distortion-free camera from its horizontal field of view.

    Args:
        width: image width [px].
        height: image height [px].
        field_of_view: angle between the image's left and right edge [rad].

    Returns:
        The camera; its principal point is the image's centre.

    Raises:
        SloshCameraError: there is no such angle.
    """
    if not 0.0 < field_of_view < np.pi:
        raise SloshCameraError(
            f"field of view: {np.rad2deg(field_of_view):g} deg, must be between 0 and 180"
        )
    focal = 0.5 * width / float(np.tan(0.5 * field_of_view))
    return PinholeCamera(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))


def camera_of(root: Mapping[str, Any], source: YamlDocument) -> PinholeCamera:
    """Creates the camera from a YAML mapping with the keys of ROS camera_calibration.

    Raises:
        SloshCameraError: a value cannot be used; the message names the file and the key.
    """
    width = integer(root, "image_width", source, "")
    height = integer(root, "image_height", source, "")
    matrix, lens = (_data(root, key, source) for key in _NEEDED[2:])
    try:
        return camera_from_info(matrix, lens, width, height, _lens_model(root, source, lens))
    except SloshCameraError as error:
        raise _placed(source, error) from error


def lens_block(camera: PinholeCamera) -> dict[str, Any]:
    """Returns the lens distortion of a camera as keys of its YAML file."""
    lens = [float(value) for value in camera.distortion]
    return {
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": {"rows": 1, "cols": len(lens), "data": lens},
    }


def _placed(source: YamlDocument, error: SloshCameraError) -> SloshCameraError:
    """Returns a copy of an error with file name and key at the start of its message."""
    if str(error).startswith(f"{source.source}:"):
        return error
    return SloshCameraError(f"{source.where(str(error).partition(':')[0])}: {error}")


def _lens_model(root: Mapping[str, Any], source: YamlDocument, lens: list[float]) -> str:
    """Returns the name of the lens model in a camera file."""
    named = [root[key] for key in ("distortion_model", "camera_model") if root.get(key)]
    models = {
        lens_parameters(str(model), lens)[0]
        for model in named
        if str(model).lower() not in ("pinhole", "perspective")
    }
    if len(models) > 1:
        raise SloshCameraError(
            f"{place(source, 'camera_model')}: {shown(root['camera_model'])} contradicts "
            f"distortion_model {shown(root['distortion_model'])}; a fisheye lens is {EQUIDISTANT}"
        )
    return models.pop() if models else PLUMB_BOB


def _data(root: Mapping[str, Any], key: str, source: YamlDocument) -> list[float]:
    block = mapping(root[key], source, key)
    values = block.get("data")
    if not isinstance(values, list):
        raise SloshCameraError(f"{place(source, f'{key}.data')}: is missing")
    count = len(values)
    if "rows" in block and "cols" in block:
        count = integer(block, "rows", source, f"{key}.") * integer(
            block, "cols", source, f"{key}."
        )
    return numbers(block, "data", count, source, f"{key}.")


def _container(root: Mapping[str, Any], source: YamlDocument) -> dict[str, float]:
    if root.get("container") is None:
        return {}
    block = mapping(root["container"], source, "container")
    if block.get("shape", "cylinder") != "cylinder":
        return {}
    return {
        str(key): number(value, source, f"container.{key}")
        for key, value in block.items()
        if key != "shape"
    }


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

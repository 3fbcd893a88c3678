"""Intrinsic parameters from a file of ROS camera_calibration, or from a camera.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slosh_camera.calibrate.yaml_fields import (
    camera_name,
    integer,
    mapping,
    number,
    numbers,
    parse_mapping,
    place,
    read_file,
)
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PLUMB_BOB, PinholeCamera, camera_from_info
from slosh_files.yaml_document import YamlDocument, shown

_NEEDED = ("image_width", "image_height", "camera_matrix", "distortion_coefficients")


@dataclass(frozen=True, slots=True, eq=False)
class KnownCamera:
    """What a file tells before a calibration.

    Attributes:
        camera: intrinsic parameters.
        name: of the camera.
        container: numbers of the container by their key in camera.yaml; empty: none are there.
    """

    camera: PinholeCamera
    name: str
    container: Mapping[str, float]


def read_known_camera(path: str | Path) -> KnownCamera:
    """Read the camera's keys, and the container's where there are any; others are left alone.

    Args:
        path: file of ROS camera_calibration, or a camera.yaml.

    Returns:
        What it tells.

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
    return KnownCamera(_camera(root, source), name, _container(root, source))


def camera_of_view(width: int, height: int, field_of_view: float) -> PinholeCamera:
    """A camera without distortion by its horizontal field of view.

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


def _camera(root: Mapping[str, Any], source: YamlDocument) -> PinholeCamera:
    model = root.get("distortion_model", PLUMB_BOB)
    width = integer(root, "image_width", source, "")
    height = integer(root, "image_height", source, "")
    matrix, lens = (_data(root, key, source) for key in _NEEDED[2:])
    try:
        return camera_from_info(matrix, lens, width, height, str(model))
    except SloshCameraError as error:
        where = source.where(str(error).partition(":")[0])
        raise SloshCameraError(f"{where}: {error}") from error


def _data(root: Mapping[str, Any], key: str, source: YamlDocument) -> list[float]:
    block = mapping(root[key], source, key)
    values = block.get("data")
    if not isinstance(values, list):
        raise SloshCameraError(f"{place(source, f'{key}.data')}: is missing")
    return numbers(block, "data", len(values), source, f"{key}.")


def _container(root: Mapping[str, Any], source: YamlDocument) -> dict[str, float]:
    if root.get("container") is None:
        return {}
    block = mapping(root["container"], source, "container")
    if block.get("shape", "cylinder") != "cylinder":
        raise SloshCameraError(
            f"{place(source, 'container.shape')}: {shown(block['shape'])}, but a cylinder is "
            "needed here"
        )
    return {
        str(key): number(value, source, f"container.{key}")
        for key, value in block.items()
        if key != "shape"
    }

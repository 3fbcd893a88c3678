"""Reads and writes camera.yaml: camera, container, pose, image region and detection settings.

The camera's part has the keys of ROS camera_calibration files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from slosh_base.files.file_version import CAMERA
from slosh_base.files.yaml_document import YamlDocument, format_yaml, shown
from slosh_camera.calibrate.intrinsics import (
    camera_name,
    camera_of,
    check_keys,
    integer,
    lens_block,
    mapping,
    number,
    numbers,
    parse_mapping,
    place,
    read_file,
)
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.box import Box, BoxView
from slosh_camera.optics.calibration import AnyCalibration, Calibration, SideCalibration
from slosh_camera.optics.camera import Pose
from slosh_camera.optics.container import WALL
from slosh_camera.optics.cup import Cup, CupView
from slosh_camera.optics.round_body import RoundBody, RoundView
from slosh_camera.settings import DetectionSettings, LiquidContrast, RegionOfInterest
from slosh_model.containers import SHAPES
from slosh_model.errors import SloshModelError
from slosh_model.model_text import container_section, parse_container
from slosh_model.shapes.round_cups import Frustum

_CYLINDER, _RECTANGLE = "cylinder", "rectangle"
_CONTAINER_KEYS = {
    _CYLINDER: (("radius", "fill_height"), WALL),
    _RECTANGLE: (("width", "fill_height"), ("depth", *WALL)),
}
_SIDE, _THROUGH = "side", "through_wall"
_DIGITS = 12
"""Of a length [m] that is computed from others."""
_REGION_KEYS = ("x_offset", "y_offset", "width", "height")
_DETECTION_KEYS = tuple(entry.name for entry in fields(DetectionSettings))
_REQUIRED = (
    "image_width",
    "image_height",
    "camera_matrix",
    "distortion_coefficients",
    "container",
    "pose",
)
# ROS writes the last two; they describe rectification, which is not used here.
_OPTIONAL = (
    "camera_name",
    "camera_model",
    "distortion_model",
    "region_of_interest",
    "detection",
    "still_image",
    "view",
    "rectification_matrix",
    "projection_matrix",
)

_T = TypeVar("_T")


def read_calibration(path: str | Path) -> Calibration:
    """Reads the calibration file of a camera that views a cylinder or frustum through its wall.

    Returns:
        The calibration, of a cylinder or a frustum.

    Raises:
        SloshCameraError: the file cannot be read, a value cannot be used or the container is seen
            from the side; the message names the file and the key.
    """
    return _of_cylinder(read_any_calibration(path), str(path))


def read_any_calibration(path: str | Path) -> AnyCalibration:
    """Reads the calibration file of a view through the wall or of a side view.

    Raises:
        SloshCameraError: the file cannot be read or a value cannot be used; the message names
            the file and the key.
    """
    return parse_any_calibration(read_file(path), str(path), Path(path).resolve().parent)


def parse_calibration(
    text: str, source: str = "camera.yaml", folder: Path | None = None
) -> Calibration:
    """Parses the calibration of a camera that views a cylinder or frustum through its wall.

    Args:
        text: YAML.
        source: name of the file in error messages.
        folder: where relative paths in the text start; None: they are kept as they are.

    Raises:
        SloshCameraError: as read_calibration.
    """
    return _of_cylinder(parse_any_calibration(text, source, folder), source)


def parse_any_calibration(
    text: str, source: str = "camera.yaml", folder: Path | None = None
) -> AnyCalibration:
    """Parses the calibration of a view through the wall or of a side view.

    Args:
        text: YAML.
        source: name of the file in error messages.
        folder: where relative paths in the text start; None: they are kept as they are.

    Raises:
        SloshCameraError: as read_any_calibration.
    """
    document = parse_mapping(text, source)
    return _calibration(document.value, document, folder)


def format_calibration(calibration: AnyCalibration) -> str:
    """Formats a calibration as YAML text, which parse_any_calibration reads without loss."""
    camera, pose = calibration.view.camera, calibration.view.pose
    container = _container_block(calibration)
    document: dict[str, Any] = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": calibration.camera_name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": camera.matrix.ravel().tolist()},
        **lens_block(camera),
        "container": container,
        **_view_block(calibration),
        "pose": {
            "rotation": pose.rotation.ravel().tolist(),
            "translation": pose.translation.tolist(),
        },
    }
    if calibration.region is not None:
        document["region_of_interest"] = {
            key: getattr(calibration.region, key) for key in _REGION_KEYS
        }
    settings = {
        key: getattr(calibration.detection, key)
        for key in _DETECTION_KEYS
        if getattr(calibration.detection, key) != getattr(DetectionSettings(), key)
    }
    if settings:
        if "liquid" in settings:
            settings["liquid"] = settings["liquid"].value
        document["detection"] = settings
    if calibration.still_image is not None:
        document["still_image"] = str(calibration.still_image)
    document = CAMERA.versioned(document)
    return format_yaml(document, sort_keys=False, default_flow_style=None, width=99)


def _container_block(calibration: AnyCalibration) -> dict[str, Any]:
    """Returns the container's entries of the calibration file, without unknown values."""
    view = calibration.view
    if isinstance(view, RoundView):
        box = view.box
        wall = {key: getattr(box, key) for key in WALL if key != "rim_height"}
        return container_section(view.body) | wall
    if isinstance(calibration, SideCalibration):
        shape, holder = _RECTANGLE, asdict(calibration.view.box)
    elif calibration.view.cup.taper:
        return _frustum_block(calibration.view.cup)
    else:
        shape, holder = _CYLINDER, asdict(calibration.view.cup)
    required, optional = _CONTAINER_KEYS[shape]
    known = {key: holder[key] for key in (*required, *optional) if holder[key] is not None}
    return {"shape": shape, **known}


def _view_block(calibration: AnyCalibration) -> dict[str, Any]:
    """Returns the file's entry `view` for a frustum seen through its wall; otherwise empty."""
    through = isinstance(calibration, Calibration) and calibration.view.cup.taper
    return {"view": _THROUGH} if through else {}


def _frustum_block(cup: Cup) -> dict[str, Any]:
    """Returns the keys of a frustum in the container block of the camera file."""
    top = cup.radius if cup.rim_level is None else cup.rim_level
    lengths = {
        "bottom_radius": float(cup.radius_at(-cup.fill_height)),
        "top_radius": float(cup.radius_at(top)),
        "height": cup.fill_height + top,
        "fill_height": cup.fill_height,
        "wall_thickness": cup.wall_thickness,
    }
    rounded = {key: round(value, _DIGITS) for key, value in lengths.items()}
    return {
        "shape": Frustum.shape, **rounded, "wall_refractive_index": cup.wall_refractive_index
    }  # fmt: skip


def _calibration(
    root: Mapping[str, Any], source: YamlDocument, folder: Path | None
) -> AnyCalibration:
    _check_calibrated(root, source)
    check_keys(root, _REQUIRED, _OPTIONAL, source, "")
    camera = camera_of(root, source)
    container = _built(source, "container.", lambda: _container(root, source, folder))
    pose = _built(source, "pose.", lambda: _pose(root, source))
    region = _built(source, "", lambda: _region(root, source))
    detection = _built(source, "detection.", lambda: _detection(root, source))
    name = camera_name(source)
    still = _still_image(root, source, folder)
    if isinstance(container, RoundBody):
        side = _built(source, "", lambda: RoundView(camera, pose, container))
        return _built(source, "", lambda: SideCalibration(side, name, region, detection, still))
    if isinstance(container, Box):
        face = _built(source, "", lambda: BoxView(camera, pose, container))
        return _built(source, "", lambda: SideCalibration(face, name, region, detection, still))
    view = _built(source, "", lambda: CupView(camera, pose, container))
    return _built(source, "", lambda: Calibration(view, name, region, detection, still))


def _check_calibrated(root: Mapping[str, Any], source: YamlDocument) -> None:
    """Raises SloshCameraError for a file without a pose; the message says how to obtain one."""
    if "pose" not in root and "container" in root and "camera_matrix" in root:
        raise SloshCameraError(
            f"{place(source, 'pose')}: is missing: the camera is not calibrated yet; run "
            "`slosh intrinsics` for the camera's matrix, then `slosh calibrate` with an image "
            "of the liquid at rest for the pose"
        )


def _container(root: Mapping[str, Any], source: YamlDocument, folder: Path | None) -> Cup | Box:
    block = mapping(root["container"], source, "container")
    shape = block.get("shape", _CYLINDER)
    through = _is_through_wall(root, source)
    if isinstance(shape, str) and shape in SHAPES and shape not in _CONTAINER_KEYS:
        return _body(block, source, folder, through)
    if not isinstance(shape, str) or shape not in _CONTAINER_KEYS:
        raise SloshCameraError(
            f"{place(source, 'container.shape')}: {shown(shape)}, must be "
            f"{' or '.join(_CONTAINER_KEYS)}, or a body of revolution"
        )
    if through and shape == _RECTANGLE:
        raise SloshCameraError(f"{place(source, 'view')}: {_THROUGH}, not of a {shape}")
    required, optional = _CONTAINER_KEYS[shape]
    check_keys(block, required, (*optional, "shape"), source, "container.")
    values = {
        key: number(block[key], source, f"container.{key}") for key in block if key != "shape"
    }
    return Cup(**values) if shape == _CYLINDER else Box(**values)


def _is_through_wall(root: Mapping[str, Any], source: YamlDocument) -> bool:
    """Returns whether the file's key `view` says that the camera looks through the wall."""
    view = root.get("view")
    if view not in (None, _SIDE, _THROUGH):
        raise SloshCameraError(
            f"{place(source, 'view')}: {shown(view)}, must be {_SIDE} or {_THROUGH}"
        )
    return bool(view == _THROUGH)


def _body(
    block: Mapping[str, Any], source: YamlDocument, folder: Path | None, through: bool
) -> RoundBody | Cup:
    """Reads the container's contour from the calibration file, with its wall."""
    wall = {
        key: number(block[key], source, f"container.{key}")
        for key in WALL
        if key in block and key != "rim_height"
    }
    section = {key: value for key, value in block.items() if key not in wall}
    try:
        container = parse_container(section, folder or Path())
    except SloshModelError as error:
        raise SloshCameraError(f"{place(source, 'container')}: {error}") from None
    return Cup.of(container, **wall) if through else RoundBody.of(container, **wall)


def _pose(root: Mapping[str, Any], source: YamlDocument) -> Pose:
    block = mapping(root["pose"], source, "pose")
    check_keys(block, ("rotation", "translation"), (), source, "pose.")
    rotation = numbers(block, "rotation", 9, source, "pose.")
    translation = numbers(block, "translation", 3, source, "pose.")
    return Pose(np.reshape(rotation, (3, 3)), np.array(translation))


def _region(root: Mapping[str, Any], source: YamlDocument) -> RegionOfInterest | None:
    if root.get("region_of_interest") is None:
        return None
    block = mapping(root["region_of_interest"], source, "region_of_interest")
    check_keys(block, _REGION_KEYS, (), source, "region_of_interest.")
    return RegionOfInterest(
        **{key: integer(block, key, source, "region_of_interest.") for key in _REGION_KEYS}
    )


def _detection(root: Mapping[str, Any], source: YamlDocument) -> DetectionSettings:
    if root.get("detection") is None:
        return DetectionSettings()
    block = mapping(root["detection"], source, "detection")
    check_keys(block, (), _DETECTION_KEYS, source, "detection.")
    values: dict[str, Any] = {}
    for key, value in block.items():
        if key == "liquid":
            values[key] = _liquid(value, source)
        else:
            values[key] = number(value, source, f"detection.{key}")
    return DetectionSettings(**values)


def _still_image(
    root: Mapping[str, Any], source: YamlDocument, folder: Path | None
) -> Path | None:
    value = root.get("still_image")
    if value is None:
        return None
    if not isinstance(value, str) or not value or "\0" in value:
        raise SloshCameraError(
            f"{place(source, 'still_image')}: {shown(value)} is not the path of an image"
        )
    return Path(value) if folder is None else folder / value


def _liquid(value: object, source: YamlDocument) -> LiquidContrast:
    try:
        return LiquidContrast(value)
    except ValueError:
        names = " or ".join(liquid.value for liquid in LiquidContrast)
        raise SloshCameraError(
            f"{place(source, 'detection.liquid')}: {shown(value)}, must be {names}"
        ) from None


def _of_cylinder(calibration: AnyCalibration, source: str) -> Calibration:
    if isinstance(calibration, SideCalibration):
        raise SloshCameraError(
            f"{source}: container.shape: this is a side view, but a view through the wall of a "
            f"{_CYLINDER} or a {Frustum.shape} is needed here"
        )
    return calibration


def _built(source: YamlDocument, prefix: str, build: Callable[[], _T]) -> _T:
    """Builds an object from an entry of the calibration file; errors name file and key."""
    try:
        return build()
    except SloshCameraError as error:
        if str(error).startswith(f"{source.source}:"):
            raise
        where = source.where(*f"{prefix}{error}".partition(":")[0].split("."))
        raise SloshCameraError(f"{where}: {prefix}{error}") from error

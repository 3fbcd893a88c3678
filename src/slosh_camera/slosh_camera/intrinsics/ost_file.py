"""The file of a camera's intrinsic parameters, with the keys of ROS camera_calibration."""

from __future__ import annotations

import numpy as np

from slosh_base.files.yaml_text import format_yaml
from slosh_camera.calibrate.intrinsics import lens_block
from slosh_camera.optics.camera import PinholeCamera


def format_camera(camera: PinholeCamera, name: str) -> str:
    """Text of an `ost.yaml`; `read_known_camera` reads it back to the same camera."""
    projection = np.column_stack((camera.matrix, np.zeros(3)))
    document = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": camera.matrix.ravel().tolist()},
        **lens_block(camera),
        "rectification_matrix": {"rows": 3, "cols": 3, "data": np.eye(3).ravel().tolist()},
        "projection_matrix": {"rows": 3, "cols": 4, "data": projection.ravel().tolist()},
    }
    return format_yaml(document, sort_keys=False, default_flow_style=None, width=99)

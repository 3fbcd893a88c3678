"""Edges of a cylindrical container in the image: sides, floor and rim."""

from __future__ import annotations

import numpy as np

from slosh_camera.images.still_edges import PLACES, Edge, along_end, along_side
from slosh_camera.optics.cup import CupView


def outer_edges(view: CupView) -> list[Edge]:
    """Projects the container's sides, its floor and, if known, its rim into the image.

    Args:
        view: the container as the camera sees it.
    """
    cup, centre = view.cup, view.pose.camera_centre
    outer = cup.radius + cup.wall_thickness
    front = view.camera_azimuth
    half = float(np.arccos(outer / np.hypot(centre[0], centre[1])))
    levels, middle = along_side(cup.fill_height), along_end(half)
    around = np.ones(PLACES)
    lines = [((front + side) * around, levels, True) for side in (half, -half)]
    lines.append((front + middle, -cup.fill_height * around, False))
    if cup.rim_level is not None:
        rim = cup.rim_level * around
        lines += [(front + turn + middle, rim, False) for turn in (0.0, np.pi)]
    edges = []
    for azimuth, level, is_side in lines:
        points = np.column_stack((outer * np.cos(azimuth), outer * np.sin(azimuth), level))
        edges.append(Edge(view.project(points), is_side))
    return edges

"""Edges of a round container in the image: sides, floor and rim."""

from __future__ import annotations

import numpy as np

from slosh_camera.images.still_edges import PLACES, Edge, along_end, along_side
from slosh_camera.optics.cup import CupView


def outer_edges(view: CupView) -> list[Edge]:
    """Projects the container's sides, its floor and, if known, its rim into the image.

    Args:
        view: the container as the camera sees it.
    """
    cup, front, half = view.cup, view.camera_azimuth, view.side_half_angle
    levels, middle = along_side(cup.fill_height), along_end(half)
    around = np.ones(PLACES)
    lines = [((front + side) * around, levels, True) for side in (half, -half)]
    lines.append((front + middle, -cup.fill_height * around, False))
    if cup.rim_level is not None:
        rim = cup.rim_level * around
        lines += [(front + turn + middle, rim, False) for turn in (0.0, np.pi)]
    edges = []
    for azimuth, level, is_side in lines:
        edges.append(Edge(view.project(cup.outer_points(azimuth, level)), is_side))
    return edges

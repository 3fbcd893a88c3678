"""Image edges of a container's front face: sides, floor and rim."""

from __future__ import annotations

from slosh_camera.images.still_edges import Edge, along_end, along_side
from slosh_camera.optics.box import BoxView


def outer_edges(view: BoxView) -> list[Edge]:
    """Projects the face's two sides, its floor and, if known, its rim into the image.

    Args:
        view: the container as the camera sees it.
    """
    box = view.box
    half = 0.5 * box.width
    levels, middle = along_side(box.fill_height), along_end(half)
    edges = [Edge(view.project_face(side, levels), True) for side in (-half, half)]
    edges.append(Edge(view.project_face(middle, -box.fill_height), False))
    if box.rim_level is not None:
        edges.append(Edge(view.project_face(middle, box.rim_level), False))
    return edges

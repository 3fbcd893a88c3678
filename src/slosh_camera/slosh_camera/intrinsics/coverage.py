"""Which poses of the board are missing in the pictures of a camera."""

from __future__ import annotations

import numpy as np

from slosh_camera.intrinsics.solve import IntrinsicFit

GRID = 3
_ROWS, _COLUMNS = ("top", "middle", "bottom"), ("left", "middle", "right")
# A tilt that separates focal length from distance [deg]; a board that is near enough, as a part
# of the image's width or height; a number of pictures in which one more changes little.
_LEAST_TILT = 15.0
_NEAR = 0.5
_ENOUGH = 10


def seen_cells(fit: IntrinsicFit) -> frozenset[tuple[int, int]]:
    """Row and column of those ninths of the image in which corners were seen."""
    width, height = fit.camera.size
    pixels = np.concatenate([view.view.pixels for view in fit.views])
    cells = np.floor((pixels + 0.5) / (width, height) * GRID).astype(int).clip(0, GRID - 1)
    return frozenset((int(row), int(column)) for column, row in cells)


def missing_poses(fit: IntrinsicFit) -> list[str]:
    """What further pictures should show, in words; empty: nothing."""
    seen = seen_cells(fit)
    unseen = [
        f"{row} {column}" if row != column else "middle"
        for i, row in enumerate(_ROWS)
        for k, column in enumerate(_COLUMNS)
        if (i, k) not in seen
    ]
    missing = [f"the board in the image's {', '.join(unseen)}"] if unseen else []
    missing += [
        f"the board tilted, its {edge} edge nearer by {_LEAST_TILT:.0f} deg or more"
        for edge, tilt in _tilts(fit).items()
        if tilt < _LEAST_TILT
    ]
    if _largest(fit) < _NEAR:
        missing.append(f"the board from near, over more than {_NEAR:.0%} of the image's width")
    if len(fit.views) < _ENOUGH:
        missing.append(f"more pictures: {len(fit.views)} are used, {_ENOUGH} are enough")
    return missing


def _tilts(fit: IntrinsicFit) -> dict[str, float]:
    """Largest tilt by the edge that is nearer to the camera [deg]."""
    normals = np.array([view.rotation[:, 2] for view in fit.views])
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    turn, lean = np.rad2deg(np.arctan2(normals[:, :2], normals[:, 2:])).T
    return {"left": -turn.min(), "right": turn.max(), "top": -lean.min(), "bottom": lean.max()}


def _largest(fit: IntrinsicFit) -> float:
    """Largest part of the image's width or height that a board's corners span."""
    return max(
        float(np.max(np.ptp(view.view.pixels, axis=0) / fit.camera.size)) for view in fit.views
    )

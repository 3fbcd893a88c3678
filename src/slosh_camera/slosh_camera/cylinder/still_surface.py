"""Detects the liquid at rest and checks that normal measurement would also detect it.

A clear liquid shows what is behind it. Then an edge of the background may end what is taken for
liquid more clearly than the surface does, in the still image as in those to come. So the still
image is measured like any other: what does not find the liquid at rest there, without being told,
finds no wave either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.surface_choice import SurfaceChooser
from slosh_camera.cylinder.surface_comparison import SurfaceComparison
from slosh_camera.cylinder.surface_evidence import SurfaceFit, Unrolled, WallPoints
from slosh_camera.cylinder.surface_modes import SHAPES
from slosh_camera.cylinder.surface_prior import Prior
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.errors import SloshCameraError

FloatArray = NDArray[np.float64]

REMEDY = "dye the liquid"
"""What was found to help."""


@dataclass(frozen=True, slots=True, eq=False)
class StillSurface:
    """The free surface that was detected in an image of the liquid at rest.

    Attributes:
        view: the picture, with what the free surface looks like in it.
        points: of the front line.
        fit: the level surface.
        body: rows that show liquid.
        zero: (SHAPES,) heights of the surface at rest [m]: its level and its tilt.
    """

    view: Unrolled
    points: WallPoints
    fit: SurfaceFit
    body: slice
    zero: FloatArray


def find_still_surface(
    chooser: SurfaceChooser,
    seen: Sequence[tuple[Unrolled, WallPoints, slice]],
    prior: Prior,
    nearest: FloatArray,
) -> StillSurface | None:
    """Finds the most plausible level surface in an image of the liquid at rest.

    Args:
        chooser: fits it.
        seen: pictures, points of the front line and rows of liquid, the usual ones first.
        prior: of the heights of liquid at rest.
        nearest: (2,) the place of the wall that is nearest to the camera, from the axis [m].

    Returns:
        The surface; None where there is no picture.
    """
    found: list[tuple[float, StillSurface]] = []
    for view, points, body in seen:
        fit, plausible = chooser.fit_still(view, points, prior)
        tone = chooser.surface_tone(view, _at_rest(fit, nearest))
        view = replace(view, surface=tone)
        if np.isfinite(tone):
            # Fitted anew: how the surface looks tells which edges end it.
            again, likely = chooser.fit_still(view, points, prior)
            if view.scatters or not chooser.is_suspect(again):
                fit, plausible = again, likely
        still = StillSurface(view, points, fit, body, _at_rest(fit, nearest))
        found.append((plausible - (TUNING.second_body if found else 0.0), still))
    return max(found, key=lambda entry: entry[0])[1] if found else None


def is_found_again(still: StillSurface, comparison: SurfaceComparison) -> bool:
    """Whether normal measurement of the liquid at rest clearly detects the level surface.

    Args:
        still: the liquid at rest, as it was found by what is known of it.
        comparison: of surfaces in images to come.

    Raises:
        SloshCameraError: it shows another surface.
    """
    choice = comparison.choose(comparison.sighting(((still.view, still.points),)), None)
    if not choice.believed:
        return False
    height = float(np.hypot(*comparison.first(choice.candidate.fit)))
    if height > TUNING.still_wave:
        raise SloshCameraError(
            f"still image: the liquid at rest would be measured as a wave of {1e3 * height:.0f} "
            f"mm, by an edge that is seen through it; {REMEDY}"
        )
    return not choice.doubtful


def _at_rest(fit: SurfaceFit, nearest: FloatArray) -> FloatArray:
    """Returns level and tilt (SHAPES,) [m] of a surface fitted to liquid at rest.

    What bends a front line by some tenths of a millimetre, an uneven wall or what mirrors in the
    liquid's end, reads as a tilt towards the camera of a millimetre at the rear wall. So where
    that line is all that is seen, the calibration knows the tilt better.
    """
    heights, covariance = fit.heights[:3].copy(), fit.covariance[:3, :3]
    if (
        np.count_nonzero(fit.upper_weight > TUNING.inlier)
        < TUNING.least_upper * fit.upper_weight.size
    ):
        radius = float(np.hypot(*nearest))
        towards = np.concatenate(([0.0], nearest / radius))
        spread = covariance @ towards
        variance = float(towards @ spread) + (TUNING.tilt_towards * radius) ** 2
        heights -= spread * float(towards @ heights) / variance
    return np.concatenate((heights, np.zeros(SHAPES - 3)))

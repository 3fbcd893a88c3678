"""Tuning parameters for estimating intrinsic parameters."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class IntrinsicsTuning:
    """Requirements on the images of a board."""

    # drawing.py
    least_tilt: float = number(15.0, "deg", "tilt that separates focal length from distance")
    near: float = number(0.5, "1", "part of the image's width or height that a near board has")
    enough: int = number(10, "1", "number of pictures after which one more changes little")
    # solve.py
    outlier: float = number(3.0, "1", "ratio to the median error of a blurred picture")
    outlier_least: float = number(0.5, "px", "least error of such a picture")
    worst_rms: float = number(3.0, "px", "largest error of a solution")
    worst_focal: float = number(0.05, "1", "largest relative error of the focal length")
    # views.py
    least_views: int = number(4, "1", "fewest pictures")
    least_corners: int = number(6, "1", "fewest corners in a picture")
    same_pose: float = number(0.004, "width", "motion of the corners of one pose")
    flat: float = number(0.02, "1", "relative spread of corners on one line")


TUNING = IntrinsicsTuning()

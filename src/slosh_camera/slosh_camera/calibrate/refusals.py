"""Reasons to reject a pose: too little is visible, or another pose fits equally well."""

from __future__ import annotations

import numpy as np

from slosh_camera.calibrate.curves import (
    EMPTY,
    WETTED,
    Curve,
    curve_points,
    sides_of,
    view_at,
    width_of,
)
from slosh_camera.calibrate.fit import PlaceFit
from slosh_camera.calibrate.level import LevelLines
from slosh_camera.calibrate.still_fit import StillFit, height_shift
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import CupView, Wall


def find_fault(fit: PlaceFit, answer: StillFit, sure: bool, level_shows: bool) -> str:
    """Returns the reason why a fitted pose is unusable; empty if it is usable.

    Args:
        fit: of the container's curves.
        answer: what follows from it.
        sure: the distance was told, so that it is the container.
        level_shows: `shows_level` of the image, or the level was told.
    """
    for curve in WETTED:
        share = np.nan_to_num(fit.share(curve))
        if share < TUNING.least_share:
            return (
                f"the {curve.value} of the liquid is visible on {100.0 * share:.0f} % of its "
                "length; the whole container must be in the image, sharp and unobstructed"
            )
    level = np.nanmax([fit.share(Curve.FRONT), fit.share(Curve.REAR), 0.0])
    if max(level, min(fit.share(curve) for curve in WETTED)) < TUNING.clear_share:
        return (
            f"the sides and the still level are visible on {100.0 * level:.0f} % of their "
            "length at most; use a plain background, dyed liquid or a clean glass, or --scale "
            "with two clicks"
        )
    if level < TUNING.least_share:
        return (
            f"the still level is visible on {100.0 * level:.0f} % of its length; the liquid "
            "must be at rest and differ from what is above it, or click on the level: --level "
            "U V"
        )
    if not answer.residual <= TUNING.lost_residual:
        return (
            f"the container's edges are {answer.residual:.2f} px rms from the best pose, more "
            f"than {TUNING.lost_residual:g}; check the intrinsic parameters and the dimensions, "
            "or take the picture before a plain background"
        )
    if not sure and not is_corroborated(fit):
        return (
            f"two sides and a level {1e3 * fit.place.distance:.0f} mm away fit, but neither "
            "the glass above the level nor the floor is where it should be: this is another "
            "object, such as a label or a reflection; take the picture from elsewhere or "
            "before a plain background, or give --distance"
        )
    against = _speaks_against(fit, answer, level_shows)
    if not sure and len(against) >= TUNING.too_much:
        return (
            f"the best fit, {1e3 * fit.place.distance:.0f} mm away, is poor: "
            f"{', '.join(against)}; take the picture before a plain background, with less on "
            "the glass, or give --level U V, a click on the still level, or --distance"
        )
    worst = max(answer.height_stddev.values())
    if not worst <= TUNING.lost_height:
        return (
            f"it determines heights to {1e3 * worst:.1f} mm only, {1e3 * TUNING.lost_height:g} mm "
            "are needed; the container must fill more of the image, and a camera a little above "
            "the level sees both of its lines"
        )
    return ""


def level_fault(fit: PlaceFit, levels: LevelLines, told: tuple[float, float] | None) -> str:
    """Returns why the liquid level is uncertain; empty if it is certain or the user gave it.

    Args:
        fit: of the container's curves.
        levels: the lines on its front wall that may be the level.
        told: a pixel on the level; None: not told.
    """
    if told is not None:
        view = view_at(fit.camera, fit.cup, fit.place)
        line = curve_points(view, Curve.FRONT, 81)
        away = abs(float(np.interp(told[0], line[:, 0], line[:, 1])) - told[1])
        if away <= TUNING.click_reach:
            return ""
        return (
            f"the level that fits is {away:.0f} px away from the pixel of --level; click on "
            "the contact line of the level, between the container's sides"
        )
    if levels.rival is not None:
        apart = 1e3 * levels.rival.height
        return (
            f"two levels are possible, {abs(apart):.0f} mm apart: the other is "
            f"{'above' if apart > 0.0 else 'below'} the best fit; printed rings, seams and "
            "the edge of a foot look similar; click on the still level's contact line: --level "
            "U V"
        )
    if levels.below_floor >= TUNING.below:
        return (
            "the container's sides go on below the line that fits the still level by more than "
            "the fill height, as they do below a rim or a printed ring; check the fill height, or "
            "click on the still level's contact line: --level U V"
        )
    if levels.own.strength < TUNING.least_level:
        return (
            "the line that fits the still level best does not run from side to side as the "
            "level of a liquid does; click on the still level's contact line: --level U V"
        )
    return ""


def is_corroborated(fit: PlaceFit) -> bool:
    """Whether edges confirm curves of the container that were not used in the fit.

    A wall of no thickness shows no glass. Where one line of the level is all that is seen, more of
    it must show: two sides and a line are soon found in other things.
    """
    if fit.cup.wall_thickness == 0.0:
        return True
    glass = [fit.share(curve) for curve in EMPTY]
    floor = fit.share(Curve.BASE)
    known = [share for share in glass if np.isfinite(share)]
    if not known and not np.isfinite(floor):
        return True
    both = all(fit.share(curve) >= TUNING.least_share for curve in (Curve.FRONT, Curve.REAR))
    needed = TUNING.least_glass if both else TUNING.glass_alone
    return max(known, default=0.0) >= needed or floor >= TUNING.least_share


def _speaks_against(fit: PlaceFit, answer: StillFit, level_shows: bool) -> list[str]:
    """Lists contradictions between pose and image, each of which alone is only a warning."""
    level = [fit.share(curve) for curve in (Curve.FRONT, Curve.REAR)]
    reasons = {
        "the floor is not where it should be": fit.share(Curve.BASE) < TUNING.least_share,
        "a side is partly hidden": any(fit.share(curve) < TUNING.clear_share for curve in WETTED),
        "a line of the level is partly hidden": not level_shows
        and any(share < TUNING.clear_share for share in level),
        f"edges lie {answer.residual:.2f} px off": answer.residual > TUNING.most_residual,
    }
    return [reason for reason, holds in reasons.items() if holds]


def check_rival(view: CupView, best: PlaceFit, rival: PlaceFit) -> None:
    """Raises SloshCameraError if two different poses explain the image equally well.

    Raises:
        SloshCameraError: `rival` moves heights that `view`, the view of `best`, would tell.
    """
    if (
        rival.score < TUNING.rival_score * best.score
        or rival.rms > TUNING.rival_residual * best.rms
    ):
        return
    try:
        other = view_at(rival.camera, rival.cup, rival.place)
    except SloshCameraError:
        return
    shift = height_shift(other, view, Wall.FRONT)
    # A ray that misses the other container's wall gives no number.
    if not np.max(np.abs(shift)) <= TUNING.same_height:
        poses = " or ".join(
            f"{1e3 * fit.place.distance:.0f} mm from the container and "
            f"{1e3 * fit.place.height:.0f} mm above the still level"
            for fit in (best, rival)
        )
        raise SloshCameraError(
            f"still image: two poses fit equally well, {poses}; choose one with --distance, or "
            "take a picture with the floor in it, a board, or fewer other objects"
        )


def check_enclosed(best: PlaceFit, fits: list[PlaceFit]) -> None:
    """Raises SloshCameraError if the fitted shape may be only a part of a larger container.

    The other one need not be good enough to be used: of clear glass with droplets little is seen.

    Raises:
        SloshCameraError: one of the fits encloses the best.
    """
    for wide in fits:
        if wide.score >= TUNING.enclosing * best.score and _encloses(wide, best):
            raise SloshCameraError(
                f"still image: the best fit, {1e3 * best.place.distance:.0f} mm away, lies "
                "between the sides of what may be the container, "
                f"{1e3 * wide.place.distance:.0f} mm away: it may be a label, a reflection, or "
                "another glass seen through it; choose one with --distance, or remove what is on "
                "the container and behind it"
            )


def _encloses(wide: PlaceFit, narrow: PlaceFit) -> bool:
    """Whether a fitted container is clearly wider than a second one and encloses its centre."""
    outer, inner = (view_at(fit.camera, fit.cup, fit.place) for fit in (wide, narrow))
    if width_of(outer) < TUNING.wider * width_of(inner):
        return False
    (left, right), ends = sides_of(outer), sides_of(inner)
    middle = 0.5 * (ends[0][0] + ends[1][0])
    return bool(left[0] < middle < right[0])

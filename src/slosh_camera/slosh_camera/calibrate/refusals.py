"""Why a pose is refused: too little of it shows, or another one explains the image as well."""

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
from slosh_camera.calibrate.fit import CLICK_REACH, Fit
from slosh_camera.calibrate.level import LEAST_LEVEL, Levels
from slosh_camera.calibrate.still_fit import StillFit, height_shift
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import CupView, Wall

# Residual from which on a fit is refused [px].
_LOST_RESIDUAL = 0.8
# Standard error of a height from which on it is [m].
_LOST_HEIGHT = 3e-3
_LEAST_SHARE = 0.5
CLEAR_SHARE = 0.7
"""A curve that shows on less of its length may be another thing's edge."""
# A second place counts as another answer where it moves a height by more than this [m], and as a
# rival where its score comes so close to the best and its residual is at most so much larger.
_SAME = 1e-3
_RIVAL, _RIVAL_RESIDUAL = 0.93, 1.5
# What stands between the sides of a container so many times as wide is rather seen through it, or
# stuck to it, though it scores higher: unless the wide one scores less than this part.
_WIDER, _ENCLOSING = 1.25, 0.6
LEAST_FLOOR = 0.5
"""What shows of the floor where it is where it should be."""
MAX_RESIDUAL = 0.6
"""Residual up to which a fit is believed without a warning [px]."""
# What shows of the empty glass where the container is what it seems: where both lines of the level
# are seen, and where one is.
_LEAST_GLASS, _GLASS_ALONE = 0.35, 0.5
# So many things that are off at once are too many, see `_speaks_against`.
_TOO_MUCH = 3


def find_fault(fit: Fit, answer: StillFit, sure: bool, level_shows: bool) -> str:
    """Why a fit is not to be used; empty: it may be.

    Args:
        fit: of the container's curves.
        answer: what follows from it.
        sure: the distance was told, so that it is the container.
        level_shows: `shows_level` of the image, or the level was told.
    """
    for curve in WETTED:
        share = np.nan_to_num(fit.share(curve))
        if share < _LEAST_SHARE:
            return (
                f"the {curve.value} of the liquid is visible on {100.0 * share:.0f} % of its "
                "length; the whole container must be in the image, sharp and unobstructed"
            )
    level = np.nanmax([fit.share(Curve.FRONT), fit.share(Curve.REAR), 0.0])
    if max(level, min(fit.share(curve) for curve in WETTED)) < CLEAR_SHARE:
        return (
            f"the sides and the still level are visible on {100.0 * level:.0f} % of their "
            "length at most; use a plain background, dyed liquid or a clean glass, or --scale "
            "with two clicks"
        )
    if level < _LEAST_SHARE:
        return (
            f"the still level is visible on {100.0 * level:.0f} % of its length; the liquid "
            "must be at rest and differ from what is above it, or click on the level: --level "
            "U V"
        )
    if not answer.residual <= _LOST_RESIDUAL:
        return (
            f"the container's edges are {answer.residual:.2f} px rms from the best pose, more "
            f"than {_LOST_RESIDUAL:g}; check the intrinsic parameters and the dimensions, or "
            "take the picture before a plain background"
        )
    if not sure and not is_corroborated(fit):
        return (
            f"two sides and a level {1e3 * fit.place.distance:.0f} mm away fit, but neither "
            "the glass above the level nor the floor is where it should be: this is another "
            "object, such as a label or a reflection; take the picture from elsewhere or "
            "before a plain background, or give --distance"
        )
    against = _speaks_against(fit, answer, level_shows)
    if not sure and len(against) >= _TOO_MUCH:
        return (
            f"the best fit, {1e3 * fit.place.distance:.0f} mm away, is poor: "
            f"{', '.join(against)}; take the picture before a plain background, with less on "
            "the glass, or give --level U V, a click on the still level, or --distance"
        )
    worst = max(answer.height_stddev.values())
    if not worst <= _LOST_HEIGHT:
        return (
            f"it determines heights to {1e3 * worst:.1f} mm only, {1e3 * _LOST_HEIGHT:g} mm are "
            "needed; the container must fill more of the image, and a camera a little above the "
            "level sees both of its lines"
        )
    return ""


def level_fault(fit: Fit, levels: Levels, told: tuple[float, float] | None) -> str:
    """Why the still level is not certain; empty: it is, or it was told.

    Args:
        fit: of the container's curves.
        levels: the lines on its front wall that may be the level.
        told: a pixel on the level; None: not told.
    """
    if told is not None:
        view = view_at(fit.camera, fit.cup, fit.place)
        line = curve_points(view, Curve.FRONT, 81)
        away = abs(float(np.interp(told[0], line[:, 0], line[:, 1])) - told[1])
        if away <= CLICK_REACH:
            return ""
        return (
            f"the level that fits is {away:.0f} px away from the pixel of --level; click on "
            "the front line of the level, between the container's sides"
        )
    if levels.rival is not None:
        apart = 1e3 * levels.rival.height
        return (
            f"two levels are possible, {abs(apart):.0f} mm apart: the other is "
            f"{'above' if apart > 0.0 else 'below'} the best fit; printed rings, seams and "
            "the edge of a foot look similar; click on the still level's front line: --level "
            "U V"
        )
    if levels.own.strength < LEAST_LEVEL:
        return (
            "the line that fits the still level best does not run from side to side as the "
            "level of a liquid does; click on the still level's front line: --level U V"
        )
    return ""


def is_corroborated(fit: Fit) -> bool:
    """Whether a curve that the pose does not rest on is where it should be, if it can be seen.

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
    both = all(fit.share(curve) >= _LEAST_SHARE for curve in (Curve.FRONT, Curve.REAR))
    needed = _LEAST_GLASS if both else _GLASS_ALONE
    return max(known, default=0.0) >= needed or floor >= LEAST_FLOOR


def _speaks_against(fit: Fit, answer: StillFit, level_shows: bool) -> list[str]:
    """What is off that alone is a matter of a warning, in words."""
    level = [fit.share(curve) for curve in (Curve.FRONT, Curve.REAR)]
    reasons = {
        "the floor is not where it should be": fit.share(Curve.BASE) < LEAST_FLOOR,
        "a side is partly hidden": any(fit.share(curve) < CLEAR_SHARE for curve in WETTED),
        "a line of the level is partly hidden": not level_shows
        and any(share < CLEAR_SHARE for share in level),
        f"edges lie {answer.residual:.2f} px off": answer.residual > MAX_RESIDUAL,
    }
    return [reason for reason, holds in reasons.items() if holds]


def check_rival(view: CupView, best: Fit, rival: Fit) -> None:
    """Refuse where two different poses explain the image equally well.

    Raises:
        SloshCameraError: `rival` moves heights that `view`, the view of `best`, would tell.
    """
    if rival.score < _RIVAL * best.score or rival.rms > _RIVAL_RESIDUAL * best.rms:
        return
    try:
        other = view_at(rival.camera, rival.cup, rival.place)
    except SloshCameraError:
        return
    shift = height_shift(other, view, Wall.FRONT)
    # A ray that misses the other container's wall gives no number.
    if not np.max(np.abs(shift)) <= _SAME:
        poses = " or ".join(
            f"{1e3 * fit.place.distance:.0f} mm from the container and "
            f"{1e3 * fit.place.height:.0f} mm above the still level"
            for fit in (best, rival)
        )
        raise SloshCameraError(
            f"still image: two poses fit equally well, {poses}; choose one with --distance, or "
            "take a picture with the floor in it, a board, or fewer other objects"
        )


def check_enclosed(best: Fit, fits: list[Fit]) -> None:
    """Refuse what stands between the sides of another container: a part of that, or behind it.

    The other one need not be good enough to be used: of clear glass with droplets little is seen.

    Raises:
        SloshCameraError: one of the fits encloses the best.
    """
    for wide in fits:
        if wide.score >= _ENCLOSING * best.score and _encloses(wide, best):
            raise SloshCameraError(
                f"still image: the best fit, {1e3 * best.place.distance:.0f} mm away, lies "
                "between the sides of what may be the container, "
                f"{1e3 * wide.place.distance:.0f} mm away: it may be a label, a reflection, or "
                "another glass seen through it; choose one with --distance, or remove what is on "
                "the container and behind it"
            )


def _encloses(wide: Fit, narrow: Fit) -> bool:
    """Whether a fit is clearly wider than another one and has its middle between its sides."""
    outer, inner = (view_at(fit.camera, fit.cup, fit.place) for fit in (wide, narrow))
    if width_of(outer) < _WIDER * width_of(inner):
        return False
    (left, right), ends = sides_of(outer), sides_of(inner)
    middle = 0.5 * (ends[0][0] + ends[1][0])
    return bool(left[0] < middle < right[0])

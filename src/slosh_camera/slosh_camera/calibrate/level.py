"""Decides whether a line across a container is the liquid's level or, e.g., a printed ring.

Printed rings, scales and seams lie where a level could. They differ from it: liquid changes what
is below the line, a ring looks the same below and above; a level runs from side to side, a scale
mostly does not. A level has two lines, and which of them is the front one depends on the camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import WETTED, Curve, look_for_curves, view_at, width_of
from slosh_camera.calibrate.edges import EdgeImage
from slosh_camera.calibrate.fit import PlaceFit, fit_place
from slosh_camera.calibrate.pose import CameraPlace, GivenView, place_of
from slosh_camera.calibrate.strip import (
    Strip,
    lasting_changes,
    level_like,
    misplaced_colours,
    own_lines,
    rear_above,
    steps_along,
    unevenness_below,
    unrolled,
    walls_below,
)
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import Cup, CupView, Wall

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Level:
    """A line on the container that may be the liquid's level.

    Attributes:
        height: above the level of the pose [m].
        row: v of the middle of its contact line [px].
        strength: how much it looks like a level, 0 to 1.
    """

    height: float
    row: float
    strength: float


@dataclass(frozen=True, slots=True)
class LevelLines:
    """Lines on the container's front wall that may be the liquid's level.

    Attributes:
        own: the one of the pose.
        rival: another one that may be it as well; None: there is none.
        below_floor: share of the sides that shows below the floor, 0 to 1: those of a rim or a
            ring above the level go on there.
    """

    own: Level
    rival: Level | None
    below_floor: float

    @property
    def shows(self) -> bool:
        """Whether the liquid level is clearly visible and no other line could be the level."""
        return self.rival is None and self.own.strength >= TUNING.shows


def levels_of(edges: EdgeImage, fit: PlaceFit) -> LevelLines:
    """Returns the line at a pose's liquid level, and the strongest other line like a level.

    Args:
        edges: the image, without distortion.
        fit: a pose in it.
    """
    view = view_at(fit.camera, fit.cup, fit.place)
    top = fit.cup.rim_level if fit.cup.rim_level is not None else fit.cup.fill_height
    strip = unrolled(edges, view, -fit.cup.fill_height, top)
    line = own_lines(edges, view, strip)
    change = lasting_changes(strip, fit.cup, fit.place)
    here = np.abs(strip.heights) <= TUNING.strip_slack * (strip.heights[1] - strip.heights[0])
    rear = rear_above(fit.cup, fit.place, 0.0)
    apart = TUNING.rival_apart * fit.cup.radius
    other = (strip.heights < min(rear, 0.0) - apart) | (strip.heights > max(rear, 0.0) + apart)
    # The rim and the floor's edge are lines, too, and lie where the dimensions put them.
    ends = TUNING.ends * fit.cup.radius
    other &= strip.heights > strip.heights[0] + ends
    if fit.cup.rim_level is not None:
        other &= strip.heights < fit.cup.rim_level - ends
    walled = (
        walls_below(edges, view, strip.heights, 0.0, fit.cup.fill_height) >= TUNING.least_share
    )
    other &= walled
    largest = float(np.max(change, initial=0.0, where=here | other))
    strength = level_like(line, change, largest)
    middle = strip.pixels.shape[1] // 2

    def level(index: int) -> Level:
        row = float(strip.pixels[index, middle, 1])
        return Level(float(strip.heights[index]), row, float(strength[index]))

    own = level(int(np.argmax(np.where(here, strength, -1.0))))
    open_to_doubt = np.where(other, strength, 0.0)
    best = int(np.argmax(open_to_doubt))
    rivals = open_to_doubt[best] > 0.0 and open_to_doubt[best] >= TUNING.rival * own.strength
    fill = fit.cup.fill_height
    stretch = (TUNING.below_to - TUNING.below_from) * fill
    going_on = walls_below(edges, view, strip.heights, TUNING.below_from * fill, stretch)
    return LevelLines(own, level(best) if rivals else None, float(np.min(going_on[here])))


def check_line(edges: EdgeImage, view: CupView) -> None:
    """Raises an error unless the line of a pose is the liquid's level, and no other line may be.

    Liquid begins at its level: the colour changes there once, all along the line, and what is
    below is even. A printed ring has one colour above and below; foam is uneven.

    Args:
        edges: the image, without distortion.
        view: of the pose, upright.

    Raises:
        SloshCameraError: the line is a ring's or foam's, or another line is more like a level; the
            text says which, and asks for a click.
    """
    cup, radius = view.cup, view.cup.radius
    top = cup.rim_level if cup.rim_level is not None else cup.fill_height + 2.0 * radius
    strip = unrolled(edges, view, -cup.fill_height - radius, top)
    heights, step = strip.heights, steps_along(strip, radius)
    middle = int(np.argmin(np.abs(heights)))
    if np.max(step[max(middle - 1, 0) : middle + 2]) < TUNING.least_step:
        raise asked("the line that fits best has one colour above and below, as a ring has")
    if unevenness_below(strip, radius) > TUNING.uneven:
        raise asked("what is below the line that fits best is uneven, as foam is")
    amiss = misplaced_colours(strip, cup, place_of(view.pose)[0])
    own = float(np.min(amiss[np.abs(heights) <= 0.5 * TUNING.far_level]))
    other = int(np.argmin(np.where(np.abs(heights) > TUNING.far_level, amiss, np.inf)))
    if amiss[other] < own - max(TUNING.better_parted, TUNING.part_better * own):
        raise asked(f"the colours part {_apart(heights[other])} the best fit")
    evidence = own_lines(edges, view, strip) * step
    here = np.abs(heights) <= TUNING.line_slack * radius
    possible = ~here & _may_be_level(edges, view, strip, top)
    # Close above a level a ring hides a part of the change of colour that the level makes.
    close = (heights < -TUNING.far_level) & (heights > -TUNING.close_below * radius)
    needed = np.where(close, TUNING.better_close, TUNING.better) * float(np.max(evidence[here]))
    surplus = np.where(possible, evidence - needed, 0.0)
    other = int(np.argmax(surplus))
    if surplus[other] > 0.0:
        raise asked(f"a line {_apart(heights[other])} the best fit parts two colours more")


def check_exchange(edges: EdgeImage, view: CupView, line: Curve) -> None:
    """Raises an error if the level's line may as well be its other one, front or rear.

    Front and rear line are two arcs of one ellipse. From above the front one is the lower and bows
    down, from below the upper and bows up, as the rear one does from above. Where one arc is all
    that is seen, the sides tell on which side of the level the camera is: both are fitted.

    Args:
        edges: the image, without distortion.
        view: of the pose, upright.
        line: the one that is seen.

    Raises:
        SloshCameraError: the other fits about as well, with another level; the text asks for a
            click.
    """
    place, _ = place_of(view.pose)
    told = GivenView(view.camera, view.cup)
    reach = max(TUNING.exchange_reach * width_of(view), TUNING.least_exchange_reach)
    seen = look_for_curves(edges, view, reach)
    kept = tuple(one for one in seen if one.curve in (*WETTED, line))
    other = Curve.REAR if line is Curve.FRONT else Curve.FRONT
    renamed = tuple(replace(one, curve=other) if one.curve is line else one for one in kept)
    sign = 1.0 if other is Curve.REAR else -1.0
    heights = {abs(place.height), max(abs(place.height), TUNING.other_height * place.distance)}
    starts = [_from_other_side(place, view.cup, sign * height) for height in sorted(heights)]
    own = fit_place(edges, told, place, found=kept)
    tries = [fit_place(edges, told, start, found=renamed) for start in starts]
    # From below the rear line is hidden behind the liquid.
    rivals = [one for one in tries if one is not None and sign * one.place.height > 0.0]
    rival = min(rivals, key=_misfit, default=None)
    # A meniscus has several edges on the front wall, and the front line is between them.
    moved = _level_of(own, view) if own is not None and line is Curve.REAR else 0.0
    if abs(moved) > TUNING.same_height:
        raise asked(f"the rear line alone puts the level {_apart(moved)} the best fit")
    if rival is None or abs(height := _level_of(rival, view)) <= TUNING.same_height:
        return
    most = TUNING.exchanged * _misfit(own) if own is not None else np.inf
    if _misfit(rival) <= max(most, TUNING.least_error):
        name = other.value.removeprefix("still level, ")
        raise asked(f"the line may as well be the {name} one of a level {_apart(height)} it")


def _level_of(fit: PlaceFit, view: CupView) -> float:
    """Returns the height of a fit's front line on the front wall of a view [m]; NaN: not on it."""
    own = view_at(fit.camera, fit.cup, fit.place)
    front = own.project_wall(own.camera_azimuth, 0.0, Wall.FRONT)
    return float(view.on_wall(front, Wall.FRONT)[1][0])


def _from_other_side(place: CameraPlace, cup: Cup, height: float) -> CameraPlace:
    """Returns a camera at another height [m] that sees one line of the level where it was."""
    reach = float(np.copysign(cup.radius, height))
    was = np.arctan2(place.height, place.distance - reach)
    becomes = np.arctan2(height, place.distance + reach)
    return replace(place, height=height, pitch=place.pitch + float(becomes - was))


def _misfit(fit: PlaceFit) -> float:
    """Returns the mean distance of edges from their curves, strays as inliers at most [px]."""
    return float(np.mean(np.minimum(np.abs(np.concatenate(fit.residuals)), TUNING.inlier)))


def _apart(height: float) -> str:
    return f"{abs(1e3 * height):.0f} mm {'above' if height > 0.0 else 'below'}"


def _may_be_level(edges: EdgeImage, view: CupView, strip: Strip, top: float) -> BoolArray:
    """Returns at which heights (N,) the sides show above and below as a level's do."""
    cup, radius, heights = view.cup, view.cup.radius, strip.heights
    ends = TUNING.ends * radius
    possible = (heights > ends - cup.fill_height) & (heights < top - ends)
    low, high = (share * radius for share in TUNING.glass)
    shortest = TUNING.least_glass_height * radius
    for start, depth in ((0.0, shortest), (0.0, cup.fill_height), (-high, high - low)):
        possible &= walls_below(edges, view, heights, start, depth) >= TUNING.may_be_walled
    return possible


def asked(what: str) -> SloshCameraError:
    """Returns the error that asks for a click on the level, for a reason."""
    return SloshCameraError(
        f"still image: the level is in doubt: {what}; printed rings, seams and foam look like a "
        "level; click on the still level's contact line: --level U V"
    )

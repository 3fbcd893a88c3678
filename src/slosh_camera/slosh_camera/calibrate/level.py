"""Decides whether a line across a container is the liquid's level or, e.g., a printed ring.

Printed rings, scales and seams lie where a level could. They differ from it: liquid changes what
is below the line, a ring looks the same below and above; a level runs from side to side, a scale
mostly does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slosh_camera.calibrate.curves import view_at
from slosh_camera.calibrate.edges import EdgeImage
from slosh_camera.calibrate.fit import PlaceFit
from slosh_camera.calibrate.pose import CameraPlace
from slosh_camera.calibrate.strip import (
    lasting_changes,
    level_like,
    own_lines,
    rear_above,
    unrolled,
    walls_below,
)
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import CupView


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


def check_parting(edges: EdgeImage, view: CupView, place: CameraPlace) -> None:
    """Raises an error if another line parts two colours more than the level of a pose does.

    A ring, a scale and foam can be clearer lines than the level of a pale liquid, but what is
    above and below them looks the same. The sides must show above the line, and below it to the
    floor.

    Args:
        edges: the image, without distortion.
        view: of the pose, upright.
        place: of the camera.

    Raises:
        SloshCameraError: one does; the text gives its height.
    """
    cup, radius = view.cup, view.cup.radius
    ends, apart = TUNING.ends * radius, TUNING.rival_apart * radius
    top = cup.rim_level if cup.rim_level is not None else cup.fill_height + 2.0 * radius
    strip = unrolled(edges, view, -cup.fill_height - radius, top)
    heights = strip.heights
    change = np.nan_to_num(lasting_changes(strip, cup, place), posinf=0.0)
    rear = rear_above(cup, place, 0.0)
    here = np.abs(heights) <= TUNING.parting_slack * radius
    elsewhere = (heights < min(rear, 0.0) - apart) | (heights > max(rear, 0.0) + apart)
    elsewhere &= (heights > ends - cup.fill_height) & (heights < top - ends)
    elsewhere &= own_lines(edges, view, strip) >= TUNING.parting_line
    for depth in (TUNING.least_glass_height * radius, cup.fill_height):
        elsewhere &= walls_below(edges, view, heights, 0.0, depth) >= TUNING.may_be_walled
    low, high = (share * radius for share in TUNING.glass)
    above = walls_below(edges, view, heights, -high, high - low)
    elsewhere &= above >= TUNING.may_be_walled
    most = np.where(elsewhere, change, 0.0)
    other = int(np.argmax(most))
    own = float(np.max(change, initial=0.0, where=here))
    if most[other] > max(TUNING.parts_more * own, TUNING.full_step):
        side = "above" if heights[other] > 0.0 else "below"
        raise SloshCameraError(
            f"still image: two levels are possible, {abs(1e3 * heights[other]):.0f} mm apart: the "
            f"other is {side} the best fit and parts two colours more; printed rings, seams and "
            "foam look like a level; click on the still level's contact line: --level U V"
        )

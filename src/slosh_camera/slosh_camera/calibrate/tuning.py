"""Tuning parameters for estimating a camera's pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class CalibrateTuning:
    """Assumptions of the pose estimation about edges, containers and images.

    Outline, level and strip were set on every second of a set of photographs of graduated
    cylinders, `line_slack` to `exchanged` on drawn glasses of even number by
    `validation/studies/printed_levels.py`, the others on rendered still images of even number by
    `validation/studies/calibration_accuracy.py`. The unit "radius" is the container's; "strength"
    is that of the clearest line.
    """

    # board.py
    board_residual: float = number(1.5, "px", "largest residual of a board")
    board_error: float = number(0.1, "px", "least error of a corner")
    board_flatness: float = number(0.002, "rad", "error of a board's inclination")
    board_level: float = number(0.001, "m", "error of the depth of liquid and floor")
    # curves.py
    curve_spacing: float = number(2.0, "px", "distance of samples along a curve")
    shine: float = number(0.47, "px", "shift of a shiny edge, 0.46 to 0.56 by Fresnel's formulas")
    separate_lines: float = number(6.0, "px", "distance below which front and rear line are one")
    # pose.py
    least_told: float = number(0.05, "1", "least part of a given length")
    # edges.py
    smoothing: float = number(1.0, "px", "smoothing before derivatives, against blocks of JPEG")
    half_edge: float = number(8.0, "grey", "single step that counts as half an edge")
    # fit.py
    least_error: float = number(0.15, "px", "least error of a sample")
    most_error: float = number(1.0, "px", "largest error of a sample")
    shared_by: float = number(5.0, "1", "number of neighbours that share an error")
    side_error: float = number(0.3, "px", "shift of a side by reflections")
    side_turn: float = number(0.2, "px", "turn of a side by reflections")
    level_error: float = number(0.12, "px", "shift of the level by the meniscus")
    base_error: float = number(0.0015, "m", "error of floor and fill height")
    merged_error: float = number(0.3, "1", "error of lines seen as one, as part of their distance")
    claimed: float = number(2.0, "1", "factor on the curves' own errors in the stated errors")
    click_reach: float = number(4.0, "px", "largest error of a click on the still level")
    click_error: float = number(1.5, "px", "standard deviation of such a click")
    inlier: float = number(1.5, "px", "largest error of an edge after the fit")
    fit_chance: float = number(6.0, "px", "score by chance, times the width")
    two_lines: float = number(0.15, "1", "bonus for a second line of the level")
    # level.py
    rival: float = number(0.8, "1", "strength of another line that is a rival")
    rival_apart: float = number(0.15, "radius", "distance of a rival")
    least_level: float = number(0.25, "1", "least strength of a level")
    shows: float = number(0.6, "1", "least strength of a line that shows partly")
    ends: float = number(0.3, "radius", "distance from rim and floor of another level")
    line_slack: float = number(0.04, "radius", "largest error of the level's place")
    least_step: float = number(2.5, "grey", "change of colour along the whole level")
    uneven: float = number(9.0, "grey", "difference of columns below a level without foam")
    other_colour: float = number(20.0, "grey", "difference of what looks unlike its side's colour")
    far_level: float = number(1.2e-3, "m", "distance of another level by its colours")
    better_parted: float = number(0.3e-3, "m", "wall that a better level puts on its side")
    part_better: float = number(0.1, "1", "part of the wall on its wrong side, the same")
    exchange_reach: float = number(0.03, "width", "distance of edges from a line to exchange")
    least_exchange_reach: float = number(6.0, "px", "least distance of such edges")
    other_height: float = number(0.08, "distance", "height of a camera on the other side")
    exchanged: float = number(1.15, "1", "misfit of the other line that is as good")
    least_rear: float = number(0.3, "1", "least part of the rear line where it should be")
    better: float = number(1.5, "1", "strength of another line that is more like a level")
    better_close: float = number(1.1, "1", "the same of a line close below")
    close_below: float = number(0.25, "radius", "distance of a line close below")
    # edges.py, upright lines
    most_lean: float = number(0.36, "px/row", "largest lean of a line against the columns")
    lean_error: float = number(0.15, "px/row", "largest lean of an edge against its line")
    vote_reach: float = number(1.6, "px", "distance of an edge that belongs to a line")
    # outline.py
    lines: int = number(26, "1", "number of lines that may be sides")
    least_line: float = number(0.06, "1", "least part of the image's height of such a line")
    least_width: float = number(0.06, "1", "least part of the image's width between two sides")
    least_rows: float = number(0.15, "1", "least part of the rows that shows both sides")
    least_strip: int = number(40, "px", "least height of a wall that shows a level")
    shown: float = number(0.4, "1", "least strength of a side in a row")
    row_spacing: int = number(2, "px", "distance of the rows that are looked at")
    side_reach: float = number(2.0, "px", "distance of an edge from its side")
    walled: float = number(0.68, "1", "least part of the sides below the level")
    below: float = number(0.5, "1", "largest part of the sides below the floor")
    below_from: float = number(1.12, "fill height", "depth at which that stretch starts")
    below_to: float = number(1.4, "fill height", "depth at which that stretch ends")
    least_fill: float = number(1.5, "radius", "least fill height that shows a level")
    may_be_walled: float = number(0.55, "1", "least part of the sides below another level")
    glass: tuple[float, float] = number((0.3, 0.9), "radius", "where glass shows above the level")
    least_glass_height: float = number(0.5, "radius", "least height of glass above the level")
    one_line: float = number(0.3, "radius", "distance of lines that are one level")
    peaks_apart: float = number(0.1, "radius", "distance of two peaks")
    band: float = number(0.2, "radius", "distance of a level's lines")
    upwards: float = number(0.8, "1", "part of that distance upwards, where a meniscus climbs")
    from_below: float = number(0.5, "1", "part of that distance for a surface seen from below")
    wander: float = number(0.03, "radius", "largest step between columns of a line")
    to_rear: float = number(0.5, "1", "part of the way to the rear edge that is searched")
    of_inside: float = number(0.8, "1", "least strength against lines within the surface")
    outline_reach: float = number(1.5, "distance", "range of heights that is searched")
    # strip.py
    arc: float = number(math.radians(66.0), "rad", "part of the front wall that is looked at")
    strip_slack: int = number(2, "px", "largest error of a line's place")
    behind: float = number(0.6, "1", "part of a line behind the container that is subtracted")
    line_alone: float = number(0.5, "1", "weight of a line without a change of colour")
    full_step: float = number(15.0, "grey", "change of colour that counts fully")
    of_largest: float = number(0.7, "1", "part of the largest change that counts fully")
    # search.py
    most_pitch: float = number(math.radians(60.0), "rad", "largest pitch of a camera")
    most_roll: float = number(math.radians(20.0), "rad", "largest roll of a camera")
    row_step: float = number(2.0, "px", "distance of levels that are tried")
    search_slack: int = number(3, "px", "largest error of a coarse curve")
    search_chance: float = number(2.0, "1", "score by chance")
    of_one_place: int = number(3, "1", "most candidates at one place")
    one_distance: float = number(0.15, "1", "relative difference of distances of one place")
    one_yaw: float = number(0.03, "rad", "difference of yaws of one place")
    # still.py
    candidates: int = number(6, "1", "number of rough fits")
    fine_fits: int = number(3, "1", "number of fine fits")
    retried: int = number(2, "1", "number of fits whose other levels are tried")
    search_size: int = number(800, "px", "longer side of the image for the rough search")
    alike: float = number(0.02, "1", "difference of rough fits that are one")
    same_level: float = number(0.3e-3, "m", "difference of levels that are one")
    told_distance: float = number(0.1, "1", "relative error of a given distance")
    # still_fit.py
    usual_residual: float = number(0.4, "px", "residual above which errors grow")
    # refusals.py
    lost_residual: float = number(0.8, "px", "residual of a fit that is refused")
    lost_height: float = number(3e-3, "m", "standard error of a height that is refused")
    least_share: float = number(0.5, "1", "least part of a curve that shows")
    clear_share: float = number(0.7, "1", "least part of a curve that surely shows")
    same_height: float = number(1e-3, "m", "difference of heights of one answer")
    rival_score: float = number(0.93, "1", "part of the best score that makes a rival")
    rival_residual: float = number(1.5, "1", "ratio of residuals that makes a rival")
    wider: float = number(1.25, "1", "ratio of widths of a container around another")
    enclosing: float = number(0.6, "1", "part of the score that the wider one needs")
    most_residual: float = number(0.6, "px", "largest residual without a warning")
    least_glass: float = number(0.35, "1", "least part of the glass, where both lines are seen")
    glass_alone: float = number(0.5, "1", "least part of the glass, where one is seen")
    too_much: int = number(3, "1", "number of doubts that are too many")
    # scale.py
    least_pixels: float = number(20.0, "px", "least length of a scale")
    most_inclination: float = number(math.radians(20.0), "rad", "largest inclination of a scale")
    scale_click: float = number(1.0, "px", "standard error of a click on a scale")
    one_scale: float = number(0.03, "1", "relative error of one scale for all places")
    # still_fit.py, warnings
    most_height_error: float = number(1e-3, "m", "standard error of a height without a warning")
    doubtful_offset: float = number(1.0, "px", "offset of edges that is worth a warning")


TUNING = CalibrateTuning()

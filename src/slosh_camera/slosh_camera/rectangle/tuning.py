"""Tuning parameters of the detector for side views."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class RectangleTuning:
    """Assumptions of the side-view detector about containers, edges and cameras.

    Checked on traced images by `validation/studies/side_view_tables.py`. The unit "width" is the
    container's, "softness" the standard deviation of a blurred edge [px], "contrast" the levels
    of background less liquid.
    """

    # region.py
    lowest: float = number(0.95, "1", "part of the fill height above the floor's edge")
    sure: float = number(0.6, "1", "part of depth and freeboard beyond which all is wet or dry")
    sure_end: float = number(0.97, "1", "part of depth and freeboard up to which that is sampled")
    edge_inset: int = number(2, "px", "pixels at the edges that mix liquid, wall and background")
    least_columns: int = number(24, "px", "least width of the container in the image")
    least_rows: int = number(8, "px", "fewest rows or columns that determine anything")
    # appearance.py
    colour_noise: float = number(3.0, "grey", "least scatter of a colour")
    foreign: float = number(0.5, "contrast", "error of a place that shows something else")
    mixed_rows: int = number(3, "2 px", "rows about the still line that mix both")
    # line.py
    window: int = number(6, "px", "distance within which an edge is looked for")
    softest: float = number(6.0, "softness", "softest edge that is looked for")
    low_part: float = number(0.5, "1", "part of an edge's strength that continues it")
    noise_response: float = number(5.0, "σ", "response of the edge filter to mere noise")
    jump: float = number(3.0, "px", "step between columns that ends a segment")
    wide_gap: int = number(6, "px", "shortest gap that hides the line")
    gap_ends: int = number(3, "px", "columns beside a gap that are not trusted")
    beside_rows: int = number(5, "2 px", "rows beside the boundary that must agree")
    top_rows: int = number(6, "2 px", "distance at which a line leads up to the region's end")
    steepest: int = number(3, "1", "steepest line that does so")
    # fit.py
    truncation: float = number(0.03, "width", "residual that counts as wrong in the first fit")
    tukey: float = number(4.7, "σ", "deviation at which a point has no weight")
    # trace.py
    least_agreement: float = number(0.35, "1", "least evidence for the line")
    least_seen: float = number(0.3, "1", "least part of the columns that shows the line")
    least_points: int = number(12, "1", "fewest columns that show the line")
    full_columns: int = number(2, "2 px", "fewest full columns that make a line cut off")
    own_split: float = number(0.1, "width", "distance within which a column's own boundary counts")
    gate_rows: float = number(1.5, "px", "least distance at which an edge is no part of the line")
    look_again: float = number(0.02, "1", "part of columns without an edge that is searched again")
    scatter_floor: float = number(0.03, "px", "least scatter of the points")
    end_rows: float = number(4.0, "px", "rows at the region's upper end that hold no line")
    clipped: float = number(252.0, "grey", "level at which the camera clips")
    # line.py, rear wall
    apart_rows: float = number(3.0, "px", "least distance of two distinct lines")
    apart_softness: float = number(2.4, "softness", "the same for soft edges")
    sharp_percentile: float = number(10.0, "%", "percentile of the edges for the sharpness")
    least_surface: float = number(0.08, "contrast", "least contrast of surface and liquid")
    most_surface: float = number(0.5, "contrast", "contrast at which the contact line is sharper")
    margin: float = number(0.02, "width", "part over which heights at the rear wall are continued")
    all_down: float = number(0.99, "1", "part seen from above that counts as all")
    askew: float = number(0.06, "width", "shift of the rear wall at which crests hide it")
    # profile.py
    wall_part: float = number(0.05, "width", "part whose points determine the height at a wall")
    wall_points: int = number(4, "1", "fewest points that do so")
    wall_gap: float = number(0.03, "width", "gap beside a wall that hides its height")
    round_gap: float = number(0.15, "width", "the same beside a round wall")
    reach: float = number(4.0, "px", "distance within which points tell the height at a place")
    smoothed_columns: int = number(5, "px", "width of the running median")
    smoothed_noise: float = number(0.8, "1", "its standard deviation over that of its points")
    common_floor: float = number(0.05, "px", "least common error of all points")
    common_softness: float = number(0.02, "softness", "common error by uneven light and JPEG")
    common_clipped: float = number(0.3, "softness", "common error where the camera clips")
    doubt_part: float = number(0.5, "1", "standard deviation of a doubtful height over its doubt")
    correlated_columns: float = number(4.0, "px", "columns over which residuals are correlated")
    # region.py, round walls
    sideways: float = number(0.25, "1", "cosine below which the highest place is at an end")
    most_spread: float = number(1e-3, "m", "spread of a height that is not called ambiguous")
    sure_reading: float = number(0.95, "1", "probability at which a reading is sure")
    level_sure: float = number(2e-4, "m", "standard deviation of the mean level")
    level_second: float = number(0.01, "1", "the same as a part of the wave, by second order")
    second_order: float = number(0.03, "1", "second order as a part of the wave")
    least_scatter: float = number(5e-5, "m", "least scatter of points on a round wall")
    reading_error: float = number(1.5e-4, "m", "error of a point by which readings are judged")
    # detector.py
    most_hidden: float = number(0.05, "1", "part of the columns that may be hidden")
    blurred: float = number(3.0, "softness", "softness of a blurred edge")
    most_hidden_still: float = number(0.4, "1", "part of the still line that may be hidden")
    still_slope: float = number(math.tan(math.radians(5.0)), "1", "steepest still line")


TUNING = RectangleTuning()

"""Tuning parameters of the detector for cylinders."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class CylinderTuning:
    """Assumptions of the cylinder detector about liquids, images and cameras.

    Set on rendered scenes of even number by `validation/studies/camera_accuracy.py out/sequences`.
    The unit "contrast" is the way from liquid to background, "row" a sample along a scan line,
    "σ" and "median" the standard and the median deviation.
    """

    # wall_geometry.py, scan lines
    wall_depth: float = number(0.85, "1", "part of the fill height that shows the wall")
    edge_inset: float = number(1.5, "px", "pixels at the sides that mix liquid and background")
    least_lines: int = number(12, "1", "least number of lines that show liquid and wall")
    least_below: int = number(24, "row", "wall below the still level that must be in the image")
    least_above: int = number(4, "row", "wall above the still level that must be in the image")
    unknown_rim: float = number(1.2, "radius", "assumed height of a rim that is not known")
    # container_edges.py
    side_above: float = number(0.95, "1", "part of the rim's height that shows the sides")
    side_unknown_rim: float = number(0.9, "radius", "height of the sides below an unknown rim")
    side_half_edge: float = number(4.0, "grey/px", "slope of the image that is half an edge")
    turn_better: float = number(1.06, "1", "mean gain in agreement by a turn of both sides")
    turn_better_each: float = number(1.02, "1", "gain in agreement on the worse side")
    turned: float = number(math.radians(0.99), "rad", "smallest turn that is reported")
    least_turn_score: float = number(0.9, "1", "least agreement of both sides together")
    # appearance.py
    scatter: float = number(0.12, "contrast", "least scatter of any colour")
    rounding: float = number(2.0, "grey", "scatter by rounding and compression")
    least_samples: int = number(10, "1", "fewest samples, places or edges that determine anything")
    # edge_search.py
    level_samples: int = number(8, "1", "fewest samples that determine a line's level")
    edge_margin: int = number(2, "row", "rows beside an edge that must be in the image")
    soft_rows: int = number(12, "row", "longest soft edge")
    slope_ended: float = number(0.2, "1", "part of the steepest slope at which an edge ends")
    liquid_spread: float = number(0.45, "contrast", "deviation that fully denies liquid")
    background_spread: float = number(0.6, "contrast", "deviation that fully denies background")
    unknown_cost: float = number(0.2, "1", "cost of a sample of a surface of unknown brightness")
    unlike_cost: float = number(0.3, "1", "cost of a sample that differs from the known surface")
    wrong_weight: float = number(4.0, "1", "weight of wrong samples against edges")
    half_edge: float = number(0.08, "contrast", "slope that counts as half an edge")
    hidden_leak: float = number(0.3, "1", "part of the contradiction that counts on a hidden line")
    edge_reach: int = number(4, "row", "distance at which an edge belongs to another line")
    unknown_surface: tuple[float, float] = number(
        (0.3, 0.8), "1", "weights of contact line and upper edge"
    )
    dull_surface: tuple[float, float] = number((0.15, 1.0), "1", "for a surface like its liquid")
    bright_surface: tuple[float, float] = number((0.45, 0.65), "1", "for another known surface")
    # front_line.py
    level_reach: float = number(0.25, "contrast", "distance from the most frequent level")
    tolerance: float = number(0.08, "contrast", "deviation at which a sample is no liquid")
    tolerance_noise: float = number(4.0, "σ", "the same in units of the noise")
    tolerance_spread: float = number(4.0, "median", "the same in units of the liquid's deviation")
    sharp_rows: float = number(2.0, "row", "width of an edge in a sharp image")
    white: float = number(250.0, "grey", "level of a background that hides all bright things")
    hidden_line: float = number(0.6, "1", "contradiction at which a line counts as hidden")
    # front_line.py, systematic error
    bias_lines: int = number(5, "1", "number of lines over which errors are averaged")
    bias_rows: float = number(3.0, "row", "rise over which the contact line's bias changes")
    # silhouette.py
    fade_rows: float = number(3.5, "row", "rows below a crest in which it fades in")
    # front_line.py, stationary edges
    faint: float = number(0.06, "contrast", "largest step that counts as noise")
    stationary_shift: int = number(1, "1", "lines by which the image may be shifted")
    more_marked: float = number(2.0, "1", "ratio at which an edge is not the stationary one")
    # still_reference.py
    first_mode: float = number(0.5, "radius", "standard deviation of the first mode")
    still_tilt: float = number(math.radians(0.25), "rad", "standard deviation of a fitted tilt")
    at_rest: float = number(0.01, "1", "part of the usual heights that remains at rest")
    leaning: float = number(0.06, "rad", "standard deviation of an unknown tilt")
    still_plausible: float = number(0.15, "1", "least agreement of a doubtful liquid at rest")
    # still_reference.py, surface at rest
    second_body: float = number(0.3, "1", "lead that the upper part of the wall needs")
    still_wave: float = number(1e-3, "m", "largest first mode measured in the still image")
    tilt_towards: float = number(math.radians(0.05), "rad", "σ of a tilt by the contact line")
    # surface_choice.py
    pair_lines: int = number(18, "1", "number of lines whose pairs give first guesses")
    agree_rows: float = number(5.0, "row", "distance at which a point agrees with a guess")
    candidates: int = number(8, "1", "number of first guesses")
    certain: float = number(0.8, "1", "share of agreeing points at which the line decides")
    unlikely: float = number(0.3, "1", "surprise at which a surface is compared with others")
    far_from_liquid: float = number(0.35, "contrast", "deviation that no liquid has")
    tried: int = number(4, "1", "number of surfaces that are fitted to the end")
    different_rows: float = number(10.0, "row", "difference between the first modes of two")
    edge_rows: float = number(2.0, "row", "rows beside a line that belong to its edge")
    still_rows: float = number(12.0, "row", "farthest point of a level surface")
    stray: float = number(4.0, "σ", "deviation of a point that is dropped at rest")
    stray_rows: float = number(1.5, "row", "least such deviation")
    inclined: float = number(math.radians(0.8), "rad", "inclination of a suspect surface at rest")
    off_rows: float = number(0.7, "row", "error of the upper edges of a suspect surface")
    over_rim: float = number(0.1, "radius", "height of the highest crest above the rim")
    # surface_comparison.py
    believed_foretold: float = number(-0.1, "1", "least agreement of a surface that was predicted")
    clearly: float = number(0.1, "1", "its least lead over the others")
    usual: float = number(2.0, "σ", "deviation from the prediction that needs no comparison")
    jump: float = number(4.5, "σ", "deviation from the prediction that liquid cannot reach")
    certainly: float = number(0.2, "1", "bonus of a surface that most front points agree with")
    other_rows: float = number(5.0, "row", "distance between two different surfaces")
    alike: float = number(0.005, "1", "difference in agreement of one surface's fits")
    hardly: float = number(0.05, "1", "least lead of a surface that is sure")
    far_more: float = number(1.3, "1", "ratio of agreeing edges for which no wave is preferred")
    worse: float = number(0.4, "1", "loss of agreement against rest that leaves no choice")
    far_worse: float = number(0.5, "1", "loss of agreement against rest that is not sure")
    level_believed: float = number(0.4, "1", "least agreement of a changed level, no still image")
    # surface.py
    like_liquid: float = number(0.15, "contrast", "largest deviation of a surface like its liquid")
    inlier: float = number(0.1, "1", "least weight of an edge that agrees with a fit")
    fade_mean: float = number(0.6, "1", "share of the fade that crests show")
    fade_stddev: float = number(0.4, "1", "standard deviation of that share")
    # surface_fit.py
    upper_rows: float = number(0.75, "row", "standard deviation of the upper edge")
    far_rows: float = number(6.0, "row", "distance at which a point is looked for again")
    again_rows: int = number(5, "row", "distance within which it is looked for")
    apart_rows: float = number(3.0, "row", "least distance of two distinct edges")
    apart_widths: float = number(1.5, "width", "the same in widths of an edge")
    shade_rows: float = number(8.0, "row", "standard deviation of a point of a faint contact line")
    shade_band: float = number(40.0, "row", "least height of the surface for that deviation")
    least_slope: float = number(0.03, "contrast", "least slope of an edge")
    least_upper: float = number(0.125, "1", "least part of the lines that shows the upper edge")
    reversed_weight: float = number(0.3, "1", "weight of edges with less background above")
    reversed_above: int = number(3, "row", "rows above an edge that show the background")
    no_lighter: float = number(0.05, "contrast", "contrast of a background that is no lighter")
    # surface_reading.py, flags
    least_read: float = number(0.5, "1", "least part of the lines that shows an edge")
    hidden_share: float = number(0.13, "1", "part of the lines that may be hidden")
    cut_lines: int = number(2, "1", "fewest lines that make a surface cut off")
    # surface_memory.py
    acceleration: float = number(3.0, "m/s²", "standard deviation of the container's acceleration")
    memory_surprise: float = number(0.2, "1", "cost of a deviation from the prediction")
    farthest: float = number(4.0, "σ", "deviation beyond which the cost is constant")
    measured: float = number(0.01, "radius", "standard deviation of a height in the last image")
    amplitude: float = number(0.15, "radius", "usual amplitude of a liquid seen once")
    crest: float = number(2e-3, "m", "least crest that may stand still")
    stands: float = number(2e-4, "m", "largest motion of a standing crest")
    stood: float = number(4.0 * math.pi, "rad", "phase after which a crest is stationary")
    turns: int = number(3, "1", "repetitions that reveal old images")
    forgotten: float = number(1.5, "rad", "phase after which nothing is predicted")
    least_time: float = number(1e-3, "s", "least time between two images")
    decided: int = number(5, "1", "most images in a row that the memory decides")
    fade_drift: float = number(0.02, "1", "change of the fade's share between images")
    fade_known: float = number(0.15, "1", "least standard deviation of the fade's share")
    # surface.py, prior
    prior_surprise: float = number(0.02, "1", "cost of a height of one standard deviation")
    level_stddev: float = number(5e-3, "m", "standard deviation of a level that is not known")
    rare: float = number(0.18, "1", "cost of a changed level in motion")
    rare_at_rest: float = number(0.13, "1", "cost of a changed level at rest")
    highest: float = number(0.9, "radius", "largest first mode")
    # surface_reading.py
    kernel_width: float = number(math.radians(5.0), "rad", "angle over which points are averaged")
    ordinary: float = number(7.0, "median", "deviation at which a point has no weight")
    stands_out: float = number(2e-3, "m", "least such deviation")
    fit_weight: float = number(4.0, "1", "weight of the fit among the points around")
    stands_for: float = number(math.radians(25.0), "rad", "angle that a point represents")
    at_rear: float = number(0.9, "1", "part of a ray that counts as the rear wall")
    of_scatter: float = number(0.5, "1", "part of the scatter in a height's deviation")
    of_width: float = number(0.05, "1", "part of an edge's width in it")
    of_height: float = number(0.0025, "1", "part of the height in it")
    of_rest: float = number(2e-5, "m", "least deviation of a height")
    shade_weight: float = number(0.004, "1", "weight of a point of a faint contact line")
    wide_rows: float = number(10.0, "row", "assumed width of an edge that is not measured")
    together_lines: int = number(40, "1", "most lines whose errors are correlated")
    correlated: float = number(0.05, "1", "least correlation that counts")
    together_edges: int = number(5, "1", "fewest edges that show a correlation")
    # surface_solver.py
    tukey: float = number(4.7, "σ", "deviation at which an observation has no weight")
    coarse: float = number(12.0, "σ", "the same at first, from a rough start")
    fine: float = number(6.0, "σ", "the same at first, from a good start")
    converged: float = number(3e-6, "m", "largest change of a height that ends the solver")
    narrower: float = number(0.6, "1", "factor on the deviation in each step")
    many_rays: int = number(20, "1", "fewest rays that determine a start's error")
    fade_doubt: float = number(0.35, "1", "relative standard deviation of a fade's middle")
    # appearance.py, surroundings
    colours_alike: float = number(0.13, "contrast", "largest difference of two equal colours")
    least_beside: float = number(0.5, "1", "least part beside the container in the image")
    bent_rows: int = number(4, "px", "shift of the background by the glass")
    # wall_geometry.py
    systematic: float = number(1.5e-4, "m", "error that calibration and refraction leave")
    front_rows: float = number(0.5, "row", "standard deviation of a front point")
    stretch: float = number(4.0, "1", "ratio of rear wall on a row that is of no use")
    fade_limits: tuple[float, float] = number((0.7, 4.0), "1", "limits of relative softness")
    border_lines: int = number(3, "1", "fewest lines on which liquid reaches the border")
    covered: float = number(0.6, "contrast", "level that is no background at the border")
    # detector.py
    no_fade: float = number(2e-6, "m", "change of heights that needs no second fit")
    untold: float = number(5e-4, "m", "σ at which a faint line's surface is not reported")
    contradicted: float = number(1e-3 / 3.0, "m", "σ at which edges contradict each other")
    hidden_peak: float = number(5e-4, "m", "lead of the fit over a hidden peak")


TUNING = CylinderTuning()

"""Tuning numbers of planned, scaled and shaped motions."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class PlanTuning:
    """Tuning constants of the search for motions, and of sampling and checking them.

    Checked by `validation/studies/plan_tables.py` and `validation/studies/joint_plan_tables.py`:
    times against the known laws, and no limit exceeded.
    """

    # planning/known_laws.py
    law_ratio: float = number(1.02, "1", "ratio of two durations that are tried in turn")
    long: float = number(20.0, "s", "duration from which that ratio is larger")
    long_ratio: float = number(1.05, "1", "the ratio from there on")
    coarse: float = number(8e-3, "s", "sampling of motions that are tried first")
    nearly: float = number(0.03, "1", "excess of a limit at which all rows are checked")
    valley: float = number(1.5, "1", "slope of an excess between durations, by those nearby")
    longest_law: float = number(120.0, "s", "longest duration that is tried")
    leg_points: int = number(800, "1", "points of a leg at which a law is checked")
    straight: float = number(1e-3, "1", "curvature by length of a straight leg")
    # planning/path.py
    kept: float = number(5e-5, "m", "largest distance of a waypoint from the path")
    same: float = number(2e-5, "m", "distance at which two points are one")
    corner: float = number(math.radians(60.0), "rad", "turn at which the container stops")
    most_corners: int = number(40, "1", "most corners of a path")
    reversal: float = number(
        math.radians(179.0), "rad", "turn that leads back along the same tangent"
    )
    degree: int = number(5, "1", "degree of the splines")
    shortest_path: float = number(1e-3, "m", "shortest path")
    fewest_knots: int = number(8, "1", "fewest points of a spline")
    fine: int = number(4000, "1", "points at which a path is checked")
    # planning/optimise.py
    nodes_per_second: float = number(32.0, "1/s", "nodes of the collocation")
    fewest_nodes: int = number(60, "1", "fewest nodes of a motion")
    most_nodes: int = number(200, "1", "most nodes of a motion")
    fewest_on_a_leg: int = number(10, "1", "fewest nodes of a leg")
    longest_solve: float = number(12.0, "s", "longest time of one solution")
    most_iterations: int = number(200, "1", "most iterations of one solution")
    # planning/interval.py
    curve_points: int = number(400, "1", "points of the splines of a leg")
    least_angle: float = number(1e-4, "rad", "angle below which a turn is a straight line")
    edge: float = number(1e-6, "1", "part of a leg at its ends where splines are zero")
    # planning/search.py
    starts: tuple[float, float] = number(
        (1.0, 0.7), "1", "factors of the fastest known law at which searches start"
    )
    again: float = number(0.2, "1", "part of the time limit after which no second search starts")
    repeated: tuple[float, ...] = number(
        (1.02, 1.1),
        "1",
        "factors by which the start of a repeated search is slower, tried in turn",
    )
    ended: float = number(1e-3, "1", "part of a leg by duration at which a law is at rest")
    search_rounds: int = number(8, "1", "how often a limit is lowered")
    ahead: float = number(0.004, "1", "part by which heights are lowered at first")
    slack: float = number(2e-4, "1", "part by which a limit is lowered beyond its excess")
    # planning/robust.py, planning/region_search.py
    robust_rounds: int = number(24, "1", "searches that are tried for all likely parameters")
    robust_laws: int = number(10, "1", "sets of models for which a known law is sought")
    robust_liquids: int = number(4, "1", "likely models whose liquids are unknowns of a search")
    robust_near: float = number(0.05, "1", "excess below which a limit is lowered")
    robust_ahead: float = number(1e-3, "1", "part by which it is lowered beyond the excess")
    robust_starts: tuple[float, ...] = number(
        (1.0, 1.1), "1", "factors by which the start of a search is slower, tried in turn"
    )
    robust_adding: float = number(
        0.5, "1", "part of that time after which limits are lowered, and no models added"
    )
    robust_ratio: float = number(1.003, "1", "ratio of two durations of a slowed motion")
    robust_slowest: float = number(1.03, "1", "largest factor by which it is slowed")
    robust_share: float = number(0.85, "1", "part of the time limit for all searches")
    apart: tuple[float, ...] = number(
        (0.8, 0.3, 0.0), "1", "least distances of scenarios by the region's radius, tried in turn"
    )
    nominal_share: float = number(0.3, "1", "part of the time limit for the model's own plan")
    # planning/execution.py
    near: float = number(1.5e-4, "m", "distance at which a motion passes a waypoint")
    same_time: float = number(2e-5, "s", "time from a row at which a waypoint is that row")
    # scaling.py
    scales: int = number(1000, "1", "time scales that are tried")
    standing_scales: int = number(200, "1", "time scales at which a loose container is looked at")
    slowest: float = number(10.0, "1", "slowest scale where the bound says nothing")
    scale_rounds: int = number(2, "1", "divisions of the bracket of an edge")
    scale_parts: int = number(16, "1", "parts of each division")
    scan_step: float = number(0.005, "s", "sampling of the scan")
    batch: int = number(1_000_000, "1", "samples that are simulated at a time")
    doubt: float = number(0.02, "1", "part of a limit within which a motion is simulated in full")
    # shaping/shaped.py
    rest: float = number(0.01, "1", "part of the greatest speed that a motion may end with")
    rest_speed: float = number(2e-3, "m/s", "the same without regard to that speed")
    still: float = number(1e-3, "1", "part of the acceleration below which an axis has no wave")
    corner_near: float = number(
        1e-3, "m", "distance from a corner within which a stop is looked for"
    )
    path_step: float = number(1e-4, "m", "step of a path from which distances are measured")
    # gantry.py
    gantry_rows: int = number(60, "1", "samples of a period of the liquid")
    gantry_moves: int = number(13, "1", "lengths of each part of a move that are tried")
    gantry_fine: float = number(5.0, "1", "lengths of a push by which it has fewer samples")
    gantry_reserve: float = number(0.02, "1", "part of the height for moves that are not tried")
    gantry_short: float = number(0.05, "1", "shortest push by the liquid's period")
    gantry_exact: float = number(5e-3, "1", "part by which a limit may be too low")
    # consistency.py
    window: float = number(0.1, "s", "window over which two fields are compared")
    window_samples: int = number(4, "1", "sampling intervals of that window, at least")
    share: float = number(0.25, "1", "part of the greatest mean by which two fields may differ")


TUNING = PlanTuning()

"""Predicts the liquid's response to a motion, and plans motions that keep a height limit."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, overload

import numpy as np

from slosh.arguments import as_file, the_model
from slosh_bringup.simulate.answer import doubts
from slosh_model.gaps import gap_text
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.simulate import Inputs
from slosh_model.simulate import simulate as simulate_inputs
from slosh_model.tilt import with_tilt
from slosh_motion.tables.motion_table import read_motion_table
from slosh_plan.doubts import path_doubts, trajectory_doubts
from slosh_plan.limits import HeightLimits
from slosh_plan.planning.limits import ACCELERATION, JERK, RESIDUAL, PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import Plan
from slosh_plan.planning.plan import plan as plan_path
from slosh_plan.planning.waypoints import Waypoints
from slosh_plan.prediction import Prediction
from slosh_plan.prediction import predict as predict_trajectories
from slosh_plan.tables.path_table import read_path_table
from slosh_plan.tables.trajectory_table import read_trajectory
from slosh_plan.trajectory import Trajectory

if TYPE_CHECKING:
    from slosh.arguments import ModelLike, MotionLike, PathLike, Several


def simulate(model: ModelLike, motion: MotionLike) -> Response:
    """Computes the liquid's heights during a motion that begins at rest.

    >>> import slosh
    >>> slosh.simulate("cup/model.yaml", "move.csv")
    Response(3001 samples, 0 … 3 s, height up to 5.9 mm at 0.217 s)

    Args:
        model: a Model or the path of a `model.yaml`.
        motion: a Motion, a pandas table or the path of a motion table.

    Raises:
        TypeError: an argument is of another kind.
        SloshModelError, SloshBagError: an impossible model or motion.

    Warns:
        what looks wrong in the motion: gravity, units, axes, gaps.
    """
    used = the_model(model)
    if isinstance(motion, Inputs):
        return simulate_inputs(with_tilt(used, motion.attitude), motion)[0]
    with as_file(motion, "motion") as path:
        table = read_motion_table(path)
    inputs = table.inputs()
    _warn("motion", (*doubts(used, table), *filter(None, [gap_text(table.t, used)])))
    return simulate_inputs(with_tilt(used, inputs.attitude), inputs)[0]


@overload
def predict(
    model: ModelLike,
    motions: Several[MotionLike],
    *,
    limit: float = ...,
    residual: float = ...,
    rim_distance: float = ...,
) -> list[Prediction]: ...


@overload
def predict(
    model: ModelLike,
    motions: MotionLike,
    *,
    limit: float = ...,
    residual: float = ...,
    rim_distance: float = ...,
) -> Prediction: ...


def predict(
    model: ModelLike,
    motions: MotionLike | Several[MotionLike],
    *,
    limit: float = math.inf,
    residual: float = math.inf,
    rim_distance: float = 0.0,
) -> Prediction | list[Prediction]:
    """Predicts how high the liquid rises during a planned motion, and checks limits.

    >>> import slosh
    >>> slosh.predict("cup/model.yaml", "move.csv", limit=0.02)
    Prediction(move.csv: 3.000 s, peak 5.9 mm at 0.217 s, afterwards 0.8 mm, kept)

    Args:
        model: a Model or the path of a `model.yaml`.
        motions: a Motion, a Plan, a pandas table or the path of a table of accelerations or
            poses; or a list of these.
        limit: greatest height above the still level [m]; the rim, where it is lower, holds too.
        residual: greatest height after the motion's end [m].
        rim_distance: least vertical distance to the rim, another way to limit the height [m].

    Returns:
        a prediction, or as many as there are motions in the list.

    Raises:
        TypeError: an argument is of another kind.
        SloshModelError, SloshBagError, SloshPlanError: an impossible model, motion or limit.

    Warns:
        what looks wrong in a motion: gravity, units, axes.
    """
    used, limits = the_model(model), HeightLimits(limit, residual, rim_distance=rim_distance)
    if not isinstance(motions, list | tuple):
        one = _trajectory(motions, "motions", used)
        return predict_trajectories(used, one, limits=limits)[0]
    given = [
        _trajectory(motion, f"motions[{place}]", used) for place, motion in enumerate(motions)
    ]
    return predict_trajectories(used, given, limits=limits)


def plan(
    model: ModelLike,
    path: PathLike,
    *,
    limit: float,
    residual: float | None = None,
    acceleration: float = ACCELERATION,
    jerk: float = JERK,
) -> Plan:
    """Finds the fastest rest-to-rest motion along a path that keeps the liquid below a limit.

    >>> import slosh
    >>> path = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]  # m
    >>> slosh.plan("cup/model.yaml", path, limit=0.01)  # doctest: +ELLIPSIS
    Plan(0.75... s, optimal time law, height 9.9... of 10 mm, afterwards 4... of 5 mm)

    Args:
        model: a Model or the path of a `model.yaml`.
        path: (N, 3) places of the container's origin [m], or a pandas table or the path of a
            table of waypoints, `t,x,y,z[,qx,qy,qz,qw]`.
        limit: greatest height above the still level [m]; the rim, where it is lower, holds too.
        residual: greatest height after the motion's end [m]; None: half of the limit.
        acceleration, jerk: of the motion, at most [m/s², m/s³].

    Raises:
        TypeError: an argument is of another kind.
        NoSafeMotionError: no motion keeps the limits.
        SloshModelError, SloshBagError, SloshPlanError: an impossible model, path or limit.

    Warns:
        what looks wrong in the path.
    """
    used = the_model(model)
    limits = PlanLimits(
        limit, RESIDUAL * limit if residual is None else residual, acceleration, jerk
    )
    times = None
    if isinstance(path, np.ndarray | list | tuple):
        places = np.asarray(path, dtype=np.float64)
        waypoints = Waypoints(np.array([0.0, math.inf]), places, None)  # without a proposed time
    else:
        kinds = "places as an (N, 3) array, a pandas table or the path of a table of waypoints"
        with as_file(path, "path", kinds) as file:
            waypoints = read_path_table(file)
        times = waypoints.t
    way = path_through(waypoints.position, times=times)
    _warn("path", path_doubts(waypoints))
    return plan_path(used, way, limits, attitude=waypoints.attitude)


def _trajectory(motion: MotionLike, argument: str, model: Model) -> Trajectory:
    if isinstance(motion, Trajectory):
        return motion
    with as_file(motion, argument) as path:
        found = read_trajectory(path)
    name = argument if found.name != str(motion) else found.name
    _warn(name, trajectory_doubts(found, model))
    return replace(found, name=name)


def _warn(name: str, texts: Sequence[str]) -> None:
    for text in texts:
        warnings.warn(f"{name}: {text}", UserWarning, stacklevel=3)

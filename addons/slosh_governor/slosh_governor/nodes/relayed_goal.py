"""Decides about a joint trajectory: sent unchanged, sent with new times, or refused."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Time

from slosh_base.types import Array
from slosh_estimator.errors import SloshEstimatorError
from slosh_model.tray import Tray
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_plan import HeightLimits, Trajectory
from slosh_plan.errors import SloshPlanError
from slosh_plan.joints import joint_curve
from slosh_plan.look_ahead import look_ahead, warning
from slosh_plan.nodes.plan_messages import joint_points
from slosh_plan.nodes.predict_messages import joint_columns
from slosh_plan.planning.execution import execution_of
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.plan_tray import check_plan_from, plan_container
from slosh_plan.planning.progress import Watch
from slosh_plan.planning.waypoints import JointWaypoints
from slosh_plan.robot_file import CarryingRobot
from slosh_plan.start import LiquidStates
from slosh_plan.tray import TrayPrediction

NAME = "the goal"


class WrongJointsError(SloshPlanError):
    """Error of a trajectory goal whose joints are not those of the robot."""


class Relayed(NamedTuple):
    """The goal that is sent to the controller, and what was changed.

    Attributes:
        goal: of the action.
        words: what was done to it, for the log.
        is_new: whether the motion has new times.
    """

    goal: Any
    words: str
    is_new: bool


@dataclass(frozen=True, slots=True)
class RelayRules:
    """Rules by which the relay accepts, slows or refuses joint trajectories.

    Attributes:
        robot: whose joints move.
        limits: of heights, and of the joints where the motion gets new times.
        replans: whether a motion that exceeds a limit gets new times; it is refused otherwise.
        time_limit: of the search for them [s].
    """

    robot: CarryingRobot
    limits: PlanLimits
    replans: bool
    time_limit: float

    @property
    def heights(self) -> HeightLimits:
        """The relay's limits of the liquid's height, without the joint limits."""
        limits = self.limits
        return HeightLimits(limits.height, limits.residual, rim_distance=limits.rim_distance)


def relayed(
    goal: Any,
    tray: Tray,
    rules: RelayRules,
    *,
    now_ns: int,
    standing: Mapping[str, float],
    state: LiquidStates | None,
    watch: Watch,
) -> Relayed:
    """Checks a joint-trajectory goal; returns the goal to send to the controller.

    Args:
        goal: of the action.
        tray: what is carried.
        rules: by which it is judged.
        now_ns: the time [ns].
        standing: positions of the joints now, by name; empty: not known.
        state: the liquid now, of each container of a tray by its name; None: at rest.
        watch: ends the search for new times.

    Raises:
        SloshPlanError, SloshEstimatorError: the goal is none, or no motion along it is safe; a
            WrongJointsError where its joints are not the robot's.
        StoppedError: the search was ended.
    """
    given = _waypoints(goal.trajectory, rules.robot, standing)
    motion = _motion(given, rules.robot)
    stamp_ns = to_nanoseconds(goal.trajectory.header.stamp)
    delay = (stamp_ns - now_ns) * 1e-9 if stamp_ns else 0.0
    if delay < 0.0:
        raise SloshEstimatorError(f"{NAME}: by its stamp it began {-delay:.2f} s ago")
    found = look_ahead(tray, motion, delay, limits=rules.heights, state=state)
    if found.kept:
        return Relayed(_with_velocities(goal, given), _said(found), is_new=False)
    words = "; ".join(filter(None, (_named(found, warning(found.of_worst)), found.falling)))
    if not rules.replans:
        raise SloshEstimatorError(f"{NAME} is refused: {words}")
    return _retimed(goal, given, tray, rules, state, words, watch)


def _waypoints(
    message: Any, robot: CarryingRobot, standing: Mapping[str, float]
) -> JointWaypoints:
    """Returns the goal's waypoints, preceded by the present joint positions if it starts later."""
    if not len(message.points):
        raise SloshPlanError(f"{NAME} has no points")
    names, t, columns = joint_columns(message, NAME)
    strange = [n for n, known in zip(names, robot.arm.known(names), strict=True) if not known]
    if strange:
        raise WrongJointsError(f"{NAME}: joint {strange[0]!r} is not in the robot's description")
    try:
        robot.arm.check_joints(names, NAME)
    except SloshPlanError as error:
        raise WrongJointsError(str(error)) from None
    if t[0] > 0.0:
        missing = [name for name in names if name not in standing]
        if missing:
            raise SloshEstimatorError(
                f"{NAME} begins at {t[0]:.3g} s and the position of joint {missing[0]!r} is "
                "unknown: publish joint states, or begin at 0 s"
            )
        here = np.array([standing[name] for name in names])
        t = np.concatenate([[0.0], t])
        columns = [
            np.vstack([here if k == 0 else 0.0 * here, one]) for k, one in enumerate(columns)
        ]
    if len(columns) == 1 and len(t) == 2:
        columns.append(np.zeros_like(columns[0]))  # from rest to rest
    given = JointWaypoints(names, t, *columns)
    try:
        robot.check_group(given, NAME)
    except SloshPlanError as error:
        raise WrongJointsError(str(error)) from None
    return given


def _motion(given: JointWaypoints, robot: CarryingRobot) -> Trajectory:
    """Computes the container's motion while a controller executes the checked waypoints."""
    return robot.arm.motion(
        given.t, given.names, given.position, given.velocity, given.acceleration, NAME
    )


def _with_velocities(goal: Any, given: JointWaypoints) -> Any:
    """Returns the goal, with the checked motion's velocities at points that lack them.

    Between bare positions a controller moves on straight lines, and jumps in velocity.
    """
    if all(len(point.velocities) for point in goal.trajectory.points):
        return goal
    known = [one for one in (given.position, given.velocity) if one is not None]
    curve = joint_curve(given.t, known, NAME)
    sent = copy.deepcopy(goal)
    points = sent.trajectory.points
    velocities: Array = np.asarray(curve(given.t, 1))[-len(points) :]
    for point, velocity in zip(points, velocities.tolist(), strict=True):
        point.velocities = velocity
    return sent


def _retimed(
    goal: Any,
    given: JointWaypoints,
    tray: Tray,
    rules: RelayRules,
    state: LiquidStates | None,
    why: str,
    watch: Watch,
) -> Relayed:
    robot = rules.robot
    path = robot.path(given, tray.turning.model.container, NAME, watch.stopped)
    answer = plan_container(
        tray, path, rules.limits, time_limit=rules.time_limit, watch=watch
    ).plan
    if state is not None:
        check_plan_from(tray, answer, rules.limits, None, state)
    motion = answer.found.motion
    assert motion.joints is not None
    run = execution_of(motion, np.empty((0, 3)))
    sent = copy.deepcopy(goal)
    sent.trajectory.header.stamp = Time()
    sent.trajectory.joint_names = list(motion.joints.limits.names)
    sent.trajectory.points = joint_points(run.t, motion.joints)
    words = f"{why}; new times: {given.t[-1]:.3f} s become {motion.duration:.3f} s"
    return Relayed(sent, words, is_new=True)


def _said(found: TrayPrediction) -> str:
    return _named(found, f"the liquid will rise to {1e3 * found.of_worst.upper:.1f} mm")


def _named(found: TrayPrediction, words: str) -> str:
    return f"worst container {found.worst}: {words}" if found.worst and words else words

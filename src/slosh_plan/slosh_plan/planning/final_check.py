"""Checks a planned motion at the end, from its rows alone, by nothing that the search uses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from slosh_base.types import Array
from slosh_model.model import Model
from slosh_model.standing_use import standing_use
from slosh_plan.heights import first_period, highest, msh_of
from slosh_plan.limits import HeightLimits
from slosh_plan.planning.checked import PERIODS, LooseContainer, attitudes
from slosh_plan.planning.joint_path import JointLeg, JointMotion
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import KEPT, Path
from slosh_plan.planning.time_law import STEP, PlannedMotion
from slosh_plan.trajectory import Trajectory

AGREE = 2e-3
"""Share by which differences of rows, and another step of the integration, may be higher."""
REST = 2e-3
"""Speed in the first and last row that counts as rest [m/s]."""
UPRIGHT = 1e-6
"""Tilt that is left at the ends [rad]."""


class Kept(NamedTuple):
    """A container whose limits a motion keeps.

    Attributes:
        model: of its liquid.
        limits: of its heights.
        loose: how it stands; None: it is held.
    """

    model: Model
    limits: HeightLimits
    loose: LooseContainer | None = None


def broken(
    motion: PlannedMotion,
    path: Path,
    limits: PlanLimits,
    attitude: Array | None,
    containers: Sequence[Kept],
) -> str:
    """Describes what a planned motion does not keep; empty: it keeps everything.

    Args:
        motion: the motion, at 1 kHz.
        path: along which it shall lead.
        limits: of the motion.
        attitude: (4,) that the container keeps; None: not turned, or as the motion says.
        containers: whose liquids are simulated, with steps of half a row.
    """
    arrays = [motion.t, motion.position, motion.acceleration]
    if not all(np.isfinite(one).all() for one in arrays):
        return "it has numbers that are not finite"
    if np.abs(np.diff(motion.t) - STEP).max() > 1e-9:
        return "its rows are not 1 ms apart"
    words = [*_rows(motion, path, limits), *_tilt(motion, limits)]
    if motion.joints is not None:
        words += _joints(motion.joints, path, limits)
    # The liquid of a motion that is none says nothing.
    return "; ".join(words or _liquids(motion, attitude, containers))


def _rows(motion: PlannedMotion, path: Path, limits: PlanLimits) -> Iterator[str]:
    """Yields what the container's places and accelerations do not keep."""
    x, a = motion.position, motion.acceleration
    ends = path.legs[0].at(np.zeros(1), 0)[0][0], path.legs[-1].at(np.array([np.inf]), 0)[0][0]
    for name, given, wanted in zip(("begins", "ends"), (x[0], x[-1]), ends, strict=True):
        away = float(np.linalg.norm(given - wanted))
        if away > 2.0 * KEPT:
            yield f"it {name} {1e3 * away:.2f} mm from the path's end"
    change = limits.jerk * STEP
    if (a[[0, -1]] != 0.0).any():
        yield "it is not at rest at its ends"
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1) / STEP
    if max(steps[0], steps[-1]) > REST:
        yield f"it moves with {1e3 * max(steps[0], steps[-1]):.1f} mm/s at its ends"
    # A law whose third derivative is bounded lies this near to lines between rows.
    felt = (x[2:] - 2.0 * x[1:-1] + x[:-2]) / STEP**2
    between = (a[2:] + 4.0 * a[1:-1] + a[:-2]) / 6.0
    unlike = float(np.linalg.norm(felt - between, axis=1).max(initial=0.0))
    if unlike > change + limits.acceleration * AGREE:
        yield f"its accelerations differ from its places by {unlike:.2g} m/s²"
    size = float(np.linalg.norm(a, axis=1).max())
    jerk = float(np.linalg.norm(np.diff(a, axis=0), axis=1).max()) / STEP
    for name, used, most in (("acceleration", size, limits.acceleration),
                             ("jerk", jerk, limits.jerk)):  # fmt: skip
        if used > most * (1.0 + 1e-6):
            yield f"its {name} is {100.0 * (used / most - 1.0):.2g} % above the limit"


def _tilt(motion: PlannedMotion, limits: PlanLimits) -> Iterator[str]:
    """Yields what the tilt of a container that the path does not turn does not keep."""
    if motion.tilt is None:
        return
    turned = Rotation.from_quat(motion.tilt.attitude)
    up = turned.apply([0.0, 0.0, 1.0])
    lean = np.arctan2(np.linalg.norm(up[:, :2], axis=1), up[:, 2])
    if max(lean[0], lean[-1]) > UPRIGHT:
        yield "it does not begin and end upright"
    rate = np.asarray((turned[:-1].inv() * turned[1:]).magnitude()) / STEP
    first, last = rate[0], rate[-1]
    if max(first, last) > AGREE * limits.tilt_rate + limits.tilt_acceleration * STEP:
        yield "it turns at its ends"
    for name, used, most in (("tilt", lean.max(), limits.tilt),
                             ("tilt rate", rate.max(), limits.tilt_rate)):  # fmt: skip
        if used > most * (1.0 + AGREE):
            yield f"its {name} is {100.0 * (used / most - 1.0):.2g} % above the limit"


def _joints(joints: JointMotion, path: Path, limits: PlanLimits) -> Iterator[str]:
    """Yields what the joints' places, by their differences, do not keep."""
    q, own = joints.position, joints.limits
    first, last = path.legs[0], path.legs[-1]
    assert isinstance(first, JointLeg)
    assert isinstance(last, JointLeg)
    begin = first.joint_derivative(np.zeros(1), 0)[0]
    end = last.joint_derivative(np.array([np.inf]), 0)[0]
    if max(np.abs(q[0] - begin).max(), np.abs(q[-1] - end).max()) > 2.0 * KEPT:
        yield "the joints do not begin and end where their path does"
    kinds = (
        ("velocity", own.velocity, limits.joint_velocity),
        ("acceleration", own.acceleration, limits.joint_acceleration),
        ("jerk", own.jerk, limits.joint_jerk),
    )
    for order, (name, most, share) in enumerate(kinds, start=1):
        # Rest before and after the motion counts, too.
        still = np.concatenate([np.tile(q[:1], (order, 1)), q, np.tile(q[-1:], (order, 1))])
        used = np.abs(np.diff(still, order, axis=0)).max(axis=0) / STEP**order / most
        if used.max(initial=0.0) > share * (1.0 + AGREE) + 1e-6:
            worst = own.names[int(np.argmax(used))]
            yield f"the {name} of {worst} is {100.0 * (used.max() / share - 1.0):.2g} % above"
    if joints.torque is not None:
        torque = float((np.abs(joints.torque) / own.torque).max())
        if torque > limits.joint_torque * (1.0 + AGREE):
            yield f"a torque is {100.0 * (torque / limits.joint_torque - 1.0):.2g} % above"


def _liquids(
    motion: PlannedMotion, attitude: Array | None, containers: Sequence[Kept]
) -> Iterator[str]:
    """Yields what the liquids do not keep, by a simulation with steps of half a row."""
    turned = attitudes(motion, attitude, len(motion.t))
    trajectory = Trajectory(motion.t, motion.acceleration, turned, name="the plan")
    for model, limits, loose in containers:
        inputs = trajectory.inputs(PERIODS * first_period(model))
        (found,) = highest(model, [inputs], max_step=0.5 * STEP)
        msh = np.nan_to_num(msh_of(model.container, found.heights), nan=np.inf)
        after = float(msh[len(motion.t) - 1 :].max())
        for name, height, most in (("height", float(msh.max()), limits.height),
                                   ("height after the end", after, limits.residual)):  # fmt: skip
            if height > most * (1.0 + AGREE):
                yield f"its {name} is {1e3 * height:.2f} mm, the limit {1e3 * most:.2f} mm"
        if loose is not None:
            use = standing_use(model, loose.standing, inputs, np.array(loose.place))
            if not use.stands:
                yield f"a container that stands loosely {use.words}"

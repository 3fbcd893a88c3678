"""Motions of a robot's joints as motions of the container, by the robot's URDF and Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from slosh_base.types import Array
from slosh_estimator.robot import Robot
from slosh_plan.errors import SloshPlanError
from slosh_plan.trajectory import PEAK_SPACING, Trajectory, dense

MOST = 1e4
"""Of a joint's position, velocity or acceleration: more is no number of a machine."""
JUMP = 1.5 * np.pi
"""No joint with stops turns so far from one point to the next [rad]: its angle wraps."""


class Arm(Robot):
    """A robot that carries the container, and whose motions are planned.

    Args:
        urdf: text of its description.
        tool_frame: link whose origin is the container's, in the centre of the still free surface,
            with z along the container's axis.
        name: of the description, for messages.

    Raises:
        SloshPlanError: Pinocchio is missing, no such description, no such link.
    """

    def __init__(self, urdf: str, tool_frame: str, name: str = "URDF") -> None:
        super().__init__(urdf, tool_frame, name=name, error=SloshPlanError)

    def motion(
        self,
        t: Array,
        joints: Sequence[str],
        position: Array,
        velocity: Array | None = None,
        acceleration: Array | None = None,
        name: str = "trajectory",
    ) -> Trajectory:
        """The container's motion as the joints move.

        Between the points joints move by splines, as a joint trajectory controller has them: of
        the fifth degree with velocities and accelerations, of the third with velocities, and with
        positions alone the cubic spline that rests at both ends.

        Args:
            t: (N,) [s].
            joints: (J,) names of the columns.
            position: (N, J) [rad or m].
            velocity: (N, J) [rad/s or m/s]; None: not given.
            acceleration: (N, J) [rad/s² or m/s²], with velocities only; None: not given.
            name: for messages.

        Raises:
            SloshPlanError: joints that the robot does not have, or that are missing; points that
                are no motion.
        """
        self._check_joints(joints, name)
        # Times, shapes, gaps: the checks of every motion, before anything is computed.
        Trajectory(t, np.zeros((np.size(t), 3)), name=name)
        columns = [
            _checked(values, what, (len(t), len(joints)), joints, name)
            for what, values in (
                ("position", position), ("velocity", velocity), ("acceleration", acceleration),
            )
            if values is not None
        ]  # fmt: skip
        columns[0] = self._joined(joints, columns[0])
        moments = dense(np.asarray(t, dtype=np.float64), PEAK_SPACING)
        curve = _spline(np.asarray(t, dtype=np.float64), columns, name)
        states = [np.asarray(curve(moments, order)) for order in range(3)]
        return self._moved(moments, joints, states, name)

    def wrapping(self, joints: Sequence[str], position: Array) -> list[str]:
        """Joints whose angle wraps at ±π: it jumps by about 2π between two points.

        A joint without stops turns by less than half a turn from point to point; the angle of
        one with stops may be reported in -π … π, too.

        Args:
            joints: (J,) names of the columns; those that the robot does not have never wrap.
            position: (N, J) [rad or m].
        """
        joined = self._joined(joints, position)
        return [name for k, name in enumerate(joints) if (joined[:, k] != position[:, k]).any()]

    def _joined(self, joints: Sequence[str], position: Array) -> Array:
        """(N, J) the same positions, angles that wrap joined."""
        joined = position.copy()
        for place, name in enumerate(joints):
            joint = (
                self._model.joints[self._model.getJointId(name)]
                if self._model.existJointName(name)
                else None
            )
            if joint is None or joint.shortname().startswith("JointModelP"):
                continue  # a sliding joint has no angle
            jump = np.pi if joint.nq == 2 else JUMP
            if (np.abs(np.diff(position[:, place])) > jump).any():
                joined[:, place] = np.unwrap(position[:, place], discont=jump)
        return joined

    def _check_joints(self, joints: Sequence[str], name: str) -> None:
        model = self._model
        for joint in joints:
            if not model.existJointName(joint):
                known = ", ".join(model.names[1:])
                raise SloshPlanError(
                    f"{name}: {self._name} has no moving joint {joint!r} (it has {known:.200})"
                )
            if joints.count(joint) > 1:
                raise SloshPlanError(f"{name}: joint {joint!r} appears twice")
        for joint in self.carrying:
            if joint not in joints:
                raise SloshPlanError(
                    f"{name}: joint {joint!r} carries the container and is missing"
                )

    def _moved(
        self, t: Array, joints: Sequence[str], states: Sequence[Array], name: str
    ) -> Trajectory:
        """The frame's motion, with exact derivatives."""
        pin, model = self._pin, self._model
        data, places = model.createData(), [list(joints).index(m.joint) for m in self._movers]
        rest = pin.neutral(model)
        found = np.empty((len(t), 13))
        world, local = pin.LOCAL_WORLD_ALIGNED, pin.LOCAL
        for row, (at, rate, change) in enumerate(zip(*states, strict=True)):
            q, v, a = rest.copy(), np.zeros(model.nv), np.zeros(model.nv)
            for mover, place in zip(self._movers, places, strict=True):
                mover.put(q, at[place])
                v[mover.rate_at] = mover.multiplier * rate[place]
                a[mover.rate_at] = mover.multiplier * change[place]
            pin.forwardKinematics(model, data, q, v, a)
            pose = pin.updateFramePlacement(model, data, self._frame)
            found[row, :3] = pose.translation
            found[row, 3:7] = pin.Quaternion(pose.rotation).coeffs()
            felt = pin.getFrameClassicalAcceleration(model, data, self._frame, world)
            found[row, 7:10] = felt.linear
            found[row, 10:] = pin.getFrameVelocity(model, data, self._frame, local).angular
        return Trajectory(t, found[:, 7:10], found[:, 3:7], found[:, 10:], found[:, :3], name)


def _checked(
    values: Array, what: str, shape: tuple[int, int], joints: Sequence[str], name: str
) -> Array:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != shape:
        raise SloshPlanError(f"{name}: {what} has the shape {numbers.shape}, expected {shape}")
    bad = np.argwhere(~(np.abs(numbers) <= MOST))
    if len(bad):
        row, column = bad[0]
        raise SloshPlanError(
            f"{name}: {what}[{row}] of joint {joints[column]!r} = {numbers[row, column]:g} is "
            "not a usable number"
        )
    return numbers


def _spline(t: Array, columns: Sequence[Array], name: str) -> Any:
    """The joints' positions over time [s], with derivatives."""
    if len(columns) == 1:
        if len(t) < 3:
            raise SloshPlanError(
                f"{name}: {len(t)} points without velocities do not determine the "
                "acceleration; give at least 3, or velocities"
            )
        return scipy.interpolate.CubicSpline(t, columns[0], bc_type="clamped")
    if len(columns) == 2:
        return scipy.interpolate.CubicHermiteSpline(t, columns[0], columns[1])
    return scipy.interpolate.BPoly.from_derivatives(t, np.stack(columns, axis=1))

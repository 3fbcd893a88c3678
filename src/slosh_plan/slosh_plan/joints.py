"""Converts joint motions to motions of the container, with URDF and Pinocchio."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from slosh_base.types import Array
from slosh_motion.inputs.robot import Mover, Robot
from slosh_motion.tuning import TUNING as INPUTS
from slosh_plan.errors import SloshPlanError
from slosh_plan.trajectory import PEAK_SPACING, Trajectory, dense

MOST = 1e4
"""Of a joint's position, velocity or acceleration: more is no number of a machine."""
JUMP = 1.5 * np.pi
"""No joint with stops turns so far from one point to the next [rad]: its angle wraps."""


class Link(NamedTuple):
    """A joint of a robot's kinematic chain, with the pose of the link that follows.

    Attributes:
        joint: whose position it follows, by multiplier · position + offset.
        multiplier, offset: of that position [1, rad or m].
        slides: whether it slides along its axis; otherwise it turns about it.
        axis: (3,) in its own frame.
        placement: (12,) rotation by rows and translation [m] from the joint before it.
    """

    joint: str
    multiplier: float
    offset: float
    slides: bool
    axis: Array
    placement: Array


class Arm(Robot):
    """A robot that carries the container, for planning.

    Args:
        urdf: text of its description.
        tool_frame: link whose origin is the container's, in the centre of the still free surface,
            with z along the container's axis.
        name: of the description, for messages.
        group: joints that move; others that carry the container are held where they are not given.
            Empty: all joints that carry the container move.

    Attributes:
        held: names of the joints that carry the container and are not in the group.

    Raises:
        SloshPlanError: Pinocchio is missing, no such description, no such link.
    """

    def __init__(
        self, urdf: str, tool_frame: str, name: str = "URDF", group: Sequence[str] = ()
    ) -> None:
        super().__init__(urdf, tool_frame, name=name, error=SloshPlanError)
        self.held = tuple(one for one in self.carrying if one not in group) if group else ()
        limits = self.limits(self.held)
        bounds = zip(self.held, limits["lower"], limits["upper"], strict=True)
        self._rests = tuple(joint for joint, lower, upper in bounds if lower <= 0.0 <= upper)

    def motion(
        self,
        t: Array,
        joints: Sequence[str],
        position: Array,
        velocity: Array | None = None,
        acceleration: Array | None = None,
        name: str = "trajectory",
    ) -> Trajectory:
        """Computes the container's motion from a motion of the joints.

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
        columns[0] = self.joined(joints, columns[0])
        self._check_range(joints, columns[0], name)
        moments = dense(np.asarray(t, dtype=np.float64), PEAK_SPACING)
        curve = joint_curve(np.asarray(t, dtype=np.float64), columns, name)
        states = [np.asarray(curve(moments, order)) for order in range(3)]
        return self._moved(moments, joints, states, name)

    def wrapping(self, joints: Sequence[str], position: Array) -> list[str]:
        """Returns the joints whose recorded angle jumps by about 2π between two points.

        A joint without stops turns by less than half a turn from point to point; the angle of
        one with stops may be reported in -π … π, too.

        Args:
            joints: (J,) names of the columns; those that the robot does not have never wrap.
            position: (N, J) [rad or m].
        """
        joined = self.joined(joints, position)
        with np.errstate(invalid="ignore"):  # false for what is not a number
            apart = np.abs(joined - position) > 0.0
        return [name for name, column in zip(joints, apart.T, strict=True) if column.any()]

    def known(self, joints: Sequence[str]) -> list[bool]:
        """Returns for each joint name whether the robot's description contains it."""
        return [self._model.existJointName(name) for name in joints]

    def check_joints(self, joints: Sequence[str], name: str) -> None:
        """Raises SloshPlanError if a joint that carries the container is missing or repeated.

        Args:
            joints: names of the columns; those that the robot does not have are passed over.
            name: for messages.
        """
        self._check_joints([joint for joint in joints if self._model.existJointName(joint)], name)
        for joint in joints:
            if joints.count(joint) > 1:
                raise SloshPlanError(f"{name}: joint {joint!r} appears twice")

    def limits(self, joints: Sequence[str]) -> dict[str, Array]:
        """Returns the joint limits of the description: `lower`, `upper`, `velocity`, `torque`.

        (J,) each [rad or m, per second, N m or N]; infinite where there is none. Torques count
        where the description has masses.
        """
        model = self._model
        found = {name: np.full(len(joints), np.inf) for name in ("upper", "velocity", "torque")}
        found["lower"] = np.full(len(joints), -np.inf)
        heavy = sum(one.mass for one in model.inertias) > 0.0
        for place, name in enumerate(joints):
            joint = model.joints[model.getJointId(name)] if model.existJointName(name) else None
            if joint is None:
                continue
            given = {"velocity": model.velocityLimit[joint.idx_v]}
            if heavy:
                given["torque"] = model.effortLimit[joint.idx_v]
            for what, value in given.items():
                found[what][place] = value if value > 0.0 else np.inf
            if joint.nq == 1:  # a joint without stops has none
                lower = model.lowerPositionLimit[joint.idx_q]
                upper = model.upperPositionLimit[joint.idx_q]
                if lower < upper:
                    found["lower"][place], found["upper"][place] = lower, upper
        return found

    def poses(self, joints: Sequence[str], position: Array) -> tuple[Array, Array]:
        """Returns the container's positions (N, 3) [m] and quaternions x, y, z, w (N, 4).

        Args:
            joints: (J,) names of the columns; those that the robot does not have do not matter.
            position: (N, J) [rad or m].
        """
        pin, model, data = self._pin, self._model, self._model.createData()
        found = np.empty((len(position), 7))
        for row, q in enumerate(self._configurations(joints, position)):
            pin.forwardKinematics(model, data, q)
            pose = pin.updateFramePlacement(model, data, self._frame)
            found[row, :3] = pose.translation
            found[row, 3:] = pin.Quaternion(pose.rotation).coeffs()
        signs = np.sign(np.einsum("ij,ij->i", found[1:, 3:], found[:-1, 3:]))
        found[1:, 3:] *= np.cumprod(np.where(signs < 0.0, -1.0, 1.0))[:, None]
        return found[:, :3], found[:, 3:]

    def chain(self) -> tuple[list[Link], Array]:
        """Returns the joints from the robot's base to the container's link, and that link.

        Returns:
            joints; and (12,) rotation by rows and translation from the last of them to the link.
        """
        found = []
        for number, mover in zip(self._carriers, self._movers, strict=True):
            joint = self._model.joints[number]
            state = joint.createData()
            joint.calc(state, self._rest)
            moves = np.asarray(state.S, dtype=np.float64).ravel()
            slides = bool(moves[:3].any())
            found.append(
                Link(
                    mover.joint, mover.multiplier, mover.offset, slides,
                    moves[:3] if slides else moves[3:],
                    _flat(self._model.jointPlacements[number]),
                )
            )  # fmt: skip
        return found, _flat(self._placed)

    def tip(
        self, joints: Sequence[str], position: Array, velocity: Array, acceleration: Array
    ) -> Array:
        """Returns position, velocity and acceleration (3, 3) of the container's origin.

        Args:
            joints: (J,) names.
            position, velocity, acceleration: (J,) [rad or m, per second, …].
        """
        states = [np.atleast_2d(one) for one in (position, velocity, acceleration)]
        pin, model, data = self._pin, self._model, self._data
        (q,) = self._configurations(joints, states[0])
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        for mover, column in self._columns(joints):
            v[mover.rate_at] = mover.multiplier * velocity[column]
            a[mover.rate_at] = mover.multiplier * acceleration[column]
        pin.forwardKinematics(model, data, q, v, a)
        world = pin.LOCAL_WORLD_ALIGNED
        place = pin.updateFramePlacement(model, data, self._frame).translation
        rate = pin.getFrameVelocity(model, data, self._frame, world).linear
        change = pin.getFrameClassicalAcceleration(model, data, self._frame, world).linear
        return np.array([place, rate, change])

    def torque_terms(
        self, joints: Sequence[str], position: Array, slope: Array, bend: Array
    ) -> Array:
        """Returns each joint's torque terms along a path, τ = α s̈ + β ṡ² + γ [N m or N].

        Newton and Euler's equations; the liquid's and the container's masses count where the
        description holds them.

        Args:
            joints: (J,) names of the columns; 0 for those that the robot does not have.
            position, slope, bend: (N, J) the joints and their first two derivatives by s.
        """
        pin, model, data = self._pin, self._model, self._model.createData()
        found = np.zeros((len(position), 3, len(joints)))
        columns = [
            (place, model.joints[model.getJointId(name)].idx_v)
            for place, name in enumerate(joints)
            if model.existJointName(name)
        ]
        still = np.zeros(model.nv)
        for row, q in enumerate(self._configurations(joints, position)):
            rate, change = still.copy(), still.copy()
            for place, index in columns:
                rate[index], change[index] = slope[row, place], bend[row, place]
            gravity = pin.rnea(model, data, q, still, still).copy()
            along = pin.rnea(model, data, q, still, rate) - gravity
            across = pin.rnea(model, data, q, rate, change) - gravity
            for place, index in columns:
                found[row, :, place] = along[index], across[index], gravity[index]
        return found

    def _configurations(self, joints: Sequence[str], position: Array) -> Iterator[Array]:
        """Yields the robot's configuration vector for each sample; joints not given are at 0."""
        model = self._model
        places = [
            (column, model.joints[model.getJointId(name)])
            for column, name in enumerate(joints)
            if model.existJointName(name)
        ]
        rest = self._pin.neutral(model)
        for mover in self._movers:
            mover.put(rest, 0.0)
        for row in position:
            q = rest.copy()
            for column, place in places:
                value = row[column]
                # A joint without stops is held as cosine and sine.
                turned = [value] if place.nq == 1 else [np.cos(value), np.sin(value)]
                q[place.idx_q : place.idx_q + place.nq] = turned
            for mover, column in self._columns(joints):  # those that mimic others, too
                mover.put(q, row[column])
            yield q

    def _columns(self, joints: Sequence[str]) -> list[tuple[Mover, int]]:
        """Returns the joints that carry the container, each with its column in joint arrays."""
        own = list(joints)
        return [(mover, own.index(mover.joint)) for mover in self._movers if mover.joint in own]

    def joined(self, joints: Sequence[str], position: Array) -> Array:
        """Returns the joint positions (N, J) with jumps by 2π removed."""
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
            if joint not in joints and joint not in self._rests:
                held = "; it is not in the group and cannot be held at 0" * (joint in self.held)
                raise SloshPlanError(
                    f"{name}: joint {joint!r} carries the container and is missing{held}"
                )

    def _check_range(self, joints: Sequence[str], position: Array, name: str) -> None:
        """Raises SloshPlanError if a position is far beyond its limits, as if given in degrees."""
        limits = self.limits(joints)
        outside = np.maximum(limits["lower"] - position, position - limits["upper"])
        if len(outside) and outside.max() > INPUTS.beyond_limits:
            row, place = map(int, np.unravel_index(int(np.argmax(outside)), outside.shape))
            raise SloshPlanError(
                f"{name}: joint {joints[place]!r} reaches {position[row, place]:.6g}, far outside "
                f"its limits, {limits['lower'][place]:.6g} to {limits['upper'][place]:.6g}: "
                "positions must be in rad and m, not in degrees and mm"
            )

    def _moved(
        self, t: Array, joints: Sequence[str], states: Sequence[Array], name: str
    ) -> Trajectory:
        """Computes the motion of the tool frame with exact derivatives."""
        pin, model = self._pin, self._model
        data, columns = model.createData(), self._columns(joints)
        found = np.empty((len(t), 13))
        world, local = pin.LOCAL_WORLD_ALIGNED, pin.LOCAL
        configurations = self._configurations(joints, states[0])
        for row, (q, rate, change) in enumerate(zip(configurations, *states[1:], strict=True)):
            v, a = np.zeros(model.nv), np.zeros(model.nv)
            for mover, column in columns:
                v[mover.rate_at] = mover.multiplier * rate[column]
                a[mover.rate_at] = mover.multiplier * change[column]
            pin.forwardKinematics(model, data, q, v, a)
            pose = pin.updateFramePlacement(model, data, self._frame)
            found[row, :3] = pose.translation
            found[row, 3:7] = pin.Quaternion(pose.rotation).coeffs()
            felt = pin.getFrameClassicalAcceleration(model, data, self._frame, world)
            found[row, 7:10] = felt.linear
            found[row, 10:] = pin.getFrameVelocity(model, data, self._frame, local).angular
        return Trajectory(t, found[:, 7:10], found[:, 3:7], found[:, 10:], found[:, :3], name)


def _flat(placement: Any) -> Array:
    """Returns rotation (by rows) and translation of a Pinocchio placement as an array (12,)."""
    return np.concatenate([np.asarray(placement.rotation).ravel(), placement.translation])


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


def joint_curve(t: Array, columns: Sequence[Array], name: str) -> Any:
    """Interpolates joint positions over time [s] as a joint trajectory controller does.

    Args:
        t: (N,) [s].
        columns: (N, J) each: positions; or these and velocities; or these and accelerations.
        name: for messages.

    Raises:
        SloshPlanError: fewer than three points without velocities.
    """
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

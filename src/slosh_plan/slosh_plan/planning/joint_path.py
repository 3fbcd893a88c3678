"""The path of a container that a robot carries along a path of its joints.

The joints move on smooth curves q(s); the container's position and attitude follow from the
robot's kinematics, and are splines through many of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_model.tilt import TILT_THRESHOLD, largest_tilt
from slosh_plan.errors import SloshPlanError
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_demands import JointDemands, joint_columns
from slosh_plan.planning.joint_limits import JointLimits
from slosh_plan.planning.limits import JOINT_LIMITS
from slosh_plan.planning.path import DEGREE, KEPT, Leg, Path, smooth_path
from slosh_plan.planning.progress import never

POINTS = 1000
"""Of a leg at which the robot's kinematics are computed."""
LYING = math.radians(45.0)
"""A container that is tilted by more [rad] at the start is no open container with liquid."""


@dataclass(frozen=True, kw_only=True)
class JointLeg(Leg):
    """A leg parameterised by joint path length s; `spline` is the container's position [m].

    Attributes:
        joints: (J,) the joints over s [rad or m].
        attitude: (4,) the container's quaternion x, y, z, w over s, world ← container; its length
            is 1 but for the spline's error.
        torques: (3 J,) terms of the torques over s; None: no torque is limited.
        follows_yaw: whether the liquid's axes turn with the container, as in a rectangle.
    """

    joints: BSpline
    attitude: BSpline
    torques: BSpline | None
    follows_yaw: bool

    def columns(self, s: Array) -> Array:
        """Returns the quantities that the search interpolates along the leg, one per column."""
        motion = Leg.columns(self, s)
        turned = self._liquid_axes(s).reshape(len(s), -1)
        slope, bend, change = (self.joint_derivative(s, order) for order in (1, 2, 3))
        torques = None if self.torques is None else self.torque_terms(s)
        return np.column_stack([motion, turned, joint_columns(slope, bend, change, torques)])

    def joint_derivative(self, s: Array, order: int) -> Array:
        """Returns the joint positions (N, J) or their derivatives with respect to path length."""
        return np.asarray(self.joints(np.clip(s, 0.0, self.length), order))

    def joint_slowness(self, s: Array) -> Array:
        """Returns the time by length that velocities, and accelerations across, ask, (N,)."""
        assert self.demands is not None
        limits = self.demands.limits
        slow = np.abs(self.joint_derivative(s, 1)) / limits.velocity
        bent = np.sqrt(np.abs(self.joint_derivative(s, 2)) / limits.acceleration)
        return np.asarray((np.hstack([slow, bent]) ** 4).sum(axis=1) ** 0.25)

    def torque_terms(self, s: Array) -> Array:
        """Returns the torque terms (N, 3, J); see `Arm.torque_terms`."""
        assert self.torques is not None
        found = np.asarray(self.torques(np.clip(s, 0.0, self.length)))
        return found.reshape(len(s), 3, -1)

    def lean(self) -> tuple[float, float]:
        """Gravity's component along the container's floor, at rest at the leg's start [m/s²]."""
        x, y, _ = GRAVITY * self._liquid_axes(np.zeros(1))[0, :, 2]
        return float(x), float(y)

    def attitudes(self, s: Array) -> Array:
        """Returns the container's quaternions (N, 4) at path positions s."""
        found: Array = np.asarray(self.attitude(np.clip(s, 0.0, self.length)))
        length: Array = np.linalg.norm(found, axis=1, keepdims=True)
        return found / length

    def _liquid_axes(self, s: Array) -> Array:
        """Returns rotations (N, 3, 3), world to container axes, with yaw only for boxes."""
        quaternions = self.attitudes(s)
        back: Array = Rotation.from_quat(quaternions).inv().as_matrix()
        if self.follows_yaw:
            return back
        yaw = 2.0 * np.arctan2(quaternions[:, 2], quaternions[:, 3])
        return np.asarray(Rotation.from_euler("z", yaw[:, None]).as_matrix() @ back)


def joint_path(
    arm: Arm,
    limits: JointLimits,
    points: Array,
    *,
    follows_yaw: bool = False,
    name: str = "the path",
    stopped: Callable[[], bool] = never,
    times: Array | None = None,
) -> Path:
    """Creates the container's path from a joint path through waypoints of the joints.

    Args:
        arm: the robot.
        limits: of the joints, by the names of the points' columns.
        points: (N, J) [rad or m].
        follows_yaw: whether the liquid's axes turn with the container.
        name: for messages.
        stopped: whether somebody wants to end it.
        times: (N,) at which a motion passes the points, rising [s]; None: they are not known.

    Raises:
        SloshPlanError: as `smooth_path`; joints that carry the container and are missing; a point
            beyond a limit; a container that lies at the start.
        StoppedError: it was stopped before its end.
    """
    joints = limits.names
    arm.check_joints(joints, name)
    path = smooth_path(points, joints, stopped, times)
    limits.check_positions(np.asarray(points, dtype=np.float64), name)
    for leg in path.legs:
        (curve,) = leg.at(np.linspace(0.0, leg.length, POINTS), 0)
        limits.check_positions(curve, f"{name}: the smooth path between the points", 2.0 * KEPT)
    demands = JointDemands(limits, bool(np.isfinite(limits.torque).any()))
    legs = tuple(_carried(arm, joints, leg, demands, follows_yaw) for leg in path.legs)
    at = np.concatenate([leg.attitudes(np.linspace(0.0, leg.length, POINTS)) for leg in legs])
    tilt = largest_tilt(at[:1])
    if tilt > LYING:
        raise SloshPlanError(
            f"{name}: the container is tilted by {math.degrees(tilt):.0f}° at the start: the tool "
            "frame's z axis must be the container's axis, which points up"
        )
    return replace(path, legs=legs, tilts=largest_tilt(at) > TILT_THRESHOLD)


def _carried(
    arm: Arm, joints: Sequence[str], leg: Leg, demands: JointDemands, follows_yaw: bool
) -> JointLeg:
    s = np.linspace(0.0, leg.length, POINTS + 1)
    at, slope, bend = leg.at(s, 2)
    place, turn = arm.poses(joints, at)
    torques = None
    if demands.torques:
        terms = arm.torque_terms(joints, at, slope, bend)
        torques = make_interp_spline(s, terms.reshape(len(s), -1), k=DEGREE)
    return JointLeg(
        make_interp_spline(s, place, k=DEGREE), leg.length, demands, joints=leg.spline,
        attitude=make_interp_spline(s, turn, k=DEGREE), torques=torques, follows_yaw=follows_yaw,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """Motion of the robot's joints: positions, velocities, accelerations over time.

    Attributes:
        limits: of the joints, and their names.
        position, velocity, acceleration: (N, J) at the motion's rows [rad or m, …].
        attitude: (N, 4) the container's quaternions x, y, z, w, world ← container.
        torque: (N, J) [N m or N]; None: no torque is limited.
    """

    limits: JointLimits
    position: Array
    velocity: Array
    acceleration: Array
    attitude: Array
    torque: Array | None

    def shares(self, step: float) -> dict[str, float]:
        """Returns the largest used fraction of each kind of joint limit.

        Args:
            step: between two rows [s].
        """
        jerk = np.diff(self.acceleration, axis=0) / step
        pairs = (
            (self.velocity, self.limits.velocity), (self.acceleration, self.limits.acceleration),
            (jerk, self.limits.jerk), (self.torque, self.limits.torque),
        )  # fmt: skip
        used = [0.0 if one is None else float((np.abs(one) / most).max()) for one, most in pairs]
        return dict(zip(JOINT_LIMITS, used, strict=True))


def joints_along(leg: JointLeg, s: Array, rate: Array, change: Array) -> JointMotion:
    """Computes the joint motion at path positions s and their rates ds/dt, d²s/dt², (N,) each."""
    assert leg.demands is not None
    slope, bend = leg.joint_derivative(s, 1), leg.joint_derivative(s, 2)
    v, v2, a = rate[:, None], (rate**2)[:, None], change[:, None]
    torque = None
    if leg.torques is not None:
        along, across, weight = leg.torque_terms(s).transpose(1, 0, 2)
        torque = along * a + across * v2 + weight
    return JointMotion(
        leg.demands.limits, leg.joint_derivative(s, 0), slope * v, bend * v2 + slope * a,
        leg.attitudes(s), torque,
    )  # fmt: skip


def gathered(parts: Sequence[JointMotion]) -> JointMotion:
    """Concatenates the joint motions of legs, each from rest to rest."""
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("position", "velocity", "acceleration", "attitude")
    }
    for name in ("velocity", "acceleration"):
        columns[name][[0, -1]] = 0.0
    attitude = columns["attitude"]
    signs = np.sign(np.einsum("ij,ij->i", attitude[1:], attitude[:-1]))
    attitude[1:] *= np.cumprod(np.where(signs < 0.0, -1.0, 1.0))[:, None]
    torques = [part.torque for part in parts if part.torque is not None]
    return JointMotion(
        parts[0].limits, **columns, torque=np.concatenate(torques) if torques else None
    )

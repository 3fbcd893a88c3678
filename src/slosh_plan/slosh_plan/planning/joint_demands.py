"""Constraints on robot joints in the optimisation, as CasADi expressions.

A joint moves along its path as q(s), so that q̇ = q′ṡ, q̈ = q″ṡ² + q′s̈ and q⃛ = q‴ṡ³ + 3q″ṡs̈ + q′s⃛.
Torques are τ = α s̈ + β ṡ² + γ, as in Bobrow, Dubowsky and Gibson, Int. J. Robotics Research 4(3),
1985. Every demand is a square that must be at most 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_plan.planning.flow import Expression, casadi
from slosh_plan.planning.joint_limits import JointLimits

CURVE = 9
"""Columns of the container's path: its first three derivatives by s, x, y and z."""
TURN = 9
"""Columns of its attitude: the matrix from the world's axes to the liquid's, row by row."""
ORDERS = 3
"""Of a joint's derivatives by s, and the terms of a torque."""


@dataclass(frozen=True, slots=True, eq=False)
class JointDemands:
    """Constraints on the joints, computed from the interpolated columns of a path.

    Attributes:
        limits: of the joints.
        torques: whether the columns hold the torques' terms, too.
    """

    limits: JointLimits
    torques: bool

    @property
    def width(self) -> int:
        """Number of quantities that are interpolated along a leg for the limits of the joints."""
        count = len(self.limits.names)
        return CURVE + TURN + ORDERS * count * (2 if self.torques else 1)

    def turned(self, curve: Expression) -> Expression:
        """Returns the rotation from world to container axes, with yaw only for boxes."""
        ca = casadi()
        return ca.reshape(curve[CURVE : CURVE + TURN], 3, 3).T

    def demands(
        self, curve: Expression, state: Expression, shares: Expression
    ) -> list[Expression]:
        """Returns the constraints on joint velocities, accelerations and torques.

        Args:
            curve: the columns at a place.
            state: s, ṡ, s̈ first.
            shares: of the joints' limits that may be used, as JOINT_LIMITS has them.
        """
        limits, found = self.limits, []
        squared = state[1] ** 2
        for n, (slope, bend, _) in self._terms(curve, 0):
            if np.isfinite(limits.velocity[n]):
                found.append((slope * state[1] / (shares[0] * limits.velocity[n])) ** 2)
            if np.isfinite(limits.acceleration[n]):
                asked = slope * state[2] + bend * squared
                found.append((asked / (shares[1] * limits.acceleration[n])) ** 2)
        if self.torques:
            for n, (along, across, weight) in self._terms(curve, 1):
                if np.isfinite(limits.torque[n]):
                    asked = along * state[2] + across * squared + weight
                    found.append((asked / (shares[3] * limits.torque[n])) ** 2)
        return found

    def jerks(
        self, curve: Expression, at: list[Expression], third: Expression, shares: Expression
    ) -> list[Expression]:
        """Returns the constraints on the jerks of the joints.

        Args:
            curve: the columns at a place.
            at: s, ṡ, s̈ there.
            third: d³s/dt³.
            shares: as in `demands`.
        """
        found = []
        for n, (slope, bend, change) in self._terms(curve, 0):
            if np.isfinite(self.limits.jerk[n]):
                asked = slope * third + 3.0 * bend * at[1] * at[2] + change * at[1] ** 3
                found.append((asked / (shares[2] * self.limits.jerk[n])) ** 2)
        return found

    def _terms(self, curve: Expression, block: int) -> Iterator[tuple[int, list[Expression]]]:
        """Yields the interpolated terms of each joint: path derivatives or torque terms."""
        count = len(self.limits.names)
        begin = CURVE + TURN + block * ORDERS * count
        for n in range(count):
            yield n, [curve[begin + order * count + n] for order in range(ORDERS)]


def joint_columns(slope: Array, bend: Array, change: Array, torques: Array | None) -> Array:
    """Joins the joints' derivatives and torque terms to the columns of `JointDemands`.

    Args:
        slope, bend, change: (N, J) the joints' first three derivatives by s.
        torques: (N, 3, J) the torques' terms; None: not looked up.
    """
    columns = [slope, bend, change]
    if torques is not None:
        columns.append(torques.reshape(len(torques), -1))
    return np.column_stack(columns)

"""Effect: the acceleration input is measured at a point away from the container."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import (
    AX,
    AY,
    AZ,
    CHANGE_X,
    CHANGE_Y,
    CHANGE_Z,
    QW,
    QX,
    QY,
    QZ,
    RATE_X,
    RATE_Y,
    RATE_Z,
    TURN,
)


@compiled
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _drive(dt, inputs, pose, memory, p):  # type: ignore[no-untyped-def]
    rate = (pose[RATE_X], pose[RATE_Y], pose[RATE_Z])
    change = (pose[CHANGE_X], pose[CHANGE_Y], pose[CHANGE_Z])
    arm = (p[0], p[1], p[2])
    turn, swing = _cross(change, arm), _cross(rate, _cross(rate, arm))
    b = (turn[0] + swing[0], turn[1] + swing[1], turn[2] + swing[2])
    # R b by the quaternion's vector part: b + 2 u × (u × b + w b).
    u, w = (pose[QX], pose[QY], pose[QZ]), pose[QW]
    c = _cross(u, b)
    d = _cross(u, (c[0] + w * b[0], c[1] + w * b[1], c[2] + w * b[2]))
    return (
        inputs[AX] + b[0] + 2.0 * d[0],
        inputs[AY] + b[1] + 2.0 * d[1],
        inputs[AZ] + b[2] + 2.0 * d[2],
        inputs[TURN],
    )


def _arm(name: str) -> Parameter:
    return Parameter(
        name=name, unit="m", lower=-2.0, upper=2.0, neutral=0.0,
        description=f"{name} of the container's origin from the given point, container's axes",
        plausible=(-0.4, 0.4), starts=(0.0,),
        spread=0.15,  # from the flange, or the cup's floor, to the surface
    )  # fmt: skip


EFFECT = Effect(
    name="lever_arm",
    title="lever arm",
    meaning="The acceleration is that of another point of the robot than the container.",
    stages=(Stage.INPUT,),
    equation=r"a \to a + \dot\omega\times r + \omega\times(\omega\times r)",
    source="kinematics of the rigid body",
    of_rig=True,
    parameters=(_arm("x"), _arm("y"), _arm("z")),
    order=30,
    needs_rotation=True,
    drive=_drive,
)

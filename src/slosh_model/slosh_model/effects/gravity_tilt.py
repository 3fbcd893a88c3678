"""Effect: gravity acts along the floor of a tilted container."""

from __future__ import annotations

import math

from slosh_model.constants import GRAVITY
from slosh_model.effects.base import Effect, Stage, compiled
from slosh_model.indices import QW, QX, QY, QZ


@compiled
def _drive(dt, inputs, pose, memory, p):  # type: ignore[no-untyped-def]
    ax, ay, az, turn = inputs
    fx, fy, fz = ax, ay, az + GRAVITY
    # Rᵀ f by the quaternion's vector part: f + 2 u × (u × f - w f).
    ux, uy, uz, w = pose[QX], pose[QY], pose[QZ], pose[QW]
    cx, cy, cz = uy * fz - uz * fy, uz * fx - ux * fz, ux * fy - uy * fx
    cx, cy, cz = cx - w * fx, cy - w * fy, cz - w * fz
    gx = fx + 2.0 * (uy * cz - uz * cy)
    gy = fy + 2.0 * (uz * cx - ux * cz)
    gz = fz + 2.0 * (ux * cy - uy * cx)
    # To axes that are the container's but for its yaw.
    c, s = math.cos(turn), math.sin(turn)
    return c * gx - s * gy, s * gx + c * gy, gz - GRAVITY, turn


EFFECT = Effect(
    name="gravity_tilt",
    title="tilt by attitude",
    meaning="In a container that tilts as it moves, a part of gravity acts along its floor.",
    stages=(Stage.INPUT,),
    equation=r"a \to R^T(a + g\hat z) - g\hat z",
    source="equivalence of gravity and acceleration",
    order=40,
    needs_rotation=True,
    drive=_drive,
)

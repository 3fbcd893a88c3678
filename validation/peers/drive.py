"""Computes what acts on the liquid of a test case's base model at given times."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from slosh_model.simulate import Inputs
from validation.blind import drive as truth_drive
from validation.blind import gauss, theory
from validation.blind.truth_model import Truth

Array = NDArray[np.float64]
GRAVITY = theory.GRAVITY


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Inputs and the base model's coefficients at T times, in axes that do not yaw.

    Attributes:
        t: (T,) since the motion began [s].
        felt: (T, 3) acceleration that the base model feels, gravity excluded [m/s²].
        table: (T, 3) the table's acceleration in the axes of `felt` [m/s²].
        jerk: (T, 3) its rate of change [m/s³].
        lean: (T, 3) what the attitude would add to `felt` if gravity leaned with it [m/s²].
        arms: (T, 3, 3) what a lever of 1 m along the container's x, y, z would add [m/s²].
        heading: (T,) the container's yaw [rad].
        spin, spin_rate: (T,) its rate and that one's rate [rad/s, rad/s²].
        squared: (T,) ω² [rad²/s²].
        damping: (T,) 2ζω [1/s].
        curvature: (T,) c = ω²/g of a paraboloid, 0 of a plane [1/m].
        alpha: (T,) the spring's cubic share, 0 of a plane.
        vertical: (T,) 1 where the base has the vertical acceleration, else 0.
        radius: (T,) R [m].
    """

    t: Array
    felt: Array
    table: Array
    jerk: Array
    lean: Array
    arms: Array
    heading: Array
    spin: Array
    spin_rate: Array
    squared: Array
    damping: Array
    curvature: Array
    alpha: Array
    vertical: Array
    radius: Array

    def row(self, index: int) -> Drive:
        """Returns the inputs and coefficients at one time."""
        return Drive(*(getattr(self, field.name)[index] for field in fields(self)))


def drive_at(base: Truth, inputs: Inputs, times: Array) -> Drive:
    """Computes inputs and coefficients of the base model at times on the inputs' clock."""
    nodes = truth_drive.nodes_at(base, inputs, times, 0.0)
    attitude = truth_drive.attitude_at(inputs, times)
    frame = nodes[:, gauss.FRAME : gauss.SPIN].reshape(-1, 3, 3)
    curve = CubicSpline(inputs.t, inputs.acceleration)
    gravity = np.array([0.0, 0.0, GRAVITY])

    def turned(vectors: Array) -> Array:
        return np.asarray(np.einsum("tij,ti->tj", frame, vectors))

    def felt(axes: Array) -> Array:
        vectors = curve(times) + gravity
        return np.asarray(np.einsum("tij,ti->tj", axes, vectors) - gravity)

    leaning = truth_drive.nodes_at(base.plus("gravity_tilt", {}), inputs, times, 0.0)
    leant = leaning[:, gauss.FRAME : gauss.SPIN].reshape(-1, 3, 3)
    everywhere = np.ones(len(times))
    return Drive(
        times - inputs.t[0],
        felt(frame),
        turned(curve(times)),
        turned(curve(times, 1)),
        felt(leant) - felt(frame),
        _arms(base, inputs, times, frame),
        attitude.heading,
        attitude.rate[:, 2],
        attitude.angular_acceleration[:, 2],
        nodes[:, gauss.MODE],
        nodes[:, gauss.MODE + 1],
        nodes[:, gauss.MODE + 2],
        base.value("surface_nonlinearity", "alpha", 0.0) * everywhere,
        float(base.has("vertical_acceleration")) * everywhere,
        base.radius * everywhere,
    )


def _arms(base: Truth, inputs: Inputs, times: Array, frame: Array) -> Array:
    """Returns accelerations (T, 3, 3) per metre of lever arm, by arm axis and liquid axis."""
    columns = []
    for axis in "xyz":
        lever = {name: float(name == axis) for name in "xyz"}
        nodes = truth_drive.nodes_at(base.plus("lever_arm", lever), inputs, times, 0.0)
        columns.append(np.einsum("tij,ti->tj", frame, nodes[:, gauss.ADDED : gauss.FRAME]))
    return np.stack(columns, axis=1)

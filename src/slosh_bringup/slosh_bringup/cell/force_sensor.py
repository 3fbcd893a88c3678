"""Simulated force sensor under the container, with noise, delay and other errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_bringup.cell.motions import CellMotion, make_motion
from slosh_bringup.cell.truth import Push, simulated
from slosh_discovery.force.liquid import response_force
from slosh_discovery.force.record import ForceRecord
from slosh_model.containers import X_AXIS
from slosh_model.model import Model
from slosh_model.simulate import Inputs

STROKE, REST, RATE = "e-9.2", 10.0, 500.0
"""Motion by which the payload is identified, rest behind it [s], and rate of the record [Hz]."""


class ForceSensor(NamedTuple):
    """A simulated force sensor: its noise, delay, zero, mounting angle and cable force.

    Attributes:
        container: mass of the empty container [kg].
        delay: of the force behind the motion [s].
        noise: standard deviation of a sample [N].
        drift: random walk of the zero in a minute [N].
        cable: force of the cable, which pulls back [N/m].
        zero: of the sensor [N].
        turn: of the sensor about the vertical, from the container's axes [rad].
    """

    container: float = 0.4
    delay: float = 0.02
    noise: float = 0.03
    drift: float = 0.1
    cable: float = 0.3
    zero: float = 1.5
    turn: float = 0.6


def sensed_force(
    model: Model,
    motion: CellMotion,
    sensor: ForceSensor,
    seed: int,
    push: Push | None = None,
) -> Array:
    """Returns the forces (N, 3) [N] at the motion's samples in the sensor's axes.

    Args:
        model: the truth liquid.
        motion: of the container.
        sensor: the sensor.
        seed: of noise and drift.
        push: by hand, of the liquid alone; None: there is none.
    """
    inputs, response = simulated(model, motion, push)
    liquid = model.container.volume * model.liquid.density
    sloshing = liquid * model.container.mass_ratio(1, X_AXIS)
    force = (sensor.container + liquid) * motion.specific_force()
    force = force + sloshing * response_force(model, inputs, response)
    if push is not None:  # the hand's force on the liquid is none of the sensor's
        force = force + sloshing * push.acceleration(motion.t)
    force[:, :2] -= sensor.cable * (motion.position - motion.position[0])[:, :2]
    c, s = np.cos(sensor.turn), np.sin(sensor.turn)
    force = force @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).T
    t = motion.t
    late = np.column_stack([np.interp(t - sensor.delay, t, column) for column in force.T])
    rng = np.random.default_rng([seed, 38])
    step = sensor.drift * np.sqrt((t[1] - t[0]) / 60.0)
    drift = np.cumsum(step * rng.standard_normal(late.shape), axis=0)
    return np.asarray(late + drift + sensor.zero + sensor.noise * rng.standard_normal(late.shape))


def calibration_record(model: Model, sensor: ForceSensor, seed: int) -> ForceRecord:
    """Returns a simulated force record of a stroke and a standstill, to identify the payload."""
    stroke = make_motion(STROKE, RATE)
    count = round(REST * RATE)
    t = np.arange(len(stroke.t) + count) / RATE
    position = np.vstack([stroke.position, np.tile(stroke.position[-1], (count, 1))])
    acceleration = np.vstack([stroke.acceleration, np.zeros((count, 3))])
    motion = CellMotion(STROKE, t, position, acceleration)
    force = sensed_force(model, motion, sensor, seed)
    return ForceRecord("calibration of the simulated sensor", Inputs(t, acceleration), t, force)

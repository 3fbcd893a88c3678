"""Converts ROS messages of the estimator to numbers and back."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from itertools import chain

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.estimate_kernel import MODAL
from slosh_estimator.estimator import Estimate, ModelState
from slosh_estimator.state import EstimatorState
from slosh_estimator.tray_estimator import TrayEstimate
from slosh_model.wall import Wall
from slosh_motion.inputs.frames import Vector
from slosh_motion.inputs.sensor_inputs import imu_reading
from slosh_msgs import msg as messages
from slosh_msgs.msg import ExpectedReading, ModelEstimate, SloshEstimate


def imu_vectors(values: Sequence[float]) -> tuple[Vector, Vector | None]:
    """Returns specific force and angular velocity (None: not reported) of an Imu message.

    Args:
        values: numbers (37,) behind its header; see `StampedReader`.
    """
    wx, wy, wz, rate_known = values[13:17]
    fx, fy, fz, force_known = values[25:29]
    return imu_reading((fx, fy, fz), (wx, wy, wz), force_known, rate_known)


def fill(message: SloshEstimate, estimate: Estimate, wall: Wall) -> None:
    """Writes an estimate, without its flags, into a message that is reused."""
    sample = estimate.sample
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(sample.stamp_ns, SECOND)
    _fill_model(message.linear, estimate.linear)
    _fill_model(message.nonlinear, estimate.nonlinear)
    acceleration = message.acceleration
    acceleration[0], acceleration[1], acceleration[2] = sample.ax, sample.ay, sample.az
    message.jerk = estimate.jerk
    (
        message.surface_height, message.height_along_wall, message.contact_radius,
        message.distance_to_rim, message.distance_along_wall,
    ) = wall.place(estimate.nonlinear.msh)  # fmt: skip
    message.yaw = sample.yaw


def fill_tray(message: messages.TrayEstimate, stamp_ns: int, tray: TrayEstimate) -> None:
    """Writes the estimates of a tray's containers at a stamp [ns] into a message."""
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(stamp_ns, SECOND)
    message.msh, message.azimuth = array("d", tray.msh), array("d", tray.azimuth)
    message.flags, message.worst = array("H", tray.flags), tray.worst
    linear = [one.linear for one in tray.each]
    nonlinear = [one.nonlinear for one in tray.each]
    message.linear_msh = array("d", [one.msh for one in linear])
    message.linear_reading = array("d", [one.reading for one in linear])
    message.reading = array("d", [one.reading for one in nonlinear])
    message.delay = array("d", tray.delays)
    message.modes = array("B", [len(one.modal) // MODAL for one in linear])
    message.linear_modal = array("d", chain.from_iterable(one.modal for one in linear))
    message.modal = array("d", chain.from_iterable(one.modal for one in nonlinear))
    message.acceleration[:] = tray.each[0].sample[1:4]


def fill_reading(message: ExpectedReading, estimate: Estimate, delay: float) -> None:
    """Writes the model's prediction of the sensor's height, with its delay [s], to a message."""
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(estimate.sample.stamp_ns, SECOND)
    message.linear = estimate.linear.reading
    message.nonlinear = estimate.nonlinear.reading
    message.delay = delay


def fill_state(
    message: messages.EstimatorState, state: EstimatorState, memory: Sequence[float]
) -> None:
    """Writes the state of the estimator and of its input reader into a message."""
    sample = state.sample
    message.sample_stamp = sample.stamp_ns
    pose = sample.pose or ()
    message.sample = array("d", (sample.ax, sample.ay, sample.az, sample.yaw, *pose))
    message.first_stamp, message.settled_stamp = state.first_ns, state.settled_ns
    message.linear, message.nonlinear = array("d", state.linear), array("d", state.nonlinear)
    message.checks, message.input = array("d", state.checks), array("d", memory)


def _fill_model(message: ModelEstimate, state: ModelState) -> None:
    message.msh = state.msh
    message.azimuth = state.azimuth
    message.sh_x = state.sh_x
    message.sh_y = state.sh_y
    position, velocity = message.modal_position, message.modal_velocity
    modal = state.modal
    if 2 * len(position) != len(modal):
        # The message copies what it is given: what is written to is its own array.
        message.modal_position = array("d", bytes(4 * len(modal)))
        message.modal_velocity = array("d", bytes(4 * len(modal)))
        position, velocity = message.modal_position, message.modal_velocity
    if len(modal) == MODAL:  # nearly always: one mode
        position[0], position[1], velocity[0], velocity[1] = modal
        return
    for at in range(0, len(position), 2):
        position[at], position[at + 1], velocity[at], velocity[at + 1] = modal[2 * at : 2 * at + 4]

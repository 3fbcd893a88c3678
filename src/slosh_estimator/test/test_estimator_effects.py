"""Tests that every effect acts in the live estimator as in a simulation."""

from collections.abc import Iterator

import numpy as np
import pytest
from example_effects import STRENGTHS, in_fitting_container
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slosh_estimator.estimator import Estimator
from slosh_estimator.readings import has_readings
from slosh_estimator.validity import attitude_warning
from slosh_model.constants import GRAVITY
from slosh_model.effects.registry import EFFECTS
from slosh_model.measure import measured_heights
from slosh_model.model import Model
from slosh_model.pose import pose_rows
from slosh_model.response import Response
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_motion.inputs.frames import SensorTransform
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import Sample, Samples
from slosh_motion.inputs.sensor_inputs import ImuInput

MS = 1_000_000
Array = NDArray[np.float64]
BASE = Model(Cylinder(0.05, 0.07), damping_ratio=0.02)
RATE = 256
TICK = 3_906_250  # ns: both clocks have the same intervals, to the last bit
SECONDS = 2.0
TILT, YAW = 0.2, 1.0


def rise(t: Array) -> Array:
    """Returns a smooth rise from 0 to 1 within the first second."""
    s = np.clip(t, 0.0, 1.0)
    return s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)


def times(start: float = 0.0, end: float = SECONDS) -> Array:
    """Returns times (N,) [s] at the sample rate."""
    return np.arange(round(start * RATE), round(end * RATE) + 1) / RATE


def position(t: Array) -> Array:
    """Returns positions (N, 3) [m] of the container's origin in the world."""
    place = np.column_stack(
        (0.03 * np.sin(8.0 * t), 0.02 * np.cos(7.0 * t + 0.4), 0.02 * np.sin(9.0 * t))
    )
    return rise(t)[:, None] * place


def acceleration(t: Array) -> Array:
    """Returns accelerations (N, 3) [m/s²] of the origin in world axes, without gravity."""
    h = 1e-4
    return (position(t - h) - 2.0 * position(t) + position(t + h)) / (h * h)


def attitude(t: Array) -> Rotation:
    """Returns the attitude world ← container: rotation about z, then about a horizontal axis."""
    zero, share = np.zeros_like(t), rise(t)
    swing = TILT * np.column_stack((share * np.sin(4.0 * t), share * np.cos(3.0 * t), zero))
    twist = YAW * np.column_stack((zero, zero, share * (0.3 + np.sin(2.5 * t))))
    return Rotation.from_rotvec(swing) * Rotation.from_rotvec(twist)


def rates(t: Array) -> Array:
    """Returns angular velocities (N, 3) [rad/s] in container axes."""
    h = 1e-4
    turned: Array = (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2.0 * h)
    return turned


def cup_inputs(t: Array) -> Inputs:
    """Returns the motion as inputs of a model."""
    return Inputs(t, acceleration(t), attitude(t).as_quat(), rates(t))


def forces(t: Array) -> Array:
    """Returns specific forces (N, 3) [m/s²] as an IMU at the container's origin measures them."""
    felt: Array = attitude(t).inv().apply(acceleration(t) + np.array([0.0, 0.0, GRAVITY]))
    return felt


def stamps_of(t: Array) -> Iterator[int]:
    """Yields the stamps [ns] of times [s]."""
    return (round(second * RATE) * TICK for second in t.tolist())


def with_effect(name: str) -> Model:
    return in_fitting_container(BASE, name).with_effect(name, **STRENGTHS[name])


def samples_of(restarts: tuple[int, ...] = (0,)) -> Samples:
    """Returns samples of the cup's motion with attitude; a gap lies before each restart."""
    motion = cup_inputs(times())
    yaws, poses = pose_rows(motion.t, motion.attitude, motion.angular_velocity)
    stamps = np.array(list(stamps_of(motion.t)), dtype=np.int64)
    restarted = np.zeros(len(stamps), dtype=bool)
    for index in restarts:
        restarted[index] = True
        stamps[index:] += 500 * MS * (index > 0)
    doubtful = np.arange(len(stamps)) % 100 > 80
    return Samples(stamps, motion.acceleration.copy(), yaws, restarted, poses, doubtful)


@pytest.mark.parametrize("name", EFFECTS)
def test_live_heights_and_readings_are_those_of_a_simulation(name: str) -> None:
    model = with_effect(name)
    live = Estimator(model).update_many(samples_of())
    motion = cup_inputs(times())
    for twin, which in ((model.linear(), 0), (model.nonlinear(), 1)):
        response, _ = simulate(twin, motion)
        np.testing.assert_array_equal(live.heights[:, which, 2], response.sh_x)
        np.testing.assert_array_equal(live.heights[:, which, 3], response.sh_y)
        read = measured_heights(twin, response)[:, 0]
        np.testing.assert_allclose(live.as_read[:, which], read, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    "name", sorted(set(EFFECTS) - {"surface_nonlinearity", "pendulum_nonlinearity"})
)
def test_an_effect_acts_where_it_should(name: str) -> None:
    """Tests that effects of the sensor change the expected measurement, not the liquid."""
    samples, model = samples_of(), with_effect(name)
    plain, live = Estimator(BASE).update_many(samples), Estimator(model).update_many(samples)
    on_the_measurement = EFFECTS[name].reading is not None or EFFECTS[name].delay is not None
    only = on_the_measurement and name != "fill_loss"
    assert np.array_equal(live.heights, plain.heights) == only
    assert np.array_equal(live.as_read, live.heights[:, :, 0]) == (EFFECTS[name].reading is None)
    assert has_readings(model.name) == on_the_measurement
    late = {"time_offset": 0.04, "clock_drift": 0.02}.get(name, 0.0)
    assert Estimator(model).reading_delay(0) == late


def test_a_drifting_clock_s_delay_grows_and_begins_anew_with_a_reset() -> None:
    samples, estimator = samples_of(), Estimator(with_effect("clock_drift"))
    estimator.update_many(samples)
    first, last = int(samples.stamps[0]), int(samples.stamps[-1])
    assert estimator.reading_delay(first) == 0.02
    grown = 0.02 + 0.015 * (last - first) / 1e9
    assert estimator.reading_delay(last) == pytest.approx(grown, abs=1e-12)
    estimator.reset()
    assert estimator.reading_delay(last) == 0.02


def test_what_is_lost_of_the_liquid_stays_lost_after_a_gap() -> None:
    model = with_effect("fill_loss")
    samples = samples_of(restarts=(0, 300))
    late = Estimator(model).update_many(samples)
    seconds = (samples.stamps - samples.stamps[0]) * 1e-9
    # At rest after the gap; the level itself has fallen.
    assert late.heights[300, 1, 0] == 0.0
    assert late.as_read[300, 1] == pytest.approx(-0.01 * seconds[300])
    estimator = Estimator(model)
    estimator.update_many(samples)
    estimator.reset()
    anew = estimator.update(Sample(10**10, 0.0, 0.0, 0.0, 0.0, True))
    assert anew.nonlinear.reading == 0.0


def heights_by(model: Model, samples: list[Sample]) -> tuple[np.ndarray, np.ndarray]:
    """Returns times [s] and heights [m] of the nonlinear model at +x and +y."""
    found = Estimator(model).update_many(Samples.of(samples))
    return found.stamps * 1e-9, found.heights[:, 1, 2:]


def by_pose(shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> list[Sample]:
    """Returns samples from a tracker at a point of the container [m]."""
    adapter, t = PoseInput(GateSettings(), 9), times(-0.1, SECONDS + 0.1)
    turned = attitude(t)
    places, quaternions = position(t) + turned.apply(shift), turned.as_quat()
    return [
        sample
        for stamp, place, quaternion in zip(
            stamps_of(t), places.tolist(), quaternions, strict=True
        )
        for sample in adapter.update(stamp + 10**10, tuple(place), tuple(-2.0 * quaternion))
    ]


def by_imu(transform: SensorTransform | None = None) -> list[Sample]:
    adapter, t = ImuInput(GateSettings(), transform or SensorTransform()), times(-0.1)
    found = [
        adapter.update(stamp + 10**10, tuple(force), tuple(rate))
        for stamp, force, rate in zip(
            stamps_of(t), forces(t).tolist(), rates(t).tolist(), strict=True
        )
    ]
    return [sample for sample in found if sample is not None]


def truth(t: np.ndarray) -> Response:
    """Returns the simulated response with gravity turned by the container's attitude."""
    motion = cup_inputs(times())
    response, _ = simulate(BASE.with_effect("gravity_tilt").nonlinear(), motion)
    assert np.abs(response.msh).max() > 0.01
    return response


def error(model: Model, samples: list[Sample]) -> float:
    """Returns the largest difference from the truth, relative to the largest height."""
    t, heights = heights_by(model, samples)
    motion = times()
    response = truth(motion)
    known = np.column_stack((response.sh_x, response.sh_y))
    found = np.column_stack([np.interp(motion, t - 10.0, column) for column in heights.T])
    return float(np.abs(found - known).max() / np.abs(known).max())


def test_a_tilted_pose_with_gravity_tilt_is_a_tilted_imu_without() -> None:
    tilting = BASE.with_effect("gravity_tilt")
    assert error(BASE, by_pose()) > 0.3
    assert error(tilting, by_pose()) < 0.02
    assert error(BASE, by_imu()) < 0.02


def test_the_lever_arm_of_a_tracker_that_sits_elsewhere_is_taken_off() -> None:
    tilting = BASE.with_effect("gravity_tilt")
    elsewhere = by_pose(shift=(-0.3, 0.2, 0.1))
    assert error(tilting, elsewhere) > 0.1
    assert error(tilting.with_effect("lever_arm", x=0.3, y=-0.2, z=-0.1), elsewhere) < 0.03


@pytest.mark.parametrize(("kind", "blind"), [("accel", True), ("imu", False), ("pose", False)])
def test_effects_that_an_input_without_attitude_leaves_idle_are_named(
    kind: str, blind: bool
) -> None:
    model = BASE.with_effect("gravity_tilt").with_effect("yaw_coupling", kappa=0.1)
    assert bool(attitude_warning(model, kind)) == blind
    assert attitude_warning(BASE, kind) == ""
    if blind:
        assert "gravity_tilt, yaw_coupling" in attitude_warning(model, kind)

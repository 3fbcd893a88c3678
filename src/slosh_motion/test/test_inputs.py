import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slosh_base.files.nanoseconds import SECOND
from slosh_model.constants import GRAVITY
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import SensorTransform
from slosh_motion.inputs.gate import GateSettings, SampleVerdict
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sensor_inputs import AccelInput, ImuInput

MS = 1_000_000
GATE = GateSettings()
LEVEL = (0.0, 0.0, 0.0, 1.0)


def test_accelerations_in_another_frame_are_dropped_and_the_frame_is_named() -> None:
    accel = AccelInput(GATE, ("world", "container"))
    assert accel.update(0, "tool0", 1.0, 0.0, 0.0) is None
    assert accel.update(MS, "world", 1.0, 2.0, 3.0) is not None
    assert accel.update(2 * MS, "container", 1.0, 2.0, 3.0) is not None
    assert accel.gate.counts[SampleVerdict.WRONG_FRAME] == 1
    assert "'tool0'" in str(accel.warning())


def test_an_imu_at_rest_gives_no_acceleration() -> None:
    sample = ImuInput(GATE, SensorTransform()).update(0, (0.0, 0.0, GRAVITY), (0.0, 0.0, 0.0))
    assert sample is not None
    assert (sample.ax, sample.ay, sample.az) == (0.0, 0.0, 0.0)


def test_lever_arm_of_a_spinning_container() -> None:
    """Tests a sensor off the axis of a spinning container: no acceleration at the origin."""
    imu = ImuInput(GATE, SensorTransform(to_origin=(-0.1, 0.0, 0.0)))
    for k in range(100):
        sample = imu.update(k * MS, (-0.1 * 4.0, 0.0, GRAVITY), (0.0, 0.0, 2.0))
        assert sample is not None
        assert math.hypot(sample.ax, sample.ay, sample.az) == pytest.approx(0.0, abs=1e-12)


def test_a_constant_push_in_the_world_stays_constant_while_the_container_yaws() -> None:
    imu = ImuInput(GATE, SensorTransform())
    for k in range(1000):
        yaw = 3.0 * k * 1e-3
        force = (2.0 * math.cos(yaw), -2.0 * math.sin(yaw), GRAVITY)
        sample = imu.update(k * MS, force, (0.0, 0.0, 3.0))
        assert sample is not None
        assert (sample.ax, sample.ay) == pytest.approx((2.0, 0.0), abs=1e-9)
        assert sample.yaw == pytest.approx(yaw)


@pytest.mark.parametrize("askew", [0.0, 10.0])
@pytest.mark.parametrize("spin", [-2.0, 0.5, 4.0])
@pytest.mark.parametrize("aside", [0.0, 0.4])
def test_an_askew_sensor_that_spins_is_named_and_an_upright_one_is_not(
    askew: float, spin: float, aside: float
) -> None:
    """Tests that a tilted sensor on a turntable is reported, and an upright one is not."""
    rng = np.random.default_rng(5)
    mounted = Rotation.from_euler("y", -askew, degrees=True)
    pull = spin**2 * aside
    force = mounted.apply([-pull, 0.0, GRAVITY]) + 0.02 * rng.standard_normal((1000, 3))
    rate = mounted.apply([0.0, 0.0, spin]) + 0.002 * rng.standard_normal((1000, 3))
    imu = ImuInput(GATE, SensorTransform(), checks=True)
    for k, (f, w) in enumerate(zip(force.tolist(), rate.tolist(), strict=True)):
        imu.update(5 * k * MS, tuple(f), tuple(w))
        if k == 120 and aside == 0.0:  # after 0.6 s
            assert (imu.doubt is not None) == (askew > 0.0)
    if askew and aside == 0.0:
        assert imu.doubt is not None
        assert "10.0° off the container's +z" in imu.doubt.text
    elif not askew and pull < 1.0:
        assert imu.doubt is None


@pytest.mark.parametrize("rate", [1e300, 1.7e308, math.inf, math.nan, -201.0])
def test_a_turn_that_no_arm_makes_is_dropped_and_leaves_no_trace(rate: float) -> None:
    imu = ImuInput(GATE, SensorTransform())
    still = ((0.0, 0.0, GRAVITY), (0.0, 0.0, 0.0))
    assert imu.update(0, *still) is not None
    assert imu.update(MS, still[0], (0.0, 0.0, rate)) is None
    after = imu.update(2 * MS, *still)
    assert after is not None
    assert after.yaw == 0.0


@pytest.mark.parametrize("size", [1e5, 1e160, 1.7e308])
def test_poses_that_cannot_be_are_dropped(size: float) -> None:
    poses = PoseInput(GATE, 5)
    for k in range(20):
        assert poses.update(k * MS, (size, -size, 0.0), (0.0, 0.0, 0.0, 1.0)) == []
        assert poses.update(k * MS, (0.0, 0.0, 0.0), (0.0, 0.0, size, size)) == []
    assert poses.gate.dropped == 40


def test_a_missing_rate_matters_only_with_a_lever_arm() -> None:
    for place, warned in (((0.0, 0.0, 0.0), False), ((0.1, 0.0, 0.0), True)):
        imu = ImuInput(GATE, SensorTransform(to_origin=place))
        assert imu.update(0, (0.0, 0.0, GRAVITY), None) is not None
        assert (imu.warning() is not None) is warned


def test_a_transform_that_is_not_finite_is_refused() -> None:
    with pytest.raises(SloshMotionError, match="finite"):
        SensorTransform(roll=math.nan)


@settings(deadline=None)
@given(
    st.lists(st.integers(1, 20), min_size=30, max_size=60),
    st.tuples(*[st.floats(-2.0, 2.0)] * 3),
)
def test_a_cubic_motion_is_exact_at_the_centre_s_own_stamp(
    steps: list[int], c: tuple[float, float, float]
) -> None:
    pose = PoseInput(GATE, 11)
    given_ns = [int(s) * MS for s in np.cumsum(steps)]
    out = []
    for stamp in given_ns:
        t = stamp * 1e-9
        position = (c[0] * t**3, c[1] * t**2, c[2] * t)
        out += pose.update(stamp, position, LEVEL)
    assert [s.stamp_ns for s in out] == given_ns[5:-5]
    for sample in out:
        expected = (6.0 * c[0] * sample.stamp_ns * 1e-9, 2.0 * c[1], 0.0)
        assert (sample.ax, sample.ay, sample.az) == pytest.approx(expected, abs=1e-6)


def test_a_jump_of_the_tracker_that_lasts_starts_the_window_anew() -> None:
    pose = PoseInput(GATE, 5)
    samples = [pose.update(k * MS, (0.1 * (k >= 20), 0.0, 0.0), LEVEL) for k in range(34)]
    assert pose.jumps == 1
    assert pose.gate.counts[SampleVerdict.JUMP] == 4
    assert all(s.ax == pytest.approx(0.0) for found in samples for s in found)
    assert samples[20:28] == [[]] * 8
    assert samples[28][0].restarted


@pytest.mark.parametrize("way", [(16.0, 28.0, 33.0), (0.0, 16.0, 0.0)])
def test_a_fast_turn_that_goes_on_is_used_and_one_that_comes_back_is_not(
    way: tuple[float, ...],
) -> None:
    pose = PoseInput(GATE, checks=True)
    angles = [0.0] * 60 + [*way] + [way[-1]] * 60
    for k, angle in enumerate(angles):
        half = 0.5 * math.radians(angle)
        pose.update(20 * k * MS, (0.3, 0.2, 0.8), (math.sin(half), 0.0, 0.0, math.cos(half)))
    away = way[-1] == 0.0
    assert pose.gate.counts[SampleVerdict.JUMP] == away
    assert pose.gate.used == len(angles) - away
    assert any("leap by up to" in doubt.text for doubt in pose.message_doubts()) == away


@pytest.mark.parametrize("zeros", [1, 3])
@pytest.mark.parametrize("rate", [30, 125])
def test_zeros_now_and_then_are_not_used(zeros: int, rate: int) -> None:
    pose = PoseInput(GATE, checks=True, noun="joint states")
    found = []
    for k in range(4 * rate):
        at = (0.0, 0.0, 0.0) if k % rate < zeros and k > rate else (0.3, 0.2, 0.8)
        found += pose.update(k * SECOND // rate, at, LEVEL)
    assert max(abs(sample.ax) for sample in found) < 1e-9
    (doubt,) = pose.message_doubts()
    assert "leap by up to 0.88 m" in doubt.text
    assert not doubt.wrong


def test_yaw_is_the_attitude_s_twist_even_when_tilted() -> None:
    pose, yaw, tilt = PoseInput(GATE, 5), 0.8, 0.3
    half, lean = 0.5 * yaw, 0.5 * tilt
    # Tilted about the container's own x after the yaw.
    q = (
        math.cos(half) * math.sin(lean),
        math.sin(half) * math.sin(lean),
        math.sin(half) * math.cos(lean),
        math.cos(half) * math.cos(lean),
    )
    samples = [pose.update(k * MS, (0.0, 0.0, 0.0), q) for k in range(5)]
    assert samples[-1][0].yaw == pytest.approx(yaw)


@pytest.mark.parametrize("window", [3, 10, -0.1, math.inf, math.nan])
def test_windows_that_cannot_be_are_refused(window: float) -> None:
    with pytest.raises(SloshMotionError, match=str(window)):
        PoseInput(GATE, window)


MOUNT = SensorTransform(0.4, -0.3, 1.1, (0.2, 0.05, -0.1))
"""Of a tool whose frame lies 0.2 m beside the cup and is turned."""


def turning_cup():
    """Returns stamps [ns], positions and attitudes of a cup that moves and turns on a circle."""
    t = np.arange(0.0, 1.0, 0.004)
    position = 0.3 * np.column_stack((np.cos(2.0 * t), np.sin(2.0 * t), 0.1 * t * t))
    tilt = 0.2 * np.sin(3.0 * t)[:, None] * [1.0, 0.5, 0.0]
    attitude = Rotation.from_euler("z", 2.0 * t[:, None]) * Rotation.from_rotvec(tilt)
    return np.rint(t * 1e9).astype(np.int64), position, attitude


def test_the_pose_of_a_tool_beside_the_cup_gives_the_cups_motion() -> None:
    stamps, position, attitude = turning_cup()
    mount = Rotation.from_euler("xyz", (MOUNT.roll, MOUNT.pitch, MOUNT.yaw))
    tool_attitude = attitude * mount
    tool = position - attitude.apply(MOUNT.to_origin)
    direct, mounted, bare = (PoseInput(GATE, 11, m) for m in (None, MOUNT, None))
    apart = 0.0
    for k, stamp in enumerate(stamps.tolist()):
        quaternion = tuple(tool_attitude[k].as_quat())
        made = (
            direct.update(stamp, tuple(position[k]), tuple(attitude[k].as_quat())),
            mounted.update(stamp, tuple(tool[k]), quaternion),
            bare.update(stamp, tuple(tool[k]), quaternion),
        )
        for right, found, without in zip(*made, strict=True):
            assert found[1:4] == pytest.approx(right[1:4], abs=1e-8)
            assert found.pose is not None
            assert right.pose is not None
            turned = Rotation.from_quat(found.pose[:4]).inv() * Rotation.from_quat(right.pose[:4])
            assert turned.magnitude() < 1e-9
            assert found.pose[4:] == pytest.approx(right.pose[4:], abs=1e-6)
            apart = max(apart, math.dist(without[1:4], right[1:4]))
    assert apart > 0.5  # it matters: 0.2 m · (2 rad/s)² = 0.8 m/s²


def test_a_turned_accelerometer_gives_the_same_bits_one_by_one_and_in_blocks() -> None:
    one = AccelInput(GATE, ("world", "container"), MOUNT, checks=True)
    many = AccelInput(GATE, ("world", "container"), MOUNT, checks=True)
    random = np.random.default_rng(1)
    values = np.cumsum(random.normal(size=(500, 3)), axis=0) * 0.1
    stamps = np.arange(500, dtype=np.int64) * 4 * MS
    frames = np.full(500, "world", dtype=object)
    singly = [
        one.update(stamp, "world", *row)
        for stamp, row in zip(stamps.tolist(), values.tolist(), strict=True)
    ]
    together = many.update_many(stamps, frames, values)
    assert [together.one(k) for k in range(500)] == singly
    assert one.memory == many.memory
    turned = Rotation.from_euler("xyz", (MOUNT.roll, MOUNT.pitch, MOUNT.yaw)).apply(values)
    assert together.accelerations == pytest.approx(turned, abs=1e-12)
    assert "sensor_to_origin has no effect" in str(one.remark())


def test_poses_in_a_frame_that_is_not_the_worlds_are_dropped_and_named() -> None:
    poses = PoseInput(GATE, 5, frame="world")
    for k, frame in enumerate(("world", "", "camera_optical")):
        poses.update(k * MS, (0.0, 0.0, 0.0), LEVEL, None, frame)
    assert (poses.gate.used, poses.gate.counts[SampleVerdict.WRONG_FRAME]) == (2, 1)
    assert "'camera_optical' are dropped: publish them in 'world'" in str(poses.warning())
    assert poses.warning() is None  # told once, until there are more
    free = PoseInput(GATE, 5, frame="world", any_frame=True)
    free.update(0, (0.0, 0.0, 0.0), LEVEL, None, "base")
    assert "'base' are assumed to be in the world's frame" in str(free.remark())


def stroke(t: float) -> float:
    """Returns the place on a stroke of 0.5 m in 0.7 s from 0 on [m]."""
    s = min(max(t / 0.7, 0.0), 1.0)
    return 0.5 * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


@pytest.mark.parametrize("rate", [50, 125, 500])
@pytest.mark.parametrize("begin", [-0.5, 0.0, 0.3])
def test_poses_that_begin_in_motion_say_so_once(rate: int, begin: float) -> None:
    reader = PoseInput(GATE, checks=True)
    samples = []
    for k in range(rate):
        place = (stroke(begin + k / rate), 0.0, 0.0)
        samples += reader.update(SECOND + k * SECOND // rate, place, LEVEL)
    moving = [sample.stamp_ns for sample in samples if sample.moving]
    assert len(moving) == (begin > 0.0)
    assert not moving or moving[0] < 1.15 * SECOND
    assert (reader.began is not None) == (begin > 0.0)


@pytest.mark.parametrize("kind", ["accel", "imu"])
@pytest.mark.parametrize("shake", [0.0, 4.0])
def test_accelerations_that_begin_in_motion_say_so_live_and_in_blocks(
    kind: str, shake: float
) -> None:
    stamps = np.arange(100, dtype=np.int64) * (SECOND // 100) + SECOND
    values = np.column_stack([shake * np.cos(9.0 * np.arange(100) / 100.0)] + [np.zeros(100)] * 2)
    moving = []
    for stamp, (x, y, z) in zip(stamps.tolist(), values.tolist(), strict=True):
        if kind == "accel":
            if not moving:
                accel = AccelInput(GATE, ("world",), checks=True)
            sample = accel.update(stamp, "world", x, y, z)
        else:
            if not moving:
                imu = ImuInput(GATE, SensorTransform(), checks=True)
            sample = imu.update(stamp, (x, y, z + GRAVITY), (0.0, 0.0, 0.0))
        assert sample is not None
        moving.append(sample.moving)
    assert sum(moving) == (shake > 0.0)
    frames = np.full(100, "world", dtype=object)
    found = AccelInput(GATE, ("world",), checks=True).update_many(stamps, frames, values).moving
    assert found is not None
    assert found.tolist() == moving


def test_an_input_that_is_taken_up_does_not_begin() -> None:
    before = AccelInput(GATE, ("world",), checks=True)
    for k in range(50):
        before.update(k * 10 * MS, "world", 0.0, 0.0, 0.0)
    after = AccelInput(GATE, ("world",), checks=True)
    after.take_up(490 * MS, before.memory)
    samples = [
        after.update((500 + 10 * k) * MS, "world", 5.0 * math.cos(0.1 * k), 0.0, 0.0)
        for k in range(50)
    ]
    assert not any(sample is not None and sample.moving for sample in samples)

"""Tests reading of tables, bags and recordings of a day as measured motions."""

import gzip
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slosh_base.files.errors import SloshFileError
from slosh_discovery.discover_data import day_motions, motions_of_day, read_motions
from slosh_discovery.discover_data.recording import (
    BagRecording,
    Heights,
    Residuals,
    angular_velocity,
)
from slosh_discovery.discover_data.splitting import LEAD_IN_NS, LONGEST_NS, REST_NS, split
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.constants import GRAVITY
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_motion.recorded.motion import RecordedMotion
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_replay.tables.table_bag import write_table_bag
from slosh_testing.cell_bag import CellBag

Array = np.ndarray[Any, np.dtype[np.float64]]

MODEL = Model(Cylinder(0.05, 0.07), damping_ratio=0.03).spatial()
NOISE = 1e-4
UP = np.array([0.0, 0.0, GRAVITY])
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
NONE = Residuals(np.empty(0, dtype=np.int64), np.empty(0))


def burst(t: Array, start: float, size: float = 2.0, length: float = 2.0) -> Array:
    """Returns the acceleration (N, 3) [m/s²] of a motion that begins and ends at rest."""
    swell = np.where(
        (t > start) & (t < start + length), np.sin(np.pi * (t - start) / length) ** 2, 0.0
    )
    waves = np.column_stack((np.sin(15.0 * t), 0.5 * np.cos(14.0 * t), 0.3 * np.sin(11.0 * t)))
    found: Array = size * swell[:, None] * waves
    return found


def bursts(starts: tuple[float, ...], seconds: float) -> tuple[Array, Array]:
    t = np.arange(0.0, seconds, 0.004)
    return t, sum((burst(t, start) for start in starts), np.zeros((len(t), 3)))


def seen(t: Array, acceleration: Array, model: Model = MODEL, seed: int = 3) -> Heights:
    """Returns simulated heights as a camera with 50 images per second measures them."""
    msh = simulate(model, Inputs(t, acceleration))[0].msh[::5]
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(msh))
    return Heights(stamps_of(t)[::5], msh + noise, np.full(len(msh), NOISE))


def stamps_of(t: Array) -> np.ndarray[Any, np.dtype[np.int64]]:
    return START + np.rint(t * 1e9).astype(np.int64)


def recording(t: Array, acceleration: Array, heights: Heights) -> BagRecording:
    motion = RecordedMotion(stamps_of(t), acceleration)
    return BagRecording(Path("day"), motion, heights, NONE, {}, SECOND // 20)


def parts_of(starts: tuple[float, ...], seconds: float) -> list[tuple[float, float, float]]:
    """Returns start, end and start of the heights of each recorded part [s]."""
    t, acceleration = bursts(starts, seconds)
    found = split(recording(t, acceleration, seen(t, acceleration)))
    assert found.notes == []
    return [tuple((ns - START) / SECOND for ns in part) for part in found.parts]


def table_of(seconds: float = 4.0) -> MotionTable:
    t, acceleration = bursts((0.5,), seconds)
    msh = np.full(len(t), np.nan)
    msh[::5] = seen(t, acceleration).msh
    quaternion = Rotation.from_euler("z", 0.5 * t[:, None]).as_quat()
    turning = np.tile([0.0, 0.0, 0.5], (len(t), 1))
    return MotionTable(100.0 + t, acceleration, quaternion, turning, msh)


class TestTables:
    def test_a_table_is_one_motion_with_all_that_it_says(self, tmp_path: Path) -> None:
        table = table_of()
        write_motion_table(tmp_path / "run.csv.gz", table)
        (motion,) = read_motions(tmp_path / "run.csv.gz")
        assert motion.name == "run"
        assert motion.same_clock
        assert motion.level_known
        assert motion.stddev is None
        for name, value in (
            ("t", table.t), ("acceleration", table.acceleration), ("attitude", table.attitude),
            ("angular_velocity", table.angular_velocity),
        ):  # fmt: skip
            np.testing.assert_array_equal(getattr(motion.inputs, name), value)
        assert table.msh is not None
        sampled = np.isfinite(table.msh)
        np.testing.assert_array_equal(motion.t, table.t[sampled])
        np.testing.assert_array_equal(motion.msh, table.msh[sampled])

    def test_wall_heights_are_taken_before_msh_where_there_are_as_many(
        self, tmp_path: Path
    ) -> None:
        table = table_of()
        assert table.msh is not None
        azimuth = np.radians([0.0, 90.0, 180.0])
        eta = np.column_stack([table.msh, 0.5 * table.msh, -table.msh])
        walls = MotionTable(
            table.t, table.acceleration, msh=table.msh, eta_azimuth=azimuth, eta=eta
        )
        write_motion_table(tmp_path / "walls.csv", walls)
        (motion,) = read_motions(tmp_path / "walls.csv")
        assert motion.msh is None
        assert motion.eta is not None
        np.testing.assert_allclose(motion.eta_azimuth, azimuth)
        np.testing.assert_array_equal(motion.eta, eta[np.isfinite(table.msh)])
        eta[200:] = np.nan
        write_motion_table(tmp_path / "few.csv", walls)
        notes: list[str] = []
        (motion,) = read_motions(tmp_path / "few.csv", tell=notes.append)
        assert motion.eta is None
        assert "wall heights are left out" in notes[0]

    def test_a_spike_is_left_out_and_said(self, tmp_path: Path) -> None:
        table = table_of()
        assert table.msh is not None
        table.msh[250] = 0.2
        write_motion_table(tmp_path / "run.csv", table)
        notes: list[str] = []
        (motion,) = read_motions(tmp_path / "run.csv", tell=notes.append)
        assert table.t[250] not in motion.t
        assert notes == [
            f"{tmp_path / 'run.csv'}: 1 single spikes of the measured height are left out"
        ]


class TestWrongInput:
    @pytest.mark.parametrize(
        ("name", "content", "words"),
        [
            ("a.csv", b"", "is empty"),
            ("a.csv", b"t,ax,ay,az\n0,1,2,3\n", "no measured heights"),
            ("a.csv", b"t,ax,ay,az,msh\n0,0,0,0,0\n1,0,0,0,0\n", "fewer than 20"),
            ("a.csv", b"t,ax,ay,az,msh\n0,0,0,0,0\n9999,0,0,0,0\n", "--time-unit us"),
            ("a.csv", b"t,ax,ay,az,qx,qy,qz,qw,msh\n0,0,0,0,0,0,0,0,0\n", "quaternion"),
            ("a.csv", b"t,ax,ay,az,msh\n0,0,0,0,high\n", "'high' is not a number"),
            # Without the time in it: the test's name holds the bytes, and all workers need one.
            (
                "a.csv.gz",
                gzip.compress(b"t,ax,ay,az,msh\n" * 99, mtime=0)[:30],
                "cut off or damaged",
            ),
            ("a.mcap", b"\x89MCAP0\r\n", ""),
            ("a.mcap", b"no bag at all", ""),
            ("a.txt", b"t,ax,ay,az\n", ""),
        ],
    )
    def test_one_line_that_names_the_file(
        self, tmp_path: Path, name: str, content: bytes, words: str
    ) -> None:
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises((SloshFileError, SloshDiscoveryError)) as raised:
            read_motions(path)
        assert words in str(raised.value)
        assert str(path) in str(raised.value)
        assert "\n" not in str(raised.value)

    def test_nothing_there_and_nothing_in_it(self, tmp_path: Path) -> None:
        for path in (tmp_path, tmp_path / "nowhere"):
            with pytest.raises(SloshDiscoveryError, match=str(path)):
                read_motions(path)


class TestSplit:
    def test_motions_with_rest_between_are_cut_there(self) -> None:
        (first, second) = parts_of((3.0, 24.0), 40.0)
        assert first == pytest.approx((1.2, 13.0, 1.2), abs=0.5)
        assert second == pytest.approx((22.2, 34.0, 22.2), abs=0.5)

    def test_the_dwell_ends_where_the_rest_before_the_next_motion_begins(self) -> None:
        (first, second) = parts_of((3.0, 13.0), 26.0)
        assert first[1] == pytest.approx(second[0], abs=0.01)
        assert second[0] == pytest.approx(13.0 - REST_NS / SECOND, abs=0.5)

    def test_joined_motions_that_become_too_long_go_on_behind_a_lead_in(self) -> None:
        starts = tuple(np.arange(3.0, 200.0, 4.0).tolist())
        first, second = parts_of(starts, 220.0)
        assert first[1] - first[0] <= LONGEST_NS / SECOND + 3.0
        assert second[2] - second[0] == pytest.approx(LEAD_IN_NS / SECOND)
        assert second[2] == pytest.approx(first[1], abs=REST_NS / SECOND + 0.5)

    def test_what_follows_a_gap_in_the_inputs_of_a_motion_is_left_out(self) -> None:
        t, acceleration = bursts((3.0, 24.0), 40.0)
        heights = seen(t, acceleration)
        kept = (t < 4.0) | (t > 4.5)
        found = split(recording(t[kept], acceleration[kept], heights))
        assert (found.parts[0].end - START) / SECOND == pytest.approx(4.0, abs=0.01)
        assert len(found.parts) == 2
        assert "a gap in the inputs at 4.00 s" in found.notes[0]
        resting = (t < 15.0) | (t > 15.5)
        found = split(recording(t[resting], acceleration[resting], heights))
        assert found.notes == []

    def test_a_motion_that_began_before_the_recording_is_left_out(self) -> None:
        t, acceleration = bursts((3.0, 24.0), 40.0)
        heights = seen(t, acceleration)
        late = t >= 4.0
        cut = Heights(*(column[heights.stamps >= START + 4 * SECOND] for column in heights))
        found = split(recording(t[late], acceleration[late], cut))
        assert [round((part.start - START) / SECOND) for part in found.parts] == [22]
        assert "begun before the recording" in found.notes[0]


class Bag(CellBag):
    """Writes a bag of a robot cell with measured heights."""

    def heights(self, heights: Heights, flags: dict[int, int] | None = None) -> None:
        for row, (stamp, msh, stddev) in enumerate(zip(*heights, strict=True)):
            marks = (flags or {}).get(row, 0)
            self.surface(int(stamp), float(msh), msh_stddev=float(stddev), flags=marks)


class TestBags:
    def test_a_bag_gives_its_motions_on_its_own_clock(self, tmp_path: Path) -> None:
        t, acceleration = bursts((2.5, 18.0), 30.0)
        bag, heights = Bag(), seen(t, acceleration)
        for stamp, a in zip(stamps_of(t).tolist(), acceleration, strict=True):
            bag.accel(stamp, a)
        in_motion = int(np.searchsorted(heights.stamps, START + 4 * SECOND))
        bag.heights(heights, {in_motion: 1, in_motion + 1: 32, in_motion + 2: 128})
        notes: list[str] = []
        path = bag.write(tmp_path / "day")
        first, second = read_motions(path, tell=notes.append)
        assert (first.name, second.name) == ("day#1", "day#2")
        assert notes == [
            f"{path}: 2 images without a usable height are left out",
            f"{path}: 1 saturated heights are left out: they are lower bounds",
        ]
        missing = (heights.stamps[in_motion : in_motion + 3] - START) / SECOND
        assert not np.isin(missing, first.t).any()
        assert first.stddev is not None
        np.testing.assert_array_equal(first.stddev, np.full(len(first.t), NOISE))
        assert second.inputs.t[0] == pytest.approx(16.3, abs=0.5)
        for motion in (first, second):
            assert motion.msh is not None
            predicted = simulate(MODEL, motion.inputs)[0].msh
            residual = motion.msh - np.interp(motion.t, motion.inputs.t, predicted)
            assert np.sqrt(np.mean(residual**2)) < 2.0 * NOISE
            assert motion.msh.max() > 50.0 * NOISE

    def test_an_imu_feels_gravity_so_its_attitude_is_the_yaw_alone(self, tmp_path: Path) -> None:
        t, acceleration = bursts((2.5,), 8.0)
        yaw, roll = 0.4 * t, 0.1
        turn = Rotation.from_euler("ZX", np.column_stack((yaw, np.full(len(t), roll))))
        force = turn.inv().apply(acceleration + UP)
        rate = Rotation.from_euler("x", roll).inv().apply([0.0, 0.0, 0.4])
        bag = Bag()
        for stamp, f in zip(stamps_of(t).tolist(), force.tolist(), strict=True):
            bag.put("/slosh/imu", "sensor_msgs/msg/Imu", stamp, "imu",
                    linear_acceleration__x=f[0], linear_acceleration__y=f[1],
                    linear_acceleration__z=f[2], angular_velocity__x=rate[0],
                    angular_velocity__y=rate[1], angular_velocity__z=rate[2])  # fmt: skip
        bag.heights(seen(t, acceleration))
        (motion,) = read_motions(bag.write(tmp_path / "imu"))
        inputs = motion.inputs
        assert inputs.attitude is not None
        assert inputs.angular_velocity is not None
        np.testing.assert_array_equal(inputs.attitude[:, :2], 0.0)
        # The container's z is tilted: its own yaw runs a little slower than the turning.
        psi = 2.0 * np.arctan2(inputs.attitude[:, 2], inputs.attitude[:, 3])
        slope = (psi[-1] - psi[0]) / (inputs.t[-1] - inputs.t[0])
        assert slope == pytest.approx(0.4 * math.cos(roll), rel=1e-3)
        np.testing.assert_allclose(inputs.angular_velocity, np.tile(rate, (len(psi), 1)))
        # At rest a tilted floor has gravity's share along it, turned back by the yaw.
        at_rest = np.hypot(*inputs.acceleration[:50, :2].T)
        np.testing.assert_allclose(at_rest, GRAVITY * math.sin(roll), rtol=1e-6)
        np.testing.assert_allclose(
            inputs.acceleration[:50, 2], GRAVITY * (math.cos(roll) - 1.0), atol=1e-9
        )

    def test_poses_keep_their_attitude_and_tell_the_angular_velocity(self, tmp_path: Path) -> None:
        t, acceleration = bursts((2.5,), 8.0)
        place = np.cumsum(np.cumsum(acceleration, axis=0), axis=0) * 0.004**2
        angles = np.column_stack((0.5 * t, 0.2 * np.sin(2.0 * t)))
        turn = Rotation.from_euler("ZY", angles).as_quat()
        bag = Bag()
        for stamp, p, q in zip(stamps_of(t).tolist(), place.tolist(), turn.tolist(), strict=True):
            given = dict(zip(("x", "y", "z"), p, strict=True))
            turned = dict(zip(("x", "y", "z", "w"), q, strict=True))
            bag.put("/slosh/pose", "geometry_msgs/msg/PoseStamped", stamp, "world",
                    **{f"pose__position__{axis}": value for axis, value in given.items()},
                    **{f"pose__orientation__{axis}": value for axis, value in turned.items()},
                    )  # fmt: skip
        bag.heights(seen(t, acceleration))
        (motion,) = read_motions(bag.write(tmp_path / "poses"))
        inputs = motion.inputs
        assert inputs.attitude is not None
        assert inputs.angular_velocity is not None
        # The first sample is that of the middle of the first window, 11 poses to each side.
        at = np.rint((inputs.t + 11 * 0.004) / 0.004).astype(int)
        np.testing.assert_allclose(inputs.attitude, turn[at], atol=1e-9)
        pitch = angles[at, 1]
        expected = np.column_stack(
            (-0.5 * np.sin(pitch), 0.4 * np.cos(2.0 * t[at]), 0.5 * np.cos(pitch))
        )
        inner = slice(10, -10)
        np.testing.assert_allclose(inputs.angular_velocity[inner], expected[inner], atol=2e-3)
        np.testing.assert_allclose(inputs.acceleration, acceleration[at], atol=0.15)

    @pytest.mark.parametrize("beside", ["all along", "in part"])
    def test_poses_beside_accelerations_tell_the_attitude_where_they_are_there_all_along(
        self, tmp_path: Path, beside: str
    ) -> None:
        t, acceleration = bursts((2.5,), 8.0)
        bag = Bag()
        for stamp, a in zip(stamps_of(t).tolist(), acceleration, strict=True):
            bag.accel(stamp, a)
        posed = t[1::5] if beside == "all along" else t[t < 5.0]
        for stamp, second in zip(stamps_of(posed).tolist(), posed.tolist(), strict=True):
            bag.put("/slosh/pose", "geometry_msgs/msg/PoseStamped", stamp, "world",
                    pose__orientation__y=math.sin(0.15 * second),
                    pose__orientation__w=math.cos(0.15 * second))  # fmt: skip
        bag.heights(seen(t, acceleration))
        (motion,) = read_motions(bag.write(tmp_path / "beside"))
        if beside == "in part":
            assert motion.inputs.attitude is None
            return
        assert motion.inputs.attitude is not None
        assert motion.inputs.angular_velocity is not None
        inside = slice(5, -5)  # at the ends the nearest pose holds
        tilt = 2.0 * np.arctan2(motion.inputs.attitude[:, 1], motion.inputs.attitude[:, 3])
        np.testing.assert_allclose(tilt[inside], 0.3 * motion.inputs.t[inside], atol=1e-9)
        np.testing.assert_allclose(
            motion.inputs.angular_velocity, np.tile([0.0, 0.3, 0.0], (len(tilt), 1)), atol=1e-6
        )

    def test_a_day_begins_with_what_was_off_most(self, tmp_path: Path) -> None:
        t, acceleration = bursts((2.5, 18.0, 33.0), 45.0)
        bag, heights = Bag(), seen(t, acceleration)
        for stamp, a in zip(stamps_of(t)[::2].tolist(), acceleration[::2], strict=True):
            bag.accel(stamp, a)
        bag.heights(heights)
        for stamp in heights.stamps.tolist():
            second = (stamp - START) / SECOND
            residual = 1e-3 if second < 16.0 else 3e-3 if second < 31.0 else 2e-3
            bag.put("/slosh/comparison", "slosh_msgs/msg/SloshComparison", stamp, "container",
                    residual_nonlinear=residual)  # fmt: skip
        path = bag.write(tmp_path / "day")
        assert [m.name for m in read_motions(path)] == ["day#1", "day#2", "day#3"]
        assert [m.name for m in motions_of_day(path)] == ["day#2", "day#3", "day#1"]
        found = [entry.disagreement for entry in day_motions(path)]
        assert found == pytest.approx([3e-3, 2e-3, 1e-3])

    def test_a_table_that_became_a_bag_is_the_same_motion(self, tmp_path: Path) -> None:
        table = table_of()
        assert table.msh is not None
        eta = np.column_stack([table.msh, 0.5 * table.msh])
        walls = MotionTable(
            table.t, table.acceleration, table.attitude, table.angular_velocity,
            table.msh, np.radians([0.0, 90.0]), eta,
        )  # fmt: skip
        write_motion_table(tmp_path / "run.csv", walls)
        write_table_bag(tmp_path / "run.csv", walls, tmp_path / "run")
        (table_motion,) = read_motions(tmp_path / "run.csv")
        (bag_motion,) = read_motions(tmp_path / "run")
        for name in ("t", "eta", "eta_azimuth"):
            expected, found = getattr(table_motion, name), getattr(bag_motion, name)
            np.testing.assert_allclose(found, expected, atol=1e-9)
        np.testing.assert_allclose(bag_motion.inputs.attitude, table_motion.inputs.attitude)

    def test_bags_that_cannot_be_compared_say_so(self, tmp_path: Path) -> None:
        t, acceleration = bursts((2.5,), 6.0)
        still = np.zeros_like(acceleration)

        def refused(name: str, moved: Array, fill: Callable[[Bag], None]) -> str:
            bag = Bag()
            for stamp, a in zip(stamps_of(t)[::5].tolist(), moved[::5], strict=True):
                bag.accel(stamp, a)
            fill(bag)
            path = bag.write(tmp_path / name)
            with pytest.raises((SloshFileError, SloshDiscoveryError)) as raised:
                read_motions(path)
            assert str(path) in str(raised.value)
            assert "\n" not in str(raised.value)
            return str(raised.value)

        heights = seen(t, acceleration)
        assert "no measured heights" in refused("none", acceleration, lambda bag: None)
        blind = dict.fromkeys(range(len(heights.stamps)), 32)
        assert "no usable height" in refused(
            "blind", acceleration, lambda bag: bag.heights(heights, blind)
        )
        assert "no motion" in refused("still", still, lambda bag: bag.heights(heights))


def test_angular_velocity_of_a_turning_body_at_uneven_stamps() -> None:
    t = np.cumsum(np.random.default_rng(4).uniform(0.001, 0.004, 500))
    axis = np.array([0.2, -0.4, 0.5])
    attitude = (Rotation.from_euler("x", 0.7) * Rotation.from_rotvec(t[:, None] * axis)).as_quat()
    attitude[::3] *= -1.0  # a quaternion and its negative are one attitude
    found = angular_velocity(stamps_of(t), attitude, 5)
    np.testing.assert_allclose(found, np.tile(axis, (len(t), 1)), atol=1e-4)

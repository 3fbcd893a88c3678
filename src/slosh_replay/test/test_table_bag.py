"""Tests conversion of motion tables to bags and back without loss of a bit."""

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_estimator.sight import SurfaceFlag
from slosh_model.constants import GRAVITY
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.recorded.motion import RecordedMotion
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_replay.tables.bag_table import TableSettings, read_bag_table, with_rows_at
from slosh_replay.tables.table_bag import import_table, table_times, write_table_bag
from slosh_testing.cell_bag import IMU, POSE, CellBag

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)
HEIGHT = FINITE | st.just(math.nan)
DEFINITIONS = Definitions()
NOWHERE = Path("table.csv")
MS = 1_000_000
START = 1_795_231_502_851_364_726


def same_bits(one, other) -> bool:
    if one is None or other is None:
        return one is other
    return one.shape == other.shape and one.tobytes() == other.tobytes()


@st.composite
def tables(draw) -> MotionTable:
    rows = draw(st.integers(1, 6))
    steps = draw(st.lists(st.integers(1, 3 * 10**9), min_size=rows, max_size=rows))
    first = draw(st.integers(-(10**12), 10**18))

    def column(width, elements=FINITE):
        return draw(arrays(np.float64, (rows, width), elements=elements))

    degrees = draw(st.lists(st.integers(0, 359), min_size=1, max_size=4, unique=True))
    eta = draw(st.booleans())
    # Accelerations that can be; tiny numbers would only underflow.
    moderate = st.floats(-2000.0, 2000.0)
    turning = moderate.filter(lambda value: abs(value) > 1e-6)
    return MotionTable(
        t=table_times(first + np.cumsum(steps)),
        acceleration=column(3, moderate),
        attitude=column(4, turning) if draw(st.booleans()) else None,
        angular_velocity=column(3) if draw(st.booleans()) else None,
        msh=column(1, HEIGHT)[:, 0] if draw(st.booleans()) else None,
        eta_azimuth=np.radians(np.sort(np.array(degrees, dtype=np.float64))) if eta else None,
        eta=column(len(degrees), HEIGHT) if eta else None,
    )


@settings(deadline=None, max_examples=30)
@given(table=tables())
def test_table_to_bag_to_table_gives_the_same_bits(table: MotionTable):
    # Beyond 4e6 s a float tells no single nanosecond: such times may fall on one stamp.
    with TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        try:
            told = write_table_bag(NOWHERE, table, bag, definitions=DEFINITIONS)
        except SloshBagError as error:
            assert "same nanosecond" in str(error)
            assert (np.diff(table.t) < 1e-6).any()
            return
        back = read_bag_table(bag).table
    assert told.rounded == 0
    # What is doubtful in the numbers is told of the second table alone.
    for name in MotionTable.__dataclass_fields__.keys() - {"remarks"}:
        assert same_bits(getattr(table, name), getattr(back, name)), name


def test_times_that_are_no_whole_nanoseconds_are_rounded_and_counted(tmp_path: Path):
    t = np.cumsum(np.full(5, 0.1))  # 0.30000000000000004
    table = MotionTable(t, np.zeros((5, 3)))
    told = write_table_bag(NOWHERE, table, tmp_path / "bag")
    back = read_bag_table(tmp_path / "bag").table.t
    assert told.rounded == np.count_nonzero(back != t) == 1
    np.testing.assert_allclose(back, t, rtol=0.0, atol=0.5e-9)
    assert back.tolist() == [0.1, 0.2, 0.3, 0.4, 0.5]


@pytest.mark.parametrize(
    ("t", "expected"),
    [
        ([0.0, 1e-10], "line 3: column 't': 1e-10 s falls on the same nanosecond"),
        ([0.0, 3e9], "3e+09 s is beyond a stamp's"),
        ([-3e9, 0.0], "beyond a stamp's"),
    ],
)
def test_times_that_no_stamp_holds_are_named(tmp_path: Path, t, expected: str):
    table = MotionTable(np.array(t), np.zeros((2, 3)))
    with pytest.raises(SloshBagError) as caught:
        write_table_bag(NOWHERE, table, tmp_path / "bag")
    assert expected in str(caught.value)
    assert not (tmp_path / "bag").exists()


def test_a_file_goes_through_a_bag_to_the_same_bytes(tmp_path: Path):
    table = MotionTable(
        np.arange(50) / 500, np.full((50, 3), 0.1), msh=np.where(np.arange(50) % 8, np.nan, 0.01)
    )
    write_motion_table(tmp_path / "a.csv.gz", table)
    import_table(tmp_path / "a.csv.gz", tmp_path / "bag")
    write_motion_table(tmp_path / "b.csv.gz", read_bag_table(tmp_path / "bag").table)
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()
    surfaces = BagReader(tmp_path / "bag").topics()["/slosh/free_surface"]
    assert surfaces.count == 7  # none where the camera has no sample


def test_the_imu_feels_gravity_in_the_containers_axes(tmp_path: Path):
    half = math.radians(15.0)
    table = MotionTable(
        np.zeros(1),
        np.array([[1.0, 0.0, 0.0]]),
        attitude=3.0 * np.array([[math.sin(half), 0.0, 0.0, math.cos(half)]]),  # 30° about x
    )
    write_table_bag(NOWHERE, table, tmp_path / "bag")
    reader = BagReader(tmp_path / "bag")
    (message,) = [reader.decode(entry) for entry in reader.messages(["/slosh/imu"])]
    force = message.linear_acceleration
    np.testing.assert_allclose(
        [force.x, force.y, force.z], [1.0, GRAVITY * 0.5, GRAVITY * math.sqrt(0.75)], rtol=1e-12
    )
    assert message.orientation_covariance[0] == 0.0
    assert message.angular_velocity_covariance[0] == -1.0


def test_an_attitude_without_a_length_is_named(tmp_path: Path):
    table = MotionTable(np.arange(2.0), np.zeros((2, 3)), attitude=np.eye(4)[[0]].repeat(2, 0))
    table.attitude[1] = 0.0
    with pytest.raises(SloshBagError, match="line 3: qx, qy, qz, qw are all 0"):
        write_table_bag(NOWHERE, table, tmp_path / "bag")


def test_the_surface_shows_the_wall_heights(tmp_path: Path):
    table = MotionTable(
        np.arange(2.0),
        np.zeros((2, 3)),
        eta_azimuth=np.radians([0.0, 90.0, 270.0]),
        eta=np.array([[0.001, math.nan, 0.003], [math.nan] * 3]),
    )
    write_table_bag(NOWHERE, table, tmp_path / "bag")
    reader = BagReader(tmp_path / "bag")
    (message,) = [reader.decode(entry) for entry in reader.messages(["/slosh/free_surface"])]
    assert (message.msh, message.azimuth) == (0.003, -math.pi / 2)
    np.testing.assert_allclose(message.profile_azimuth, [0.0, -math.pi / 2], rtol=1e-6)
    np.testing.assert_allclose(message.profile_height, [0.001, 0.003], rtol=1e-6)


class Cell(CellBag):
    """A bag of a robot cell whose messages arrive in the order in which they are added."""

    def __init__(self, folder: Path, facts: dict[str, str] | None = None) -> None:
        super().__init__(lambda stamp, count: START + 1 + count)
        self.folder, self.facts = folder, facts

    def imu(self, stamp: int, force, rate, frame: str = "imu") -> None:
        fields = {
            f"{name}__{axis}": float(value)
            for name, values in (("angular_velocity", rate), ("linear_acceleration", force))
            for axis, value in zip("xyz", values, strict=True)
        }
        unknown = np.array([-1.0, *[0.0] * 8])
        self.put(
            "/slosh/imu", IMU, stamp, frame, orientation__w=1.0, orientation_covariance=unknown,
            **fields,
        )  # fmt: skip

    def settings(self, **parameters) -> None:
        """Adds the settings message that an estimator node publishes."""
        given = {
            "input": "accel", "max_gap": 0.05, "max_age": 0.5, "sensor_rotation": [0.0, 0.0, 0.0],
            "sensor_to_origin": [0.0, 0.0, 0.0], "pose_window": 21, "world_frame": "world",
            "container_frame": "container", **parameters,
        }  # fmt: skip
        document = yaml.safe_dump({"parameters": given, "files": {}})
        kind = "slosh_msgs/msg/NodeSettings"
        self.put("/slosh/settings", kind, 1, "", node="estimator", document=document)

    def pose(self, stamp: int, position, turn) -> None:
        places = {f"pose__position__{axis}": v for axis, v in zip("xyz", position, strict=True)}
        turns = {f"pose__orientation__{axis}": v for axis, v in zip("xyzw", turn, strict=True)}
        self.put("/slosh/pose", POSE, stamp, "world", **places, **turns)

    def table(self, **chosen):
        if not self.folder.exists():
            self.write(self.folder, self.facts)
        return read_bag_table(self.folder, TableSettings(**chosen))


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return Cell(tmp_path / "cell")


def test_heights_between_samples_get_rows_of_their_own(cell: Cell):
    for k in range(4):
        cell.accel(START + 10 * k * MS, (float(k), 0.0, 0.0))
    cell.surface(START + 10 * MS, 0.001)
    cell.surface(START + 25 * MS, 0.002)
    cell.surface(START + 40 * MS, 0.003)  # after the last sample
    given = cell.table()
    assert given.table.t.tolist() == [0.0, 0.01, 0.02, 0.025, 0.03]
    assert given.table.acceleration[:, 0].tolist() == [0.0, 1.0, 2.0, 2.5, 3.0]
    np.testing.assert_array_equal(given.table.msh, [np.nan, 0.001, np.nan, 0.002, np.nan])
    assert given.origin_ns == START
    assert given.notes == (
        "1 rows between two input samples, at the moments of heights: interpolated",
        "1 heights left out: the input has no sample around them",
    )


def test_no_motion_is_made_up_in_a_gap(cell: Cell):
    for stamp in (0, 10, 200, 210):
        cell.accel(START + stamp * MS, (1.0, 0.0, 0.0))
    for stamp in (0, 100, 205):
        cell.surface(START + stamp * MS, 0.001)
    given = cell.table()
    assert given.table.t.tolist() == [0.0, 0.01, 0.2, 0.205, 0.21]
    assert any("1 gaps in accel" in note for note in given.notes)
    assert any("1 heights left out" in note for note in given.notes)


def test_unusable_heights_are_unknown_and_bounds_are_told(cell: Cell):
    told = (0, SurfaceFlag.NOT_FOUND, SurfaceFlag.BAD_IMAGE, SurfaceFlag.SATURATED)
    for k, flags in enumerate(told):
        cell.accel(START + 10 * k * MS, (1.0, 0.0, 0.0))
        cell.surface(START + 10 * k * MS, 0.001, flags=flags)
    given = cell.table()
    np.testing.assert_array_equal(given.table.msh, [0.001, np.nan, np.nan, 0.001])
    assert given.notes == (
        "2 images without a usable height",
        "1 heights are lower bounds (SATURATED); a table cannot say so",
    )


def test_the_topic_of_the_heights_can_be_chosen(cell: Cell):
    for k in range(3):
        cell.accel(START + k * MS, (1.0, 0.0, 0.0))
    cell.surface(START, 0.001)
    cell.surface(START, 0.002, topic="/slosh/cell/truth")
    assert cell.table().table.msh[0] == 0.001
    assert cell.table(measured="cell/truth").table.msh[0] == 0.002
    assert cell.table(measured="none").table.msh is None
    with pytest.raises(
        SloshBagError, match=r"no topic 'cell/trth'; its topics: /slosh/cell/truth,"
    ):
        cell.table(measured="cell/trth")
    with pytest.raises(SloshBagError, match="is geometry_msgs/msg/AccelStamped, not slosh_msgs"):
        cell.table(measured="accel")


def test_samples_closer_than_absolute_times_can_tell_are_refused(cell: Cell):
    for k in range(3):
        cell.accel(START + 100 * k, (1.0, 0.0, 0.0))
    assert len(cell.table().table.t) == 3
    with pytest.raises(SloshBagError, match="count from the first row"):
        cell.table(absolute=True)


def test_the_sensors_table_holds_what_drives_the_liquid(cell: Cell):
    for k in range(3):
        cell.imu(START + 10 * k * MS, (0.5, 0.0, GRAVITY + 0.25), (0.0, 0.0, 2.0))
    table = cell.table(kind="imu").table
    yaw = 2.0 * table.t
    np.testing.assert_allclose(table.acceleration[:, 0], 0.5 * np.cos(yaw))
    np.testing.assert_allclose(table.acceleration[:, 1], 0.5 * np.sin(yaw), atol=1e-15)
    np.testing.assert_allclose(table.acceleration[:, 2], 0.25, atol=1e-12)
    np.testing.assert_allclose(table.attitude[:, 2], np.sin(0.5 * yaw), atol=1e-15)
    np.testing.assert_array_equal(table.angular_velocity, [[0.0, 0.0, 2.0]] * 3)


def test_the_input_is_read_as_the_recorded_estimator_did(cell: Cell):
    cell.settings(input="imu", sensor_rotation=[0.0, 0.0, math.pi / 2], container_frame="cup")
    for k in range(3):
        cell.accel(START + 10 * k * MS, (7.0, 0.0, 0.0))
        cell.imu(START + 10 * k * MS, (0.5, 0.0, GRAVITY), (0.0, 3.0, 0.0))
    table = cell.table().table
    np.testing.assert_allclose(table.acceleration, [[0.0, 0.5, 0.0]] * 3, atol=1e-15)
    np.testing.assert_allclose(table.angular_velocity, [[-3.0, 0.0, 0.0]] * 3, atol=1e-15)
    assert cell.table(kind="accel").table.acceleration[0, 0] == 7.0


def test_a_sensor_that_is_slower_than_accel_gives_nothing(cell: Cell):
    for k in range(5):
        cell.accel(START + k * MS, (1.0, 0.0, 0.0))
        if k % 2 == 0:
            cell.imu(START + k * MS, (0.0, 0.0, GRAVITY), (0.0, 0.0, 2.0), "container")
    assert cell.table().table.angular_velocity is None


def test_a_pose_gives_its_own_attitude_at_each_row(cell: Cell):
    for k in range(9):
        t = 0.01 * k
        cell.pose(START + 10 * k * MS, (0.5 * t * t, 0.0, 0.0), (0.0, 0.0, 0.1 * k, 1.0))
    table = cell.table(inputs=InputSettings(pose_window=5)).table
    np.testing.assert_allclose(table.acceleration[:, 0], 1.0, rtol=1e-9)
    half = 0.1 * np.arange(2, 7)  # tangents of half the angle
    np.testing.assert_allclose(table.attitude[:, 2], np.sin(np.arctan(half)), rtol=1e-12)
    np.testing.assert_allclose(table.angular_velocity[:, 2], 20.0 / (1.0 + half**2), rtol=1e-3)
    assert table.t[0] == 0.0


def test_what_is_missing_is_named(cell: Cell):
    cell.surface(START, 0.001)
    with pytest.raises(SloshBagError, match="holds no message of accel, imu, pose"):
        cell.table()
    with pytest.raises(SloshBagError, match="holds no message of pose;"):
        cell.table(kind="pose")


def test_unrelated_clocks_are_refused(tmp_path: Path):
    cell = Cell(tmp_path / "cell", {"clocks": "unrelated"})
    for k in range(3):
        cell.accel(START + k * MS, (1.0, 0.0, 0.0))
    cell.surface(START, 0.001)
    with pytest.raises(SloshBagError, match="unrelated clocks"):
        cell.table()
    assert cell.table(measured="none").table.msh is None


def test_stamps_that_go_back_are_refused(cell: Cell):
    for k in (50, 51, *range(25)):
        cell.accel(START + k * MS, (1.0, 0.0, 0.0))
    cell.write(cell.folder)
    inputs = InputSettings(gate=GateSettings(restart_after=3))
    with pytest.raises(SloshBagError, match="go back at"):
        read_bag_table(cell.folder, TableSettings(inputs=inputs))


def test_interpolated_attitudes_take_the_shorter_way():
    quarter = math.sqrt(0.5)
    turn = np.array([[0.0, 0.0, 0.0, 2.0], [0.0, 0.0, -quarter, -quarter]])  # 90° about z
    motion = RecordedMotion(np.array([0, 10]), np.zeros((2, 3)), turn)
    attitude = with_rows_at(motion, np.array([5])).attitude
    assert attitude is not None
    eighth = math.radians(22.5)
    np.testing.assert_allclose(attitude[1], [0.0, 0.0, math.sin(eighth), math.cos(eighth)])
    np.testing.assert_array_equal(attitude[[0, 2]], turn)

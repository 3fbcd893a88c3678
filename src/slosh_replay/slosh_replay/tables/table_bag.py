"""Converts motion tables to bags; every column becomes a message field.

| columns | topic | field |
|---|---|---|
| ax, ay, az | accel | accel.linear, frame world |
| qx, qy, qz, qw | imu | orientation, world ← container |
| wx, wy, wz | imu | angular_velocity, container's frame |
| msh | free_surface | msh; without the column the maximum of eta |
| eta_000 … eta_359 | wall_heights | azimuth [rad] and height [m] as 64-bit floats |
| | free_surface | profile_azimuth, profile_height: what is known of eta, in 32 bits |

The imu also carries the specific force Rᵀ(a + g ẑ) in the container's frame. A row whose measured
values are all NaN has no message in free_surface and wall_heights. Times become stamps of whole
nanoseconds after an origin that the bag's metadata notes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_base.files import new_folder
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_motion.checks.table_checks import InputDoubt, motion_doubts
from slosh_motion.inputs.inputs import ACCEL, IMU, MESSAGE_TYPES
from slosh_motion.recorded.motion import NOT_REPORTED
from slosh_motion.recorded.sources import TABLE_COLUMNS, TABLE_ORIGIN
from slosh_motion.tables.columns import FOUND_OUT, TableOptions
from slosh_motion.tables.motion_table import MotionTable, column_names, read_motion_table
from slosh_msgs_py.topics import NAMESPACE

Stamps = NDArray[np.int64]

LAST_NS: Final = (2**31 - 1) * SECOND
ACCEL_TYPE, IMU_TYPE = MESSAGE_TYPES[ACCEL], MESSAGE_TYPES[IMU]
SURFACE, SURFACE_TYPE = "free_surface", "slosh_msgs/msg/FreeSurface"
HEIGHTS, HEIGHTS_TYPE = "wall_heights", "sensor_msgs/msg/PointCloud2"
WALL_POINT = np.dtype([("azimuth", "<f8"), ("height", "<f8")])
_FLOAT64 = 8  # PointField.FLOAT64
_UNKNOWN_FIELDS = (
    "msh_stddev", "fitted_msh", "fitted_msh_stddev", "fitted_azimuth", "sh_left", "sh_right",
    "azimuth_left", "azimuth_right", "slope_angle", "peak_u", "peak_v", "distance_to_rim",
)  # fmt: skip


class TableImport(NamedTuple):
    """Result of converting a motion table to a bag.

    Attributes:
        bag: the bag's folder.
        rows: rows of the table.
        rounded: rows whose time was not a whole number of nanoseconds and was rounded to one.
        doubts: what is wrong with the motion, one sentence each.
    """

    bag: Path
    rows: int
    rounded: int
    doubts: tuple[InputDoubt, ...] = ()


Progress = Callable[[int, int], object]


def import_table(
    path: Path,
    bag: Path,
    progress: Progress = lambda done, total: None,
    options: TableOptions = FOUND_OUT,
) -> TableImport:
    """Converts a motion table file to a bag.

    Args:
        path: the `.csv` or `.csv.gz` file.
        bag: the bag's folder; it must be new or empty.
        progress: is told the number of rows so far and in all.
        options: what the user says of the table.

    Raises:
        SloshBagError: the table is broken, or does not fit into messages.
        SloshFileError: the bag's folder holds something.
        OSError: the bag cannot be written.
    """
    return write_table_bag(path, read_motion_table(path, options), bag, progress=progress)


def write_table_bag(
    path: Path,
    table: MotionTable,
    bag: Path,
    definitions: Definitions | None = None,
    progress: Progress = lambda done, total: None,
) -> TableImport:
    """Writes a motion table as a bag.

    Args:
        path: where the table comes from; for what is said of it.
        table: the table.
        bag: the bag's folder.
        definitions: where message definitions come from.
        progress: is told the number of rows so far and in all.

    Raises:
        SloshBagError: a time or an attitude does not fit into a message, or it holds a profile.
        SloshFileError: the bag's folder holds something.
        OSError: the bag cannot be written.
    """
    if table.profile is not None:
        raise SloshBagError(
            f"{path}: contains a profile (columns profile_X), for which there is no message; "
            "remove it"
        )
    origin_ns, stamps = table_stamps(path, table.t)
    messages = _TableMessages(path, table, definitions or Definitions())
    columns = ",".join(column_names(path, table))
    facts = {
        "source": f"motion table {path.name}",
        TABLE_COLUMNS: columns,
        TABLE_ORIGIN: str(origin_ns),
    }
    with new_folder(bag) as room, BagWriter(room, messages.definitions, facts) as writer:
        for topic, message_type in messages.topics().items():
            writer.add_topic(f"{NAMESPACE}/{topic}", message_type)
        for row, stamp in enumerate(stamps.tolist()):
            for topic, data in messages.serialised(row, stamp):
                writer.write(f"{NAMESPACE}/{topic}", data, stamp)
            progress(row + 1, len(stamps))
    rounded = np.count_nonzero(table.t != table_times(stamps - origin_ns))
    doubts = motion_doubts(table.t, table.acceleration, table.attitude)
    return TableImport(bag, len(stamps), int(rounded), doubts)


def table_stamps(path: Path, t: Array) -> tuple[int, Stamps]:
    """Returns the origin [ns] and the stamps (N,) [ns] of times (N,) [s].

    A stamp is the origin and the whole nanoseconds nearest to the time. The origin is 0, and whole
    seconds where the times start before 1 s: a stamp of 0 means 'no stamp' in ROS.

    Raises:
        SloshBagError: two times fall on one nanosecond, or one is beyond what a stamp holds.
    """
    if t[-1] - min(t[0], 0.0) > LAST_NS / SECOND - 2.0:
        raise SloshBagError(f"{path}: column 't': {t[-1]:.9g} s is beyond a stamp's 2³¹ s")
    origin = 0 if t[0] >= 1.0 else 1 + math.ceil(-min(t[0], 0.0))
    # The parts before and after the point one by one: their product by 1e9 would be rounded.
    after, before = np.modf(t)
    stamps = (before.astype(np.int64) + origin) * SECOND + np.rint(after * 1e9).astype(np.int64)
    same = np.flatnonzero(np.diff(stamps) <= 0)
    if len(same):
        raise SloshBagError(
            f"{path}: line {same[0] + 3}: column 't': {t[same[0] + 1]:.17g} s falls on the same "
            "nanosecond as the line before; a bag's stamps are whole nanoseconds"
        )
    return origin * SECOND, stamps


def table_times(nanoseconds: Stamps) -> Array:
    """Converts whole nanoseconds (N,) to times [s], rounded to the nearest floats."""
    # Division of whole numbers: 2e18 ns as a float would have lost its last digits before.
    return np.array([ns / SECOND for ns in nanoseconds.tolist()], dtype=np.float64)


class _TableMessages:
    """Creates the ROS messages of a motion table's rows."""

    def __init__(self, path: Path, table: MotionTable, definitions: Definitions) -> None:
        self.definitions = definitions
        self._table = table
        self._force = _specific_force(path, table)
        for message_type in self.topics().values():
            self.definitions.hash(message_type)  # loads the definition
        self._types: Any = self.definitions.typestore.types
        makers: dict[str, Callable[[int, int], Any]] = {
            ACCEL: self._accel,
            IMU: self._imu,
            SURFACE: self._surface,
            HEIGHTS: self._heights,
        }
        self._makers = {topic: (kind, makers[topic]) for topic, kind in self.topics().items()}

    def topics(self) -> dict[str, str]:
        """Message types of the written topics, by relative topic name."""
        table = self._table
        topics = {ACCEL: ACCEL_TYPE}
        if table.attitude is not None or table.angular_velocity is not None:
            topics[IMU] = IMU_TYPE
        if table.measured is not None:
            topics[SURFACE] = SURFACE_TYPE
        if table.eta is not None:
            topics[HEIGHTS] = HEIGHTS_TYPE
        return topics

    def serialised(self, row: int, stamp: int) -> Iterator[tuple[str, bytes]]:
        """Yields topic and CDR bytes of every message of a row with a stamp [ns]."""
        for topic, (message_type, make) in self._makers.items():
            message = make(row, stamp)
            if message is not None:
                data = self.definitions.typestore.serialize_cdr(message, message_type)
                yield topic, bytes(data)

    def _header(self, stamp: int, frame: str) -> Any:
        sec, nanosec = divmod(stamp, SECOND)
        time = self._types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        return self._types["std_msgs/msg/Header"](stamp=time, frame_id=frame)

    def _vector(self, values: Array) -> Any:
        x, y, z = values.tolist()
        return self._types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)

    def _accel(self, row: int, stamp: int) -> Any:
        accel = self._types["geometry_msgs/msg/Accel"](
            linear=self._vector(self._table.acceleration[row]), angular=self._vector(np.zeros(3))
        )
        return self._types[ACCEL_TYPE](header=self._header(stamp, "world"), accel=accel)

    def _imu(self, row: int, stamp: int) -> Any:
        attitude, turning = self._table.attitude, self._table.angular_velocity
        known, unknown = np.zeros(9), np.array([NOT_REPORTED, *[0.0] * 8])
        x, y, z, w = (0.0, 0.0, 0.0, 1.0) if attitude is None else attitude[row].tolist()
        return self._types[IMU_TYPE](
            header=self._header(stamp, "container"),
            orientation=self._types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w),
            orientation_covariance=unknown if attitude is None else known,
            angular_velocity=self._vector(np.zeros(3) if turning is None else turning[row]),
            angular_velocity_covariance=unknown if turning is None else known,
            linear_acceleration=self._vector(self._force[row]),
            linear_acceleration_covariance=known,
        )

    def _surface(self, row: int, stamp: int) -> Any:
        table = self._table
        eta = np.empty(0) if table.eta is None else table.eta[row]
        azimuth = np.empty(0) if table.eta_azimuth is None else _wrapped(table.eta_azimuth)
        seen = np.isfinite(eta)
        msh = float(eta[seen].max()) if seen.any() else math.nan
        peak = float(azimuth[seen][eta[seen].argmax()]) if seen.any() else math.nan
        if table.msh is not None:
            msh = float(table.msh[row])
        if math.isnan(msh) and not seen.any():
            return None
        return self._types[SURFACE_TYPE](
            header=self._header(stamp, "container"),
            msh=msh,
            azimuth=peak,
            profile_azimuth=azimuth[seen].astype(np.float32),
            profile_height=_single(eta[seen]),
            peak_side=0,
            flags=0,
            **dict.fromkeys(_UNKNOWN_FIELDS, math.nan),
        )

    def _heights(self, row: int, stamp: int) -> Any:
        table = self._table
        if table.eta is None or table.eta_azimuth is None or np.isnan(table.eta[row]).all():
            return None
        points = np.empty(len(table.eta_azimuth), dtype=WALL_POINT)
        points["azimuth"], points["height"] = table.eta_azimuth, table.eta[row]
        field = self._types["sensor_msgs/msg/PointField"]
        return self._types[HEIGHTS_TYPE](
            header=self._header(stamp, "container"),
            height=1,
            width=len(points),
            fields=[
                field(name=name, offset=8 * place, datatype=_FLOAT64, count=1)
                for place, name in enumerate(WALL_POINT.names or ())
            ],
            is_bigendian=False,
            point_step=WALL_POINT.itemsize,
            row_step=points.nbytes,
            data=points.view(np.uint8),
            is_dense=not bool(np.isnan(points["height"]).any()),
        )


def _single(heights: Array) -> NDArray[np.float32]:
    """Converts heights to 32-bit floats; values out of range become infinite."""
    with np.errstate(over="ignore"):
        single: NDArray[np.float32] = heights.astype(np.float32)
    return single


def _wrapped(azimuth: Array) -> Array:
    """Returns azimuths [rad] in the range (-π, π]."""
    wrapped: Array = np.where(azimuth > math.pi, azimuth - 2.0 * math.pi, azimuth)
    return wrapped


def _specific_force(path: Path, table: MotionTable) -> Array:
    """Returns the specific force Rᵀ(a + g ẑ) (N, 3) [m/s²] in the container's frame.

    Raises:
        SloshBagError: a quaternion is zero.
    """
    force: Array = table.acceleration + np.array([0.0, 0.0, GRAVITY])
    if table.attitude is None:
        return force
    largest = np.abs(table.attitude).max(axis=1, keepdims=True)
    zero = np.flatnonzero(largest == 0.0)
    if len(zero):
        raise SloshBagError(
            f"{path}: line {zero[0] + 2}: qx, qy, qz, qw are all 0; a quaternion must not be zero"
        )
    scaled = table.attitude / largest  # keeps squares of tiny and of huge numbers finite
    unit = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    # v' = v + 2 u × (u × v + w v) turns by q; its conjugate (-u, w) turns back.
    u, w = -unit[:, :3], unit[:, 3:]
    turned: Array = force + 2.0 * np.cross(u, np.cross(u, force) + w * force)
    return turned

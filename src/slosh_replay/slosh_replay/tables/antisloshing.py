"""Converts the public AntiSloshing measurements to bags.

A run is two files: `poses/RUN.csv[.gz]`, the commanded pose of the container (500 Hz,
`t;x;y;z;qx;qy;qz;qw`, no heading), and `heights/RUN.mat`, the maximum height that two cameras on
the robot saw (`slosh_times` [s], `slosh_heights` [mm], about 60 Hz). The clocks of the two are
unrelated; the bag keeps both as they are, and its metadata says so. Outliers are kept too: a bag
holds data.

For some runs there are the commanded positions of the arm's joints, `joints/RUN.csv[.gz]` (500 Hz,
`t;q1;…;q6`), and beside the folders its URDF: they become `/joint_states` and
`/robot_description`, so that `--input joints` replays what `--input pose` does. Their third joint
is zero where the arm is straight, 1.57 rad from the zero of the URDF; the cup is 80 mm in front of
the flange. The forearm of the poses is 0.6471 m long, that of the URDF 0.64707 m.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.io

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_base.files import check_free, new_folder
from slosh_base.files.bounded_text import bounded_text, read_text
from slosh_base.files.errors import TextFileError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_motion.inputs.robot import LONGEST
from slosh_motion.recorded.sources import (
    CLOCKS,
    CONTAINER_FILL_HEIGHT,
    CONTAINER_RADIUS,
    UNRELATED,
)
from slosh_msgs_py.topics import JOINT_STATES, ROBOT_DESCRIPTION

RADIUS = 0.049
FILL_HEIGHT = 0.078
"""The measured container [m]."""
ORIGIN_NS = SECOND
"""Both clocks start at 1 s: a stamp of 0 means 'no stamp' in ROS."""
POSE_TOPIC, POSE_TYPE = "/slosh/pose", "geometry_msgs/msg/PoseStamped"
SURFACE_TOPIC, SURFACE_TYPE = "/slosh/free_surface", "slosh_msgs/msg/FreeSurface"
METADATA = {
    CLOCKS: UNRELATED,
    "clocks_note": "the stamps of /slosh/pose and of /slosh/free_surface have no common origin",
    "motion": "commanded, not measured",
    CONTAINER_RADIUS: repr(RADIUS),
    CONTAINER_FILL_HEIGHT: repr(FILL_HEIGHT),
    "source": "AntiSloshing, Motions_10_10_2024, (c) 2025 Simone Soprani, MIT licence",
}
JOINT_TOPIC, JOINT_TYPE = JOINT_STATES, "sensor_msgs/msg/JointState"
TEXT_TYPE = "std_msgs/msg/String"
JOINTS = tuple(f"q{number}_joint" for number in range(1, 7))
ZEROS = (0.0, 0.0, 1.57, 0.0, 0.0, 0.0)
"""Of the tables in the URDF's convention [rad]."""
CUP = """
<link name="container"/>
<joint name="cup" type="fixed"><parent link="axes_6"/><child link="container"/>
  <origin xyz="0.08 0 0" rpy="3.141592653589793 -1.5707963267948966 0"/></joint>
"""
"""What the description of the arm lacks: its cup."""
_POSE_COLUMNS, _JOINT_COLUMNS = 8, 7
_FLOAT_FIELDS = (
    "msh_stddev", "azimuth", "fitted_msh", "fitted_msh_stddev", "fitted_azimuth", "sh_left",
    "sh_right", "azimuth_left", "azimuth_right", "slope_angle", "peak_u", "peak_v",
    "distance_to_rim",
)  # fmt: skip


def import_antisloshing(
    folder: Path, output: Path, progress: Callable[[str], None] = lambda run: None
) -> list[Path]:
    """Writes one bag for each run of the public AntiSloshing data set.

    Args:
        folder: holds `heights/` and `poses/`.
        output: gets one folder per run.
        progress: is told the name of each run that is written.

    Returns:
        the bags, in the order of their names.

    Raises:
        SloshBagError: a file is missing or broken; one line that names it.
        SloshFileError: a run's folder holds something.
        OSError: a bag cannot be written.
    """
    bags = []
    runs = find_runs(folder)
    for run, _, _ in runs:
        check_free(output / run)
    arm = read_arm(folder)
    for run, heights, poses in runs:
        bag = output / run
        import_run(heights, poses, bag, run, arm)
        progress(run)
        bags.append(bag)
    return bags


def find_runs(folder: Path) -> list[tuple[str, Path, Path]]:
    """Returns name, heights file and poses file of every run in the data set.

    Raises:
        SloshBagError: no runs, or one of the two files of a run is missing.
    """
    heights = {path.stem: path for path in sorted((folder / "heights").glob("*.mat"))}
    poses = {
        path.name.removesuffix(".gz").removesuffix(".csv"): path
        for path in sorted((folder / "poses").glob("*.csv*"))
    }
    if not heights and not poses:
        raise SloshBagError(f"{folder}: holds no heights/*.mat and no poses/*.csv(.gz)")
    for run in sorted({*heights, *poses}):
        if run not in poses:
            raise SloshBagError(f"{heights[run]}: has no matching poses/{run}.csv(.gz)")
        if run not in heights:
            raise SloshBagError(f"{poses[run]}: has no matching heights/{run}.mat")
    return [(run, heights[run], poses[run]) for run in sorted(heights)]


class RecordedArm(NamedTuple):
    """The robot arm of the data set: its description, and its joint files by run."""

    urdf: str
    joints: Mapping[str, Path]


def read_arm(folder: Path) -> RecordedArm | None:
    """Reads the robot arm of the data set, or returns None if it has none.

    Raises:
        SloshBagError: its description cannot be read.
    """
    described = sorted(folder.glob("*.urdf"))
    joints = {
        path.name.removesuffix(".gz").removesuffix(".csv"): path
        for path in sorted((folder / "joints").glob("*.csv*"))
    }
    if not described or not joints:
        return None
    try:
        text = read_text(described[0], LONGEST)
    except TextFileError as error:
        raise SloshBagError(str(error)) from None
    body, end, rest = text.rpartition("</robot>")
    return RecordedArm(f"{body}{CUP}{end}{rest}" if end else f"{text}{CUP}", joints)


def import_run(
    heights: Path, poses: Path, bag: Path, run: str, arm: RecordedArm | None = None
) -> None:
    """Writes the bag of one run of the AntiSloshing data set.

    Args:
        heights, poses: its files.
        bag: the bag's folder.
        run: its name.
        arm: that moved the cup; None: not known.

    Raises:
        SloshBagError: a file is broken.
        SloshFileError: the bag's folder holds something.
        OSError: the bag cannot be written.
    """
    times, measured = read_heights(heights)
    motion = read_poses(poses)
    definitions = Definitions()
    facts = {**METADATA, "run": run}
    with new_folder(bag) as room, BagWriter(room, definitions, facts) as writer:
        writer.add_topic(POSE_TOPIC, POSE_TYPE)
        writer.add_topic(SURFACE_TOPIC, SURFACE_TYPE)
        store = definitions.typestore
        surfaces = (
            (stamp, SURFACE_TOPIC, store.serialize_cdr(message, SURFACE_TYPE))
            for stamp, message in _surfaces(store.types, times, measured)
        )
        commands = (
            (stamp, POSE_TOPIC, store.serialize_cdr(message, POSE_TYPE))
            for stamp, message in _poses(store.types, motion)
        )
        entries = [*surfaces, *commands]
        if arm is not None and run in arm.joints:
            writer.add_topic(JOINT_TOPIC, JOINT_TYPE)
            writer.add_topic(ROBOT_DESCRIPTION, TEXT_TYPE)
            told = _joints(store.types, read_joints(arm.joints[run]), arm.urdf)
            entries += [
                (stamp, topic, store.serialize_cdr(message, kind))
                for stamp, topic, kind, message in told
            ]
        for stamp, topic, data in sorted(entries, key=lambda entry: entry[0]):
            writer.write(topic, bytes(data), stamp)


def read_heights(path: Path) -> tuple[Array, Array]:
    """Reads times [s] and heights [m], (N,) each, from a `.mat` file.

    Raises:
        SloshBagError: no MATLAB file, a variable is missing or empty, time does not increase.
    """
    try:
        content = scipy.io.loadmat(path, variable_names=["slosh_times", "slosh_heights"])
    except Exception as error:  # the reader lets through whatever broken bytes cause in it
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise SloshBagError(f"{path}: is not a readable MATLAB file: {reason}") from None
    columns = []
    for name in ("slosh_times", "slosh_heights"):
        value = np.asarray(content.get(name, ()))
        if value.size == 0 or value.dtype.kind not in "fiu":
            raise SloshBagError(f"{path}: variable {name!r} is missing, empty or not numeric")
        columns.append(np.asarray(value, dtype=np.float64).ravel())
    times, heights = columns
    if times.shape != heights.shape:
        raise SloshBagError(f"{path}: {times.size} slosh_times but {heights.size} slosh_heights")
    _check_times(path, "slosh_times", times, first_line=1)
    return times, heights * 1e-3


def read_poses(path: Path) -> Array:
    """Reads rows t, x, y, z, qx, qy, qz, qw (N, 8) from a `.csv` or `.csv.gz` file.

    Raises:
        SloshBagError: the file is empty or cut off, has other columns, holds something that is no
            finite number, time does not increase; one line with the file and the line.
    """
    return _rows(path, "t;x;y;z;qx;qy;qz;qw", _POSE_COLUMNS)


def read_joints(path: Path) -> Array:
    """Reads time [s] and six joint positions [rad] (N, 7), in the URDF's convention.

    Raises:
        SloshBagError: as `read_poses`.
    """
    rows = _rows(path, "t;q1;q2;q3;q4;q5;q6", _JOINT_COLUMNS).copy()
    rows[:, 1:] -= ZEROS
    return rows


def _rows(path: Path, columns: str, count: int) -> Array:
    with bounded_text(path, f"rows are {columns}") as text:
        values = array("d")
        for line, row in enumerate(text, start=1):
            values.extend(_row(path, line, row, columns, count))
    if not values:
        raise SloshBagError(f"{path}: is empty; rows are {columns}")
    rows = np.frombuffer(values, np.float64).reshape(-1, count)
    _check_times(path, "t", rows[:, 0], first_line=1)
    return rows


def _row(path: Path, line: int, row: str, columns: str, count: int) -> list[float]:
    cells = row.strip().split(";")
    if len(cells) != count:
        raise SloshBagError(f"{path}: line {line}: has {len(cells)} columns, expected {columns}")
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        raise SloshBagError(f"{path}: line {line}: {row.strip()!r} is not all numbers") from None
    if not np.isfinite(values).all():
        raise SloshBagError(f"{path}: line {line}: a value is not finite")
    return values


def _check_times(path: Path, name: str, times: Array, first_line: int) -> None:
    bad = np.flatnonzero(~np.isfinite(times))
    if len(bad):
        raise SloshBagError(f"{path}: {name}, entry {bad[0] + first_line}: is not finite")
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if len(late):
        entry = int(late[0]) + 1
        raise SloshBagError(
            f"{path}: {name}, entry {entry + first_line}: {times[entry]:.9g} s does not come "
            f"after {times[entry - 1]:.9g} s"
        )
    if times[0] < 0.0:
        raise SloshBagError(f"{path}: {name} starts at {times[0]:.9g} s, before its clock's zero")


def _header(types: Any, stamp_ns: int, frame: str) -> Any:
    stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def _poses(types: Any, motion: Array) -> Iterator[tuple[int, Any]]:
    point, turn = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"]
    pose, stamped = types["geometry_msgs/msg/Pose"], types[POSE_TYPE]
    for t, x, y, z, qx, qy, qz, qw in motion.tolist():
        stamp = ORIGIN_NS + round(t * 1e9)
        place = pose(position=point(x=x, y=y, z=z), orientation=turn(x=qx, y=qy, z=qz, w=qw))
        yield stamp, stamped(header=_header(types, stamp, "world"), pose=place)


def _joints(types: Any, motion: Array, urdf: str) -> Iterator[tuple[int, str, str, Any]]:
    none = np.empty(0)
    yield ORIGIN_NS, ROBOT_DESCRIPTION, TEXT_TYPE, types[TEXT_TYPE](data=urdf)
    for t, *positions in motion.tolist():
        stamp = ORIGIN_NS + round(t * 1e9)
        state = types[JOINT_TYPE](
            header=_header(types, stamp, ""), name=list(JOINTS), position=np.array(positions),
            velocity=none, effort=none,
        )  # fmt: skip
        yield stamp, JOINT_TOPIC, JOINT_TYPE, state


def _surfaces(types: Any, times: Array, heights: Array) -> Iterator[tuple[int, Any]]:
    surface = types[SURFACE_TYPE]
    unknown = dict.fromkeys(_FLOAT_FIELDS, float("nan"))
    none = np.empty(0, dtype=np.float32)
    for t, height in zip(times.tolist(), heights.tolist(), strict=True):
        stamp = ORIGIN_NS + round(t * 1e9)
        yield (
            stamp,
            surface(
                header=_header(types, stamp, "container"),
                msh=height,
                profile_azimuth=none,
                profile_height=none,
                peak_side=0,
                flags=0,
                **unknown,
            ),
        )

"""Motion tables as CSV: a container's motion, with measured heights if there are any.

Columns: `t,ax,ay,az` [s, m/s²: container's origin, world frame, gravity excluded]; optional
`x,y,z` (of the container's origin in the world, m, as in a plan: passed over), `qx,qy,qz,qw`
(attitude, world ← container), `wx,wy,wz` (angular velocity, container's frame, rad/s), `msh` [m],
`eta_000` … `eta_359` (height on the wall by azimuth in degrees from the
container's +x, m) and `profile_X` (height of the surface seen from the side at X metres along the
container's x axis, as in `profile_-0.0295`, m). A height that was not measured is `nan` or an
empty cell. `.csv.gz` is compressed. Tables of other programs, with other names, units and marks
between columns, are read by `text_table`, which tells what it assumed.

What was told of the source of a table stands before the heading, one comment each: `# warning: …`
where the motion is wrong by it, else `# note: …`.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from slosh_base.files import new_text
from slosh_base.files.errors import SloshFileError
from slosh_base.types import Array
from slosh_model import for_notebooks
from slosh_model.simulate import Inputs
from slosh_motion.tables.columns import FOUND_OUT, TableOptions
from slosh_motion.tables.reading import TextTable, read_table

if TYPE_CHECKING:
    from pandas import DataFrame


SUFFIXES = (".csv", ".csv.gz")
"""Of a motion table's file."""
MOTION = ("t", "ax", "ay", "az")
POSITION = ("x", "y", "z")
ATTITUDE = ("qx", "qy", "qz", "qw")
ANGULAR_VELOCITY = ("wx", "wy", "wz")
MSH = "msh"
ETA = "eta_"
PROFILE = "profile_"
CHOOSE = "for other column names use --columns t=…,ax=… (other columns are then not read)"
IMPOSSIBLE = 1e6
"""No container survives such an acceleration [m/s²]: the table is refused."""
_WARNING, _NOTE = "warning: ", "note: "
_BATCH = 10_000  # rows that are turned into text at a time


def is_motion_table(path: Path) -> bool:
    """Returns whether a path has the file name suffix of a motion table.

    >>> is_motion_table(Path("move.csv.gz")), is_motion_table(Path("bag.mcap"))
    (True, False)
    """
    return path.name.lower().endswith(SUFFIXES)


class Remark(NamedTuple):
    """What was told of the source of a table.

    Attributes:
        text: one line.
        wrong: whether the motion is wrong by it.
    """

    text: str
    wrong: bool = False


@dataclass(frozen=True, slots=True, repr=False)
class MotionTable(for_notebooks.Shown):
    """A container's motion with measured heights.

    >>> import numpy as np
    >>> from slosh_motion import MotionTable
    >>> t = np.arange(1001) / 1000.0  # s
    >>> table = MotionTable(t, np.outer(np.sin(9.0 * t), [1.0, 0.0, 0.0]))  # m/s²
    >>> table.attitude is None
    True

    Attributes:
        t: (N,) time [s], strictly increasing.
        acceleration: (N, 3) of the container's origin, world frame, gravity excluded [m/s²].
        attitude: (N, 4) quaternion x, y, z, w, world ← container; None: upright.
        angular_velocity: (N, 3) in the container's frame [rad/s]; None: not given.
        msh: (N,) measured maximum sloshing height [m], NaN where the camera has no sample.
        eta_azimuth: (K,) azimuths of the measured wall heights from the container's +x [rad].
        eta: (N, K) measured wall heights above the still level [m], NaN likewise.
        profile_x: (I,) places of the measured profile from the container's middle along its x axis
            [m], rising.
        profile: (N, I) measured heights of the surface there, above the still level [m], NaN
            likewise.
        remarks: what was told of its source.
    """

    t: Array
    acceleration: Array
    attitude: Array | None = None
    angular_velocity: Array | None = None
    msh: Array | None = None
    eta_azimuth: Array | None = None
    eta: Array | None = None
    profile_x: Array | None = None
    profile: Array | None = None
    remarks: tuple[Remark, ...] = ()

    @property
    def measured(self) -> Array | None:
        """Measured maximum height (N,) [m]: `msh`, or the maximum of `eta` over the azimuth."""
        if self.msh is not None or self.eta is None:
            return self.msh
        unknown = np.isnan(self.eta).all(axis=1)
        filled = np.where(np.isnan(self.eta), -np.inf, self.eta).max(axis=1)
        return np.where(unknown, np.nan, filled)

    def __repr__(self) -> str:
        strongest = float(np.linalg.norm(self.acceleration, axis=1).max(initial=0.0))
        told = f"{for_notebooks.span(self.t)}, acceleration up to {strongest:.3g} m/s²"
        heights = self.measured
        found = "" if heights is None else f", {for_notebooks.peak(self.t, heights, 'measured')}"
        return f"{type(self).__name__}({told}{found})"

    def inputs(self) -> Inputs:
        """Returns the motion as input for `slosh_model.simulate`.

        Raises:
            SloshModelError: it cannot be simulated; the text names the array and the row.
        """
        return Inputs(self.t, self.acceleration, self.attitude, self.angular_velocity)

    def to_pandas(self) -> DataFrame:
        """Returns the columns of the file as a pandas table, indexed by time.

        Raises:
            SloshFileError: a measured azimuth is no whole degree.
            ImportError: pandas is not installed.
        """
        names, columns = _columns("this motion", self)
        data = np.column_stack(columns)
        units = {**dict.fromkeys(MOTION[1:], "m/s²"), **dict.fromkeys(ATTITUDE, "1")}
        units |= dict.fromkeys(ANGULAR_VELOCITY, "rad/s")
        return for_notebooks.table(
            self.t,
            dict(zip(names[1:], data.T[1:], strict=True)),
            units={name: unit for name, unit in units.items() if name in names},
        )


def read_motion_table(
    path: str | Path, options: TableOptions = FOUND_OUT, *, tell_wrong: bool = True
) -> MotionTable:
    """Reads a motion table from a file.

    >>> from slosh_motion import read_motion_table
    >>> read_motion_table("move.csv").acceleration.shape
    (3001, 3)

    Args:
        path: a text file; one whose name ends in .gz is unpacked.
        options: what the user says of it, where it differs from what is written here.
        tell_wrong: whether remarks by which the motion is wrong are told as the others are; False:
            the caller does.

    Raises:
        SloshFileError: the file is missing, empty or cut off, a column is missing, unknown or
            twice, a value is no number, an input is not finite, time does not increase; one line
            that names the file, the line and the column.
    """
    table = read_table(Path(path), _check_columns, options, may_be_blank=_is_height)
    table.check_finite(_is_height)
    table.check_time()
    found = _table(table)
    _check_possible(table, found)
    for remark in found.remarks:
        if tell_wrong or not remark.wrong:
            options.tell(f"{path}: {remark.text}")
    return found


def write_motion_table(path: str | Path, table: MotionTable) -> None:
    """Writes a motion table; `read_motion_table` returns exactly the same values.

    >>> from slosh_motion import read_motion_table, write_motion_table
    >>> table = read_motion_table("move.csv")
    >>> write_motion_table("copy.csv.gz", table)
    >>> bool((read_motion_table("copy.csv.gz").t == table.t).all())
    True

    Args:
        path: the `.csv` or `.csv.gz` file to write.
        table: the table.

    Raises:
        SloshFileError: a measured azimuth is no whole degree.
        OSError: the file cannot be written; what was there is as it was.
    """
    path = Path(path)
    names, columns = _columns(path, table)
    data = np.column_stack(columns)
    with new_text(path) as text:
        for remark in table.remarks:
            line = " ".join(remark.text.split())
            text.write(f"# {_WARNING if remark.wrong else _NOTE}{line}\n")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(names)
        for start in range(0, len(data), _BATCH):
            # The csv module writes floats by repr: to the same bits when read.
            writer.writerows(data[start : start + _BATCH].tolist())


def column_names(path: Path, table: MotionTable) -> list[str]:
    """Returns the names of a table's columns in the written order.

    Raises:
        SloshFileError: a measured azimuth is no whole degree.
    """
    return _columns(path, table)[0]


def eta_azimuths(names: Iterable[str]) -> Array:
    """Returns the azimuths [rad] of wall height columns in increasing order.

    >>> eta_azimuths(["t", "eta_090", "eta_000"]).round(3).tolist()  # rad
    [0.0, 1.571]
    """
    degrees = sorted(float(name.removeprefix(ETA)) for name in names if _is_eta(name))
    return np.radians(degrees)


def _is_eta(name: str) -> bool:
    digits = name.removeprefix(ETA)
    return name.startswith(ETA) and len(digits) == 3 and digits.isdecimal() and int(digits) < 360


def _is_height(name: str) -> bool:
    return name == MSH or _is_eta(name) or _is_profile(name)


def _is_profile(name: str) -> bool:
    try:
        return name.startswith(PROFILE) and math.isfinite(_place(name))
    except ValueError:
        return False


def _place(name: str) -> float:
    """Returns the position x [m] that the name of a profile column states."""
    return float(name.removeprefix(PROFILE))


def _check_columns(path: Path, names: list[str]) -> None:
    known = {*MOTION, *POSITION, *ATTITUDE, *ANGULAR_VELOCITY, MSH}
    for name in names:
        if names.count(name) > 1:
            raise SloshFileError(f"{path}: line 1: column {name!r} appears twice")
        if name not in known and not (_is_eta(name) or _is_profile(name)):
            raise SloshFileError(
                f"{path}: line 1: column {name!r} is unknown; known are {', '.join(MOTION)}, "
                f"{', '.join(POSITION)}, "
                f"{', '.join(ATTITUDE)}, {', '.join(ANGULAR_VELOCITY)}, {MSH}, eta_000 … eta_359, "
                f"{PROFILE}X; {CHOOSE}"
            )
    for group in (MOTION, POSITION, ATTITUDE, ANGULAR_VELOCITY):
        missing = [name for name in group if name not in names]
        if missing and (group is MOTION or len(missing) < len(group)):
            raise SloshFileError(
                f"{path}: line 1: column {missing[0]!r} is missing; "
                f"{', '.join(group)} belong together; {CHOOSE}"
            )


def _table(table: TextTable) -> MotionTable:
    etas = tuple(sorted(name for name in table.names if _is_eta(name)))
    places = tuple(sorted((name for name in table.names if _is_profile(name)), key=_place))
    acceleration = table.group(MOTION[1:])
    assert acceleration is not None  # the names were checked
    return MotionTable(
        t=table.column("t").copy(),
        acceleration=acceleration,
        attitude=table.group(ATTITUDE),
        angular_velocity=table.group(ANGULAR_VELOCITY),
        msh=table.column(MSH).copy() if MSH in table.names else None,
        eta_azimuth=eta_azimuths(etas) if etas else None,
        eta=table.group(etas) if etas else None,
        profile_x=np.array([_place(name) for name in places]) if places else None,
        profile=table.group(places) if places else None,
        remarks=tuple(_remarks(table.comments)),
    )


def _check_possible(text: TextTable, table: MotionTable) -> None:
    """Raises an error where a row has an acceleration that nothing has."""
    # The greatest component: a norm of 1e300 overflows.
    greatest = np.abs(table.acceleration).max(axis=1)
    row = int(np.argmax(greatest))
    if greatest[row] > IMPOSSIBLE:
        raise SloshFileError(
            f"{text.path}: line {text.lines[row]}: an acceleration of {greatest[row]:.3g} m/s² is "
            "not possible; ax, ay, az must be in m/s²"
        )


def _remarks(comments: Iterable[str]) -> Iterator[Remark]:
    for comment in comments:
        for mark, wrong in ((_WARNING, True), (_NOTE, False)):
            if comment.startswith(mark):
                yield Remark(comment.removeprefix(mark), wrong)


def _columns(path: Path | str, table: MotionTable) -> tuple[list[str], list[Array]]:
    names, columns = list(MOTION), [table.t, table.acceleration]
    groups = ((ATTITUDE, table.attitude), (ANGULAR_VELOCITY, table.angular_velocity))
    for group, values in groups:
        if values is not None:
            names += group
            columns.append(values)
    if table.msh is not None:
        names.append(MSH)
        columns.append(table.msh)
    if table.eta is not None and table.eta_azimuth is not None:
        names += _eta_names(path, table.eta_azimuth)
        columns.append(table.eta)
    if table.profile is not None and table.profile_x is not None:
        names += [f"{PROFILE}{x!r}" for x in table.profile_x.tolist()]
        columns.append(table.profile)
    return names, columns


def _eta_names(path: Path | str, azimuth: Array) -> list[str]:
    degrees = np.degrees(azimuth)
    whole = np.rint(degrees)
    if np.abs(degrees - whole).max() > 1e-6:
        raise SloshFileError(
            f"{path}: eta at {degrees[np.argmax(np.abs(degrees - whole))]:.6g}° cannot be "
            "written; the table holds whole degrees"
        )
    return [f"{ETA}{int(value) % 360:03d}" for value in whole]

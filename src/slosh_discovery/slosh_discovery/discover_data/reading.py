"""Converts table files and bags to measured motions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_bag.black_box.black_box import EVENTS
from slosh_bag.black_box.event_bags import has_event_name
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_folder import import_hint
from slosh_bag.reader import BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.tuning import TUNING
from slosh_discovery.discover_data.heights import without_spikes
from slosh_discovery.discover_data.recording import (
    BagRecording,
    Heights,
    Tell,
    read_recording,
    sources_of,
)
from slosh_discovery.discover_data.splitting import Part, split
from slosh_discovery.discover_data.unrelated import unrelated_motion
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.errors import SloshModelError
from slosh_model.gaps import gap_text
from slosh_model.model import Model
from slosh_model.simulate import Inputs
from slosh_motion.checks.table_checks import InputDoubt, motion_doubts
from slosh_motion.recorded.sources import TABLE_COLUMNS, clocks_unrelated
from slosh_motion.signals.metrics import line_slopes
from slosh_motion.tables.columns import FOUND_OUT, TableOptions, check_span
from slosh_motion.tables.motion_table import (
    SUFFIXES,
    MotionTable,
    is_motion_table,
    read_motion_table,
)
from slosh_replay.tables.bag_table import TableSettings, read_bag_table

NAN = float("nan")


@dataclass(frozen=True, slots=True)
class DayMotion:
    """A recorded motion and the error of the estimator during the recording.

    Attributes:
        motion: the motion.
        disagreement: root mean square of measured minus estimated height, as the monitor compared
            them live [m]; NaN: no comparison was recorded.
        span_ns: first and last input of a motion in a bag that was written round an event [ns]:
            another such bag may hold it, too. None: in another bag, or in a table.
    """

    motion: MeasuredMotion
    disagreement: float
    span_ns: tuple[int, int] | None = None


def _quietly(line: str) -> None:
    """Ignores a line of text; default for callers that want no remarks."""


def read_motions(
    path: str | Path,
    model: Model | None = None,
    tell: Callable[[str], object] = _quietly,
    tables: TableOptions = FOUND_OUT,
) -> list[MeasuredMotion]:
    """Reads the measured motions of a file or a folder.

    Args:
        path: a motion table (`.csv`, `.csv.gz`), a bag (folder or `.mcap`, also an unfinished
            one), or a folder of these.
        model: by whose container heights are laid over the motion where their clocks are
            unrelated, and profiles become heights; None: what the bag says of its container.
        tell: is told what is left out or assumed, one line each.
        tables: how motion tables are to be read.

    Returns:
        at least one motion: a table's own; of a bag each motion that begins with the liquid at
        rest, in the order of the recording.

    Raises:
        SloshBagError, SloshDiscoveryError: one line that says what is wrong and where.
    """
    return [
        entry.motion for item in files_at(Path(path)) for entry in _read(item, model, tell, tables)
    ]


def motions_of_day(
    path: Path, model: Model | None = None, tell: Callable[[str], object] = _quietly
) -> list[MeasuredMotion]:
    """Returns the motions of a day's recording, those with the largest live error first.

    Args and errors are those of `read_motions`.
    """
    return [entry.motion for entry in day_motions(path, model, tell)]


def day_motions(
    path: Path,
    model: Model | None = None,
    tell: Callable[[str], object] = _quietly,
    tables: TableOptions = FOUND_OUT,
) -> list[DayMotion]:
    """Returns the motions of a day's recording, each with the error of the live estimate.

    Motions of which no comparison was recorded come last, in the order of the recording. A bag of
    an event, among others, may hold no motion: that is told. What several of them hold is one.
    """
    items, found = files_at(path), list[DayMotion]()
    for number, item in enumerate(items, start=1):
        try:
            found += _read(item, model, tell, tables)
        except (SloshBagError, SloshDiscoveryError) as error:
            if not _is_of_event(item) or (number == len(items) and not found):
                raise
            tell(f"left out: {error}")
    return sorted(_once(found), key=lambda entry: -np.nan_to_num(entry.disagreement, nan=-1.0))


def _is_of_event(path: Path) -> bool:
    """Returns whether a path is an event bag, which may begin or end within a motion."""
    if has_event_name(path) or has_event_name(path.parent):
        return True
    try:
        return not is_motion_table(path) and EVENTS in BagReader(path).metadata()
    except SloshBagError:
        return False


def _once(motions: Sequence[DayMotion]) -> list[DayMotion]:
    """Returns each motion once; of its copies in several event bags, the longest."""
    kept: list[DayMotion] = []
    for entry in sorted(motions, key=lambda entry: -_length(entry)):
        if entry.span_ns is None or not any(_overlap(entry, other) for other in kept):
            kept.append(entry)
    return [entry for entry in motions if any(entry is other for other in kept)]


def _length(entry: DayMotion) -> int:
    return 0 if entry.span_ns is None else entry.span_ns[1] - entry.span_ns[0]


def _overlap(one: DayMotion, other: DayMotion) -> bool:
    if one.span_ns is None or other.span_ns is None:
        return False
    return one.span_ns[0] <= other.span_ns[1] and other.span_ns[0] <= one.span_ns[1]


def files_at(path: Path) -> list[Path]:
    """Returns the table files and bags at a path, a file or a folder.

    Raises:
        SloshDiscoveryError: there are none.

    >>> files_at(Path("move.csv"))
    [PosixPath('move.csv')]
    """
    if not path.exists():
        raise SloshDiscoveryError(f"{path}: no such file or folder")
    if not path.is_dir() or any(path.glob("*.mcap")):
        return [path]
    tables = [entry for entry in path.iterdir() if entry.is_file() and is_motion_table(entry)]
    bags = [entry for entry in path.iterdir() if entry.is_dir() and any(entry.glob("*.mcap"))]
    if not tables and not bags:
        raise SloshDiscoveryError(
            f"{path}: holds no motion tables (.csv, .csv.gz) and no bags{import_hint(path)}"
        )
    return sorted([*tables, *bags])


def _read(
    path: Path, model: Model | None, tell: Tell, tables: TableOptions
) -> Iterator[DayMotion]:
    """Yields the motions of a table or a bag, each with the error of the live estimate."""
    if is_motion_table(path):
        yield DayMotion(table_motion(path, tell, model, replace(tables, tell=tell)), NAN)
        return
    name = path.name.removesuffix(".mcap")
    reader, sources = sources_of(path)
    if clocks_unrelated(sources.facts):
        recording = read_recording(path, reader, sources, tell)
        yield DayMotion(unrelated_motion(name, recording, model, tell), NAN)
    elif TABLE_COLUMNS in sources.facts:
        # A table that became a bag is one motion, with wall heights where it had them.
        table = read_bag_table(path, TableSettings()).table
        yield DayMotion(motion_of_table(path, name, table, tell, model), NAN)
    else:
        recording = read_recording(path, reader, sources, tell)
        of_event = EVENTS in sources.facts
        for entry in _motions(name, recording, tell):
            yield entry if of_event else replace(entry, span_ns=None)


def _motions(name: str, recording: BagRecording, tell: Tell) -> Iterator[DayMotion]:
    path, raw = recording.path, recording.heights
    clean, spikes = without_spikes(raw.msh)
    if spikes:
        tell(f"{path}: {spikes} single spikes of the measured height are left out")
    keep = np.isfinite(clean)
    heights = Heights(raw.stamps[keep], clean[keep], raw.stddev[keep])
    recording = replace(recording, heights=heights)
    found = split(recording)
    for note in found.notes:
        tell(f"{path}: {note}")
    count = 0
    for number, part in enumerate(found.parts, start=1):
        motion = _motion_of(f"{name}#{number}", recording, part)
        if motion is None:
            tell(f"{path}: motion {number} has fewer than {TUNING.least_motion} measured heights")
            continue
        count += 1
        yield DayMotion(motion, _disagreement(recording, part), (part.start, part.end))
    if not count:
        raise SloshDiscoveryError(f"{path}: holds no motion with measured heights")


def _motion_of(name: str, recording: BagRecording, part: Part) -> MeasuredMotion | None:
    """Returns the motion in a part of a recording, or None if it has too few data."""
    motion, heights = recording.motion, recording.heights
    rows = slice(*np.searchsorted(motion.stamps, (part.start, part.end + 1)))
    samples = slice(*np.searchsorted(heights.stamps, (part.heights_start, part.end + 1)))
    if samples.stop - samples.start < TUNING.least_motion:
        return None
    origin = int(motion.stamps[0])
    stddev = heights.stddev[samples]
    attitude, turning = motion.attitude, motion.angular_velocity
    try:
        return MeasuredMotion(
            name,
            Inputs(
                (motion.stamps[rows] - origin) / SECOND,
                motion.acceleration[rows],
                None if attitude is None else attitude[rows],
                None if turning is None else turning[rows],
            ),
            (heights.stamps[samples] - origin) / SECOND,
            msh=heights.msh[samples],
            stddev=stddev if np.isfinite(stddev).any() else None,
        )
    except (SloshModelError, SloshDiscoveryError) as error:
        raise SloshDiscoveryError(f"{recording.path}: {error}") from None


def _disagreement(recording: BagRecording, part: Part) -> float:
    """Returns the rms of recorded residuals in part of a recording [m]; NaN without residuals."""
    stamps, values = recording.residuals
    first, last = np.searchsorted(stamps, (part.heights_start, part.end + 1))
    if first == last:
        return float("nan")
    return float(np.sqrt(np.mean(values[first:last] ** 2)))


def table_motion(
    path: Path,
    tell: Callable[[str], object],
    model: Model | None = None,
    options: TableOptions = FOUND_OUT,
) -> MeasuredMotion:
    """Reads the motion in a table file.

    Args:
        path: `.csv` or `.csv.gz`.
        model: whose container a profile was seen in; None: unknown.
        tell: is told what is left out, one line each.
        options: what the user says of the table.

    Raises:
        SloshBagError: the table cannot be read.
        SloshDiscoveryError: it holds no measured heights or too few, or inputs that cannot be.
    """
    name = path.name
    for suffix in reversed(SUFFIXES):
        name = name.removesuffix(suffix)
    table = read_motion_table(path, options, tell_wrong=False)
    return motion_of_table(path, name, table, tell, model)


def motion_of_table(
    path: Path,
    name: str,
    table: MotionTable,
    tell: Callable[[str], object],
    model: Model | None = None,
) -> MeasuredMotion:
    """Converts the values of a table to a measured motion.

    Of msh and wall heights the latter are taken: their maximum is the msh, so that nothing is
    lost. Where more moments have an msh than wall heights it is the other way round. A profile
    without either gives the height at the container's +x, on the line that is nearest to it.

    Args:
        path: where the table comes from; for what is said of it.
        name: of the motion.
        table: the table.
        tell: is told what is left out, one line each.
        model: whose container a profile was seen in; None: unknown.

    Raises:
        SloshBagError: it is too long to be simulated.
        SloshDiscoveryError: no measured heights, too few of them, or inputs that cannot be.
    """
    check_span(path, table.t)
    gaps = gap_text(table.t, model) if model is not None else ""
    if gaps:
        tell(InputDoubt(gaps).of_file(path))
    told = [InputDoubt(remark.text) for remark in table.remarks if remark.wrong]
    seen = motion_doubts(table.t, table.acceleration, table.attitude)
    for doubt in (*told, *(one for one in seen if one not in told)):
        tell(doubt.of_file(path))
    sampled, walls = _sampled(table.msh), _sampled(table.eta)
    if table.msh is None and table.eta is None and table.profile is None:
        raise SloshDiscoveryError(
            f"{path}: holds no measured heights; add a column msh or columns eta_000 … eta_359"
        )
    try:
        if table.msh is None and table.eta is None:
            return _profile_motion(path, name, table, model)
        inputs = table.inputs()
        if table.eta is not None and len(walls) >= len(sampled):
            return MeasuredMotion(
                name, inputs, table.t[walls], eta_azimuth=table.eta_azimuth, eta=table.eta[walls]
            )
        assert table.msh is not None  # its samples outnumber those of the wall
        if len(walls):
            tell(f"{path}: more rows have msh than wall heights: the wall heights are left out")
        # Spikes are looked for among samples: rows of the input alone lie between them.
        clean, spikes = without_spikes(table.msh[sampled])
        if spikes:
            tell(f"{path}: {spikes} single spikes of the measured height are left out")
        kept = np.isfinite(clean)
        return MeasuredMotion(name, inputs, table.t[sampled][kept], msh=clean[kept])
    except (SloshModelError, SloshDiscoveryError) as error:
        raise SloshDiscoveryError(f"{path}: {error}") from None


def _profile_motion(
    path: Path, name: str, table: MotionTable, model: Model | None
) -> MeasuredMotion:
    """Fits a line to each surface profile, which gives heights at +x (TM20, eqs. (11), (12))."""
    if model is None:
        raise SloshDiscoveryError(f"{path}: holds a profile; its width is known only with a model")
    assert table.profile is not None and table.profile_x is not None  # noqa: PT018  # by the caller
    rows = _sampled(table.profile)
    profile = table.profile[rows]
    half = model.container.reaches[0]
    return MeasuredMotion(
        name,
        table.inputs(),
        table.t[rows],
        eta_azimuth=np.zeros(1),
        eta=half * line_slopes(table.profile_x, profile)[:, np.newaxis],
        profile_x=table.profile_x,
        profile=profile,
    )


def _sampled(heights: Array | None) -> NDArray[np.intp]:
    """Returns the indices of the rows that contain a measured height."""
    if heights is None:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(np.isfinite(heights.reshape(len(heights), -1)).any(axis=1))

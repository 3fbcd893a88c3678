"""Reads the motions of a recording, one row for each."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import is_held
from slosh_bag.mcap_files.remote_path import bag_path
from slosh_base.files.file_version import without_version
from slosh_base.types import Array, Integers
from slosh_estimator.limits import Kind, Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_fleet.motions.motion_row import MotionRow
from slosh_model.errors import SloshModelError
from slosh_model.mode_table import mode_table
from slosh_motion.recorded.inputs import STAMP, stamps_of
from slosh_motion.recorded.settings import NodeStart, latest, model_of
from slosh_motion.recorded.sources import CellTopics
from slosh_motion.signals.motion_spans import MotionFinder, MotionSpan
from slosh_msgs_py import topics
from slosh_replay.recorded_run import RecordedRun

_TYPES = {row.name: row.type for row in topics.TOPICS}
_FIELDS: Mapping[str, tuple[str, ...]] = {
    topics.ESTIMATE: ("acceleration", "linear.msh", "nonlinear.msh", "flags"),
    topics.COMPARISON: (
        "measured", "estimated_linear", "estimated_nonlinear", "measured_flags", "measured_stale",
    ),
    topics.FUSED_ESTIMATE: (
        "frequency_factor", "frequency_stddev", "damping_factor", "damping_stddev", "level",
        "trusted",
    ),
    topics.CALM: ("calm",),
    topics.LIMIT_EVENT: ("kind",),
}  # fmt: skip
"""Fields that are read of each topic, beside the stamps."""
OPENING = 20
"""Samples by which a motion is known again where its bag is cut off behind them."""
NAN = math.nan
Columns = Mapping[str, NDArray[Any]]


class _Table(NamedTuple):
    """Columns of the messages of one topic, sorted by stamp.

    Attributes:
        stamps: (N,) [ns].
        columns: (N,) or (N, n) by field.
    """

    stamps: Integers
    columns: Columns

    def within(self, begin_ns: int, end_ns: int) -> _Table:
        """Returns the messages with stamps in a time span, whose end is excluded."""
        part = slice(*np.searchsorted(self.stamps, [begin_ns, end_ns]).tolist())
        return _Table(self.stamps[part], {name: one[part] for name, one in self.columns.items()})


class _Liquid(NamedTuple):
    """The container of a recording, with frequency and damping of the model's first mode.

    Attributes:
        shape: of the container.
        digest: SHA-256 of the model file.
        frequency: natural frequency [rad/s]; NaN: unknown.
        damping: damping ratio; NaN: unknown.
    """

    shape: str = ""
    digest: str = ""
    frequency: float = NAN
    damping: float = NAN


def motions_of(path: str | Path) -> list[MotionRow]:
    """Reads the motions of all robot cells in a bag, one row for each motion.

    Args:
        path: the bag's folder or MCAP file.

    Raises:
        SloshBagError: it cannot be read, is being recorded, or holds no estimates.
    """
    if is_held(bag_path(path)):
        raise SloshBagError(f"{path}: is being recorded; ingest it when it is finished")
    run = RecordedRun(path)
    rows: list[MotionRow] = []
    has_estimates = False
    for cell in run.cell.cells:
        own = CellTopics(run.reader, cell)
        if own.topic(topics.ESTIMATE, _TYPES[topics.ESTIMATE]) is None:
            continue
        has_estimates = True
        rows += _motions_of_cell(run, own, cell)
    if not has_estimates:
        raise SloshBagError(
            f"{path}: holds no estimates; `slosh replay {path} -o DIR` writes a bag with them"
        )
    return rows


def _motions_of_cell(run: RecordedRun, own: CellTopics, cell: str) -> list[MotionRow]:
    starts = own.starts
    tables = {name: _read(run, own, name, columns) for name, columns in _FIELDS.items()}
    estimates = tables[topics.ESTIMATE]
    finder = MotionFinder()
    finite = np.isfinite(estimates.columns["acceleration"]).all(axis=1)
    finder.add(estimates.stamps[finite], estimates.columns["acceleration"][finite])
    finder.finish()
    spans = finder.spans
    ends = [span.start_ns for span in spans[1:]] + [2**62]
    liquid, limits = _liquid(starts), _limits(starts)
    name = cell.strip("/").replace("/", ".") or "slosh"
    rows = []
    for span, end_ns in zip(spans, ends, strict=True):
        parts = {topic: table.within(span.start_ns, end_ns) for topic, table in tables.items()}
        rows.append(_row(name, str(run.path.resolve()), span, parts, liquid, limits))
    return rows


def _row(
    cell: str,
    bag: str,
    span: MotionSpan,
    parts: Mapping[str, _Table],
    liquid: _Liquid,
    limits: Mapping[Source, float],
) -> MotionRow:
    estimates = parts[topics.ESTIMATE]
    moving = estimates.within(span.start_ns, span.end_ns)
    strength = np.linalg.norm(moving.columns["acceleration"], axis=1)
    compared = _compared(parts[topics.COMPARISON])
    return MotionRow(
        cell=cell,
        digest=_digest(cell, moving),
        opening=_digest(cell, moving, OPENING),
        bag=bag,
        container=liquid.shape,
        model_digest=liquid.digest,
        begin_ns=span.start_ns,
        duration=1e-9 * (span.end_ns - span.start_ns),
        acceleration=_largest(strength),
        linear_peak=_largest(estimates.columns["linear.msh"]),
        nonlinear_peak=_largest(estimates.columns["nonlinear.msh"]),
        measured_limit=limits[Source.MEASURED],
        estimated_limit=limits[Source.ESTIMATED],
        calm_time=_calm_time(parts[topics.CALM], span.end_ns),
        events=int((parts[topics.LIMIT_EVENT].columns["kind"] == int(Kind.START)).sum()),
        measured_flags=_all_flags(parts[topics.COMPARISON].columns["measured_flags"]),
        estimate_flags=_all_flags(estimates.columns["flags"]),
        **compared,
        **_identified(parts[topics.FUSED_ESTIMATE], liquid),
    )


def _compared(table: _Table) -> dict[str, Any]:
    """Returns measured peak height, and linear and nonlinear model's errors at valid images."""
    columns = table.columns
    measured = columns["measured"]
    usable = np.isfinite(measured) & (columns["measured_stale"] == 0)
    peak = _largest(measured[usable])
    found: dict[str, Any] = {"measured_peak": peak, "images": int(usable.sum())}
    for name in ("linear", "nonlinear"):
        estimated = columns[f"estimated_{name}"]
        both = usable & np.isfinite(estimated)
        errors = np.abs(measured[both] - estimated[both])
        found[f"sigma_{name}"] = float(errors.mean()) if len(errors) else NAN
        top = _largest(measured[both])
        found[f"epsilon_{name}"] = (_largest(estimated[both]) - top) / top if top > 0.0 else NAN
    return found


def _identified(table: _Table, liquid: _Liquid) -> dict[str, Any]:
    """Returns frequency, damping and fill level from the last trusted state of the observer."""
    rows = np.flatnonzero(table.columns["trusted"])
    names = ("frequency_factor", "frequency_stddev", "damping_factor", "damping_stddev", "level")
    last = [float(table.columns[n][rows[-1]]) for n in names] if len(rows) else [NAN] * 5
    frequency, damping = liquid.frequency * last[0], liquid.damping * last[2]
    return {
        "natural_frequency": frequency,
        "natural_frequency_stddev": frequency * last[1],  # its logarithm's is stored
        "damping_ratio": damping,
        "damping_ratio_stddev": damping * last[3],
        "level": last[4],
    }


def _calm_time(table: _Table, end_ns: int) -> float:
    """Returns the time from a motion's end until the liquid is calm [s]; NaN if unknown."""
    calm = table.stamps[(table.columns["calm"] != 0) & (table.stamps >= end_ns)]
    return 1e-9 * float(calm[0] - end_ns) if len(calm) else NAN


def _digest(cell: str, moving: _Table, count: int | None = None) -> str:
    """Returns the digest of a motion's first samples, by default of all."""
    stamps, accelerations = moving.stamps[:count], moving.columns["acceleration"][:count]
    parts = (stamps.astype("<i8"), accelerations.astype("<f8"))
    digest = hashlib.sha256(cell.encode())
    for part in parts:
        digest.update(part.tobytes())
    return digest.hexdigest()


def _liquid(starts: Sequence[NodeStart]) -> _Liquid:
    start = latest(starts, "estimator")
    text = start.files.get("model") if start is not None else None
    if start is None or text is None:
        return _Liquid()
    # One container is one trend, before an upgrade and after it.
    digest = hashlib.sha256(without_version(text).encode()).hexdigest()
    try:
        model = model_of(start)
        first = mode_table(model, 1)[0]
    except (SloshModelError, SloshBagError):
        return _Liquid(digest=digest)
    shape = model.container.shape
    return _Liquid(shape, digest, first.natural_frequency, first.damping_ratio)


def _limits(starts: Sequence[NodeStart]) -> Mapping[Source, float]:
    start = latest(starts, "monitor")
    return MonitorSettings.from_partial(start.parameters if start is not None else {}).limits


def _read(run: RecordedRun, own: CellTopics, name: str, fields: Sequence[str]) -> _Table:
    """Reads one topic of a robot cell as columns; no rows if the topic was not recorded."""
    topic = own.topic(name, _TYPES[name])
    blocks = [] if topic is None else list(run.reader.look_up([topic]))
    parts = [run.reader.columns(block, (*STAMP, *fields)) for block in blocks]
    if not parts:
        empty = np.empty(0)
        nothing = {one: np.empty((0, 3)) if one == "acceleration" else empty for one in fields}
        return _Table(np.empty(0, np.int64), nothing)
    stamps = np.concatenate([stamps_of(part) for part in parts])
    order = np.argsort(stamps, kind="stable")
    columns = {one: np.concatenate([part[one] for part in parts])[order] for one in fields}
    return _Table(stamps[order], columns)


def _largest(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else NAN


def _all_flags(flags: NDArray[Any]) -> int:
    return int(np.bitwise_or.reduce(flags.astype(np.int64))) if len(flags) else 0

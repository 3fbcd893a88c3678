"""Heights in a tray's further containers that have a camera, for the report of a run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from slosh_estimator.container_monitor import own_settings
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.tray import Tray
from slosh_motion.recorded.inputs import STAMP, stamps_of
from slosh_motion.recorded.settings import first, tray_of
from slosh_motion.recorded.sources import COMPARISON as COMPARISON_TYPE
from slosh_msgs_py.topics import COMPARISON, of_container
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay.report import report_start, shown_models
from slosh_replay.replay.result import ReplayResult
from slosh_report.run_report import RunReport

FIELDS = ("measured", "estimated_linear", "estimated_nonlinear", "measured_stale")


def further_containers(run: RecordedRun, result: ReplayResult) -> tuple[RunReport, ...]:
    """Returns the heights in each container of a tray, except the first, that has a camera.

    Args:
        run: the recording.
        result: its replay, whose zero of time and limits hold for them, too.

    Returns:
        a report of each, with the container's name as title; empty without such containers.

    Raises:
        SloshBagError: the bag cannot be read.
        SloshModelError: the recorded tray cannot be read.
    """
    started = first(run.starts, "estimator")
    tray = tray_of(started) if started else None
    if tray is None:
        return ()
    found = []
    for index, name in enumerate(tray.names):
        topic = run.cell.topic(of_container(COMPARISON, name), COMPARISON_TYPE) if index else None
        columns = None if topic is None else _columns(run, topic)
        if columns is not None:
            found.append(_report(name, columns, result, _limit(tray, index, result.limits)))
    return tuple(found)


def _columns(run: RecordedRun, topic: str) -> Mapping[str, NDArray[np.float64]] | None:
    """Reads a container's SloshComparison messages as columns; None if none were recorded."""
    parts = [
        (stamps_of(columns), columns)
        for block in run.reader.look_up([topic])
        for columns in [run.reader.columns(block, (*STAMP, *FIELDS))]
    ]
    if not parts:
        return None
    stamps = np.concatenate([stamps for stamps, _ in parts])
    columns = {name: np.concatenate([part[name] for _, part in parts]) for name in FIELDS}
    rows = np.flatnonzero(columns["measured_stale"] == 0)
    rows = rows[np.argsort(stamps[rows], kind="stable")]
    return {"stamps": stamps[rows], **{name: columns[name][rows] for name in FIELDS[:-1]}}


def _report(
    name: str, columns: Mapping[str, NDArray[np.float64]], result: ReplayResult, limit: float
) -> RunReport:
    stamps = columns["stamps"]
    start = report_start(result) if len(result.stamps) or not len(stamps) else int(stamps[0])
    linear, nonlinear = shown_models(result)
    return RunReport(
        title=name,
        t=np.asarray((stamps - start) * 1e-9, dtype=np.float64),
        measured=columns["measured"],
        linear=columns["estimated_linear"],
        nonlinear=columns["estimated_nonlinear"],
        linear_name=linear,
        nonlinear_name=nonlinear,
        limit=limit if np.isfinite(limit) else None,
    )


def _limit(tray: Tray, index: int, settings: MonitorSettings | None) -> float:
    """Returns the limit of a container's measured height [m]; NaN if no limit was set."""
    if settings is None:
        return float("nan")
    return own_settings(tray, index, settings).limits[Source.MEASURED]

"""Metrics of a recorded run, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_bringup.live.run_data import COLUMNS, RunData
from slosh_estimator.sight import UNSOUND, judged
from slosh_motion.signals.metrics import mean_absolute_error, peak_error, rms_error
from slosh_replay.replay import ReplayResult
from slosh_report.json_values import plain


@dataclass(frozen=True, slots=True)
class SeriesAgreement:
    """Metrics of the agreement between a series of liquid heights and a reference series.

    Attributes:
        name: what is compared with what.
        sigma: mean absolute error (DL22, eq. (33)) [m].
        epsilon: relative error of the maximum (DL22, eq. (32)).
        rms: root mean square error [m].
        count: compared moments.
    """

    name: str
    sigma: float
    epsilon: float
    rms: float
    count: int


@dataclass(frozen=True, slots=True)
class RunResult:
    """All metrics of a recorded run: accuracy, latencies and losses.

    Attributes:
        agreements: models against camera and, in the simulated cell, all against the truth.
        latency: median and maximum by node [s].
        lost: messages by topic that were published but not recorded; see `RunData.lost`.
        dropped: samples that nodes dropped, by node and reason.
        events: number of excesses of limits.
        values, rows: what the simulated cell found besides, for JSON and as texts, by name.
    """

    agreements: tuple[SeriesAgreement, ...]
    latency: Mapping[str, tuple[float, float]]
    lost: Mapping[str, int]
    dropped: Mapping[str, int]
    events: int
    values: Mapping[str, Any] = field(default_factory=dict)
    rows: Mapping[str, str] = field(default_factory=dict)

    @property
    def lost_line(self) -> str:
        """Describes lost messages in one line; empty if none is lost."""
        total = sum(self.lost.values())
        return (
            f"{total} messages are lost and missing in the bag{_which(self.lost)}" if total else ""
        )

    @property
    def compared(self) -> int:
        """Number of images for which both the modelled and the measured height are known."""
        return self.agreements[0].count

    def document(self) -> dict[str, Any]:
        """Returns the metrics for JSON; unknown values are None."""
        latency = {
            node: plain({"median": median, "maximum": greatest})
            for node, (median, greatest) in self.latency.items()
        }
        own = {
            name: value for name, value in plain(self).items() if name not in ("values", "rows")
        }
        return {**own, "latency": latency, **plain(self.values)}


def evaluate(data: RunData) -> RunResult:
    """Computes the metrics of a recorded run."""
    measured = data.columns["measured"]
    linear, nonlinear = data.columns["estimated_linear"], data.columns["estimated_nonlinear"]
    sound = (data.flags("estimate") & UNSOUND) == 0
    truth = data.truth_at_images()
    l_name, nl_name = data.models

    def counted(model: Array) -> Array:
        known = judged(measured, data.flags("measured"), model, sound)
        return np.where(known, model, np.nan)

    pairs = [
        (f"{nl_name} / camera", measured, counted(nonlinear)),
        (f"{l_name} / camera", measured, counted(linear)),
        *(_further(name, table) for name, table in data.further.items()),
    ]
    if len(data.truth):
        known = np.where(sound, nonlinear, np.nan)
        pairs += [("camera / truth", truth, measured), (f"{nl_name} / truth", truth, known)]
    return RunResult(
        agreements=tuple(agreement(*pair) for pair in pairs),
        latency={
            node.rsplit("/", 1)[-1]: latency
            for node, facts in data.diagnostics.items()
            if (latency := _latency(facts)) is not None
        },
        lost=data.lost(),
        dropped=_dropped(data),
        events=len({event.id for event in data.events}),
        values=data.values,
        rows=data.rows,
    )


def _further(container: str, table: Array) -> tuple[str, Array, Array]:
    """Returns name, measured and estimated heights of a tray's second or later container."""
    of = dict(zip(COLUMNS, table.T, strict=True))
    flags, sound = of["measured_flags"].astype(np.int64), of["estimate_flags"].astype(np.int64)
    measured, model = of["measured"], of["estimated_nonlinear"]
    known = judged(measured, flags, model, (sound & UNSOUND) == 0)
    return f"camera of {container}", measured, np.where(known, model, np.nan)


def agreement(name: str, reference: Array, series: Array) -> SeriesAgreement:
    """Compares a height series with its reference at the samples where both are known."""
    count = int(np.count_nonzero(np.isfinite(reference) & np.isfinite(series)))
    if not count:
        return SeriesAgreement(name, math.nan, math.nan, math.nan, 0)
    return SeriesAgreement(
        name,
        mean_absolute_error(reference, series),
        peak_error(reference, series),
        rms_error(reference, series),
        count,
    )


def table(result: RunResult) -> str:
    """Formats the metrics of a run as a text table."""
    lines = [
        f"{row.name:<18}{1e3 * row.sigma:8.2f}{1e2 * row.epsilon:8.1f}{1e3 * row.rms:10.2f}"
        f"{row.count:8d}"
        for row in result.agreements
        if row.count
    ]
    if lines:
        heads = f"{'':<18}{'MAE [mm]':>8}{'ε [%]':>8}{'rms [mm]':>10}{'images':>8}"
        lines = [heads, *lines, ""]
    for node, (median, greatest) in sorted(result.latency.items()):
        lines.append(
            f"latency {node:<11} median {1e3 * median:6.1f} ms   maximum {1e3 * greatest:6.1f} ms"
        )
    lines.append(f"lost messages       {sum(result.lost.values())}{_which(result.lost)}")
    lines.append(f"dropped samples     {sum(result.dropped.values())}{_which(result.dropped)}")
    lines.append(f"limit events        {result.events}")
    lines += [f"{label:<20}{text}" for label, text in result.rows.items()]
    return "\n".join(lines)


def print_replay(replayed: ReplayResult) -> None:
    """Prints whether a replay reproduced the recorded estimates and monitor results."""
    parts = [
        f"{found.identical} of {found.total} {name}s" for name, found in replayed.verified.items()
    ]
    print(f"{'replayed':<20}{', '.join(parts) or 'nothing'} bit for bit")
    for found in replayed.verified.values():
        for line in found.lines()[1:]:
            print(line)


def _which(counts: Mapping[str, int]) -> str:
    named = [f"{name} {count}" for name, count in counts.items() if count]
    return f" ({', '.join(named)})" if named else ""


def _latency(facts: Mapping[str, str]) -> tuple[float, float] | None:
    try:
        median = float(facts["latency median [ms]"])
        return 1e-3 * median, 1e-3 * float(facts["latency maximum [ms]"])
    except (KeyError, ValueError):
        return None


def _dropped(data: RunData) -> dict[str, int]:
    dropped = {}
    for node, facts in data.diagnostics.items():
        short = node.rsplit("/", 1)[-1]
        for key, value in facts.items():
            if key.startswith("dropped: "):
                dropped[f"{short} {key.removeprefix('dropped: ')}"] = int(value)
    missing = _images_without_measurement(data)
    if missing is not None:
        dropped["camera images"] = missing
    return dropped


def _images_without_measurement(data: RunData) -> int | None:
    """Returns the number of images that the camera node did not measure, or None if unknown."""
    images = next((n for topic, n in data.published.items() if topic.endswith("/image_raw")), None)
    measured = next(
        (info.count for topic, info in data.topics.items() if topic.endswith("/free_surface")),
        None,
    )
    return None if images is None or measured is None else images - measured

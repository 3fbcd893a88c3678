"""Contents of a recorded run: compared and exact heights, exceeded limits and latencies."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_bag.reader import TopicInfo, stamp_ns
from slosh_base.types import Array
from slosh_motion.recorded.sources import lost_messages, shared_topics_line
from slosh_msgs_py.topics import COMPARISON
from slosh_replay.recorded_run import RecordedRun

HEIGHTS = (
    "measured",
    "estimated_linear",
    "estimated_nonlinear",
    "sigma_linear",
    "sigma_nonlinear",
    "epsilon_linear",
    "epsilon_nonlinear",
)
FLAGS = ("measured_flags", "estimate_flags")
COLUMNS = (*HEIGHTS, *FLAGS)
"""Fields of SloshComparison that are read."""


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """A recorded event in which a height exceeded its limit; see LimitEvent.msg for the fields."""

    stamp_ns: int
    id: int
    kind: int
    source: int
    limit: float
    peak: float
    description: str


@dataclass(frozen=True, slots=True)
class RunData:
    """Heights, limit events, latencies and numbers of lost messages of a recorded run.

    Attributes:
        run: the recording.
        stamps: (N,) of the compared images [ns].
        columns: the fields of SloshComparison by name, (N,) each.
        truth_stamps, truth: (M,) the simulated cell's exact heights [ns], [m]; none on a robot.
        events: in order.
        topics: type and number of messages by topic.
        published: what the simulated cell published, by topic; empty on a robot.
        diagnostics: the last report of each node: key -> value.
        models: names of the L and the NL model.
        warnings: about the bag itself.
        noted_lost: messages that were sent and are not in the bag, by topic, as the recorder
            noted; without a topic where it is not known.
        further: (M, columns) of the comparisons of each container behind a tray's first that has
            a camera, by its name, in the order of `columns`.
        values, rows: what the simulated cell found besides, for JSON and as texts, by name.
        mixed: what the recorder noted of several publishers on topics of one; empty: nothing.
    """

    run: RecordedRun
    stamps: NDArray[np.int64]
    columns: Mapping[str, Array]
    truth_stamps: NDArray[np.int64]
    truth: Array
    events: tuple[RecordedEvent, ...]
    topics: Mapping[str, TopicInfo]
    published: Mapping[str, int]
    diagnostics: Mapping[str, Mapping[str, str]]
    models: tuple[str, str]
    warnings: tuple[str, ...]
    noted_lost: Mapping[str, int] = field(default_factory=dict)
    mixed: str = ""
    further: Mapping[str, Array] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    rows: Mapping[str, str] = field(default_factory=dict)

    @property
    def seconds(self) -> Array:
        """Times (N,) of the compared images since the first compared image [s]."""
        return np.asarray((self.stamps - self.stamps[:1]) * 1e-9, dtype=np.float64)

    def flags(self, side: str) -> NDArray[np.int64]:
        """Returns the validity flags (N,) of the compared measurements or of the estimates."""
        return self.columns[f"{side}_flags"].astype(np.int64)

    def lost(self) -> dict[str, int]:
        """Number of published messages that the bag does not contain, by topic.

        The one count that is told everywhere: what the recorder noted and, where the simulated
        cell tells what it published, no less than what the bag lacks of that.
        """
        lost = {topic or "recorder": count for topic, count in self.noted_lost.items()}
        for topic, count in self.published.items():
            if topic in self.topics:
                lacking = count - (self.topics[topic].count or 0)
                lost[topic] = max(lacking, lost.get(topic, 0))
        return lost

    def truth_at_images(self) -> Array:
        """Exact height (N,) at the compared images [m]; NaN if it was not recorded."""
        if not len(self.truth):
            return np.full(len(self.stamps), np.nan)
        origin = self.truth_stamps[0]
        known = self.truth_stamps - origin
        return np.asarray(np.interp(self.stamps - origin, known, self.truth), dtype=np.float64)


@dataclass(slots=True)
class _Gathered:
    rows: list[list[float]] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    further: dict[str, list[list[float]]] = field(default_factory=dict)
    truth: list[tuple[int, float]] = field(default_factory=list)
    events: list[RecordedEvent] = field(default_factory=list)
    published: dict[str, int] = field(default_factory=dict)
    diagnostics: dict[str, dict[str, str]] = field(default_factory=dict)
    models: tuple[str, str] = ("L", "NL")
    values: dict[str, Any] = field(default_factory=dict)
    rows_told: dict[str, str] = field(default_factory=dict)


def read_run(run: RecordedRun) -> RunData:
    """Reads heights, limit events, latencies and numbers of lost messages from a run's bag.

    Raises:
        SloshBagError: there is no readable bag.
    """
    reader, topics, facts = run.reader, run.topics, run.facts
    gathered = _Gathered()
    told = {run.cell.told(ending): taker for ending, taker in _TAKERS.items()}
    takers = {
        topic: taker for topic in topics if (taker := told.get(topic) or _taker(topic)) is not None
    }
    seen_estimate = False
    for message in reader.messages(list(takers)):
        is_estimate = takers[message.topic] is _take_estimate
        if is_estimate and seen_estimate:
            continue  # only the models' names are wanted, once
        seen_estimate = seen_estimate or is_estimate
        takers[message.topic](gathered, reader.decode(message))
    table = np.array(gathered.rows, dtype=np.float64).reshape(-1, len(COLUMNS))
    return RunData(
        run=run,
        stamps=np.array(gathered.stamps, dtype=np.int64),
        columns={name: table[:, i] for i, name in enumerate(COLUMNS)},
        truth_stamps=np.array([stamp for stamp, _ in gathered.truth], dtype=np.int64),
        truth=np.array([height for _, height in gathered.truth]),
        events=tuple(gathered.events),
        topics=topics,
        published=gathered.published,
        diagnostics=gathered.diagnostics,
        models=gathered.models,
        warnings=tuple(reader.warnings),
        values=gathered.values,
        rows=gathered.rows_told,
        mixed=shared_topics_line(facts),
        noted_lost=lost_messages(facts),
        further={
            name: np.array(rows, dtype=np.float64) for name, rows in gathered.further.items()
        },
    )


def facts_of(data: RunData, node: str) -> Mapping[str, str]:
    """Returns the values of a node's last recorded diagnostics; empty if there are none.

    Args:
        data: the run.
        node: its name, without namespace.
    """
    found = (facts for name, facts in data.diagnostics.items() if name.endswith(f"/{node}"))
    return next(found, {})


def _taker(topic: str) -> Callable[[_Gathered, Any], None] | None:
    for ending, taker in _TAKERS.items():
        if topic.endswith(ending):
            return taker
    container = topic.rpartition("/")[2].partition(f"{COMPARISON}_")[2]
    return partial(_take_further, container) if container else None


def _take_further(container: str, gathered: _Gathered, message: Any) -> None:
    if not message.measured_stale:
        row = [getattr(message, name) for name in COLUMNS]
        gathered.further.setdefault(container, []).append(row)


def _take_comparison(gathered: _Gathered, message: Any) -> None:
    if message.measured_stale or getattr(message, "without_camera", False):
        return  # the monitor's word where there is no image
    gathered.stamps.append(stamp_ns(message))
    gathered.rows.append([getattr(message, name) for name in COLUMNS])


def _take_truth(gathered: _Gathered, message: Any) -> None:
    gathered.truth.append((stamp_ns(message), message.msh))


def _take_event(gathered: _Gathered, message: Any) -> None:
    gathered.events.append(
        RecordedEvent(
            stamp_ns(message),
            message.id,
            message.kind,
            message.source,
            message.limit,
            message.peak,
            message.description,
        )
    )


def _take_summary(gathered: _Gathered, message: Any) -> None:
    told = json.loads(message.data)
    gathered.published.update(told["published"])
    results = told.get("results", {})
    gathered.values.update(results.get("values", {}))
    gathered.rows_told.update(results.get("rows", {}))


def _take_diagnostics(gathered: _Gathered, message: Any) -> None:
    for status in message.status:
        gathered.diagnostics[status.name] = {pair.key: pair.value for pair in status.values}


def _take_estimate(gathered: _Gathered, message: Any) -> None:
    gathered.models = (message.linear.model, message.nonlinear.model)


_TAKERS: Mapping[str, Callable[[_Gathered, Any], None]] = {
    f"/{COMPARISON}": _take_comparison,
    "/cell/truth": _take_truth,
    "/limit_event": _take_event,
    "/cell/summary": _take_summary,
    "/diagnostics": _take_diagnostics,
    "/estimate": _take_estimate,
}

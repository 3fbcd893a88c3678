"""Replays a recorded bag through estimator and monitor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compile_cache import sources_digest
from slosh_base.files.nanoseconds import SECOND
from slosh_estimator import SOURCES
from slosh_estimator.held_container import empty_and_fresh
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.validity import EstimateFlag, attitude_warning
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_model.tilt import added_text, attitude_of, ignored_text, with_tilt
from slosh_motion.inputs.inputs import WINDOWED, InputSettings, WantedInput
from slosh_motion.recorded import settings
from slosh_motion.recorded.input_blocks import InputBlocks, by_chunk, reading
from slosh_motion.recorded.inputs import STAMP, InputReader, stamps_of
from slosh_motion.recorded.settings import NodeStart, TakenInputs
from slosh_motion.recorded.sources import (
    TABLE_COLUMNS,
    TABLE_ORIGIN,
    TRAY,
    Sources,
    clocks_unrelated,
    find_sources,
    lost_messages,
    noted_container,
    shared_topics_line,
)
from slosh_msgs_py.topics import (
    CALM,
    COMPARISON,
    ESTIMATE,
    FUSED_ESTIMATE,
    TOPICS,
    TRAY_ESTIMATE,
)
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.recording.heights import WAVE_FIELDS, measurements
from slosh_replay.recording.states import RecordedState, states_of
from slosh_replay.replay.conclusion import Origin, conclude
from slosh_replay.replay.replay_table import replay_table
from slosh_replay.replay.result import ReplayResult
from slosh_replay.replay.series import Series
from slosh_replay.replay.setting import Outputs, Setting
from slosh_replay.replay.stream import ReplayStream
from slosh_replay.replay.verification import (
    COMPARED,
    ORDER_UNKNOWN,
    STALE,
    Tally,
    Verification,
    Verifier,
    estimate_fields,
    tray_fields,
)
from slosh_replay.tables.bag_table import TableSettings, read_bag_table

BY_JOURNAL = "the nodes' own code gives them, with ROS 2, by the journals (--check)"
IN_LOG_ORDER = "inputs in the order of recording; with ROS 2 that of the journals is taken"
HEARD_NS = 100_000_000
"""A recorder may hear an estimate so long before the input that it is made of."""
_UNRECORDED = np.uint16(EstimateFlag.INPUT_CONTESTED | EstimateFlag.INPUT_CONTRADICTED)


def replay_bag(
    path: str | Path | RecordedRun,
    model: Model | None = None,
    monitor: MonitorSettings | None = None,
    given: InputSettings | WantedInput | None = None,
    outputs: Outputs | None = None,
    cell: str | None = None,
) -> ReplayResult:
    """Replays a recorded bag through estimator and monitor, and returns the result.

    All recorded inputs are taken, in the order in which they were recorded.

    >>> from slosh_replay import replay_bag
    >>> result = replay_bag("bags/c3")
    >>> result.verification.exact
    True

    Args:
        path: the bag's folder or MCAP file, or a recording that was opened already.
        model: to replay with; None: the one that the estimator had when it was recorded, or water
            in the container that the bag's metadata gives.
        monitor: limits that are watched; None: those of the recorded monitor.
        given: how the input is read, or in what other than by the recorded estimator; None: as
            by that.
        outputs: receives estimates, comparisons and events as they come.
        cell: namespace of the topics; None: the bag's only or first cell.

    Raises:
        SloshBagError: no readable bag, no input in it, no model, or clocks that cannot be related.
    """
    run = path if isinstance(path, RecordedRun) else RecordedRun(path)
    path, reader = run.path, run.reader
    sources = find_sources(path, reader, given.kind if given else None, cell)
    sources = sources._replace(starts=_heard_starts(reader, sources))
    sources = sources.without_answers_to_others()
    started = settings.first(sources.starts, "estimator")
    recorded = settings.model_of(started) if started else None
    used = model or recorded or _noted_model(path, sources.facts)
    how = reading(reader, sources, given, as_recorded=True)
    plain = used
    if not _is_as_recorded(started, sources, model):
        used = _felt(path, sources, how, used)
    watched, limit_changes = (monitor, []) if monitor else _monitor_settings(sources)
    watched, limit_changes = _with_rim(watched, limit_changes, used, told=model is None)
    if _is_turning_table(sources, used):
        return _replay_table_bag(path, reader, sources, (plain, used), watched, outputs)
    tray = settings.tray_of(started) if started and model is None else None
    if tray is not None and used is not plain:
        tray = tray.of(partial(how.felt, sources.kind))
    input_reader = InputReader(sources.kind, how)
    blocks = InputBlocks(reader, sources, how, _taken(reader, sources, given))
    setting = Setting(
        used,
        input_reader,
        watched,
        limit_changes,
        at_rest=settings.starts_at_rest(started),
        late=begins_late(reader, sources, blocks.topics),
        empty=started is not None and empty_and_fresh(started.parameters)[0],
        changes=_changes(sources, used, follow=model is None),
        follows_input=not isinstance(given, InputSettings),
        tray=tray,
        outputs=outputs or Outputs(),
    )
    compared = _compared(sources, setting)
    verifiers = {name: Verifier(topic) for topic, (name, _) in compared.items()}
    unrelated = clocks_unrelated(sources.facts)
    with Series(4) as series:
        stream = ReplayStream(str(path), setting, series, verifiers=verifiers, unrelated=unrelated)
        for chunk in feed(reader, sources, compared, blocks):
            for batch in chunk:
                _hand_over(batch, sources, compared, stream)
            stream.advance()
        blocks.check()
        stream.advance(final=True)
        origin = _origin(started, recorded, used, journaled=sources.journal is not None)
        result = conclude(path.name, sources.input, stream, origin, blocks.left_out)
    verified = {**_unchecked(reader, sources), **result.verified}
    said = [
        *_attitude_warnings(path, sources, used, how),
        *input_reader.ignored_tilt(plain, used),
        blocks.trouble(),
        *(() if TABLE_COLUMNS in sources.facts else blocks.doubts()),
    ]
    told = [f"{path}: {line}" for line in said if line]
    told = [*_warnings(path, reader, sources), *told]
    return replace(result, verified=verified, warnings=(*told, *result.warnings))


def _unchecked(reader: BagReader, sources: Sources) -> dict[str, Verification]:
    """Counts recorded messages that only the nodes' own code gives, by the journal."""
    why = ORDER_UNKNOWN if sources.journal is None else BY_JOURNAL
    found = {}
    for name in (COMPARISON, FUSED_ESTIMATE, CALM):
        row = next(row for row in TOPICS if row.name == name)
        topic = sources.topics.topic(name, row.type)
        count = (reader.topics()[topic].count or 0) if topic is not None else 0
        if topic is not None and count and sources.estimate is not None:
            tally = Tally(topic)
            tally.leave_out(count, why)
            found[name] = tally.result()
    return found


def _taken(
    reader: BagReader, sources: Sources, given: InputSettings | WantedInput | None
) -> TakenInputs | None:
    """Returns what the recorded estimator took of its input; None: another input is replayed."""
    if sources.journal is None or sources.estimate is None or given is not None:
        return None
    return TakenInputs(reader, sources.journal)


def _is_as_recorded(started: NodeStart | None, sources: Sources, model: Model | None) -> bool:
    """Returns whether the model is that of the recorded node, and its input is replayed."""
    if started is None or model is not None:
        return False
    return bool(started.parameters.get("input", sources.kind) == sources.kind)


def _felt(path: Path, sources: Sources, how: InputSettings, model: Model) -> Model:
    """Returns the model that a live cell would run, with gravity where the attitude is known."""
    if {"qx", "wx"} & set(sources.facts.get(TABLE_COLUMNS, "").split(",")):
        return with_tilt(model, attitude_of(read_bag_table(path, TableSettings()).table))
    return how.felt(sources.kind, model)


def _attitude_warnings(
    path: Path, sources: Sources, model: Model, how: InputSettings
) -> list[str]:
    """Warns of model effects that need more attitude data than the input contains."""
    said = [] if how.placed else [attitude_warning(model, sources.kind)]
    if {"qx", "wx"} & set(sources.facts.get(TABLE_COLUMNS, "").split(",")):
        table = read_bag_table(path, TableSettings()).table
        said.append(ignored_text(model, attitude_of(table)))
    return said


def _heard_starts(reader: BagReader, sources: Sources) -> tuple[NodeStart, ...]:
    """Returns the starts, of those of the estimator only what estimates were published after."""
    starts = [s for s in sources.starts if s.node == "estimator" and s.is_process]
    if len(starts) < 2 or sources.estimate is None:
        return sources.starts
    recorded = [block.log_ns for block in reader.blocks([sources.estimate])]
    published = np.sort(np.concatenate([np.empty(0, np.int64), *recorded]))
    return settings.heard(sources.starts, "estimator", published)


def begins_late(reader: BagReader, sources: Sources, inputs: Sequence[str]) -> bool:
    """Returns whether the estimator had used more inputs before its first recorded estimate.

    Then the state of the liquid at the recording's beginning is unknown.

    Args:
        reader: of the bag.
        sources: its topics.
        inputs: topics of the input.
    """
    if sources.estimate is None:
        return False
    # An estimate from a window is stamped before the last input that it is made of.
    by_log = sources.kind in WINDOWED or len(inputs) > 1
    came: list[int] = []
    used, until_ns, end_ns = 0, 2**62, 2**62
    for block in reader.blocks([*inputs, sources.estimate]):
        if block.log_ns[0] > end_ns:
            break
        if block.topic in inputs:
            came += (block.log_ns if by_log else stamps_of(reader.columns(block, STAMP))).tolist()
        elif not used:
            first = reader.columns(block.take(slice(1)), (*STAMP, "samples_used"))
            used, end_ns = int(first["samples_used"][0]), int(block.log_ns[0]) + SECOND
            until_ns = int(block.log_ns[0]) + HEARD_NS if by_log else int(stamps_of(first)[0])
    return used > sum(one <= until_ns for one in came)


def _is_turning_table(sources: Sources, model: Model) -> bool:
    """Returns whether the bag holds a motion table whose attitude the model needs."""
    return TABLE_COLUMNS in sources.facts and bool(attitude_warning(model, sources.kind))


def _replay_table_bag(
    path: Path,
    reader: BagReader,
    sources: Sources,
    models: tuple[Model, Model],
    monitor: MonitorSettings,
    outputs: Outputs | None,
) -> ReplayResult:
    """Replays the motion table from which a bag was created, with its attitude.

    The models are the given one, and that with gravity along a tilted floor.
    """
    given, model = models
    table = read_bag_table(path, TableSettings()).table
    origin_ns = int(sources.facts.get(TABLE_ORIGIN, 0))
    result = replay_table(
        path.name, table, model, monitor, source=sources.input, origin_ns=origin_ns,
        outputs=outputs,
    )  # fmt: skip
    blind = table.attitude is None and table.angular_velocity is None
    told = [attitude_warning(model, sources.kind)] if blind else []
    added = added_text(given, attitude_of(table)) if model is not given else ""
    told += [f"the container {added}"] if added else []
    said = [*_warnings(path, reader, sources), *(f"{path}: {line}" for line in told)]
    return replace(result, warnings=(*said, *result.warnings))


def _warnings(path: Path, reader: BagReader, sources: Sources) -> list[str]:
    found = list(reader.warnings)
    lost = sum(lost_messages(sources.facts).values())
    if lost:
        found.append(
            f"{path}: {lost} messages were lost while recording and are missing in the bag"
        )
    shared = shared_topics_line(sources.facts)
    if shared:
        found.append(f"{path}: {shared}")
    if len(sources.topics.cells) > 1:
        own, *others = (cell or "/" for cell in sources.topics.cells)
        found.append(f"{path}: the cell {own} is replayed; the bag also holds {', '.join(others)}")
    return found


class TopicBatch(NamedTuple):
    """Consecutive messages of one topic, as columns.

    Attributes:
        topic: theirs.
        columns: their fields, (N,) each; none of the estimator's states.
        log_ns: when the last of them was recorded [ns].
        states: of the estimator, where the topic is theirs.
    """

    topic: str
    columns: Mapping[str, NDArray[Any]]
    log_ns: int
    states: tuple[RecordedState, ...] = ()


Compared = Mapping[str, tuple[str, tuple[str, ...]]]
"""Recorded estimates by their topic: its last name, and the fields that are compared."""


def _compared(sources: Sources, setting: Setting) -> Compared:
    found: dict[str, tuple[str, tuple[str, ...]]] = {}
    if sources.estimate is not None:
        fields = estimate_fields(len(setting.model.mode_constants()))
        found[sources.estimate] = (ESTIMATE, (*STAMP, *fields))
    tray = sources.topics.topic(TRAY_ESTIMATE, TRAY)
    if setting.tray is not None and tray is not None:
        found[tray] = (TRAY_ESTIMATE, (*STAMP, *tray_fields(len(setting.tray.containers))))
    if sources.journal is None and sources.comparison is not None and setting.limits.camera:
        found[sources.comparison] = (COMPARISON, (*STAMP, *COMPARED, STALE))
    return found


def feed(
    reader: BagReader, sources: Sources, compared: Compared, inputs_of: InputBlocks
) -> Iterator[list[TopicBatch]]:
    """Yields the messages for a replay, chunk by chunk in recorded order.

    Args:
        reader: of the bag.
        sources: what to read.
        compared: recorded estimates.
        inputs_of: reads the input.
    """
    wanted = {topic: names for topic, (_, names) in compared.items()}
    if sources.surface is not None:
        wanted[sources.surface] = WAVE_FIELDS
    topics = [*inputs_of.topics, *wanted, *filter(None, [sources.state])]
    for blocks in by_chunk(reader.blocks(topics)):
        own = [block for block in blocks if block.topic in inputs_of.topics]
        batches = []
        for block in blocks:
            last_ns = int(block.log_ns[-1])
            if block.topic == sources.state:
                batches.append(TopicBatch(block.topic, {}, last_ns, states_of(reader, block)))
            elif block.topic in wanted:
                columns = reader.columns(block, wanted[block.topic])
                batches.append(TopicBatch(block.topic, columns, last_ns))
        if own:
            last_ns = max(int(block.log_ns[-1]) for block in own)
            batches.insert(0, TopicBatch(sources.input, inputs_of.columns(own), last_ns))
        yield batches


def _hand_over(
    batch: TopicBatch, sources: Sources, compared: Compared, stream: ReplayStream
) -> None:
    if batch.topic == sources.input:
        stream.add_input(batch.columns, batch.log_ns)
    elif batch.topic == sources.surface:
        stream.add_measurements(measurements(batch.columns), batch.log_ns)
    elif batch.topic == sources.state:
        stream.add_states(batch.states)
    else:
        columns = batch.columns
        name, _ = compared[batch.topic]
        if name == ESTIMATE:  # what depends on other publishers is not in a recording
            columns = {**columns, "flags": columns["flags"] & ~_UNRECORDED}
        elif name == COMPARISON:  # without an image it follows the monitor's own clock
            has_image = ~columns[STALE].astype(bool)
            columns = {key: column[has_image] for key, column in columns.items()}
        stream.add_recorded(name, columns)


def _changes(sources: Sources, model: Model, *, follow: bool) -> tuple[NodeStart, ...]:
    """Returns the estimator's recorded settings after its first start; keeps the user's model."""
    later = [start for start in sources.starts if start.node == "estimator"][1:]
    if follow:
        return tuple(later)
    files = {"model": format_model(model)}
    return tuple(start._replace(files=files) for start in later)


def _origin(
    started: NodeStart | None, recorded: Model | None, used: Model, *, journaled: bool
) -> Origin:
    """Returns the known reasons why the replay may differ from the recording."""
    if started is None or recorded is None:
        return Origin(() if journaled else (ORDER_UNKNOWN,))
    causes = settings.model_differences(recorded, used)
    code = sources_digest(*SOURCES)
    if started.code != code:
        causes.append(f"the estimator's code: recorded {started.code}, replayed with {code}")
    arithmetic = arithmetic_fingerprint()
    otherwise = started.arithmetic != arithmetic
    if otherwise:
        causes.append(
            f"this machine rounds differently: recorded on {started.arithmetic}, replayed on "
            f"{arithmetic}; last bits may differ"
        )
    causes.append(IN_LOG_ORDER if journaled else ORDER_UNKNOWN)
    return Origin(tuple(causes), otherwise)


def _monitor_settings(
    sources: Sources,
) -> tuple[MonitorSettings, list[tuple[int, MonitorSettings]]]:
    """Returns the settings of the recorded monitor, and their changes by stamp [ns]."""
    meaning = MonitorSettings.from_parameters
    return settings.limits_over_time(sources.starts, "monitor", meaning) or (MonitorSettings(), [])


def _with_rim(
    first: MonitorSettings, changes: list[tuple[int, MonitorSettings]], model: Model, *, told: bool
) -> tuple[MonitorSettings, list[tuple[int, MonitorSettings]]]:
    """Returns the monitor settings with the recorded height of the rim, or else the model's.

    Args:
        first, changes: of the recording.
        model: that is replayed with.
        told: whether what the recording tells is of this model's container.
    """
    if told and any(math.isfinite(one.rim) for one in (first, *(one for _, one in changes))):
        return first, changes
    return first.under_rim(model), [(stamp, one.under_rim(model)) for stamp, one in changes]


def _noted_model(path: Path, facts: Mapping[str, str]) -> Model:
    container = noted_container(facts)
    if container is None:
        raise SloshBagError(f"{path}: contains no model or container; give a model file (--model)")
    return Model(container).spatial()

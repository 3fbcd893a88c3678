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

from slosh_bag.columns.cdr_columns import ColumnReader, Columns
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagReader
from slosh_bag.recorder import SEVERAL
from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compile_cache import sources_digest
from slosh_estimator import SOURCES
from slosh_estimator.inputs import WINDOWED, InputSettings, WantedInput
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.validity import attitude_warning
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_model.tilt import added_text, attitude_of, ignored_text, with_tilt
from slosh_msgs_py.topics import (
    CALM,
    COMPARISON,
    ESTIMATE,
    FUSED_ESTIMATE,
    TRAY_ESTIMATE,
)
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.recording import settings
from slosh_replay.recording.facts import (
    TABLE_COLUMNS,
    TABLE_ORIGIN,
    clocks_unrelated,
    lost_messages,
    mixed_topics,
    noted_container,
    shared_topics_line,
)
from slosh_replay.recording.heights import WAVE_FIELDS, measurements
from slosh_replay.recording.input_blocks import InputBlocks, by_chunk, reading
from slosh_replay.recording.inputs import STAMP, InputReader, stamps_of
from slosh_replay.recording.settings import NodeStart
from slosh_replay.recording.sources import Sources, find_sources
from slosh_replay.recording.states import observer_states_of, states_of
from slosh_replay.replay.conclusion import Origin, conclude
from slosh_replay.replay.container_feed import container_nodes
from slosh_replay.replay.input_matching import InputMatcher
from slosh_replay.replay.known_state import KnownState
from slosh_replay.replay.node_table import node_table
from slosh_replay.replay.nodes import NodeTopic, Outputs, ReplayedNode, Setting
from slosh_replay.replay.one_estimator import OneEstimator
from slosh_replay.replay.replay_table import replay_table
from slosh_replay.replay.replayed_force import force_surface_topic
from slosh_replay.replay.result import ReplayResult
from slosh_replay.replay.series import Series
from slosh_replay.replay.stream import ReplayStream
from slosh_replay.replay.verification import Verifier
from slosh_replay.tables.bag_table import TableSettings, read_bag_table

TURNS = 10
"""Turns of the estimates per process of an estimator: more are of several at once."""


def replay_bag(
    path: str | Path | RecordedRun,
    model: Model | None = None,
    monitor: MonitorSettings | None = None,
    given: InputSettings | WantedInput | None = None,
    outputs: Outputs | None = None,
    cell: str | None = None,
    estimator: int = 1,
    further: Sequence[ReplayedNode] = (),
) -> ReplayResult:
    """Replays a recorded bag through estimator and monitor, and returns the result.

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
        estimator: which, from 1, where several were mixed on one topic; by their first estimates.
        further: nodes that run behind those of `node_table`.

    Raises:
        SloshBagError: no readable bag, no input in it, no model, no such estimator, or clocks that
            cannot be related.
    """
    run = path if isinstance(path, RecordedRun) else RecordedRun(path)
    path, reader = run.path, run.reader
    sources = find_sources(path, reader, given.kind if given else None, cell)
    sources, several = _estimators(reader, sources)
    sources = _unmixed(sources)
    sources = sources._replace(starts=_heard_starts(reader, sources))
    sources = sources.without_answers_to_others()
    mixed = mixed_topics(sources.facts)
    if not 1 <= estimator <= max(several, 1):
        raise SloshBagError(f"{path}: estimator {estimator} of {several}: there is no such one")
    if several > 1:
        own = settings.of_process(sources.starts, "estimator", estimator, several)
        sources = sources._replace(starts=own)
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
    count = len(tray.containers) if tray else 0
    cameras = container_nodes(sources.starts, tray.names) if tray else ()
    force_surface = force_surface_topic(sources.starts)
    table = node_table(len(used.mode_constants()), count, force_surface, cameras)
    nodes = _running(sources, (*table, *further))
    heard = _heard(sources, nodes)
    verifiers = _verifiers(heard, nodes, camera=watched.camera)
    matcher = None
    if sources.estimate and sources.kind not in WINDOWED:
        matcher = InputMatcher(mixed={sources.input, sources.estimate} <= mixed)
    input_reader = InputReader(sources.kind, how, chosen=matcher is not None)
    losses: list[int] = []
    setting = Setting(
        used,
        input_reader,
        watched,
        limit_changes,
        at_rest=settings.starts_at_rest(started),
        matcher=matcher,
        known=_known_state(verifiers, losses) if sources.state else None,
        counter=None if sources.state or matcher is None or mixed else KnownState(None, losses),
        changes=_changes(sources, used, follow=model is None),
        follows_input=not isinstance(given, InputSettings),
        tray=tray,
        trays=[],
        starts=sources.starts,
        outputs=outputs or Outputs(),
        loaded=[],
        fused=verifiers.get(FUSED_ESTIMATE),
        calm=verifiers.get(CALM),
        observer_states=[],
        losses=losses,
    )
    unrelated = clocks_unrelated(sources.facts)
    blocks = InputBlocks(reader, sources, how)
    one = OneEstimator(estimator) if sources.estimate in mixed else None
    with Series(4) as series:
        stream = ReplayStream(
            str(path), nodes, setting, series, verifiers=verifiers, unrelated=unrelated
        )
        lacking: set[str] = set()
        for chunk in feed(reader, sources, heard, blocks, lacking):
            for batch in chunk:
                _hand_over(batch, sources, heard, stream, one)
            stream.advance()
        blocks.check()
        stream.advance(final=True)
        result = conclude(path.name, sources.input, stream, _origin(started, recorded, used))
    said = [
        *_attitude_warnings(path, sources, used, how),
        *input_reader.ignored_tilt(plain, used),
        blocks.trouble(),
        *(() if TABLE_COLUMNS in sources.facts else blocks.doubts()),
        *sorted(lacking),
    ]
    if several > 1:
        said.append(
            f"of {several} estimators on {sources.estimate} the replayed one is {estimator}"
        )
    told = [f"{path}: {line}" for line in said if line]
    return replace(result, warnings=(*_warnings(path, reader, sources), *told, *result.warnings))


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


def _known_state(verifiers: Mapping[str, Verifier], losses: list[int]) -> KnownState:
    """Creates the object that tracks for which inputs the liquid's state is known."""
    estimate, comparison = (verifiers.get(name) for name in (ESTIMATE, COMPARISON))
    of_trays = [
        verifier
        for name, verifier in verifiers.items()
        if name == TRAY_ESTIMATE or name.startswith(f"{COMPARISON}_")
    ]
    return KnownState(estimate, losses, of_trays, comparison)


def _attitude_warnings(
    path: Path, sources: Sources, model: Model, how: InputSettings
) -> list[str]:
    """Warns of model effects that need more attitude data than the input contains."""
    said = [] if how.placed else [attitude_warning(model, sources.kind)]
    if {"qx", "wx"} & set(sources.facts.get(TABLE_COLUMNS, "").split(",")):
        table = read_bag_table(path, TableSettings()).table
        said.append(ignored_text(model, attitude_of(table)))
    return said


def _unmixed(sources: Sources) -> Sources:
    """Drops recorded results in which the messages of several nodes cannot be separated."""
    mixed = mixed_topics(sources.facts)
    if sources.estimate in mixed:
        return sources._replace(state=None, comparison=None)
    if mixed & {sources.comparison, sources.surface}:
        return sources._replace(comparison=None)
    return sources


def _heard_starts(reader: BagReader, sources: Sources) -> tuple[NodeStart, ...]:
    """Returns the starts of those estimator processes that published estimates."""
    processes = [s for s in sources.starts if s.node == "estimator" and not s.stamp_ns]
    if len(processes) < 2 or sources.estimate is None:
        return sources.starts
    recorded = [block.log_ns for block in reader.blocks([sources.estimate])]
    published = np.sort(np.concatenate([np.empty(0, np.int64), *recorded]))
    return settings.heard(sources.starts, "estimator", published)


def _estimators(reader: BagReader, sources: Sources) -> tuple[Sources, int]:
    """Returns the topics to replay, and how many estimators published on the estimate topic.

    Other recorders note nothing; there the estimates themselves tell.
    """
    if sources.estimate is None:
        return sources, 1
    noted = sources.estimate in mixed_topics(sources.facts)
    processes = sum(start.node == "estimator" and start.is_process for start in sources.starts)
    if not noted and processes < 2:
        return sources, 1
    known = OneEstimator()
    for block in reader.blocks([sources.estimate]):
        columns = reader.columns(block, (*STAMP, "samples_used"))
        known.mask(stamps_of(columns), columns["samples_used"].astype(np.int64))
    if noted:
        return sources, known.count
    # Processes that take the place of others take one turn each.
    if known.turns < TURNS * processes:
        return sources, 1
    told = ",".join((sources.input, sources.estimate))
    return sources._replace(facts={**sources.facts, SEVERAL: told}), known.count


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
    states: tuple[Any, ...] = ()


def feed(
    reader: BagReader,
    sources: Sources,
    heard: Mapping[str, NodeTopic],
    inputs_of: InputBlocks,
    lacking: set[str],
) -> Iterator[list[TopicBatch]]:
    """Yields the messages for a replay, chunk by chunk in recorded order.

    Args:
        reader: of the bag.
        sources: what to read.
        heard: further topics that nodes read or give, by their full names.
        inputs_of: reads the input.
        lacking: is told, one line each, which fields an older version did not record.
    """
    wanted = {full: (*STAMP, *topic.fields) for full, topic in heard.items()}
    if sources.surface is not None:
        others = wanted.get(sources.surface, ())
        wanted[sources.surface] = tuple(dict.fromkeys((*WAVE_FIELDS, *others)))
    read = ColumnReader(reader.typestore_of)
    stateful = {
        topic: read_states
        for topic, read_states in (
            (sources.state, states_of), (sources.observer_state, observer_states_of)
        )
        if topic is not None
    }  # fmt: skip
    topics = [*inputs_of.topics, *wanted, *stateful]
    for blocks in by_chunk(reader.blocks(topics)):
        own = [block for block in blocks if block.topic in inputs_of.topics]
        batches = [
            TopicBatch(
                block.topic, {}, int(block.log_ns[-1]), stateful[block.topic](reader, block)
            )
            if block.topic in stateful
            else TopicBatch(
                block.topic,
                _columns(read, block, wanted[block.topic], heard.get(block.topic), lacking),
                int(block.log_ns[-1]),
            )
            for block in blocks
            if block.topic not in inputs_of.topics
        ]
        if own:
            last_ns = max(int(block.log_ns[-1]) for block in own)
            batches.insert(0, TopicBatch(sources.input, inputs_of.columns(own), last_ns))
        yield batches


def _columns(
    read: ColumnReader,
    block: MessageBlock,
    names: Sequence[str],
    topic: NodeTopic | None,
    lacking: set[str],
) -> Columns:
    """Returns the columns of a block; fields that an older version lacked have a default value."""
    later = {} if topic is None else topic.later
    try:
        return read.columns(block, names)
    except SloshBagError:
        if not later:
            raise
    found = dict(read.columns(block, [name for name in names if name not in later]))
    for name, value in later.items():
        found[name] = np.full(len(block), value)
        whole = name.partition("[")[0]
        lacking.add(
            f"{block.topic}: messages of an older version, without {whole}, taken as {value}"
        )
    return found


def _running(sources: Sources, nodes: Sequence[ReplayedNode]) -> tuple[ReplayedNode, ...]:
    """Returns the nodes whose required recorded messages are present."""
    found = sources.topics.topic
    return tuple(
        node
        for node in nodes
        if not node.needs_recorded or found(node.outputs[0].name, node.outputs[0].message_type)
    )


def _heard(sources: Sources, nodes: Sequence[ReplayedNode]) -> dict[str, NodeTopic]:
    """Returns the recorded topics that nodes publish or read, by full name."""
    given = {topic.name for node in nodes for topic in node.outputs}
    own = {ESTIMATE: sources.estimate, COMPARISON: sources.comparison}
    heard = {}
    for node in nodes:
        for topic in (*node.outputs, *(one for one in node.inputs if one.name not in given)):
            found = sources.topics.topic(topic.name, topic.message_type)
            full = own.get(topic.name, found)
            if full is not None:
                heard[full] = topic
    return heard


def _verifiers(
    heard: Mapping[str, NodeTopic], nodes: Sequence[ReplayedNode], *, camera: bool
) -> dict[str, Verifier]:
    """Creates the objects that compare replayed with recorded messages, one for each topic."""
    return {
        topic.name: Verifier(full, topic.can_lack, node.tolerance)
        for full, topic in heard.items()
        for node in nodes
        # Without a camera comparisons follow the monitor's own clock.
        if topic in node.outputs and (camera or topic.name != COMPARISON)
    }


def _hand_over(
    batch: TopicBatch,
    sources: Sources,
    heard: Mapping[str, NodeTopic],
    stream: ReplayStream,
    estimator: OneEstimator | None,
) -> None:
    columns = batch.columns
    if batch.topic == sources.input:
        stream.add_input(columns, batch.log_ns)
    elif batch.topic == sources.surface:
        stream.add_measurements(measurements(columns), batch.log_ns)
        if batch.topic in heard:
            stream.add_recorded(heard[batch.topic], columns)
    elif batch.topic == sources.state:
        stream.add_states(batch.states)
    elif batch.topic == sources.observer_state:
        stream.setting.observer_states.extend(batch.states)
    else:
        if batch.topic == sources.estimate and estimator is not None:
            own = estimator.mask(stamps_of(columns), columns["samples_used"].astype(np.int64))
            columns = {name: column[own] for name, column in columns.items()}
        stream.add_recorded(heard[batch.topic], columns)


def _changes(sources: Sources, model: Model, *, follow: bool) -> tuple[NodeStart, ...]:
    """Returns the estimator's recorded settings after its first start; keeps the user's model."""
    later = [start for start in sources.starts if start.node == "estimator"][1:]
    if follow:
        return tuple(later)
    files = {"model": format_model(model)}
    return tuple(start._replace(files=files) for start in later)


def _origin(started: NodeStart | None, recorded: Model | None, used: Model) -> Origin:
    """Returns the known reasons why the replay may differ from the recording."""
    if started is None or recorded is None:
        return Origin()
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

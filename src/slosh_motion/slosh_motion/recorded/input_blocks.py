"""Converts blocks of messages of any input to columns of samples or poses.

Joint states and transforms become poses here, by what the node itself uses, and are columns of
poses from here on.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_bag.columns.cdr_columns import ColumnReader
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagMessage, BagReader, messages_of, stamp_ns
from slosh_base.files.nanoseconds import SECOND
from slosh_motion.checks.message_checks import TwistCheck, unstamped
from slosh_motion.checks.stamp_checks import stamp_doubts
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import FixedFrames, TimedPose, Transform
from slosh_motion.inputs.inputs import (
    ACCEL,
    BY_POSE,
    JOINTS,
    MOUNTED,
    NOUNS,
    ODOMETRY,
    POSE,
    InputSettings,
    WantedInput,
)
from slosh_motion.inputs.joint_poses import JointPoses
from slosh_motion.inputs.transform_poses import (
    PlacedAccel,
    PlacedAcceleration,
    TransformPoses,
)
from slosh_motion.recorded.inputs import (
    LACKING,
    LOGGED,
    PLACED_FIELDS,
    STAMP,
    fields,
    recorded_inputs,
    stamps_of,
    twist_of,
)
from slosh_motion.recorded.settings import NOT_TAKEN, TakenInputs, first
from slosh_motion.recorded.sources import Sources
from slosh_msgs_py import topics

Columns = Mapping[str, NDArray[Any]]
_FRAME = "header.frame_id"


class InputBlocks:
    """Reads the messages of an input from a bag, block by block.

    Args:
        taken: leaves out what the recorded estimator did not take, or not in time; None: nothing.

    Attributes:
        left_out: messages of the input that `taken` has left out so far.

    Raises:
        SloshBagError: joints without a robot's description, or with one that does not fit.
    """

    def __init__(
        self,
        reader: BagReader,
        sources: Sources,
        how: InputSettings,
        taken: TakenInputs | None = None,
    ) -> None:
        self._reader, self._taken_inputs, self.left_out = reader, taken, 0
        self._max_age_ns = round(how.gate.max_age * 1e9)
        self._lacking: list[int] = []
        self._columns = ColumnReader(reader.typestore_of)
        self._fields = fields(sources.kind)
        self._world = how.frames[0]
        self._kind = sources.kind
        self._count = self._messages = self._stamped = 0
        self._clocks: dict[object, tuple[array[int], array[int]]] = {}
        if sources.kind == JOINTS and not how.urdf:
            how = how._replace(urdf=_description(reader, sources))
        try:
            self._poses = how.poses(sources.kind)
        except SloshMotionError as error:
            raise SloshBagError(f"{reader.path}: {sources.input}: {error}") from None
        self.topics: tuple[str, ...] = (sources.input,)
        placed = isinstance(self._poses, PlacedAccel)
        if placed or (sources.kind == POSE and isinstance(self._poses, TransformPoses)):
            self.topics += (sources.topics.topic("tf", _row(topics.TF).type) or "",)
        for message in _latched(reader, sources, topics.TF_STATIC):
            if isinstance(self._poses, PlacedAccel | TransformPoses):
                self._poses.hear(message, None, fixed=True)

    def columns(self, blocks: Sequence[MessageBlock]) -> Columns:
        """Returns the values of the input's messages in a chunk, as columns.

        LACKING is there with the journal of the recorded estimator.

        Args:
            blocks: of `topics`, at least one.

        Raises:
            SloshBagError: a message is not of its type.
        """
        taken = self._taken_inputs
        if taken is None:
            return self._values(blocks)
        columns = self._values([self._in_time(taken, block) for block in blocks])
        lacking = np.zeros(len(columns[LOGGED]), dtype=bool)
        places = np.searchsorted(columns[LOGGED], self._lacking)
        lacking[places[places < len(lacking)]] = True
        late = zip(self._lacking, places.tolist(), strict=True)
        self._lacking = [log_ns for log_ns, place in late if place == len(lacking)]
        return {**columns, LACKING: lacking}

    def _values(self, blocks: Sequence[MessageBlock]) -> Columns:
        if self._poses is None:
            (block,) = blocks
            columns = self._columns.columns(block, self._fields)
            stamps = stamps_of(columns)
            self._stamped += int(np.count_nonzero(stamps))
            self._messages += len(stamps)
            own_stamps, own_logged = self._clock_of("")
            own_stamps.extend(stamps.tolist())
            own_logged.extend(block.log_ns.tolist())
            return {**columns, LOGGED: block.log_ns}
        messages = [message for block in blocks for message in messages_of(block)]
        if len(blocks) > 1:  # in the order in which the node heard them
            messages.sort(key=lambda message: message.log_ns)
        logged: list[int] = []
        if isinstance(self._poses, PlacedAccel):
            placed: list[PlacedAcceleration] = []
            for message in messages:
                placed += self._poses.hear(self._noted(message), message.log_ns)
                logged += [message.log_ns] * (len(placed) - len(logged))
            self._count += len(placed)
            columns = _placed_columns(placed, self._world)
        else:
            found: list[TimedPose] = []
            for message in messages:
                found += self._poses.hear(self._noted(message), message.log_ns)
                logged += [message.log_ns] * (len(found) - len(logged))
            self._count += len(found)
            columns = _pose_columns(found, self._world)
        return {**columns, LOGGED: np.array(logged, dtype=np.int64)}

    def _in_time(self, taken: TakenInputs, block: MessageBlock) -> MessageBlock:
        """Returns the messages that the recorded estimator took, and not too late."""
        arrivals, lacking = taken.arrivals(block)
        self._lacking += block.log_ns[lacking].tolist()
        kept = arrivals != NOT_TAKEN
        if kept.any() and _row(topics.TF).type != block.message_type:
            late = arrivals - stamps_of(self._columns.columns(block, STAMP))
            kept &= (arrivals < 0) | (np.abs(late) <= self._max_age_ns)
        self.left_out += int(np.count_nonzero(~kept & (block.log_ns >= taken.begun_ns)))
        return block if kept.all() else block.take(kept)

    def _noted(self, message: BagMessage) -> Any:
        """Returns a decoded message of `topics`; counts those of the input and their stamps."""
        decoded = self._reader.decode(message)
        if message.topic == self.topics[0]:
            links = decoded.transforms if hasattr(decoded, "transforms") else (decoded,)
            self._stamped += any(stamp_ns(one) for one in links)
            self._messages += 1
            for one in links:
                stamped, logged = self._clock_of(_publisher_of(one))
                stamped.append(stamp_ns(one))
                logged.append(message.log_ns)
        return decoded

    def _clock_of(self, publisher: object) -> tuple[array[int], array[int]]:
        """Returns the stamps and log times [ns] of one publisher's messages so far."""
        return self._clocks.setdefault(publisher, (array("q"), array("q")))

    def doubts(self) -> list[InputDoubt]:
        """Returns, after all messages, what their stamps show beside the log times."""
        noun, found = NOUNS[self._kind], dict[str, InputDoubt]()
        for stamped, logged in self._clocks.values():
            stamps, logs = (np.frombuffer(each, np.int64) for each in (stamped, logged))
            found |= {str(doubt): doubt for doubt in stamp_doubts(stamps, logs, noun)}
        clocks = self._poses.clock_doubt() if self._poses is not None else None
        found |= {clocks.text: InputDoubt.of(clocks)} if clocks is not None else {}
        told = self._poses.velocities.remark() if isinstance(self._poses, JointPoses) else ""
        return [*found.values(), *([InputDoubt(told, wrong=False)] if told else [])]

    def trouble(self) -> str:
        """Describes why poses are missing or wrong; empty if no fault is known."""
        return self._poses.trouble() if self._poses is not None else ""

    def check(self) -> None:
        """Raises an error, after all messages, if there was no pose, or no stamp was filled.

        Raises:
            SloshBagError: no pose came out of the messages, or all are stamped 0.
        """
        reason = unstamped(self._stamped, self._messages, self.topics[0])
        if reason:
            raise SloshBagError(f"{self._reader.path}: {reason}")
        if self._poses is not None and not self._count:
            reason = self.trouble() or "no pose of the container follows from the messages"
            raise SloshBagError(f"{self._reader.path}: {reason}")


def reading(
    reader: BagReader,
    sources: Sources,
    given: InputSettings | WantedInput | None = None,
    *,
    as_recorded: bool = False,
) -> InputSettings:
    """Returns the settings with which the input of a bag is read.

    Args:
        given: how it is read, or in what other than by the recorded estimator; None: as by that.
        as_recorded: whether an input that an estimator read is read as it did, though its messages
            contradict themselves.

    Raises:
        SloshBagError: a recorded parameter is missing or cannot be.
    """
    how = recorded_inputs(sources.starts, sources.facts) if given is None else given
    if isinstance(how, WantedInput):
        how = how.over(recorded_inputs(sources.starts, sources.facts))
    how = _mounted(reader, sources, how)
    if sources.kind == ODOMETRY and not (as_recorded and _was_read(sources)):
        return _by_right_part(reader, sources, how)
    return how


def _was_read(sources: Sources) -> bool:
    """Returns whether a recorded estimator read the input."""
    started = first(sources.starts, "estimator")
    return started is not None and started.parameters.get("input", sources.kind) == sources.kind


def _by_right_part(reader: BagReader, sources: Sources, how: InputSettings) -> InputSettings:
    """Returns the settings with the pose as input if the twist of the odometry is wrong."""
    names, check = fields(ODOMETRY), TwistCheck()
    for block in reader.blocks([sources.input]):
        columns = reader.columns(block, names)
        rows = np.column_stack([columns[name] for name in names[3:]]).tolist()
        for stamp, row in zip(stamps_of(columns).tolist(), rows, strict=True):
            twist_of(stamp, row, "").compare(check)
        if check.pose_tells:
            return how._replace(odometry=BY_POSE)
    return how


def _mounted(reader: BagReader, sources: Sources, how: InputSettings) -> InputSettings:
    """Returns the settings with the sensor's mounting from the bag's fixed transforms.

    A recorded estimator has told what it took from them for its own input.
    """
    if sources.kind not in MOUNTED or _was_read(sources):
        return how
    fixed = FixedFrames()
    for message in _latched(reader, sources, topics.TF_STATIC):
        fixed.take(map(Transform.of_message, message.transforms))
    block = next(iter(reader.blocks([sources.input])), None)
    if block is None:
        return how
    frame = str(reader.columns(block, [_FRAME])[_FRAME][0])
    moving = sources.topics.topic("tf", _row(topics.TF).type) is not None
    found = how.mounted(sources.kind, frame, fixed, moving=moving)
    return how.with_mounting(found) if found else how


def _publisher_of(message: Any) -> object:
    """Returns what tells the publisher of a message from others on its topic."""
    if hasattr(message, "child_frame_id"):
        return message.child_frame_id
    return tuple(message.name) if hasattr(message, "name") else ""


def _pose_columns(poses: list[TimedPose], frame: str) -> dict[str, NDArray[Any]]:
    values = np.array([(*p.position, *p.quaternion) for p in poses], np.float64).reshape(-1, 7)
    found = _stamp_columns([pose.stamp_ns for pose in poses], POSE, frame)
    return found | dict(zip(fields(POSE)[3:], values.T, strict=True))


def _placed_columns(placed: list[PlacedAcceleration], frame: str) -> dict[str, NDArray[Any]]:
    found = _stamp_columns([one.stamp_ns for one in placed], ACCEL, frame)
    values = np.array([(*one.vector, *one.pose) for one in placed], np.float64)
    names = (*fields(ACCEL)[3:], *PLACED_FIELDS)
    return found | dict(zip(names, values.reshape(-1, len(names)).T, strict=True))


def _stamp_columns(stamps_ns: list[int], kind: str, frame: str) -> dict[str, NDArray[Any]]:
    stamps = np.array(stamps_ns, dtype=np.int64)
    seconds, nanoseconds, name = fields(kind)[:3]
    return {
        seconds: stamps // SECOND,
        nanoseconds: stamps % SECOND,
        name: np.full(len(stamps), frame, dtype=object),
    }


def by_chunk(blocks: Iterable[MessageBlock]) -> Iterator[list[MessageBlock]]:
    """Groups message blocks by the chunk of the bag file that contains them."""
    chunk: list[MessageBlock] = []
    for block in blocks:
        if chunk and block.buffer.base is not chunk[0].buffer.base:
            yield chunk
            chunk = []
        chunk.append(block)
    if chunk:
        yield chunk


def _row(name: str) -> topics.Topic:
    return next(row for row in topics.TOPICS if row.name == name)


def _latched(reader: BagReader, sources: Sources, name: str) -> Iterator[Any]:
    """Yields the decoded messages of a topic with few messages, such as /tf_static."""
    row = _row(name)
    topic = sources.topics.topic(name.strip("/"), row.type)
    for block in reader.look_up([topic]) if topic else ():
        for message in messages_of(block):
            yield reader.decode(message)


def _description(reader: BagReader, sources: Sources) -> str:
    text = next((str(one.data) for one in _latched(reader, sources, topics.ROBOT_DESCRIPTION)), "")
    if not text:
        raise SloshBagError(
            f"{reader.path}: holds joint states in {sources.input} and no robot description; give "
            "it with --urdf FILE --tool-frame LINK"
        )
    return text

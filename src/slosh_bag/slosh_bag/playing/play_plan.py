"""Chooses the topics of a bag to play, their names and their quality of service."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError

from slosh_bag.bag_writer import Qos
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.bag_contents import BagContents, BagTopic, bag_contents
from slosh_bag.playing.playback import Playback, PlaybackSettings, Step
from slosh_bag.reader import BagReader
from slosh_msgs_py import topics as names

CLOCK, ENCODING = names.CLOCK, "cdr"
# Publishers' history depths: DDS does not tell a recorder what they were.
STREAM_DEPTH, LATCHED_DEPTH = 1000, 100
LARGE_DEPTHS = {
    "sensor_msgs/msg/Image": 30,
    "sensor_msgs/msg/PointCloud2": 30,
    "sensor_msgs/msg/CompressedImage": 100,
}
_NAME = re.compile("(/[A-Za-z_][A-Za-z0-9_]*)+")


@dataclass(frozen=True, slots=True)
class PlayRequest:
    """The user's request to play a bag.

    Attributes:
        bag: a folder with MCAP files, or one MCAP file.
        settings: rate, part and clock.
        topics: regular expression of the topics to play.
        exclude: regular expression of those to leave out; empty: none.
        inputs: only what the robot, its planner and its camera publish, not what follows from it.
        namespace: where the cell's own topics go; empty: where they were.
        told_inputs: further such inputs, by the names that the recorded nodes told.
    """

    bag: Path
    settings: PlaybackSettings = field(default_factory=PlaybackSettings)
    topics: str = ".*"
    exclude: str = ""
    inputs: bool = False
    namespace: str = ""
    told_inputs: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class PlayedTopic:
    """A topic to play: its type, its new name and its publisher's QoS."""

    message_type: str
    name: str
    qos: Qos


@dataclass(frozen=True, slots=True)
class PlayPlan:
    """A bag that is ready to be played, with the topics to play.

    Attributes:
        reader: the bag.
        playback: what is due when.
        topics: what is played, by the topics' names in the bag.
        warnings: what is missing of the bag, what cannot be played and why.
    """

    reader: BagReader
    playback: Playback
    topics: dict[str, PlayedTopic]
    warnings: list[str]

    def steps(self) -> Iterator[Step]:
        """Yields all messages and clock times to publish, in order.

        Raises:
            SloshBagError: the bag is damaged.
        """
        return self.playback.steps(lambda: self.reader.messages(list(self.topics)))


def make_plan(request: PlayRequest) -> PlayPlan:
    """Creates the play plan with all topics that can be played.

    Raises:
        SloshBagError: there is nothing to play, or the request does not fit; one line.
    """
    if not _NAME.fullmatch(f"/{request.namespace.strip('/') or '_'}"):
        raise SloshBagError(f"namespace = {request.namespace!r}: not a valid ROS name")
    contents = bag_contents(request.bag)
    if contents.first_ns is None or contents.last_ns is None:
        raise SloshBagError(f"{request.bag}: holds no messages")
    chosen = _choose(request, contents)
    refused = {
        topic: reason for topic in chosen if (reason := refusal(topic, contents.topics[topic]))
    }
    played = {
        topic: PlayedTopic(
            contents.topics[topic].message_type,
            renamed(topic, request.namespace, contents.topics[topic].message_type),
            offered_qos(contents.topics[topic]),
        )
        for topic in chosen
        if topic not in refused
    }
    if not played:
        raise SloshBagError(f"{request.bag}: nothing to play: {next(iter(refused.values()))}")
    latched = {
        topic: entry.qos.depth
        for topic, entry in played.items()
        if entry.qos.durability == "transient_local"
    }
    span = (contents.first_ns, contents.last_ns)
    return PlayPlan(
        BagReader(request.bag),
        Playback(span, request.settings, latched),
        played,
        contents.warnings + [f"{topic} is not played: {why}" for topic, why in refused.items()],
    )


def _choose(request: PlayRequest, contents: BagContents) -> list[str]:
    """Returns the topics to play, without /clock, which the player publishes itself."""
    include = _pattern("topics", request.topics)
    exclude = _pattern("exclude", request.exclude) if request.exclude else None
    chosen = [
        topic
        for topic in sorted(contents.topics)
        if topic != CLOCK
        and include.search(topic)
        and not (exclude and exclude.search(topic))
        and (
            not request.inputs
            or topic in request.told_inputs
            or names.is_input(topic, contents.topics[topic].message_type)
        )
    ]
    if not chosen:
        raise SloshBagError(
            f"{request.bag}: nothing to play: no topic is selected (topics: "
            f"{', '.join(sorted(contents.topics))})"
        )
    return chosen


def _pattern(name: str, text: str) -> re.Pattern[str]:
    try:
        return re.compile(text)
    except re.error as error:
        raise SloshBagError(f"{name} = {text!r}: not a regular expression: {error}") from None


def renamed(topic: str, namespace: str, message_type: str = "") -> str:
    """Returns a cell topic's name in another namespace; other topics keep their names."""
    found = names.cell_name(topic, message_type)
    if not namespace or found is None:
        return topic
    return f"/{namespace.strip('/')}/{found.name}".replace("//", "/")


def offered_qos(topic: BagTopic) -> Qos:
    """Returns a QoS profile that is compatible with all subscribers of the recorded topic.

    It satisfies whoever was satisfied by any of them.
    """
    offered = topic.offered or (Qos(),)
    latched = topic.latched
    reliable = latched or any(qos.reliability == "reliable" for qos in offered)
    depth = LATCHED_DEPTH if latched else STREAM_DEPTH
    depth = LARGE_DEPTHS.get(topic.message_type, depth)
    return Qos(
        "reliable" if reliable else "best_effort",
        "transient_local" if latched else "volatile",
        max(depth, *(qos.depth for qos in offered)),
    )


def refusal(name: str, topic: BagTopic) -> str:
    """Returns why a topic cannot be played; empty if it can.

    The bytes go out as they are: whoever is built with another definition of the type would read
    wrong numbers out of them.
    """
    kind = topic.message_type
    if not _NAME.fullmatch(name):
        return "not a valid ROS name"
    if topic.encoding != ENCODING:
        return f"its messages are {topic.encoding or 'of no known encoding'}, not cdr"
    try:
        installed = Definitions().hash(kind)
        recorded = definition_hash(kind, topic.definition)
    except SloshBagError as error:
        return str(error)
    if installed != recorded:
        return f"the bag's definition of {kind} is not the installed one"
    return ""


def definition_hash(message_type: str, definition: str) -> str:
    """Returns the RIHS01 hash of a message type for a given definition.

    Raises:
        SloshBagError: it is none, or not full.
    """
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(definition, message_type))
        return str(store.hash_rihs01(message_type))
    except (TypesysError, LookupError):
        raise SloshBagError(f"the bag's definition of {message_type} cannot be read") from None


def without(plan: PlayPlan, missing: Sequence[str]) -> PlayPlan:
    """Returns the plan without topics whose message types are not installed.

    Raises:
        SloshBagError: nothing is left.
    """
    topics = {topic: entry for topic, entry in plan.topics.items() if topic not in missing}
    if not topics:
        kinds = sorted({entry.message_type for entry in plan.topics.values()})
        raise SloshBagError(
            f"{plan.reader.path}: nothing to play: types not installed here: {', '.join(kinds)}"
        )
    kinds = sorted({plan.topics[topic].message_type for topic in missing})
    told = f"{', '.join(missing)}: not played, types not installed here: {', '.join(kinds)}"
    return replace(
        plan, topics=topics, warnings=[*plan.warnings, told] if missing else plan.warnings
    )

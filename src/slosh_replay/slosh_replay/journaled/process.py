"""One process of a node in a replay: it is given what it took, and its messages are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from struct import unpack_from
from typing import Any, Final, NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py.journal_format import BEGIN, START
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.offline import Place, Taken, deserialised, replayed
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_replay.journaled.outputs import ComparedOutput, Recorded
from slosh_replay.journaled.taken import ProcessNotes, RecentMessages

LONG_AGO: Final = -(2**62)


class State(NamedTuple):
    """What a node goes on from behind what a recording lacks: a published state, or time alone.

    Attributes:
        gives: types of the messages that follow from it.
        topic: where the state is published; empty: there is none.
        message: its type.
        after_ns: without a state, time after which what was before matters no more [ns].
    """

    gives: frozenset[str]
    topic: str = ""
    message: Any = None
    after_ns: int = 0


class Process:
    """One process of a node in a replay."""

    def __init__(
        self, notes: ProcessNotes, states: tuple[State, ...], messages: RecentMessages,
        output: Callable[[str], ComparedOutput | None], recorded: Mapping[str, list[Recorded]],
    ) -> None:  # fmt: skip
        self.notes, self.node, self._row_states = notes, notes.node, states
        self._messages, self._output, self._recorded = messages, output, recorded
        self._outputs: dict[str, ComparedOutput | None] = {}
        self._node: Any = None
        self._lost: list[State] = []
        self._lost_ns = LONG_AGO
        self._waits_since: int | None = None
        self._known: dict[str, dict[int, bytes]] = {}
        self._found: list[ComparedOutput] = []

    def create(
        self, node_class: type[GuardedNode], arguments: Mapping[str, Any], place: Place
    ) -> None:
        """Creates the node, without a graph; what its settings tell may be a stranger's."""
        self._try(lambda: replayed(node_class, place, **arguments))

    def begin_late(self, now_ns: int, steady_ns: int) -> None:
        """Begins the node's work in the middle of its run: its state is unknown."""
        for source in (START, BEGIN):
            self._take(Taken(source, b"", now_ns, steady_ns))
        self._lose(LONG_AGO)

    def speaks_on(self, topic: str) -> bool:
        """Returns whether the node publishes on a topic."""
        return topic in self._outputs

    def publishes(self, topic: str) -> None:
        """Is told each topic that the node publishes."""
        self._outputs[topic] = self._output(topic)

    def give(self, topic: str, serialise: Callable[[], bytes]) -> None:
        """Takes what the node publishes."""
        output = self._outputs[topic]
        if output is not None:
            output.give(serialise())

    def add(self, journal: Any, sent_ns: int) -> None:
        """Gives the node what a journal names; compares what was recorded of it until then."""
        self._look_for_states()
        for taken in self.notes.add(journal, sent_ns, self._messages):
            self._take(taken)
        self._compare()

    def finish(self, end_ns: int) -> None:
        """Compares the rest; the next process of the node began at this time [ns]."""
        for taken in self.notes.rest():
            self._take(taken)
        self._compare()
        for topic, output in self._outputs.items():
            if output is not None:
                output.finish(len(self._due(topic, end_ns - 1)))

    def _try(self, create: Callable[[], Any]) -> None:
        try:
            self._node = create()
        except (ValueError, TypeError, LookupError, OSError) as error:
            self._node = None
            self.notes.lacking = f"usable settings: {error}"
            self._lose(LONG_AGO)

    def _take(self, taken: Taken) -> None:
        node = self._node
        if node is None:
            return
        for output in self._found:
            output.find(taken.now_ns)
        self._found.clear()
        if taken.source in (START, BEGIN):
            node.journal.begin(taken)
            if taken.source == BEGIN and isinstance(node, PreparedNode):
                self._try(lambda: _prepared(node))
            return
        node.use(taken)
        if taken.content is None:
            self._lose(taken.now_ns)
        elif self._lost:
            self._go_on(node, taken.now_ns)

    def _lose(self, from_ns: int) -> None:
        """Compares nothing from a time [ns] on, until the node's states are known again."""
        for output in filter(None, self._outputs.values()):
            output.lose(from_ns)
        self._lost, self._lost_ns, self._waits_since = list(self._row_states), from_ns, None
        self._found.clear()
        if not self._lost:
            self._node = None
        self._look_for_states()

    def _look_for_states(self) -> None:
        for state in self._lost if self._node is not None else ():
            if not state.topic:
                continue
            recorded = self._recorded[self._node.resolve_topic_name(state.topic)]
            self._known[state.topic] = {
                stamp_of(one.data): one.data for one in recorded if one.sent_ns >= self._lost_ns
            }

    def _go_on(self, node: Any, now_ns: int) -> None:
        """Takes up the recorded states that belong to the moment at which the node stands."""
        if self._waits_since is None:
            self._waits_since = now_ns
        while self._lost:
            state = self._lost[0]
            if state.topic:
                data = self._known[state.topic].get(node.stands_at(state.topic))
                if data is None:
                    return
                try:
                    node.take_up(deserialised(data, state.message))
                except ValueError as error:
                    self.notes.lacking += f", and its state cannot be restored: {error}"
                    self._lost.clear()
                    return
            elif now_ns - self._waits_since < state.after_ns:
                return
            self._found += [
                one for one in filter(None, self._outputs.values()) if one.kind in state.gives
            ]
            del self._lost[0]

    def _compare(self) -> None:
        for topic, output in self._outputs.items():
            if output is not None:
                output.compare(self._due(topic, self.notes.until_ns))

    def _due(self, topic: str, until_ns: int) -> list[Recorded]:
        """Removes and returns recorded messages of the process that were sent until a time."""
        waiting = self._recorded[topic]
        found = [one for one in waiting if self.notes.begun_ns <= one.sent_ns <= until_ns]
        if found:
            waiting[:] = [one for one in waiting if one.sent_ns > until_ns]
        return found


def _prepared(node: Any) -> Any:
    """Lets a node begin its work, as `run_node` does."""
    node.prepare(lambda _: None)
    node.is_prepared()
    return node


def stamp_of(data: bytes) -> int:
    """Returns the stamp in the header of a serialised message [ns]."""
    seconds, nanoseconds = unpack_from("<iI", data, 4)
    return int(seconds) * SECOND + int(nanoseconds)

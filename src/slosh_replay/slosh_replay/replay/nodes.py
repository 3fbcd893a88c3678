"""Describes a node in a replay: its processing class, topics and tolerance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, Protocol

import numpy as np

from slosh_estimator.comparison import Comparison
from slosh_estimator.limits import Event
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.observer.states import ObserverState
from slosh_model.model import Model
from slosh_model.tray import Tray
from slosh_model.wall import Wall
from slosh_replay.recording.heights import Measurements
from slosh_replay.recording.inputs import InputReader
from slosh_replay.recording.settings import NodeStart
from slosh_replay.replay.input_matching import InputMatcher
from slosh_replay.replay.known_state import KnownState
from slosh_replay.replay.model_set import ModelHeights, ModelSetEstimates
from slosh_replay.replay.verification import Messages, Verifier


class Outputs:
    """Base class of receivers of a replay's results; ignores all results."""

    def begin(self, names: tuple[str, str], wall: Wall) -> None:
        """Sets the linear and nonlinear model's names, and the container wall's geometry."""

    def estimates(self, estimates: ModelSetEstimates) -> None:
        """Receives estimates in the order of their samples."""

    def comparisons(self, comparisons: list[Comparison]) -> None:
        """Receives comparisons of estimated and measured heights, in order."""

    def events(self, events: list[Event]) -> None:
        """Receives events at which limits are exceeded or kept again."""


class Setting(NamedTuple):
    """Settings that all nodes of a replay share: model, input, limits and changes.

    Attributes:
        model: container, liquid and effects at the start.
        reader: of the input.
        limits: what the monitor watches at first.
        limit_changes: what it watches for data with stamps after these [ns], in order.
        at_rest: whether the liquid is still at the first sample.
        matcher: decides which inputs the live estimator used; None: all.
        known: follows where the liquid's state is known; None: no state is recorded.
        counter: follows the estimator's counter of inputs, where no state is recorded; None: it
            tells nothing.
        changes: starts of the estimator after its first, and changes of its parameters.
        follows_input: whether they also say how the input is read.
        tray: whose first container the model is of; None: there is none.
        starts: of all recorded nodes.
        outputs: receives all results.
        trays: later trays of the estimator, with the last stamps before them [ns]; grows.
        loaded: models that the estimator has loaded so far, that of each start; grows.
        fused: compares the observer's states; None: none are recorded.
        calm: compares whether the liquid is calm; None: none is recorded.
        observer_states: recorded states of the observer; grows.
        losses: stamps after which the estimator's state is not in the recording [ns]; grows.
    """

    model: Model
    reader: InputReader
    limits: MonitorSettings = MonitorSettings()
    limit_changes: Sequence[tuple[int, MonitorSettings]] = ()
    at_rest: bool = True
    matcher: InputMatcher | None = None
    known: KnownState | None = None
    counter: KnownState | None = None
    changes: tuple[NodeStart, ...] = ()
    follows_input: bool = True
    tray: Tray | None = None
    starts: tuple[NodeStart, ...] = ()
    outputs: Outputs = Outputs()
    trays: list[tuple[int, Tray]] = []  # noqa: RUF012 - given by each replay
    loaded: list[Model] = []  # noqa: RUF012 - given by each replay
    fused: Verifier | None = None
    calm: Verifier | None = None
    observer_states: list[ObserverState] = []  # noqa: RUF012 - given by each replay
    losses: list[int] = []  # noqa: RUF012 - given by each replay


_NONE, _NO_STAMPS = np.empty(0), np.empty(0, dtype=np.int64)
NO_MEASUREMENTS = Measurements(_NO_STAMPS, _NONE, _NO_STAMPS, _NONE, _NONE)


class Moment(NamedTuple):
    """Data that became available since the last step of a replay, up to a stamp.

    Attributes:
        messages: of the topics that nodes read, recorded ones and those of the rows above, by the
            topic's last name.
        estimates: of all models; None: there are none yet.
        own: which of their heights are the loaded model's L and NL twin.
        measured: heights.
        final: nothing follows.
    """

    messages: Mapping[str, Messages]
    estimates: ModelHeights | None = None
    own: tuple[int, int] = (0, 1)
    measured: Measurements = NO_MEASUREMENTS
    final: bool = False


class Core(Protocol):
    """Interface of a node's processing class in a replay."""

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Processes new data; returns the node's messages by the last part of the topic name."""


class NodeTopic(NamedTuple):
    """A topic that a node in a replay reads or publishes.

    Attributes:
        name: its last name.
        message_type: such as 'slosh_msgs/msg/SloshEstimate'.
        fields: dotted names of those that are read or compared, beside the stamp.
        can_lack: see Verifier.
        known: what recorded messages tell that a replay can know; None: all.
        later: fields that messages of older versions lack, with the value that they stand for.
    """

    name: str
    message_type: str
    fields: tuple[str, ...] = ()
    can_lack: tuple[str, ...] = ()
    known: Callable[[Messages], Messages] | None = None
    later: Mapping[str, float] = MappingProxyType({})


def recorded_name(name: str) -> str:
    """Returns the name under which a node reads recorded messages of its own topic."""
    return f"recorded {name}"


class ReplayedNode(NamedTuple):
    """A node that a replay runs: name, topics, tolerance and processing class.

    Attributes:
        name: of the node.
        core: makes its core.
        inputs: topics that it reads, beside measured heights and the input of the models.
        outputs: topics that it gives; recorded messages of these are compared.
        needs_recorded: whether it reads the recorded messages of the first output, too, by
            `recorded_name`; where there are none it does not run.
        tolerance: by how much a field may differ from the recorded one [its SI unit]; 0: not by
            a bit; None: a difference is told and is no failure.
    """

    name: str
    core: Callable[[Setting], Core]
    inputs: tuple[NodeTopic, ...] = ()
    outputs: tuple[NodeTopic, ...] = ()
    tolerance: float | None = 0.0
    needs_recorded: bool = False

"""The estimator in a replay: inputs in recorded order, restarts, models and a recorded state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Final

import numpy as np

from slosh_base.types import Integers
from slosh_estimator.held_container import changed_place, empty_and_fresh
from slosh_estimator.tray_estimator import TrayEstimator
from slosh_model.tray import Tray
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.sampling import modes_of
from slosh_motion.recorded.inputs import LACKING, LOGGED, settings_of_start
from slosh_motion.recorded.settings import NodeStart, model_of, starts_at_rest, tray_of
from slosh_replay.recording.states import RecordedState
from slosh_replay.replay.model_set import ModelHeights, ModelSet
from slosh_replay.replay.setting import Setting
from slosh_replay.replay.verification import (
    Columns,
    Messages,
    Verifier,
    estimate_columns,
    tray_columns,
)

AT_FIRST: Final = "before the first known state"
MISSING: Final = "after inputs that are missing in the recording, until the next known state"


class ReplayedEstimator:
    """Computes estimates from the recorded inputs, in the order in which they were recorded.

    Args:
        setting: of the replay.
        estimates, trays: compare what is estimated with recorded messages; None: none are there.

    Attributes:
        models: the estimators.
        tray_changes: later trays, with the last stamps before them [ns]; grows.
        untaken: why the estimator's recorded state cannot be taken up; empty: it can.
    """

    def __init__(
        self, setting: Setting, estimates: Verifier | None = None, trays: Verifier | None = None
    ) -> None:
        self.setting = setting
        self._verifiers = estimates, trays
        self.models = ModelSet(setting.model, at_rest=setting.at_rest and not setting.late)
        self._tray = setting.tray
        self._others = self._new_others(setting.at_rest)
        self.tray_changes: list[tuple[int, Tray]] = []
        self._until_ns = self._given_ns = 0
        self.untaken = ""
        self._changes = list(setting.changes)
        self._states: list[RecordedState] = []
        self._unknown = setting.late
        if setting.late:
            for verifier in filter(None, self._verifiers):
                verifier.lose(-(2**62), AT_FIRST)
        if setting.empty:
            self.models.empty()
        setting.reader.carry(modes_of(setting.model))
        setting.outputs.begin(self.models.own_names, self.models.model.container.wall)

    def _new_others(self, at_rest: bool) -> TrayEstimator | None:
        return None if self._tray is None else TrayEstimator(self._tray, at_rest=at_rest)

    @property
    def longest_gap_ns(self) -> int:
        """Longest input gap [ns] that the models integrate across, over all recorded settings."""
        later = [self._input_settings(c) for c in self.setting.changes if c.changed]
        gaps = [round(one.gate.max_gap * 1e9) for one in later if one is not None]
        return max([self.setting.reader.max_gap_ns, *gaps])

    def add_states(self, states: Sequence[RecordedState]) -> None:
        """Adds recorded states; one is taken up where the recording begins late or has a hole."""
        self._states += states

    def update(self, inputs: Messages) -> list[ModelHeights]:
        """Processes the next inputs; returns the heights of all models."""
        lacking = np.flatnonzero(inputs.columns.get(LACKING, ())).tolist()
        found = []
        for begin, end in pairwise([0, *lacking, len(inputs.stamps)]):
            given = self._update(inputs.rows(slice(begin, end)))
            self._given_ns = max(self._given_ns, *(int(one.stamps[-1]) for one in given), 0)
            found += given
            if end in lacking:
                self._lose(self._given_ns)
        if len(inputs.stamps):
            last_ns = int(inputs.stamps[-1])
            self._states = [state for state in self._states if state.stamp_ns >= last_ns]
        return found

    def _lose(self, after_ns: int) -> None:
        """Marks estimates after a stamp as not comparable, until the next recorded state."""
        for verifier in filter(None, self._verifiers) if not self._unknown else ():
            verifier.lose(after_ns, MISSING)
        self._unknown = True

    def _update(self, inputs: Messages) -> list[ModelHeights]:
        stamps, columns = inputs
        count = len(stamps)
        if not count:
            return []
        # What belongs to the inputs before an index comes first.
        actions = self._known_again(stamps) + self._due(stamps, columns.get(LOGGED, stamps))
        start, found = 0, []
        for index, act in sorted(actions, key=lambda action: action[0]):
            found += self._take(stamps, columns, start, index)
            # A state may be that behind the last input that has come so far.
            behind = index == count
            self._until_ns = int(stamps[-1]) if behind else int(stamps[index]) - 1
            act()
            start = index
        return found + self._take(stamps, columns, start, count)

    def _due(self, stamps: Integers, logged: Integers) -> list[tuple[int, Callable[[], None]]]:
        """Returns the restarts, model changes and parameter changes due at the given inputs.

        Args:
            stamps: (N,) [ns].
            logged: (N,) when the inputs were recorded [ns].
        """
        actions: list[tuple[int, Callable[[], None]]] = []
        begin = 0
        while self._changes:
            change = self._changes[0]
            if change.is_process:
                later = np.flatnonzero(logged[begin:] > change.log_ns)
                act: Callable[[NodeStart], None] = self._restart
            else:
                later = np.flatnonzero(stamps[begin:] > change.stamp_ns)
                act = self._change if change.changed else self._load
            if not len(later):
                break
            begin += int(later[0]) * change.is_process
            place = begin if change.is_process else begin + int(later[0])
            actions.append((place, partial(act, change)))
            self._changes.pop(0)
        return actions

    def _known_again(self, stamps: Integers) -> list[tuple[int, Callable[[], None]]]:
        """Returns the action that takes up the first recorded state, with its input's index."""
        for state in self._states if self._unknown else ():
            place = int(np.searchsorted(stamps, state.stamp_ns))
            if place < len(stamps) and stamps[place] == state.stamp_ns:
                self._unknown = False
                return [(place + 1, partial(self._take_up, state))]
        return []

    def _take_up(self, state: RecordedState) -> None:
        self._others = None  # no state tells of a tray's further containers
        try:
            self.models.take_up(state.estimator)
            self.setting.reader.take_up(state.stamp_ns, state.memory)
        except SloshMotionError as error:
            self.untaken = str(error)
        estimates, _ = self._verifiers
        if estimates is not None:
            estimates.find(state.estimator.sample.stamp_ns)

    def _load(self, change: NodeStart) -> None:
        empty, fresh = empty_and_fresh(change.parameters)
        place = self._carry(change)
        if self._others is not None and self._tray is not None:
            if place < 0:
                self._others.reset()
            else:
                self._others.change(self._tray, place, fresh=fresh)
        if place > 0:
            return
        model = model_of(change)
        self.models.load_model(model, fresh=fresh, empty=empty)
        self.setting.reader.carry(modes_of(model))
        self.setting.outputs.begin(self.models.own_names, self.models.model.container.wall)

    def _carry(self, change: NodeStart) -> int:
        """Loads the recorded tray; returns the index of the replaced container, or -1 for all."""
        tray = tray_of(change) if self._tray is not None else None
        if tray is None or self._tray is None or tray.names != self._tray.names:
            return -1
        if tray != self._tray:
            self._tray = tray
            self.tray_changes.append((self._until_ns, tray))
        place = changed_place(change.parameters)
        return tray.names.index(place) if place in tray.names else -1

    def _change(self, change: NodeStart) -> None:
        settings = self._input_settings(change)
        if settings is not None:
            self.setting.reader.change(settings)

    def _input_settings(self, start: NodeStart) -> InputSettings | None:
        """Returns new input settings of the node, or None if the replay ignores them."""
        if not self.setting.follows_input or "input" not in start.parameters:
            return None
        return settings_of_start(start)

    def _restart(self, start: NodeStart) -> None:
        """Restarts the models and the input reader, as the node's process did."""
        self.setting.reader.restart(self._input_settings(start))
        self._load(start)
        self.models.restart(at_rest=starts_at_rest(start))
        self._others = self._new_others(starts_at_rest(start))

    def _take(self, stamps: Integers, inputs: Columns, start: int, end: int) -> list[ModelHeights]:
        if start == end:
            return []
        samples = self.setting.reader.samples(stamps, inputs, np.arange(start, end))
        if not len(samples.stamps):
            return []
        answers = self.models.update_many(samples)
        own, heights = answers.own, answers.heights
        estimates, trays = self._verifiers
        if self._others is not None:
            tray = self._others.update_many(samples, own)
            if trays is not None:
                trays.add_replayed(own.stamps, tray_columns(tray))
            heights = heights._replace(tray=tray.msh)
        elif self.setting.tray is not None:
            unknown = np.full((len(own.stamps), len(self.setting.tray.containers)), np.nan)
            heights = heights._replace(tray=unknown)
        if estimates is not None:
            estimates.add_replayed(own.stamps, estimate_columns(own))
        self.setting.outputs.estimates(answers)
        return [heights]

"""Replays the observer from the estimator's samples and the recorded heights."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Final

import numpy as np

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import TOLD_FIELDS, WallHeights, told_fields
from slosh_estimator.observer.surface_heights import SurfaceHeights, wall_heights
from slosh_estimator.sample import Samples
from slosh_estimator.validity import EstimateFlag
from slosh_msgs_py.topics import FREE_SURFACE, FUSED_ESTIMATE
from slosh_replay.replay.nodes import Moment, Setting, recorded_name
from slosh_replay.replay.replayed_estimator import SAMPLES, samples_of
from slosh_replay.replay.verification import Messages

TAKEN: Final = "heights_taken"
SURFACES: Final = SurfaceHeights._fields
UNKNOWN = "the observer's state is not in the recording, until the next known one"

EMPTY = "the gripper was empty: which heights came after that is not recorded"


class ReplayedObserver:
    """Replays the observer; recorded states tell which heights it used when.

    Args:
        setting: of the replay.
    """

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._start = -1
        self._observer: Observer | None = None
        self._surfaces: deque[WallHeights] = deque()
        self._taken = 0
        self._states: deque[tuple[int, int]] = deque()
        self._hears = True
        self._lost = self._was_empty = False

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Processes samples, heights and recorded states; returns the fused states."""
        recorded = moment.messages[recorded_name(FUSED_ESTIMATE)]
        if len(recorded.stamps):
            counts = recorded.columns[TAKEN].astype(np.int64).tolist()
            self._states.extend(zip(recorded.stamps.tolist(), counts, strict=True))
        self._surfaces.extend(_heights(moment.messages[FREE_SURFACE]))
        batch = moment.messages[SAMPLES]
        if not len(batch.stamps):
            return {}
        told: list[tuple[int, dict[str, float]]] = []
        samples = samples_of(batch)
        flags = batch.columns["flags"].astype(np.int64).tolist()
        starts = batch.columns["start"].astype(np.int64).tolist()
        for index, (flag, start) in enumerate(zip(flags, starts, strict=True)):
            self._follow(samples, index, flag, start, told)
        return {FUSED_ESTIMATE: _messages(told)} if told else {}

    def _follow(
        self,
        samples: Samples,
        index: int,
        flags: int,
        start: int,
        told: list[tuple[int, dict[str, float]]],
    ) -> None:
        if flags & EstimateFlag.NO_CONTAINER:
            self._was_empty = True
            return
        sample = samples.one(index)
        if self._was_empty and self._surfaces and self._setting.fused is not None:
            self._setting.fused.lose(sample.stamp_ns - 1, EMPTY)
            self._lost = True
        self._was_empty = False
        self._follow_losses(sample.stamp_ns)
        if start != self._start or self._observer is None:
            self._begin(start)
        observer = self._observer
        assert observer is not None
        self._feed(observer, sample.stamp_ns)
        state = observer.follow(sample, flags)
        if self._lost and self._take_up(observer, sample.stamp_ns):
            return
        if state is not None:
            told.append((state.stamp_ns, told_fields(state, observer.counts)))

    def _begin(self, start: int) -> None:
        """Creates the observer at a start of the node."""
        self._start = start
        model = self._setting.loaded[start]
        self._observer, self._taken = Observer(model), 0
        self._hears = not model.uses("reading")

    def _follow_losses(self, stamp_ns: int) -> None:
        """Excludes messages from the comparison if inputs before them were not recorded."""
        losses, fused = self._setting.losses, self._setting.fused
        while losses and losses[0] < stamp_ns:
            after_ns = losses.pop(0)
            if fused is not None and not self._lost:
                fused.lose(after_ns, UNKNOWN)
            self._lost = True

    def _take_up(self, observer: Observer, stamp_ns: int) -> bool:
        """Restores the recorded state with this stamp, if there is one."""
        states = self._setting.observer_states
        while states and states[0].stamp_ns < stamp_ns:
            del states[0]
        if not states or states[0].stamp_ns != stamp_ns or self._setting.fused is None:
            return False
        try:
            observer.take_up(states[0])
        except SloshEstimatorError:
            return False
        self._lost, self._taken = False, observer.taken
        self._setting.fused.find(stamp_ns)
        judged = states[0].judged_ns
        stamps = [heights.stamp_ns for heights in self._surfaces]
        if judged in stamps:
            for _ in range(stamps.index(judged) + 1):
                self._surfaces.popleft()
        return True

    def _feed(self, observer: Observer, stamp_ns: int) -> None:
        """Passes to the observer the heights that the live one had used at this sample."""
        while self._states and self._states[0][0] < stamp_ns:
            self._states.popleft()
        if not self._states or self._states[0][0] != stamp_ns:
            return
        _, taken = self._states.popleft()
        if self._lost:  # how many came before is not known
            return
        while self._hears and self._taken < taken and self._surfaces:
            observer.take(self._surfaces.popleft())
            self._taken += 1


def _heights(batch: Messages) -> list[WallHeights]:
    """Converts recorded FreeSurface messages to wall heights as the node does."""
    if not len(batch.stamps):
        return []
    columns = [batch.columns[name].tolist() for name in SURFACES]
    return [
        wall_heights(stamp_ns, SurfaceHeights(*values))
        for stamp_ns, *values in zip(batch.stamps.tolist(), *columns, strict=True)
    ]


def _messages(told: list[tuple[int, dict[str, float]]]) -> Messages:
    stamps = np.array([stamp_ns for stamp_ns, _ in told], dtype=np.int64)
    columns = {name: np.array([fields[name] for _, fields in told]) for name in TOLD_FIELDS}
    return Messages(stamps, columns)

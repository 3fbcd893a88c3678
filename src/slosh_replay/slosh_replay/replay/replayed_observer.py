"""The observer's core in a replay: the estimator's samples and the recorded heights."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Final

import numpy as np

from slosh_estimator.observer.observer import FusedState, Observer, Outcome, WallHeights
from slosh_estimator.observer.surface_heights import SurfaceHeights, wall_heights
from slosh_estimator.sample import Samples
from slosh_msgs_py.topics import FREE_SURFACE, FUSED_ESTIMATE
from slosh_replay.replay.nodes import Moment, Setting, recorded_name
from slosh_replay.replay.replayed_estimator import SAMPLES, samples_of
from slosh_replay.replay.verification import Messages

TAKEN: Final = "heights_taken"
SURFACES: Final = SurfaceHeights._fields
_HEIGHTS = {
    "msh": "msh", "msh_stddev": "stddev", "azimuth": "azimuth", "sh_x": "sh_x",
    "sh_x_stddev": "stddev_x", "sh_y": "sh_y", "sh_y_stddev": "stddev_y",
    "frequency_factor": "frequency_factor", "frequency_stddev": "frequency_stddev",
    "damping_factor": "damping_factor", "damping_stddev": "damping_stddev", "level": "level",
    "clock_offset": "clock_offset",
}  # fmt: skip
"""Fields of FusedEstimate.msg and of FusedState."""
FIELDS: Final = (TAKEN, *_HEIGHTS, "heights_used", "heights_rejected", "uncorrected")
_Told = tuple[FusedState, tuple[int, int, int]]
"""A state, and how many heights were judged, used and rejected before it."""


class ReplayedObserver:
    """Follows the samples; each recorded state says how many heights came before it.

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

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Takes samples, heights and recorded states; returns its own states."""
        recorded = moment.messages[recorded_name(FUSED_ESTIMATE)]
        if len(recorded.stamps):
            counts = recorded.columns[TAKEN].astype(np.int64).tolist()
            self._states.extend(zip(recorded.stamps.tolist(), counts, strict=True))
        self._surfaces.extend(_heights(moment.messages[FREE_SURFACE]))
        batch = moment.messages[SAMPLES]
        if not len(batch.stamps):
            return {}
        states: list[_Told] = []
        samples = samples_of(batch)
        flags = batch.columns["flags"].astype(np.int64).tolist()
        starts = batch.columns["start"].astype(np.int64).tolist()
        for index, (flag, start) in enumerate(zip(flags, starts, strict=True)):
            self._follow(samples, index, flag, start, states)
        return {FUSED_ESTIMATE: _messages(states)} if states else {}

    def _follow(
        self,
        samples: Samples,
        index: int,
        flags: int,
        start: int,
        states: list[_Told],
    ) -> None:
        sample = samples.one(index)
        if start != self._start or self._observer is None:
            self._begin(start)
        observer = self._observer
        assert observer is not None
        self._feed(observer, sample.stamp_ns)
        state = observer.follow(sample, flags)
        if state is not None:
            counts = observer.counts
            told = (observer.taken, counts[Outcome.USED], counts[Outcome.REJECTED])
            states.append((state, told))

    def _begin(self, start: int) -> None:
        """Makes the observer of a start of the node."""
        self._start = start
        model = self._setting.loaded[start]
        self._observer, self._taken = Observer(model), 0
        self._hears = not model.uses("reading")

    def _feed(self, observer: Observer, stamp_ns: int) -> None:
        """Gives the observer what the live one had judged when it told of this sample."""
        while self._states and self._states[0][0] < stamp_ns:
            self._states.popleft()
        if not self._states or self._states[0][0] != stamp_ns:
            return
        _, taken = self._states.popleft()
        while self._hears and self._taken < taken and self._surfaces:
            observer.take(self._surfaces.popleft())
            self._taken += 1


def _heights(batch: Messages) -> list[WallHeights]:
    """Recorded FreeSurface messages as the node takes them."""
    if not len(batch.stamps):
        return []
    columns = [batch.columns[name].tolist() for name in SURFACES]
    return [
        wall_heights(stamp_ns, SurfaceHeights(*values))
        for stamp_ns, *values in zip(batch.stamps.tolist(), *columns, strict=True)
    ]


def _messages(states: list[_Told]) -> Messages:
    stamps = np.array([state.stamp_ns for state, _ in states], dtype=np.int64)
    columns = {
        field: np.array([getattr(state, name) for state, _ in states])
        for field, name in _HEIGHTS.items()
    }
    told = np.array([counts for _, counts in states], dtype=np.uint64)
    columns[TAKEN], columns["heights_used"], columns["heights_rejected"] = told.T
    columns["uncorrected"] = np.array(
        [math.nan if state.corrected_ns is None else state.uncorrected for state, _ in states]
    )
    return Messages(stamps, columns)

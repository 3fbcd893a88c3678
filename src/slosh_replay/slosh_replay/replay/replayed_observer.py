"""Replays the observer from the estimator's samples and the recorded heights."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Final

import numpy as np

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.observer.calm import CALM_FIELDS, CalmReason, CalmWatch, calm_fields
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import FUSED_FIELDS, FusedState, WallHeights, fused_fields
from slosh_estimator.observer.surface_heights import SurfaceHeights, wall_heights
from slosh_estimator.sample import Samples
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag
from slosh_msgs_py.topics import CALM, FREE_SURFACE, FUSED_ESTIMATE, SENSED_SURFACE
from slosh_replay.replay.nodes import Moment, Setting, recorded_name
from slosh_replay.replay.replayed_estimator import SAMPLES, samples_of
from slosh_replay.replay.verification import Messages

TAKEN: Final = ("heights_taken", "sensed_taken")
DOORS: Final = (FREE_SURFACE, SENSED_SURFACE)
"""Topics of measured surfaces: of the camera, and of sensors beside it."""
TOLERANCE: Final = 1e-3
"""Of calm, of recordings that do not tell it [m]."""
Told = list[tuple[int, dict[str, float]]]
SURFACES: Final = SurfaceHeights._fields
UNKNOWN = "the observer's state is not in the recording, until the next known one"

BEFORE_A_MOTION = "whether it is calm is not known from a state, until the container moves"
EMPTY = "the gripper was empty: which heights came after that is not recorded"


class ReplayedObserver:
    """Replays the observer; its recorded states show which heights the live node used, and when.

    Args:
        setting: of the replay.
    """

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._start = -1
        self._observer: Observer | None = None
        self._surfaces: tuple[deque[WallHeights], ...] = tuple(deque() for _ in DOORS)
        self._taken = [0] * len(DOORS)
        self._states: deque[tuple[int, tuple[int, ...]]] = deque()
        self._hears = True
        self._moved = 0
        self._calm_slot = -1
        starts = [one for one in setting.starts if one.node == "estimator"]
        self._tolerances = [
            (one.stamp_ns, float(one.parameters.get("calm_tolerance", TOLERANCE)))
            for one in starts
            if one is starts[0] or "calm_tolerance" in one.changed
        ] or [(0, TOLERANCE)]
        self._watch = CalmWatch(self._tolerances[0][1])
        self._lost = self._was_empty = self._calm_lost = False

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Processes samples, heights and recorded states; returns the fused states."""
        recorded = moment.messages[recorded_name(FUSED_ESTIMATE)]
        if len(recorded.stamps):
            taken, sensed = (recorded.columns[name].astype(np.int64) for name in TAKEN)
            counts = zip((taken - sensed).tolist(), sensed.tolist(), strict=True)
            self._states.extend(zip(recorded.stamps.tolist(), counts, strict=True))
        for door, waiting in zip(DOORS, self._surfaces, strict=True):
            # Of a replayed sensor, too, what was recorded is what the live node heard.
            name = recorded_name(door)
            waiting.extend(_heights(moment.messages[name if name in moment.messages else door]))
        batch = moment.messages[SAMPLES]
        if not len(batch.stamps):
            return {}
        told: Told = []
        calm: Told = []
        samples = samples_of(batch)
        flags = batch.columns["flags"].astype(np.int64).tolist()
        starts = batch.columns["start"].astype(np.int64).tolist()
        for index, (flag, start) in enumerate(zip(flags, starts, strict=True)):
            self._follow(samples, index, flag, start, told, calm)
        given = {FUSED_ESTIMATE: (told, FUSED_FIELDS), CALM: (calm, CALM_FIELDS)}
        return {name: _messages(*found) for name, found in given.items() if found[0]}

    def _follow(
        self,
        samples: Samples,
        index: int,
        flags: int,
        start: int,
        told: Told,
        calm: Told,
    ) -> None:
        if flags & EstimateFlag.NO_CONTAINER:
            self._was_empty = True
            return
        sample = samples.one(index)
        if self._was_empty and any(self._surfaces) and self._setting.fused is not None:
            self._lose(sample.stamp_ns - 1, EMPTY)
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
            told.append((state.stamp_ns, fused_fields(state, observer.counts, observer.sensed)))
            self._look(state, calm)

    def _look(self, state: FusedState, calm: Told) -> None:
        """Computes whether the liquid is calm, at the rate at which the node publishes it."""
        while len(self._tolerances) > 1 and self._tolerances[1][0] < state.stamp_ns:
            del self._tolerances[0]
            self._watch = CalmWatch(self._tolerances[0][1])
        found = self._watch.update(state)
        if state.stamp_ns // TUNING.calm_ns == self._calm_slot:
            return
        self._calm_slot = state.stamp_ns // TUNING.calm_ns
        calm.append((state.stamp_ns, calm_fields(found)))
        # In motion all that calm depends on begins anew.
        self._moved = self._moved + 1 if found.reason is CalmReason.MOVING else 0
        if self._calm_lost and not self._lost and self._moved > 1:
            self._calm_lost = False
            if self._setting.calm is not None:
                self._setting.calm.find(state.stamp_ns)

    def _lose(self, after_ns: int, why: str) -> None:
        """Marks fused states and calmness after a stamp as not comparable."""
        if self._setting.fused is not None:
            self._setting.fused.lose(after_ns, why)
        if self._setting.calm is not None and not self._calm_lost:
            self._setting.calm.lose(after_ns, BEFORE_A_MOTION)
        self._lost = self._calm_lost = True

    def _begin(self, start: int) -> None:
        """Creates the observer with the model and settings of a recorded node start."""
        self._start = start
        model = self._setting.loaded[start]
        self._observer, self._taken = Observer(model, holds=False), [0] * len(DOORS)
        self._hears = not model.uses("reading")
        self._watch = CalmWatch(self._tolerances[0][1])

    def _follow_losses(self, stamp_ns: int) -> None:
        """Excludes messages from the comparison if inputs before them were not recorded."""
        losses = self._setting.losses
        while losses and losses[0] < stamp_ns:
            after_ns = losses.pop(0)
            if not self._lost:
                self._lose(after_ns, UNKNOWN)

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
        self._lost = False
        self._taken = [observer.taken - observer.sensed, observer.sensed]
        self._setting.fused.find(stamp_ns)
        for waiting, judged in zip(
            self._surfaces, (states[0].judged_ns, states[0].sensed_ns), strict=True
        ):
            stamps = [heights.stamp_ns for heights in waiting]
            if judged in stamps:
                for _ in range(stamps.index(judged) + 1):
                    waiting.popleft()
        return True

    def _feed(self, observer: Observer, stamp_ns: int) -> None:
        """Passes to the observer the heights that the live observer used up to a given stamp."""
        while self._states and self._states[0][0] < stamp_ns:
            self._states.popleft()
        if not self._states or self._states[0][0] != stamp_ns:
            return
        _, taken = self._states.popleft()
        if self._lost:  # how many came before is not known
            return
        for place, waiting in enumerate(self._surfaces):
            while self._hears and self._taken[place] < taken[place] and waiting:
                observer.take(waiting.popleft(), sensed=place > 0)
                self._taken[place] += 1


def _heights(batch: Messages) -> list[WallHeights]:
    """Converts recorded FreeSurface messages to wall heights as the node does."""
    if not len(batch.stamps):
        return []
    columns = [batch.columns[name].tolist() for name in SURFACES]
    return [
        wall_heights(stamp_ns, SurfaceHeights(*values))
        for stamp_ns, *values in zip(batch.stamps.tolist(), *columns, strict=True)
    ]


def _messages(told: Told, fields: tuple[str, ...]) -> Messages:
    stamps = np.array([stamp_ns for stamp_ns, _ in told], dtype=np.int64)
    columns = {name: np.array([one[name] for _, one in told]) for name in fields}
    return Messages(stamps, columns)

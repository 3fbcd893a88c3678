"""Tracks for which inputs of a recording the state of the liquid is known.

It is known from a start of the estimator on, until the estimator used an input that the recording
lacks: then its counter went on by more than the inputs that are there. A recording that begins in
the middle of a run lacks all before. From a recorded state on it is known again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slosh_base.types import Integers
from slosh_replay.recording.states import RecordedState
from slosh_replay.replay.input_matching import Decision
from slosh_replay.replay.verification import Verifier

AT_FIRST = "before the first known state"
LATER = "after inputs that are missing in the recording, until the next known state"
OF_A_TRAY = "no state of a tray's further containers is recorded"
_LONG_AGO = -(2**62)
_STARTED, _LOST, _STATE = range(3)  # in the order in which they count at one input


class Course(NamedTuple):
    """Whether the liquid's state is known at the next inputs, and recorded states to restore.

    Attributes:
        unknown: whether it is not known at the first of them, with which the replay begins.
        states: those to be taken up, each with the index of the first input behind it.
    """

    unknown: bool
    states: list[tuple[int, RecordedState]]


class _Event(NamedTuple):
    """A change at an input: from there on, the liquid's state is unknown, or known again."""

    place: int
    kind: int
    stamp_ns: int
    state: RecordedState | None = None


class KnownState:
    """Tracks from inputs and recorded states whether the replay knows the liquid's state.

    Args:
        verifier: is told what cannot be compared; None: nothing is.
        trays: the same for what follows from the estimates of all containers of a tray, of the
            first of which alone states are recorded.
        comparison: the same for the monitor's comparisons with these estimates.
        losses: receives the stamps after which the state is unknown [ns].

    Attributes:
        breaks: how often the counter went on by another number than that of the inputs.
    """

    def __init__(
        self,
        verifier: Verifier | None,
        losses: list[int] | None = None,
        trays: Sequence[Verifier] = (),
        comparison: Verifier | None = None,
    ) -> None:
        self._estimate, self._comparison = verifier, comparison
        self._found_before = False  # the next input is the first one with a known estimate
        self._trays = tuple(trays)
        self._losses = losses
        self._states: list[RecordedState] = []
        self._known = True
        self.breaks = 0
        # The estimator's counter at the last input of which it is known, and inputs used since.
        self._count = self._since = 0
        self._stamp_ns = _LONG_AGO
        self._lag_ns = 0  # by which estimates lie behind the inputs that they are made of

    def add(self, states: Sequence[RecordedState]) -> None:
        """Adds recorded states of the estimator, in recorded order."""
        self._states += states

    def follow(self, stamps: Integers, decision: Decision) -> Course:
        """Processes the next inputs, given which of them the live estimator used.

        Args:
            stamps: (N,) of at least the inputs that were decided upon [ns].
            decision: on them.
        """
        stamps = stamps[: decision.reached]
        last_ns = int(stamps[-1]) if len(stamps) else _LONG_AGO
        due = [state for state in self._states if state.stamp_ns <= last_ns]
        self._states = [state for state in self._states if state.stamp_ns > last_ns]
        places = np.searchsorted(stamps, [state.stamp_ns for state in due]).tolist()
        at = [(k, s) for k, s in zip(places, due, strict=True) if stamps[k] == s.stamp_ns]
        counts, lags = self._counts(decision, at), np.zeros(decision.reached, dtype=np.int64)
        for k, state in at:
            lags[k] = state.stamp_ns - state.estimator.sample.stamp_ns
        events = self._breaks(stamps, decision, counts, lags)
        events += [
            _Event(k, _STATE, s.estimator.sample.stamp_ns, s)
            for k, s in at
            if decision.used[k] and counts[k] == s.used
        ]
        course = Course(False, [])
        self._find_comparisons(stamps, 0)
        for event in sorted(events, key=lambda event: event[:2]):
            if event.kind == _LOST:
                course = course._replace(unknown=course.unknown or event.stamp_ns == _LONG_AGO)
                self._lose(event.stamp_ns)
            elif not self._known:
                if event.state is not None:
                    course.states.append((event.place + 1, event.state))
                    self._lag_ns = event.state.stamp_ns - event.stamp_ns
                self._find(event.stamp_ns)
                self._find_comparisons(stamps, event.place + (event.kind == _STATE))
        return course

    def _counts(self, decision: Decision, at: Sequence[tuple[int, RecordedState]]) -> Integers:
        """Returns the counter of used samples (N,) at each input; 0 where unknown."""
        if decision.counts is not None:
            return decision.counts
        counts = np.zeros(decision.reached, dtype=np.int64)
        for k, state in at:
            counts[k] = state.used
        return counts

    def _breaks(
        self, stamps: Integers, decision: Decision, counts: Integers, lags: Integers
    ) -> list[_Event]:
        """Returns the inputs at which the counter disagrees with the inputs, or restarts."""
        total = np.concatenate(([0], np.cumsum(decision.used)))  # used before each input
        rows = np.flatnonzero((counts > 0) & decision.used)
        before = np.concatenate(([-self._since], total[rows + 1]))
        count = np.concatenate(([self._count], counts[rows]))
        moment = np.concatenate(([self._stamp_ns], stamps[rows] - lags[rows]))
        starts = [_Event(k, _STARTED, int(stamps[k]) - 1) for k in decision.restarts]
        for start in starts:
            follower = int(np.searchsorted(rows, start.place))
            before[follower], count[follower] = total[start.place], 0
        lacking = counts[rows] - count[:-1] != total[rows + 1] - before[:-1]
        lost = [
            _Event(int(rows[k]), _LOST, int(moment[k])) for k in np.flatnonzero(lacking).tolist()
        ]
        self.breaks += sum(event.stamp_ns > _LONG_AGO for event in lost)
        self._count, self._since = int(count[-1]), int(total[-1] - before[-1])
        self._stamp_ns = int(moment[-1])
        return [*starts, *lost]

    def _lose(self, after_ns: int) -> None:
        if self._found_before and self._comparison is not None:
            self._comparison.find(after_ns)  # nothing was replayed since
        self._found_before = False
        why = AT_FIRST if after_ns == _LONG_AGO else LATER
        for verifier in (self._estimate, self._comparison) if self._known else ():
            if verifier is not None:
                verifier.lose(after_ns, why)
        for verifier in self._trays:
            verifier.lose(after_ns, OF_A_TRAY)
        self._trays = ()
        if self._losses is not None:
            self._losses.append(after_ns)
        self._known = False

    def find_later(self, found_ns: int, answered_ns: int) -> None:
        """Excludes answers that the replay gave from an unknown state, behind a known one.

        Args:
            found_ns: stamp from which the state is known [ns].
            answered_ns: stamp of the replay's last answer [ns].
        """
        for verifier in (self._estimate, self._comparison):
            if verifier is not None:
                verifier.find_later(found_ns, answered_ns)

    def _find(self, until_ns: int) -> None:
        if self._estimate is not None:
            self._estimate.find(until_ns)
        self._known = self._found_before = True

    def _find_comparisons(self, stamps: Integers, place: int) -> None:
        """Resumes the check of monitor messages at the first replayed estimate of a known state.

        A comparison of an image before it interpolates from an estimate that is not replayed.

        Args:
            stamps: (N,) of the inputs [ns].
            place: index of the first input behind the known state.
        """
        if self._found_before and place < len(stamps):
            if self._comparison is not None:
                self._comparison.find(int(stamps[place]) - self._lag_ns)
            self._found_before = False

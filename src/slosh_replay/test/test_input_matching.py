"""Tests that the inputs used live are found by the counter, in any cut recording."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_replay.recording.states import RecordedState
from slosh_replay.replay.input_matching import PATIENCE_NS, Decision, InputMatcher
from slosh_replay.replay.known_state import KnownState

MS = 1_000_000
FAR = 10**6


class Live:
    """A simulated run: inputs, the estimator's use of them, and what was recorded.

    Attributes:
        used: for each input.
        restarts: inputs with which a new process begins.
        log: ('input' | 'estimate', stamp, counter) in the order of the recording.
    """

    def __init__(self, segments, delay=0, step=MS):
        self.used, self.restarts, self.stamps, estimates = [], [], [], []
        counter = 0
        for kind, count in segments:
            if kind == "restart":
                counter = 0
                if any(self.used):
                    self.restarts.append(len(self.used))
            for _ in range(count):
                stamp = 10**18 + step * len(self.used)
                self.stamps.append(stamp)
                self.used.append(kind != "unused")
                if kind == "unused":
                    continue
                counter += 1
                if kind == "recorded":
                    estimates.append((len(self.used) - 1 + delay, stamp, counter))
        entries = [(index, 0, stamp, 0) for index, stamp in enumerate(self.stamps)]
        entries += [(index, 1, stamp, counter) for index, stamp, counter in estimates]
        self.log = [(("input", "estimate")[s], *rest) for _, s, *rest in sorted(entries)]

    def decided(self, cuts=()):
        """Returns the decisions of InputMatcher if the run is read in blocks."""
        live, used, restarts, waiting = InputMatcher(), [], [], []
        ends = sorted({*(cut % (len(self.log) + 1) for cut in cuts), len(self.log)})
        start = 0
        for end in ends:
            block, start = self.log[start:end], end
            waiting += [stamp for kind, stamp, _ in block if kind == "input"]
            estimates = [(stamp, count) for kind, stamp, count in block if kind == "estimate"]
            live.add_recorded(*np.array(estimates, dtype=np.int64).reshape(-1, 2).T)
            found = live.decide(np.array(waiting, dtype=np.int64), final=end == len(self.log))
            restarts += [len(used) + place for place in found.restarts]
            used += found.used.tolist()
            del waiting[: found.reached]
        return live, used, restarts

    def agrees(self, cuts=()):
        _, used, restarts = self.decided(cuts)
        return used == self.used and restarts == self.restarts


some = st.integers(1, 12)
# What follows a recorded stretch and can be told: inputs that were not used, inputs whose
# estimates were not recorded, or a new process, up and running before the recorder hears it.
gap = st.one_of(
    st.tuples(st.tuples(st.just("unused"), some)),
    st.tuples(st.tuples(st.just("unrecorded"), some)),
    st.tuples(
        st.tuples(st.just("unused"), st.integers(0, 12)),
        st.tuples(st.just("restart"), st.integers(0, 5)),
    ),
)
# Long enough that the counter of a new process starts below.
recorded = st.tuples(st.just("recorded"), st.integers(6, 14))
beginning = st.tuples(
    st.tuples(st.just("unused"), st.integers(0, 12)),
    st.tuples(st.just("restart"), st.integers(0, 5)),
    recorded,
)
runs = st.builds(
    lambda first, rest, last: [
        *first, *(s for segments, r in rest for s in (*segments, r)), ("unrecorded", last)
    ],
    beginning, st.lists(st.tuples(gap, recorded), max_size=6), st.integers(0, 8),
)  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(runs, st.lists(st.integers(0, FAR), max_size=8), st.integers(0, 4))
def test_the_decision_is_right_wherever_the_recording_is_cut(segments, cuts, delay):
    live = Live(segments, delay)
    assert live.agrees(cuts)
    assert live.decided(cuts)[0].remarks() == ()


def test_an_estimator_that_starts_long_after_the_recorder_has_used_nothing_before():
    live = Live([("unused", 50), ("recorded", 20)], step=500 * MS)
    assert 50 * 500 * MS > 2 * PATIENCE_NS
    assert live.agrees(range(len(live.log)))


def test_inputs_wait_for_their_estimates_no_longer_than_needed():
    live = InputMatcher()
    live.add_recorded(np.array([0]), np.array([1]))
    stamps = np.arange(0, PATIENCE_NS + 10 * MS, MS)
    assert live.decide(stamps).reached == 10  # all but those within the patience
    assert live.decide(stamps[10:]).reached == 0


def test_a_recording_that_begins_late_says_how_late():
    live = InputMatcher()
    stamps = np.arange(0, 10 * MS, MS)
    live.add_recorded(stamps[2:], np.arange(5003, 5011))
    found = live.decide(stamps, final=True)
    assert found.used.all()
    assert found.restarts == []
    assert live.used_before == 5000
    (line,) = live.remarks()
    assert "had used 5000 inputs" in line


def test_what_cannot_be_told_is_said():
    """Tests that an ambiguous use of inputs is reported."""
    live = InputMatcher()
    stamps = np.arange(0, 6 * MS, MS)
    live.add_recorded(stamps[[0, 5]], np.array([1, 4]))
    assert live.decide(stamps, final=True).used.all()
    assert live.unclear == 4
    (line,) = live.remarks()
    assert "which of 4 inputs" in line


def test_mixed_estimates_of_two_nodes_restart_at_an_input_that_is_there():
    """Tests the restart of mixed estimates of two nodes whose stamps go back."""
    matcher = InputMatcher()
    matcher.add_recorded(np.array([5, 100, 15]), np.array([1, 2, 1]))
    decision = matcher.decide(np.array([5, 10, 15, 20]), final=True)
    assert decision.reached == 4
    assert all(place < decision.reached for place in decision.restarts)
    KnownState(None).follow(np.array([5, 10, 15, 20]), decision)


class Told:
    """Verifier that records which stamps are excluded from the comparison."""

    def __init__(self):
        self.found, self.lost = [], []

    def find(self, until_ns):
        self.found.append(until_ns)

    def lose(self, after_ns, why):
        self.lost.append(after_ns)


def state(stamp, used):
    return RecordedState(stamp, used, SimpleNamespace(sample=SimpleNamespace(stamp_ns=stamp)), ())


@pytest.mark.parametrize("cut", [1, 2, 3])
def test_comparisons_are_checked_from_the_first_replayed_estimate_on(cut):
    """An image between state and next estimate needs an estimate that is not replayed."""
    estimate, comparison = Told(), Told()
    known = KnownState(estimate, comparison=comparison)
    stamps, counts = np.arange(10, 50, 10), np.arange(101, 105)
    known.add([state(20, 102)])
    for part in (slice(cut), slice(cut, None)):
        used = np.ones(len(stamps[part]), dtype=bool)
        known.follow(stamps[part], Decision(len(used), used, [], counts[part]))
    assert (estimate.found, comparison.found) == ([20], [30])
    assert len(comparison.lost) == len(estimate.lost) == 1


def test_a_loss_behind_a_state_resumes_and_suspends_comparisons():
    comparison = Told()
    known = KnownState(None, comparison=comparison)
    known.add([state(10, 101)])
    known.follow(np.array([10]), Decision(1, np.array([True]), [], np.array([101])))
    known.follow(np.array([50]), Decision(1, np.array([True]), [], np.array([105])))
    assert comparison.lost[1:] == [10]
    assert comparison.found == [50]

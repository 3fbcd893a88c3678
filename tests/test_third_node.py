"""Tests that a third node in the replay's table is run and compared with the recording."""

import numpy as np
import pytest

from slosh_msgs_py.topics import ESTIMATE
from slosh_replay import replay_bag
from slosh_replay.manifest import Expectation
from slosh_replay.recording.sources import ESTIMATE as ESTIMATE_TYPE
from slosh_replay.replay.checking import check_result
from slosh_replay.replay.nodes import NodeTopic, ReplayedNode
from slosh_replay.replay.verification import Messages
from slosh_testing.live_bag import START, TYPES, LiveBag

VECTOR = "geometry_msgs/msg/Vector3Stamped"
HEIGHT = "nonlinear.msh"
RAISED = 0.25


class Peak:
    """Replayed node that returns the greatest estimate, raised by another topic's value."""

    def __init__(self, setting) -> None:
        self.peak = self.raised = 0.0

    def update(self, moment):
        for value in moment.messages["raise"].columns.get("vector.x", ()):
            self.raised = value
        estimates = moment.messages[ESTIMATE]
        if not len(estimates.stamps):
            return {}
        peaks = np.maximum.accumulate(np.append(self.peak, estimates.columns[HEIGHT]))[1:]
        self.peak = peaks[-1]
        return {"peak": Messages(estimates.stamps, {"vector.x": peaks + self.raised})}


ROW = ReplayedNode(
    "peak_holder",
    Peak,
    inputs=(NodeTopic(ESTIMATE, ESTIMATE_TYPE), NodeTopic("raise", VECTOR, ("vector.x",))),
    outputs=(NodeTopic("peak", VECTOR, ("vector.x",)),),
)


class PeakBag(LiveBag):
    """Recording of this node, whose first result is wrong by `change`."""

    def __init__(self, change: float) -> None:
        super().__init__()
        self._wrong, self._peak = change, 0.0

    def entries(self, seconds):
        found = super().entries(seconds)
        self._vector("raise", START, START, RAISED)
        return found

    def _estimate(self, estimator, estimate, gate, log_ns):
        super()._estimate(estimator, estimate, gate, log_ns)
        self._peak = max(self._peak, estimate.nonlinear.msh)
        self._vector("peak", estimate.sample.stamp_ns, log_ns, self._peak + RAISED + self._wrong)
        self._wrong = 0.0

    def _vector(self, topic, stamp, log_ns, value):
        vector = self._types["geometry_msgs/msg/Vector3"](value, 0.0, 0.0)
        self._put(topic, stamp, log_ns, vector=vector)


@pytest.fixture
def bag(tmp_path, monkeypatch):
    monkeypatch.setitem(TYPES, "raise", VECTOR)
    monkeypatch.setitem(TYPES, "peak", VECTOR)
    return lambda change=0.0: PeakBag(change).write(tmp_path / "bag")


def failures(result):
    return check_result(result, Expectation(tolerance=0.0)).failures


def test_its_messages_come_out_again_bit_for_bit(bag):
    recording = bag()
    result, without = replay_bag(recording, further=[ROW]), replay_bag(recording)
    found = result.verified["peak"]
    assert found.exact, found.lines()
    assert (found.topic, found.recorded) == ("/slosh/peak", result.verification.recorded)
    assert failures(result) == ()
    # The other nodes do not notice it.
    assert (result.accuracy, result.events) == (without.accuracy, without.events)
    assert result.verification == without.verification


@pytest.mark.parametrize(("tolerance", "failing"), [(0.0, True), (1e-3, False), (None, False)])
def test_a_difference_fails_beyond_the_tolerance_of_its_row(bag, tolerance, failing):
    result = replay_bag(bag(change=1e-6), further=[ROW._replace(tolerance=tolerance)])
    found = result.verified["peak"]
    assert found.identical == found.recorded - 1
    assert any("/slosh/peak: first difference" in line for line in failures(result)) == failing

"""Tests a planned motion in the simulated cell: predicted, measured and recorded."""

import math

import pytest
from planned_cell import LIMITS, planned, play

from slosh_bag.reader import BagReader
from slosh_bringup.live.report import make_live_report
from slosh_msgs.msg import MotionPrediction
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_plan.planning import optimise

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not optimise.available(), reason="no CasADi (requirements/plan.txt)"),
]

TOPICS = {f"/slosh/{name}" for name in ("planned_trajectory", "prediction", "prediction_outcome")}


@pytest.fixture(scope="module")
def line(tmp_path_factory, domain):
    """Plans and plays a line of 0.4 m; returns the plan and the path of the bag."""
    folder = tmp_path_factory.mktemp("line")
    return play("p2p", planned("p2p"), folder, domain, record=True), folder / "bag"


def test_the_motion_is_predicted_before_it_begins(line):
    played, _ = line
    prediction = played.prediction
    assert played.ahead > 0.5
    assert prediction.state == MotionPrediction.KEPT
    assert prediction.duration == pytest.approx(played.plan.found.motion.duration)
    # The sensors' noise has set the estimated liquid in motion, a little.
    assert prediction.peak == pytest.approx(played.plan.found.peak, abs=5e-4)


def test_predicted_estimated_and_measured_peak_agree(line):
    played, _ = line
    outcome = played.outcome
    assert outcome.id == played.prediction.id
    assert outcome.counted, outcome.description
    assert outcome.count == 1
    assert outcome.predicted == played.prediction.peak
    assert outcome.measured == pytest.approx(outcome.predicted, abs=1e-3)
    assert outcome.estimated == pytest.approx(outcome.predicted, abs=1e-3)
    assert outcome.sigma == pytest.approx(abs(outcome.error))
    assert math.isfinite(outcome.epsilon)
    began, said = to_nanoseconds(outcome.start), to_nanoseconds(played.prediction.start)
    assert abs(began - said) < 0.3e9
    # What was promised: the simulated liquid, damped otherwise, stays below the limit.
    assert played.truth <= LIMITS.height * 1.02


def test_the_report_tells_of_it(line):
    played, bag = line
    page = make_live_report(bag, "a line").page
    assert "planned motion 1" in page
    assert f"{1e3 * played.outcome.measured:.1f} mm measured" in page


def test_both_are_in_the_bag(line):
    played, bag = line
    reader = BagReader(bag)
    said = {one.topic: reader.decode(one) for one in reader.messages(TOPICS)}
    assert said["/slosh/prediction"].peak == played.prediction.peak
    assert said["/slosh/prediction_outcome"].measured == played.outcome.measured
    assert len(said["/slosh/planned_trajectory"].points) > 500

"""Tests changed parameters and a requested state in a running cell of real processes."""

import math

import pytest
import rclpy
from geometry_msgs.msg import AccelStamped
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from slosh_bringup.live.report import make_live_report
from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_estimator.limits import Source
from slosh_msgs.msg import FreeSurface, LimitEvent
from slosh_msgs.srv import PredictSlosh
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_testing.hearing_robot import HearingRobot
from slosh_testing.journaled import replayed_by_journal

RATE = 200
IMAGE_EVERY = 4
STILL = 400
READERS = {
    topics.ACCEL: {"estimator", "recorder"},
    topics.ESTIMATE: {"monitor", "predictor", "recorder", "robot"},
    topics.FREE_SURFACE: {"monitor", "recorder"},
    topics.LIMIT_EVENT: {"recorder", "robot"},
}


class Cell(HearingRobot):
    """Node processes, and a simulated robot with a camera that reads the estimates.

    Attributes:
        group: of the processes.
        events: that came so far.
    """

    def __init__(self, group: NodeGroup, nodes: tuple[NodeProcess, ...]) -> None:
        self.group = group
        for process in nodes:
            group.start(process)
        super().__init__()
        self.events = self.listen(LimitEvent, topics.LIMIT_EVENT, qos.EVENT)
        self._sent = self._shown = self._began_ns = 0
        self._accel = self.node.create_publisher(AccelStamped, topics.ACCEL, qos.STREAM_OUT)
        self._surface = self.node.create_publisher(
            FreeSurface, topics.FREE_SURFACE, qos.STREAM_OUT
        )
        # What comes before the recorder listens would lack in the bag.
        self.until(lambda: all(self._is_read(topic, nodes) for topic in READERS))
        if any(process.name == "monitor" for process in nodes):
            # It learns the rim from the estimator: before the first input, or that is a change.
            self.until(lambda: self.fact("monitor", "rim [mm]"), "the rim")
        self.node.create_timer(1.0 / RATE, self._move)
        self.until(lambda: self._sent > STILL + 20 and len(self.estimates) > 20)

    def _is_read(self, topic: str, nodes: tuple[NodeProcess, ...]) -> bool:
        # By their number: the middleware may know a reader long before its node's name.
        readers = READERS[topic] & {"robot", *(process.name for process in nodes)}
        return self.node.count_subscribers(topic) >= len(readers)

    def _move(self) -> None:
        message = AccelStamped()
        now = self.node.get_clock().now()
        message.header.stamp = now.to_msg()
        message.header.frame_id = "world"
        # The recorder may hear the first messages late: until then the liquid rests.
        # By the clock: on a busy machine the timer comes late, and the wave would stay low.
        self._began_ns = now.nanoseconds if self._sent <= STILL else self._began_ns
        moved = 1e-9 * (now.nanoseconds - self._began_ns)
        message.accel.linear.x = 2.5 * math.sin(15.0 * moved)
        self._sent += 1
        self._accel.publish(message)
        for estimate in self.estimates[self._shown + IMAGE_EVERY - 1 :: IMAGE_EVERY]:
            self._shown += IMAGE_EVERY
            surface = FreeSurface(msh=estimate.nonlinear.msh + 0.001, azimuth=0.0)
            surface.header = estimate.header
            self._surface.publish(surface)

    def go_on(self, count: int = 100) -> None:
        """Waits for a number of further estimates."""
        wanted = len(self.estimates) + count
        self.until(lambda: len(self.estimates) >= wanted)

    def change(self, node: str, **values):
        """Sets several parameters of a node together; returns the result."""
        request = SetParametersAtomically.Request(parameters=messages(values))
        name = f"{node}/set_parameters_atomically"
        return self.call(SetParametersAtomically, name, request).result


def messages(values) -> list[ParameterMessage]:
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]


@pytest.fixture
def start(tmp_path, domain):
    model = {"model": str(config_folder() / "truth.yaml")}
    groups, cells = [], []

    def begin(**nodes) -> Cell:
        rclpy.init(domain_id=domain)
        groups.append(NodeGroup("/slosh", tmp_path / "logs", node_environment(domain)).__enter__())
        processes = tuple(
            NodeProcess(name, parameters={**(model if "model" in given else {}), **{
                key: value for key, value in given.items() if key != "model"
            }})
            for name, given in nodes.items()
        )  # fmt: skip
        cells.append(Cell(groups[-1], processes))
        return cells[-1]

    yield begin
    for group in groups:
        group.__exit__(None, None, None)
    for cell in cells:  # else its publishers stay, and the next test's cell hears them
        cell.close()
    rclpy.try_shutdown()


@pytest.mark.parametrize("executor", ["events", pytest.param("single", marks=pytest.mark.long)])
def test_each_prediction_starts_from_the_newest_estimate(start, monkeypatch, executor):
    monkeypatch.setenv("SLOSH_EXECUTOR", executor)
    # A pause of the machine is no gap here.
    cell = start(estimator={"model": "", "max_gap": "1.0"}, predictor={"model": ""})
    request = PredictSlosh.Request(from_estimate=True, no_time_scales=True)
    request.time, request.limit = [0.0, 0.1, 0.2], math.nan
    request.acceleration_x = request.acceleration_y = request.acceleration_z = [0.0] * 3
    cell.call(PredictSlosh, topics.PREDICT, request)
    answers = []
    for _ in range(20):
        cell.go_on(10)
        answers.append(cell.call(PredictSlosh, topics.PREDICT, request))
    assert [answer.message for answer in answers if not answer.success] == []
    assert len({answer.peak_nonlinear for answer in answers}) == 20


@pytest.fixture
def recorded(start, tmp_path):
    """Records a cell whose limits change; returns process names and the path of the bag."""
    bag = tmp_path / "bag"
    limits = {"measured_limit": "1.0", "estimated_limit": "1.0", "disagreement_limit": "1.0"}
    cell = start(
        recorder={"output": str(bag)},
        monitor=limits,
        estimator={"model": ""},
    )
    cell.await_settings("estimator", "monitor")
    cell.go_on()
    assert cell.change("estimator", max_jump=0.1, max_gap=0.2).successful
    cell.until(lambda: cell.estimates[-1].samples_dropped > 20)
    assert cell.change("estimator", max_jump=20.0).successful
    cell.go_on(150)
    highest = max(estimate.nonlinear.msh for estimate in cell.estimates[-150:])
    assert cell.change("monitor", measured_limit=highest, estimated_limit=0.5 * highest).successful
    cell.until(lambda: len(cell.events) > 3)
    # So long that the event goes on until the last change.
    assert cell.change("monitor", estimated_limit=0.4 * highest, release=0.5, hold=2.0).successful
    cell.go_on(150)
    assert cell.change("monitor", estimated_limit=1.0, measured_limit=1.0).successful
    cell.go_on(50)
    cell.group.stop()
    return cell, bag


def told(events) -> list[tuple]:
    return sorted((e.source, e.stamp_ns, e.kind, e.limit, e.peak, e.description) for e in events)


def test_a_recording_with_changes_replays_bit_for_bit_and_is_reported(recorded):
    cell, bag = recorded
    result = replayed_by_journal(bag)
    assert result.verification.exact, result.verification.lines()
    assert result.comparisons.exact, result.comparisons.lines()
    assert result.limits.estimated_limit == 1.0
    # Before the first input the monitor learns the rim from the estimator.
    changes = [settings for stamp_ns, settings in result.limit_changes if stamp_ns]
    assert len(changes) == 3
    live = [
        (e.source, to_nanoseconds(e.header.stamp), e.kind, e.limit, e.peak, e.description)
        for e in cell.events
    ]
    assert told(result.events) == sorted(live)
    # The last limit is the rim, which no wave need reach.
    set_limits = [min(settings.estimated_limit, settings.rim) for settings in changes]
    limits = {limit for source, _, _, limit, *_ in live if source == Source.ESTIMATED}
    assert set(set_limits[:2]) <= limits <= set(set_limits)
    assert any("limit changed to" in words for *_, words in live)

    page = make_live_report(bag, "changed").page
    assert "estimator: max_jump changed from 20.0 to 0.1 after" in page
    assert "monitor: hold changed from 0.1 to 2.0 after" in page

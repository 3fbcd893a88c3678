"""The monitor's state on real processes: silence, a clock that stands, sides that disagree."""

import cmath
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
import rclpy
from std_srvs.srv import Trigger

from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_msgs.msg import FreeSurface, LimitEvent, SloshComparison
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_testing.robot import MODEL, Robot, nodes_and_robot, swing

OK, WARN, ERROR = SloshComparison.STATE_OK, SloshComparison.STATE_WARN, SloshComparison.STATE_ERROR
STALE, BLIND = SloshComparison.STATE_STALE, SloshComparison.STATE_BLIND
pytestmark = pytest.mark.timeout(200)


@contextmanager
def monitor_alone(
    folder: Path, domain: int, namespace: str, **nodes: dict[str, str]
) -> Iterator[tuple[NodeGroup, Robot]]:
    """Nodes, by name with their parameters, and a robot that has not spoken yet."""
    (folder / "model.yaml").write_text(MODEL)
    with ExitStack() as stack:
        if not rclpy.ok():
            rclpy.init()
            stack.callback(rclpy.shutdown)
        environment = node_environment(domain)
        group = stack.enter_context(NodeGroup(namespace, folder / "logs", environment))
        robot = Robot("robot", topics.ACCEL, namespace)
        stack.callback(robot.close)
        robot.listen()
        for name, values in nodes.items():
            group.start(NodeProcess(name, (), values))
        robot.until(lambda: "monitor" in robot.health, "the monitor", speak=False)
        yield group, robot
        assert group.failed() is None


def by_report(robot: Robot, reports: int) -> list[list[SloshComparison]]:
    """The comparisons that come between the monitor's reports, which come once a second."""
    found = []
    for _ in range(reports):
        robot.health.pop("monitor", None)
        count = len(robot.comparisons)
        robot.until(lambda: "monitor" in robot.health, "a report", speak=False)
        found.append(robot.comparisons[count:])
    return found[1:]  # the first may have begun anywhere in its second


@pytest.mark.long
def test_a_monitor_that_hears_nothing_says_so_at_least_twice_a_second(
    tmp_path: Path, domain: int
) -> None:
    with monitor_alone(tmp_path, domain, "/silent", monitor={}) as (_, robot):
        robot.until(lambda: robot.comparisons, "a heartbeat", speak=False)
        seconds = by_report(robot, 4)
        assert [len(second) >= 2 for second in seconds] == [True] * 3
        for one in robot.comparisons:
            assert one.state == STALE
            assert one.measured_stale
            assert one.estimate_stale
            assert math.isnan(one.measured)
            assert math.isnan(one.estimated_nonlinear)
            assert to_nanoseconds(one.header.stamp) == 0  # nothing has ever come


@pytest.mark.long
def test_a_simulated_clock_that_stands_is_never_ok(tmp_path: Path, domain: int) -> None:
    with monitor_alone(
        tmp_path, domain, "/standing",
        estimator={"model": str(tmp_path / "model.yaml")}, monitor={"use_sim_time": "true"},
    ) as (_, robot):  # fmt: skip
        robot.sees()
        robot.until(lambda: sum(one.count > 0 for one in robot.comparisons) > 100, "comparisons")
        assert {one.state for one in robot.comparisons} <= {STALE, BLIND}
        robot.until(lambda: "simulated time does not advance" in robot.health["monitor"][1], "why")
        robot.simulates(time.time_ns)
        robot.until(lambda: robot.comparisons[-1].state == OK, "the state OK with a clock")
        robot.simulates(None)
        stopped = time.monotonic()
        robot.until(lambda: robot.comparisons[-1].state in (STALE, BLIND), "the clock that stands")
        assert time.monotonic() - stopped < 5.0  # one second, on a machine that is not busy
        heard = len(robot.comparisons)
        robot.until(lambda: len(robot.comparisons) > heard + 50, "more comparisons")
        assert OK not in {one.state for one in robot.comparisons[heard:]}


@pytest.mark.first(1)
@pytest.mark.parametrize("constant", [0.0, 0.7])
def test_a_dead_accelerometer_under_a_wave(tmp_path: Path, domain: int, constant: float) -> None:
    with nodes_and_robot(tmp_path, domain, namespace="/dead") as (_, robot):
        robot.push = lambda t: constant
        robot.until(lambda: robot.estimates[-1].acceleration[0] == constant, "the constant")
        robot.for_seconds(2.0)  # the liquid of the model comes to rest

        def sees(condition: Callable[[], bool]) -> Callable[[], bool]:
            def look() -> bool:
                robot.surface.msh = 8.9e-3 * abs(math.sin(15.0 * time.time()))
                return condition()

            return look

        robot.until(sees(lambda: robot.comparisons[-1].sides_disagree), "the disagreement")
        robot.until(sees(lambda: robot.comparisons[-1].state == WARN), "the state WARN")
        robot.until(sees(lambda: robot.health["monitor"][0] == WARN), "the diagnostics")
        said = robot.health["monitor"][1]
        if constant == 0.0:
            assert said.startswith("the camera sees a wave of 8.")
            assert said.endswith("shows no motion: check the accelerometer")
        robot.surface.msh = 1e-4
        count = len(robot.comparisons)
        robot.until(lambda: len(robot.comparisons) > count + 20, "rest")
        assert robot.comparisons[-1].sides_disagree  # until a motion agrees, or a reset
        assert robot.call(Trigger, "monitor/reset").success
        robot.until(lambda: robot.comparisons[-1].state == OK, "the state OK")


class EchoingCamera:
    """Sees what is estimated, turned about the container's axis."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._taken = robot, len(robot.estimates)
        self._publisher = robot.node.create_publisher(
            FreeSurface, topics.FREE_SURFACE, qos.STREAM_OUT
        )
        self.turn = 0.0

    def look(self) -> None:
        """Measures at every fourth estimate that has come."""
        while self._taken < len(self._robot.estimates):
            estimate = self._robot.estimates[self._taken]
            self._taken += 4
            newest = estimate.nonlinear
            azimuth = cmath.phase(cmath.exp(1j * (newest.azimuth + self.turn)))
            surface = FreeSurface(msh=newest.msh, msh_stddev=1e-4, azimuth=azimuth)
            surface.fitted_msh, surface.fitted_azimuth = newest.msh, azimuth
            surface.header.stamp = estimate.header.stamp
            self._publisher.publish(surface)


@pytest.mark.long
@pytest.mark.parametrize("degrees", [90, pytest.param(180, marks=pytest.mark.long)])
def test_an_azimuth_that_is_wrong_reaches_the_state_within_the_motion(
    tmp_path: Path, domain: int, degrees: int
) -> None:
    with monitor_alone(
        tmp_path, domain, "/turned",
        estimator={"model": str(tmp_path / "model.yaml")}, monitor={},
    ) as (_, robot):  # fmt: skip
        robot.until(lambda: robot.estimates, "estimates")
        camera = EchoingCamera(robot)

        def moves(condition: Callable[[], object]) -> Callable[[], object]:
            def look() -> object:
                camera.look()
                return condition()

            return look

        def compared() -> list[SloshComparison]:
            return [one for one in robot.comparisons if not one.measured_stale]

        robot.push = swing(1.0)
        robot.until(moves(lambda: len(compared()) > 250), "five seconds")
        robot.until(moves(lambda: robot.comparisons[-1].state == OK), "the state OK")
        assert not any(one.sides_disagree for one in robot.comparisons)
        camera.turn = math.radians(degrees)
        robot.until(moves(lambda: robot.comparisons[-1].sides_disagree), "the disagreement")
        remedy = "degrees from the estimated one: check the yaw in sensor_rotation"
        robot.until(moves(lambda: remedy in robot.health["monitor"][1]), "the diagnostics")
        level, said = robot.health["monitor"]
        assert level == WARN
        assert abs(float(said.split(" is ")[1].split(" ")[0]) - degrees) < 25.0
        residuals = [one.residual_nonlinear for one in compared()]
        assert np.nanmax(np.abs(residuals)) < 1e-6  # the heights agree
        robot.until(moves(lambda: robot.comparisons[-1].state == WARN), "the state WARN")


@pytest.mark.long
def test_without_a_camera_the_estimate_alone_is_watched(tmp_path: Path, domain: int) -> None:
    with monitor_alone(
        tmp_path, domain, "/alone",
        estimator={"model": str(tmp_path / "model.yaml")},
        monitor={"camera": "false", "estimated_limit": "0.002"},
    ) as (_, robot):  # fmt: skip
        events: list[LimitEvent] = []
        robot.node.create_subscription(LimitEvent, topics.LIMIT_EVENT, events.append, qos.EVENT)
        robot.until(
            lambda: robot.comparisons and robot.comparisons[-1].state == OK, "the state OK"
        )
        robot.until(lambda: robot.health["monitor"] == (0, "OK; no camera configured"), "why")
        newest = robot.comparisons[-1]
        assert newest.without_camera
        assert not newest.measured_stale
        assert newest.estimated_nonlinear >= 0.0
        robot.push = swing(1.0)
        robot.until(lambda: robot.comparisons[-1].state == ERROR, "the limit")
        robot.until(lambda: events, "the event")
        assert events[0].source == LimitEvent.SOURCE_ESTIMATED
        robot.until(lambda: robot.comparisons[-1].state == STALE, "silence", speak=False)
        assert robot.comparisons[-1].estimate_stale
        assert not robot.comparisons[-1].measured_stale
        assert robot.comparisons[-1].without_camera


@pytest.mark.long
def test_images_of_a_camera_that_was_contested_are_flagged_no_more(
    tmp_path: Path, domain: int
) -> None:
    pytest.importorskip("cv2")
    from slosh_bringup.cell.renderer import CupRenderer
    from slosh_bringup.processes import config_folder
    from slosh_camera.calibrate.camera_file import read_calibration
    from slosh_msgs_py.images import image_message

    pixels = CupRenderer(read_calibration(config_folder() / "camera.yaml").view).render(0, 0)
    picture = image_message(pixels, "mono8", 0, "camera")
    with nodes_and_robot(tmp_path, domain, picture=picture, namespace="/rival") as (_, robot):
        surfaces: list[FreeSurface] = []
        robot.node.create_subscription(
            FreeSurface, topics.FREE_SURFACE, surfaces.append, qos.STREAM_IN
        )
        other = Robot("stranger", topics.ACCEL, "/rival")
        other.shows(picture)
        contested = FreeSurface.CONTESTED
        robot.until(lambda: surfaces and surfaces[-1].flags & contested, "the flag")
        # Both fall silent, then one ends; when the other speaks again, it is the only one.
        robot.until(lambda: "no image" in robot.health["camera"][1], "silence", speak=False)
        other.close()
        robot.until(
            lambda: robot.node.count_publishers(robot.node.resolve_topic_name(topics.IMAGE)) == 1,
            "one publisher",
            speak=False,
        )
        by_camera(robot)
        count = len(surfaces)
        robot.until(lambda: len(surfaces) > count + 5, "images again")
        assert not any(one.flags & contested for one in surfaces[count:])


def by_camera(robot: Robot) -> None:
    """Waits for two reports of the camera node; nobody speaks."""
    for _ in range(2):
        robot.health.pop("camera", None)
        robot.until(lambda: "camera" in robot.health, "a report", speak=False)

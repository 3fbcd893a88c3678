"""Tests that a cell survives any message, reports no wrong state and names the fault."""

import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import AccelStamped, PoseStamped
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from slosh_base.files.plain_text import LONGEST
from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_msgs.msg import SloshComparison, SloshEstimate
from slosh_msgs.srv import LoadModel
from slosh_msgs_py import topics
from slosh_msgs_py.images import image_message
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.robot import GRAVITY, MODEL, RobotNode, nodes_and_robot, swing

OK, BLIND = 0, 4
ERROR = 2
SETTLING = SloshEstimate.SETTLING
pytestmark = pytest.mark.timeout(200)
StartRobot = Callable[..., RobotNode]
CUP = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n"


@pytest.fixture(scope="module", autouse=True)
def ros() -> Iterator[None]:
    """Starts ROS in this process for all robots of the tests."""
    rclpy.init()
    yield
    rclpy.shutdown()


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory, domain: int) -> Iterator[StartRobot]:
    """Yields a function that starts robots, which run until the module's tests have ended."""
    with ExitStack() as stack:

        def start(name: str, kind: str = topics.ACCEL) -> RobotNode:
            folder = tmp_path_factory.mktemp(name)
            cell = nodes_and_robot(folder, domain, kind=kind, namespace=f"/{name}")
            return stack.enter_context(cell)[1]

        yield start


@pytest.fixture(scope="module")
def calm_one(robots: StartRobot) -> RobotNode:
    """Returns a robot for all tests in which the liquid stays at rest."""
    return robots("calm")


@pytest.fixture
def calm(calm_one: RobotNode) -> RobotNode:
    """Returns the robot with liquid at rest, after its monitor has reported OK."""
    wait_until_well(calm_one)
    return calm_one


@pytest.fixture(scope="module")
def rough_one(robots: StartRobot) -> RobotNode:
    """Returns a robot for all tests that move the liquid or load strange models."""
    return robots("rough")


@pytest.fixture
def rough(rough_one: RobotNode) -> RobotNode:
    """Returns the moving robot, after its monitor has reported OK."""
    rough_one.push = lambda t: 0.0
    assert rough_one.call(LoadModel, topics.LOAD_MODEL, text=MODEL).success
    # Its camera has not seen the waves of before.
    assert rough_one.call(Trigger, "monitor/reset").success
    wait_until_well(rough_one)
    return rough_one


@pytest.fixture(scope="module")
def inertial_one(robots: StartRobot) -> RobotNode:
    """Returns a robot with an inertial sensor."""
    return robots("imu", topics.IMU)


@pytest.fixture
def inertial(inertial_one: RobotNode) -> RobotNode:
    """Returns the robot with an inertial sensor, after its monitor has reported OK."""
    wait_until_well(inertial_one)
    return inertial_one


def wait_until_well(robot: RobotNode) -> None:
    """Waits until the monitor reports the state OK."""
    robot.until(lambda: robot.comparisons[-1].state == OK, "the state OK")


def is_blind(robot: RobotNode, reason: str) -> bool:
    """Returns whether the monitor reports BLIND on both of its topics."""
    _, sentence = robot.health.get("monitor", (0, ""))
    said = "BLIND" in sentence and reason in sentence
    return said and robot.comparisons[-1].state == BLIND


def from_now_on(robot: RobotNode, count: int) -> list[SloshEstimate]:
    """Returns the next estimates whose samples are sent after this call."""
    now, heard = time.time_ns(), len(robot.estimates)

    def new() -> list[SloshEstimate]:
        later = robot.estimates[heard:]
        return [one for one in later if to_nanoseconds(one.header.stamp) > now]

    robot.until(lambda: len(new()) >= count, "estimates")
    return new()


class TestBlind:
    """Tests that the monitor never reports OK while it cannot compare heights."""

    @pytest.mark.long
    @pytest.mark.parametrize(("shift", "way"), [(-10.0, "behind"), (10.0, "ahead of")])
    def test_a_camera_on_another_clock(self, calm: RobotNode, shift: float, way: str) -> None:
        calm.camera_shift = shift
        calm.until(lambda: is_blind(calm, f"s {way} those of the estimates"), "blindness")
        calm.camera_shift = 0.0

    @pytest.mark.long
    def test_a_second_publisher_ahead(self, rough: RobotNode) -> None:
        rough.push = swing(1.0)
        due = time.monotonic()

        def contested() -> bool:
            nonlocal due
            if time.monotonic() >= due:
                due += 0.01
                other.sample(ahead=5.0, ax=0.0)
            level, sentence = rough.health["estimator"]
            named = "/rough/robot" in sentence and "/rough/stranger" in sentence
            return level == ERROR and named and is_blind(rough, "several publishers")

        with closing(RobotNode("stranger", topics.ACCEL, "/rough")) as other:
            rough.until(contested, "both publishers' names")
            rough.until(
                lambda: contested() and rough.estimates[-1].nonlinear.msh > 2e-3, "the wave"
            )
        apart = to_nanoseconds(rough.estimates[-1].header.stamp) - time.time_ns()
        assert abs(apart) < 1_000_000_000
        rough.until(lambda: rough.comparisons[-1].state != BLIND, "sight again")

    @pytest.mark.first(1)
    @pytest.mark.parametrize("frame", ["", "nowhere", "\x1b[31m\n" * 30_000])
    def test_a_frame_that_nobody_knows(self, calm: RobotNode, frame: str) -> None:
        calm.frame = frame
        quoted = f"in frame {frame!r}"[:20]
        calm.until(lambda: quoted in calm.health["estimator"][1], "the reason")
        level, said = calm.health["estimator"]
        assert level == ERROR
        assert len(said) <= LONGEST
        assert "\x1b" not in said
        calm.until(lambda: calm.comparisons[-1].estimate_stale, "the monitor's word")
        calm.frame = "world"

    @pytest.mark.first(1)
    @pytest.mark.parametrize("gravity", [0.0, 1.0])
    def test_a_sensor_without_gravity(self, inertial: RobotNode, gravity: float) -> None:
        inertial.gravity = gravity
        inertial.until(lambda: is_blind(inertial, "is not plausible"), "blindness")
        inertial.until(lambda: inertial.health["estimator"][0] == ERROR, "the reason")
        inertial.gravity = GRAVITY

    @pytest.mark.long
    @pytest.mark.parametrize(
        "lens", ["upside down", pytest.param("covered", marks=pytest.mark.long)]
    )
    def test_images_that_show_nothing(self, lens: str, tmp_path: Path, domain: int) -> None:
        pixels = CupRenderer(read_calibration(config_folder() / "camera.yaml").view).render(0, 0)
        pixels = np.ascontiguousarray(pixels[::-1]) if lens == "upside down" else 0 * pixels
        picture = image_message(pixels, "mono8", 0, "camera")
        with nodes_and_robot(tmp_path, domain, picture=picture) as (_, robot):
            # With images coming: a busy machine may hold one up for a moment.
            def shows(reason: str) -> bool:
                return is_blind(robot, reason) and not robot.comparisons[-1].measured_stale

            robot.until(lambda: shows("NOT_FOUND"), f"blindness of a lens {lens}")
            picture.encoding = "mono17"
            robot.until(lambda: shows("BAD_IMAGE"), "blindness of a broken camera")
            if lens == "upside down":
                self.break_images(robot, picture)

    def break_images(self, robot: RobotNode, picture: Image) -> None:
        """Publishes images with contradictory sizes; checks that the camera node reports each."""
        picture.encoding, data = "mono8", picture.data
        whole = {"height": picture.height, "width": picture.width, "step": picture.step}
        for broken, said in (
            ({"height": 0, "width": 0}, "is empty"),
            ({"data": data[:1000]}, "1000 bytes do not match"),
            ({"step": picture.step - 1}, "is shorter than a row"),
            ({"height": 2**31, "width": 2**31, "step": 2**31}, "do not match 2147483648 rows"),
            ({"height": 240, "data": data[: 240 * picture.step]}, "the calibration is for"),
            ({"encoding": "\x1b[31m\n" * 30_000}, "encoding '"),
        ):
            for name, value in {"data": data, "encoding": "mono8", **whole, **broken}.items():
                setattr(picture, name, value)
            robot.until(lambda said=said: said in robot.health["camera"][1], said)
            assert robot.health["camera"][0] == ERROR
            assert len(robot.health["camera"][1]) <= LONGEST
            assert robot.comparisons[-1].state != OK


class TestUnknown:
    """Tests that estimates are flagged while the liquid's state is unknown."""

    @pytest.mark.long
    def test_a_reset_in_motion(self, rough: RobotNode) -> None:
        rough.push = swing(1.0)
        rough.until(lambda: rough.estimates[-1].nonlinear.msh > 2e-3, "a wave")
        assert rough.call(Trigger, "reset").success
        assert all(one.flags & SETTLING for one in from_now_on(rough, 50))
        rough.until(lambda: rough.comparisons[-1].state == BLIND, "blindness")

    def test_a_jump_that_stays(self, rough: RobotNode) -> None:
        rough.push = lambda t: 30.0
        rough.until(lambda: rough.estimates[-1].acceleration[0] == 30.0, "the new level")
        assert rough.estimates[-1].flags & SETTLING


class TestNoFall:
    """Tests that no single message ends a node."""

    @pytest.mark.first(3)
    @pytest.mark.parametrize(
        "text",
        [
            CUP.replace("0.05", "1e-300"),
            CUP.replace("0.07", "1e-300"),
            CUP + "liquid: {kinematic_viscosity: 1e-300}\n",
            CUP + "effects: [{name: static_tilt, roll: 0.3, pitch: 0.3}, "
            "{name: accel_gain, gain: 5}, {name: surface_nonlinearity, alpha: 50}]\n",
            CUP + "".join(f"k{n}: 1\n" for n in range(30_000)),
            "a0: &a0 [1, 1]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}]\n" for n in range(1, 60)),
            "\0\1",
        ],
    )
    def test_a_strange_model(self, rough: RobotNode, text: str) -> None:
        started = time.monotonic()
        answer = rough.call(LoadModel, topics.LOAD_MODEL, text=text)
        assert time.monotonic() - started < 5.0
        assert "\n" not in answer.message
        for push in (0.0, 1900.0, 0.0):
            rough.push = lambda t, push=push: push
            from_now_on(rough, 20)
        assert 0 <= rough.new_estimate().flags < 2**16

    def test_a_flood_of_calls(self, rough: RobotNode) -> None:
        client = rough.node.create_client(Trigger, topics.RESET)
        rough.until(client.service_is_ready, "the service")
        answers = [client.call_async(Trigger.Request()) for _ in range(1000)]
        # Some are lost where a thousand wait at once; the newest is not.
        rough.until(answers[-1].done, "an answer")
        rough.node.destroy_client(client)
        from_now_on(rough, 20)

    @pytest.mark.long
    def test_a_strange_pose(self, tmp_path: Path, domain: int) -> None:
        with nodes_and_robot(tmp_path, domain, kind=topics.POSE) as (_, robot):
            for size in (1e5, 1e160, 1.7e308, math.inf):
                message = PoseStamped()
                for vector in (message.pose.position, message.pose.orientation):
                    vector.x = vector.y = size
                for _ in range(30):
                    message.header.stamp = to_time(time.time_ns())
                    robot.inputs[topics.POSE].publish(message)
                    robot.for_seconds(0.005)
            robot.until(lambda: math.isfinite(robot.estimates[-1].nonlinear.msh), "a height")
            robot.new_estimate()

    @pytest.mark.long
    def test_stamps_at_the_ends_of_time(self, calm: RobotNode) -> None:
        for sec in (-(2**31), 2**31 - 1, 0):
            calm.surface.header.stamp.sec = sec
            for ahead in (sec - time.time(), 0.0):
                if abs(ahead + time.time()) < 2**31 - 1:
                    calm.sample(ahead=ahead)
            message = SloshEstimate()
            message.header.stamp.sec = sec
            calm.for_seconds(0.1)
        calm.until(lambda: calm.comparisons[-1].state == SloshComparison.STATE_OK, "the state OK")

    def test_paths_that_are_no_models(self, calm: RobotNode, tmp_path: Path) -> None:
        os.mkfifo(tmp_path / "pipe")
        secret = tmp_path / "secret"
        secret.write_text("root:x:0:0:root:/root:/bin/sh\nkey: hunter2\n")
        for path in map(str, ("/dev/zero", "/dev/stdin", tmp_path / "pipe", tmp_path, secret)):
            answer = calm.call(LoadModel, topics.LOAD_MODEL, path=path)
            assert not answer.success
            assert answer.message.startswith(path)
            assert "root:x" not in answer.message
            assert "hunter2" not in answer.message
        calm.new_estimate()

    def test_a_burst_of_samples_and_of_the_same_ones(self, calm: RobotNode) -> None:
        message = AccelStamped()
        message.header.frame_id = "world"
        before = calm.new_estimate()
        message.header.stamp = to_time(time.time_ns())
        for _ in range(5000):
            calm.inputs[topics.ACCEL].publish(message)
        calm.until(lambda: calm.estimates[-1].samples_dropped > before.samples_dropped, "drops")
        worst = max(estimate.nonlinear.msh for estimate in from_now_on(calm, 20))
        assert worst < 1e-6

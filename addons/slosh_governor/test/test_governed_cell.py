"""Tests `slosh cell` with a governor: robot, recording, replay and page."""

import json
import signal

import pytest
import rclpy
import yaml
from geometry_msgs.msg import AccelStamped, TwistStamped

from slosh_bringup.processes import config_folder
from slosh_bringup.watch.recording import RecordedFrames
from slosh_msgs.msg import GovernedMotion
from slosh_msgs_py import topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import Graph
from slosh_testing.journaled import replayed_by_journal
from slosh_testing.live_processes import live_process

LIMIT, RATE = 0.012, 50.0
pytestmark = [pytest.mark.long, pytest.mark.timeout(200)]


class Robot(Graph):
    """ROS node of a robot that commands a velocity and moves as the governor tells it to."""

    def __init__(self):
        super().__init__("robot", topics.NAMESPACE)
        self.moved = []
        self.speed, self.heard = 0.0, False
        self.commands = self.publisher(TwistStamped, topics.DESIRED_TWIST)
        self.accel = self.publisher(AccelStamped, topics.ACCEL)
        self.node.create_subscription(GovernedMotion, topics.GOVERNED_MOTION, self.move, 10)

    def await_recorder(self):
        """Moves only once governor, estimator and recorder hear it: all must be recorded."""
        sent = (self.commands, self.accel)
        self.until(lambda: all(one.get_subscription_count() >= 2 for one in sent), "the recorder")
        self.heard = True

    def move(self, governed):
        if not self.heard:
            return
        self.moved.append(governed)
        message = AccelStamped()
        # A robot interpolates by its own clock, whose steps are even.
        begun = to_nanoseconds(self.moved[0].header.stamp)
        reached = begun + round(1e9 * len(self.moved) / RATE)
        message.header.stamp, message.header.frame_id = to_time(reached), "world"
        message.accel.linear.x = governed.acceleration[0]
        self.accel.publish(message)
        command = TwistStamped()
        command.header.stamp = governed.header.stamp
        command.twist.linear.x = self.speed
        self.commands.publish(command)

    def follow(self, speed, steps):
        self.speed, end = speed, len(self.moved) + steps
        self.until(lambda: len(self.moved) >= end, f"{steps} steps")


def test_a_robot_that_follows_the_governor_spills_nothing(domain, tmp_path):
    path, parameters = tmp_path / "cell.yaml", tmp_path / "nodes.yaml"
    own = {"limit": LIMIT, "rate": RATE, "timeout": 1.0}
    parameters.write_text(yaml.safe_dump({"/**": {"governor": {"ros__parameters": own}}}))
    document = {"model": str(config_folder() / "model.yaml"), "camera": "none",
                "govern": "twist", "parameters": parameters.name}  # fmt: skip
    path.write_text(yaml.safe_dump(document))
    words = ("cell", "--config", str(path), "-o", str(tmp_path / "out"))
    rclpy.init()
    try:
        with live_process(*words, output=tmp_path / "words") as running:
            running.wait_until_ready()
            robot = Robot()
            robot.await_recorder()
            robot.follow(0.0, 30)
            for speed in (0.6, -0.6, 0.05):
                robot.follow(speed, 40)
            robot.follow(0.0, 80)
            running.process.send_signal(signal.SIGINT)
            running.end()
            robot.close()
    finally:
        rclpy.try_shutdown()
    bag = tmp_path / "out" / "latest" / "bag"
    result = replayed_by_journal(bag)
    found = result.verified[topics.GOVERNED_MOTION]
    assert found.exact, found.lines()
    assert found.recorded > 150
    # It moved, in part, and the estimator says that the liquid kept the limit.
    shares = [one.share for one in robot.moved if one.commands_taken]
    assert min(shares) < 1.0
    assert max(abs(one.velocity[0]) for one in robot.moved) > 0.2
    frames = [json.loads(frame) for frame in RecordedFrames(bag).frames]
    highest = max(row[2] for frame in frames for row in frame["rows"] if row[2] is not None)
    assert 0.3 * LIMIT < highest <= LIMIT
    shown = [figure for frame in frames for figure in frame["figures"]]
    assert {figure["title"] for figure in shown} == {"command followed"}
    assert min(figure["value"] for figure in shown) < 100.0

"""Tests the governor over DDS in simulated time: motion, limits, stops and their reasons."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from rclpy.node import Node
from std_srvs.srv import Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory

from slosh_governor.core import Governor, SeenLiquid
from slosh_governor.core.parameters import governor_of, velocity_command
from slosh_governor.nodes.governor_messages import governed_message
from slosh_governor.nodes.governor_node import GovernorNode
from slosh_model import Inputs, simulate
from slosh_model.model_text import format_model, parse_model
from slosh_msgs.msg import ContainerChange, FusedEstimate, GovernedMotion
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.node.diagnostics import ERROR, OK, WARN
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import SteppedGraph

TEXT = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
damping_ratio: auto
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity}]
"""
MODEL = parse_model(TEXT, "text")
RATE, LIMIT = 20.0, 0.012


class Cell(SteppedGraph):
    """The governor node, and a client that sends commands."""

    def __init__(self, model: Any, **given: Any) -> None:
        values = {
            "model": str(model), "limit": LIMIT, "rate": RATE, "timeout": 1.0,
            "starts_at_rest": True, **given,
        }  # fmt: skip
        super().__init__(
            GovernorNode, 1.0 / RATE, GovernedMotion, topics.GOVERNED_MOTION, **values
        )
        self.governor = self.tested
        self.safe = self.listen(TwistStamped, topics.SAFE_TWIST)
        kinds = {"twist": (TwistStamped, topics.DESIRED_TWIST),
                 "pose": (PoseStamped, topics.DESIRED_POSE)}  # fmt: skip
        self.commands = self.publisher(*kinds[given.get("command", "twist")])
        self.until(lambda: self.moved)

    def command(
        self, x: float, turn: float = 0.0, frame: str = "world", late: float | None = 0.0
    ) -> None:
        """Sends a command, stamped a time before now [s]; None: without a stamp."""
        message = TwistStamped()
        message.header.frame_id = frame
        if late is not None:
            message.header.stamp = to_time(self.now_ns - round(1e9 * late))
        message.twist.linear.x, message.twist.angular.y = x, turn
        self.send(self.commands, message, "command")

    def target(self, x: float) -> GovernedMotion:
        """Commands a place and makes a step."""
        message = PoseStamped()
        message.header.stamp, message.pose.position.x = to_time(self.now_ns), x
        self.send(self.commands, message, "command")
        return self.step()

    def follow(self, x: float, steps: int) -> GovernedMotion:
        """Commands a velocity for some steps; returns the last governed step."""
        for _ in range(steps):
            self.command(x)
            self.step()
        return self.moved[-1]

    def rest(self, reason: int) -> GovernedMotion:
        """Makes steps until the governor rests for a given reason."""
        self.step_until(lambda: (self.moved[-1].state, self.moved[-1].reason) == (
            GovernedMotion.RESTING, reason))  # fmt: skip
        return self.moved[-1]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    path = tmp_path_factory.mktemp("model") / "model.yaml"
    path.write_text(TEXT)
    rclpy.init()
    yield path
    rclpy.try_shutdown()


@pytest.fixture
def cell(model: Any) -> Iterator[Cell]:
    made = Cell(model)
    yield made
    made.close()


def test_it_limits_a_fast_command_and_says_so(cell: Cell) -> None:
    cell.follow(0.5, 40)
    moved = [one for one in cell.moved if one.commands_taken]
    assert all(one.safe and one.peak <= LIMIT and one.limit == LIMIT for one in moved)
    assert {one.unknown_because for one in moved} == {""}
    assert {one.state for one in moved} >= {GovernedMotion.FOLLOWING, GovernedMotion.LIMITED}
    assert moved[-1].velocity[0] > 0.2
    assert 0.0 < moved[-1].margin < LIMIT
    assert 0.0 <= moved[-1].command_age < 1.0
    assert np.diff([one.steps for one in moved]).tolist() == [1] * (len(moved) - 1)
    # The velocity for the robot is the same, and the liquid keeps the limit.
    cell.until(lambda: len(cell.safe) >= len(cell.moved))
    told = {to_nanoseconds(one.header.stamp): one.twist.linear.x for one in cell.safe}
    for one in moved:
        assert told[to_nanoseconds(one.header.stamp)] == one.velocity[0]
    rows = np.array([[0.0] * 3, *(one.acceleration for one in moved)])
    t = np.arange(len(rows)) / RATE
    assert simulate(MODEL, Inputs(t, rows))[0].msh.max() <= LIMIT
    assert cell.governor._health()[0] == OK
    assert cell.governor._facts()["step, 99th percentile [ms]"] > 0.0


def test_silence_nan_and_a_turn_stop_it_and_the_next_command_moves_it(cell: Cell) -> None:
    cell.follow(0.1, 10)
    cell.command(math.nan)
    assert cell.rest(GovernedMotion.INVALID).velocity.tolist() == [0.0] * 3
    level, told = cell.governor._health()
    assert level == WARN
    assert told.startswith("resting: invalid: the command has NaN")
    assert cell.follow(0.1, 20).velocity[0] > 0.05
    cell.command(0.1, turn=0.5)
    cell.rest(GovernedMotion.TURN)
    assert cell.follow(0.1, 20).velocity[0] > 0.05
    cell.rest(GovernedMotion.SILENT)
    assert "no usable command for longer than" in cell.governor._health()[1]


@pytest.mark.parametrize(
    ("reason", "wrong", "told"),
    [
        (GovernedMotion.TURN, {"turn": 0.3}, "resting: turn: the command turns the container"),
        (GovernedMotion.FAST, {"x": 200.0}, "desired_twist asks for 200 m/s .*not mm/s"),
        (GovernedMotion.FRAME, {"frame": "tool0"}, "in the frame 'tool0', not in 'world': send"),
        (GovernedMotion.INVALID, {"x": math.nan}, "resting: invalid: the command has NaN"),
        (GovernedMotion.STAMP, {"late": 3.0}, "is stamped 3 s before it came: set the clocks"),
        (GovernedMotion.STAMP, {"late": -6.0}, "is stamped 6 s after it came: set the clocks"),
    ],
)
def test_each_unusable_command_has_its_own_reason_also_after_a_silence(
    cell: Cell, reason: int, wrong: dict[str, Any], told: str
) -> None:
    cell.follow(0.1, 10)
    cell.rest(GovernedMotion.SILENT)
    cell.command(**{"x": 0.1, **wrong})
    assert cell.rest(reason).velocity.tolist() == [0.0] * 3
    level, sentence = cell.governor._health()
    assert level == WARN
    assert re.search(told, sentence), sentence
    assert cell.follow(0.1, 20).velocity[0] > 0.05


def test_the_frame_of_the_world_is_its_name_or_none(cell: Cell) -> None:
    for frame in ("world", "/world", ""):
        cell.command(0.1, frame=frame)
        assert cell.step().reason == GovernedMotion.NONE


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "$"),
        ({"frame": ""}, "; .*desired_twist: frame_id is empty, taken as 'world': set it$"),
        ({"late": None}, "; .*desired_twist: stamp is 0, taken as now: stamp it, so that"),
        ({"x": 15.0}, "; .*desired_twist: 15 m/s is more than robots do: send m/s, not mm/s"),
    ],
    ids=["usual", "no frame", "no stamp", "mm/s"],
)
def test_a_doubtful_command_is_followed_and_named(
    cell: Cell, given: dict[str, Any], told: str
) -> None:
    for _ in range(10):
        cell.command(**{"x": 0.1, **given})
        cell.step()
    assert cell.moved[-1].velocity[0] > 0.01
    assert {one.reason for one in cell.moved} == {GovernedMotion.NONE}
    level, sentence = cell.governor._health()
    assert level == (WARN if "x" in given else OK)
    assert re.search(f"^(following|limited){told}", sentence), sentence


def test_steps_that_come_late_are_told_and_the_next_ones_are_followed(cell: Cell) -> None:
    cell.follow(0.1, 20)
    cell.command(0.1)
    moved = cell.step(2.5)
    assert moved.unknown_wave > 0.0
    assert moved.unknown_because == "steps came late or early"
    cell.command(0.1)
    assert cell.step(4.0).reason == GovernedMotion.LATE
    assert cell.governor._health()[0] == ERROR
    cell.rest(GovernedMotion.LATE)
    cell.step_until(lambda: cell.follow(0.1, 1).velocity[0] > 0.05)
    assert cell.moved[-1].reason == GovernedMotion.NONE


def test_a_command_of_another_type_is_named(cell: Cell) -> None:
    # One process cannot have two types on a topic.
    context = rclpy.Context()
    rclpy.init(context=context)
    other = Node("joystick", context=context, namespace=cell.node.get_namespace())
    other.create_publisher(Twist, topics.DESIRED_TWIST, 10)
    try:
        cell.node.destroy_publisher(cell.commands)
        cell.until(lambda: cell.governor._health()[0] == WARN)
        _, told = cell.governor._health()
        assert re.search("published as geometry_msgs/msg/Twist, but must be .*Stamped$", told)
    finally:
        other.destroy_node()
        context.shutdown()


def test_an_emergency_stop_holds_until_it_is_released(cell: Cell) -> None:
    stops = cell.listen(MultiDOFJointTrajectory, topics.STOP_TRAJECTORY, qos.EVENT)
    before = cell.follow(0.2, 20)
    answer = cell.call(Trigger, topics.EMERGENCY_STOP, Trigger.Request())
    assert answer.success
    assert re.match(r"at rest in [\d.]+ s, \d+ mm from here; .* at most$", answer.message), (
        answer.message
    )
    cell.until(lambda: stops)
    points = stops[0].points
    assert points[0].velocities[0].linear.x == before.velocity[0]
    assert points[-1].velocities[0].linear.x == 0.0
    gap = points[1].time_from_start.nanosec - points[0].time_from_start.nanosec
    assert gap == 50_000_000
    refused = cell.call(Trigger, topics.RELEASE_STOP, Trigger.Request())
    assert not refused.success
    rest = cell.rest(GovernedMotion.REQUESTED)
    # It has gone as far as was told.
    gone = next(one.position[0] for one in cell.moved if one.steps == rest.steps)
    told = points[-1].transforms[0].translation.x
    begun = next(
        one for one in cell.moved
        if to_nanoseconds(one.header.stamp) == to_nanoseconds(stops[0].header.stamp)
    )  # fmt: skip
    assert told > 0.0
    assert gone - begun.position[0] == pytest.approx(told, abs=1e-9)
    assert cell.follow(0.2, 5).velocity[0] == 0.0
    assert cell.call(Trigger, topics.RELEASE_STOP, Trigger.Request()).success
    assert cell.follow(0.1, 20).velocity[0] > 0.05


def test_it_takes_trusted_states_of_the_liquid(cell: Cell) -> None:
    fused = cell.publisher(FusedEstimate, topics.FUSED_ESTIMATE)
    stamp = cell.moved[-1].header.stamp
    values = {"modal_position": [0.004, 0.0], "modal_velocity": [0.0, 0.0], "msh_stddev": 1e-4,
              "frequency_factor": 1.0}  # fmt: skip
    message = filled(FusedEstimate, stamp_ns=to_nanoseconds(stamp) + 1, trusted=False, **values)
    fused.publish(message)
    cell.follow(0.0, 3)
    assert to_nanoseconds(cell.moved[-1].liquid_stamp) == 0
    peak = cell.moved[-1].peak
    message.trusted, message.header.stamp = True, cell.moved[-1].header.stamp
    fused.publish(message)
    cell.step_until(lambda: to_nanoseconds(cell.moved[-1].liquid_stamp))
    assert cell.moved[-1].peak > peak + 0.003


def test_it_follows_targets(model: Any) -> None:
    cell = Cell(model, command="pose")
    try:
        for step in range(100):
            cell.target(1.0 if step < 5 else 1.1)
        assert cell.moved[-1].position[0] == pytest.approx(0.1, abs=0.005)
    finally:
        cell.close()


def test_a_target_stays_where_it_is_when_another_container_is_told(model: Any) -> None:
    cell = Cell(model, command="pose")
    change = cell.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    try:
        for step in range(14):
            cell.target(1.0 if step < 5 else 1.4)
        count = len(cell.moved)
        assert 0.0 < cell.moved[-1].position[0] < 0.3
        change.publish(filled(ContainerChange, present=True, model=TEXT, limit=0.011))
        for _ in range(600):
            last = cell.target(1.4)
            if abs(last.position[0] - 0.4) < 0.005 and abs(last.velocity[0]) < 0.01:
                break
        assert cell.moved[-1].position[0] == pytest.approx(0.4, abs=0.005)
        assert cell.moved[-1].limit == 0.011
        assert min(one.position[0] for one in cell.moved[count:]) > 0.0
    finally:
        cell.close()


def test_an_impossible_limit_of_a_container_is_not_followed(cell: Cell) -> None:
    change = cell.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    for limit in (1e300, -1.0, math.inf):
        change.publish(filled(ContainerChange, present=True, model=TEXT, limit=limit))
    change.publish(filled(ContainerChange, present=True, model=TEXT, limit=0.009))
    cell.step_until(lambda: cell.moved[-1].limit == 0.009)
    assert {one.limit for one in cell.moved} == {LIMIT, 0.009}


def test_another_container_is_governed_from_rest_on(cell: Cell) -> None:
    change = cell.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    other = parse_model(TEXT.replace("0.05", "0.03"), "text")
    cell.follow(0.1, 10)
    change.publish(filled(ContainerChange, present=True, model=format_model(other), limit=0.005))
    cell.step_until(lambda: cell.moved[-1].limit == 0.005)
    begun = next(one for one in cell.moved if one.limit == 0.005)
    assert begun.steps <= 1
    assert begun.velocity.tolist() == [0.0] * 3
    assert cell.follow(0.1, 20).velocity[0] > 0.03


def tray_text() -> str:
    """Returns the file text of a tray with a held and a loosely standing cup."""
    model = yaml.safe_load(TEXT)
    other = {**model, "container": {"shape": "cylinder", "radius": 0.035, "fill_height": 0.06}}
    loose = {"mass": 0.1, "centre_height": 0.04, "base_radius": 0.03, "friction": 0.1}
    return yaml.safe_dump({"containers": [
        {"name": "left", "model": model, "place": [-0.1, 0.0, 0.0], "limit": 0.009},
        {"name": "right", "model": other, "place": [0.1, 0.0, 0.0], "standing": loose},
    ]})  # fmt: skip


def test_a_tray_is_governed_by_its_worst_container(model: Any, tmp_path: Any) -> None:
    path = tmp_path / "tray.yaml"
    path.write_text(tray_text())
    cell = Cell(path)
    try:
        cell.follow(0.5, 40)
        moved = [one for one in cell.moved if one.steps]
        assert {one.worst_container for one in moved} == {"left", "right"}
        assert all(one.safe and max(one.friction_use, one.tipping_use) <= 1.0 for one in moved)
        assert max(one.friction_use for one in moved) > 0.8
        # Friction holds 0.1 g: more than that the tray never gets.
        assert max(abs(one.acceleration[0]) for one in moved) < 0.981
        assert moved[-1].velocity[0] > 0.2
    finally:
        cell.close()


def test_a_tray_that_is_put_in_is_not_known(cell: Cell) -> None:
    change = cell.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    cell.follow(0.1, 10)
    change.publish(filled(ContainerChange, present=True, model=TEXT, tray=tray_text()))
    cell.step_until(lambda: not math.isnan(cell.moved[-1].friction_use))
    cell.follow(0.5, 10)
    assert not cell.moved[-1].safe
    assert cell.moved[-1].unknown_because == "the liquid's state at the start is not known"
    level, text = cell.governor._health()
    assert level == ERROR
    assert "since the liquid's state at the start is not known" in text
    cell.follow(0.0, 2)
    change.publish(filled(ContainerChange, present=False, model=TEXT, tray=""))
    cell.step_until(lambda: cell.moved[-1].worst_container == "")


def test_the_same_container_told_again_changes_nothing(cell: Cell) -> None:
    change = cell.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    cell.follow(0.1, 10)
    same = filled(ContainerChange, present=True, model=format_model(MODEL), limit=math.nan)
    change.publish(same)
    heard = cell.governor._container._follows
    cell.until(lambda: cell.governor._container._follows or heard)
    core, steps = cell.governor._core, cell.moved[-1].steps
    moved = cell.follow(0.1, 20)
    assert cell.governor._core is core
    assert moved.steps == steps + 20
    assert moved.reason == GovernedMotion.NONE
    assert moved.velocity[0] > 0.05


def test_an_impossible_fused_state_is_named_and_the_node_goes_on(cell: Cell) -> None:
    fused = cell.publisher(FusedEstimate, topics.FUSED_ESTIMATE)
    cell.follow(0.1, 10)
    message = filled(
        FusedEstimate, stamp_ns=to_nanoseconds(cell.moved[-1].header.stamp), trusted=True,
        modal_position=[0.0, 0.0], modal_velocity=[0.0, 0.0], msh_stddev=-1.0,
        frequency_factor=1.0,
    )  # fmt: skip
    fused.publish(message)
    cell.until(lambda: cell.governor._unseen)
    assert "msh_stddev = -1 m must not be negative" in cell.governor._unseen
    message.msh_stddev, message.modal_position = 1e-4, [math.nan]
    fused.publish(message)
    cell.until(lambda: "lengths" in cell.governor._unseen)
    assert cell.governor._report.counts["fused_estimate refused"] == 2
    moved = cell.follow(0.1, 10)
    assert moved.velocity[0] > 0.05
    assert to_nanoseconds(moved.liquid_stamp) == 0
    assert "is not used" in cell.governor._health()[1]


def test_the_core_gives_the_same(cell: Cell) -> None:
    cell.follow(0.3, 15)
    values = dict(cell.governor._values)
    core = governor_of(MODEL, values, at_rest=True)
    taken = {to_nanoseconds(one.header.stamp) for one in cell.safe}
    assert taken
    assert isinstance(core, Governor)
    core.take(velocity_command(1, (0.3, 0.0, 0.0), (0.0, 0.0, 0.0)))
    core.see(SeenLiquid(0, np.zeros((1, 4)), math.nan))
    message = governed_message(core.step(2), "world")
    assert (message.steps, message.commands_taken, message.header.frame_id) == (1, 1, "world")

"""Tests that a replay reproduces the governor's steps from commands and fused estimates."""

from pathlib import Path

import numpy as np
import pytest

from slosh_bringup.replay.replayed_governor import governor_row
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import fused_fields
from slosh_estimator.robot import available
from slosh_model import format_model
from slosh_plan.governor import Command, Governed, SeenLiquid, StopReason
from slosh_plan.governor.parameters import arm_of, governor_of, velocity_command
from slosh_plan.joints import Arm
from slosh_plan.nodes.governor_parameters import PARAMETERS
from slosh_plan.robot_file import CarryingRobot
from slosh_replay import replay_bag
from slosh_replay.manifest import Expectation
from slosh_replay.replay.checking import check_result
from slosh_testing import live_bag
from slosh_testing.live_bag import MODEL, START, TYPES, LiveBag

TWIST, GOVERNED, FUSED = "desired_twist", "governed_motion", "fused_estimate"
VALUES = {one.name: one.default for one in PARAMETERS} | {"limit": 0.012}
ROBOT = VALUES | {"tool_frame": "cup"}
CARRYING = (0.1, 0.5, -1.1, 0.0)
EVERY, AHEAD = 5, 40_000_000
"""Inputs of 500 a second to a step; by how much the commands' clock is ahead [ns]."""


class GovernedBag(LiveBag):
    """A recording of a governor and of an estimator with an observer.

    Its first step tells a wrong share, by `wrong`; the first `cut` seconds are not recorded.
    """

    apart = EVERY
    """Inputs to a step."""

    def __init__(self, *, wrong: float = 0.0, cut: float = 0.0, ahead: int = 0) -> None:
        super().__init__()
        self._wrong, self._cut, self._ahead, self._count = wrong, cut, ahead, 0
        self._observer = Observer(self.model)
        self._governor = self._made()
        self.states = True

    def _made(self):
        return governor_of(self.model, VALUES, at_rest=True)

    def _lead(self, step):
        """Returns by how much the stamp of a step's command is ahead [ns]."""
        return self._ahead

    def _files(self):
        return {}

    def _locate(self, step, now, log_ns):
        """Tells the governor where the robot is."""

    def entries(self, seconds):
        begin = START + round(1e9 * self._cut)
        return [
            entry
            for entry in super().entries(seconds)
            if entry[0] >= begin or entry[1].endswith("settings")
        ]

    def _start(self, model, stamp, log_ns, **how):
        files = {"model": format_model(model), **self._files()}
        self._settings("governor", stamp, files, log_ns)
        return super()._start(model, stamp, log_ns, **how)

    def _estimate(self, estimator, estimate, gate, log_ns):
        super()._estimate(estimator, estimate, gate, log_ns)
        now = estimate.sample.stamp_ns
        self._count += 1
        state = self._observer.follow(estimate.sample, estimate.flags)
        if state is not None:
            modal = np.array(state.modal).reshape(-1, 4)
            self._put(
                FUSED, now, log_ns, modal_position=modal[:, :2].ravel(),
                modal_velocity=modal[:, 2:].ravel(), trusted=True, distance_to_rim=np.nan,
                **fused_fields(state, self._observer.counts),
            )  # fmt: skip
            seen = SeenLiquid(now, modal, state.msh_stddev, state.frequency_factor, 0.02)
            self._governor.see(seen)
        if self._count % self.apart == 0:
            self._move(now, log_ns)

    def _move(self, now, log_ns):
        step = self._count // self.apart
        if step % 2 == 0 and not 100 < step < 130:  # there is a silence
            speed = 0.3 * np.sign(np.sin(step / 20.0))
            sent = now - 1000 + self._lead(step)
            linear = self._types["geometry_msgs/msg/Vector3"](speed, 0.1, 0.0)
            angular = self._types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            twist = self._types["geometry_msgs/msg/Twist"](linear, angular)
            self._put(TWIST, sent, log_ns, twist=twist)
            self._governor.take(velocity_command(sent, (speed, 0.1, 0.0), (0.0, 0.0, 0.0)))
        if step == 200:
            self._governor.stop()
        self._locate(step, now, log_ns)
        self._tell(self._governor.step(now), now, log_ns)

    def _tell(self, moved, now, log_ns):
        rows = np.array(moved.joints).reshape(3, -1)
        time = self._types["builtin_interfaces/msg/Time"]
        self._put(
            GOVERNED, now, log_ns, velocity=np.array(moved.velocity),
            acceleration=np.array(moved.acceleration), position=np.array(moved.position),
            share=moved.share + self._wrong, state=int(moved.state), reason=int(moved.reason),
            safe=moved.safe, peak=moved.peak, margin=moved.margin, limit=moved.limit,
            stop_duration=moved.rest, command_age=moved.age, steps=moved.steps,
            commands_taken=moved.commands,
            liquid_stamp=time(*divmod(moved.liquid_ns, 1_000_000_000)),
            unknown_wave=moved.unknown, unknown_because=moved.unknown_cause,
            unknown_since=time(*divmod(moved.unknown_since_ns, 1_000_000_000)),
            worst_container=moved.worst, friction_use=moved.friction, tipping_use=moved.tipping,
            refused_by=moved.refused_by,
            target_velocity=np.array(moved.wanted[0]), target=np.array(moved.wanted[1]),
            joint_names=[], joint_position=rows[2], joint_velocity=rows[0],
            joint_acceleration=rows[1], joint_start=np.array(moved.joint_start, dtype=float),
        )  # fmt: skip
        self._wrong = 0.0


class MisdatedBag(GovernedBag):
    """One of steps that are too early, and of commands that are old or ahead by turns."""

    apart = EVERY - 1

    def _made(self):
        self.moved = []
        return super()._made()

    def _lead(self, step):
        return round(1e9 * {1: -3.0, 3: 6.0, 5: -1e9 / 7.0}.get(step // 40, 0.0))

    def _tell(self, moved, now, log_ns):
        self.moved.append(moved)
        super()._tell(moved, now, log_ns)


class CarriedBag(GovernedBag):
    """One of a robot whose joints carry the container: it strays once, and moves at rest."""

    def _made(self):
        link = Arm(self._files()["urdf"], ROBOT["tool_frame"])
        self.reasons = set()
        return governor_of(
            self.model, ROBOT, arm_of(CarryingRobot(link), CARRYING, ROBOT), at_rest=True
        )

    def _files(self):
        return {"urdf": (Path(__file__).resolve().parents[3] / "examples/robot.urdf").read_text()}

    def _locate(self, step, now, log_ns):
        if step == 1:
            self._tell(self._governor.idle(now), now, log_ns)
        places = self._governor.joints[2] + 0.02 * (self._governor.rests and step % 3 == 0)
        places[3] = 0.0
        places[0] += 0.5 * (30 <= step < 34)
        self._governor.locate(places)

    def _tell(self, moved, now, log_ns):
        self.reasons.add(moved.reason)
        super()._tell(moved, now, log_ns)


class ToldBag(GovernedBag):
    """One of targets, with a command that turns; then the container is told again."""

    _renewed: bool
    moved: list[Governed]

    def _move(self, now, log_ns):
        step = self._count // EVERY
        target = (0.0 if step < 5 else 0.3, 0.0, 0.0)
        turns = 40 <= step < 50
        spin = (0.0, 0.0, 0.5)
        sent = velocity_command(now, (0.1, 0.0, 0.0), spin) if turns else Command(now, (), target)
        self._governor.take(sent)
        before = self._governor
        if step == 120:
            before.stop()
        if step > 120 and before.rests and not self._renewed:
            self._governor, self._renewed = self._made(), True
            self._governor.go_on(before)
            self._settings("governor", now, {"model": format_model(self.model)}, log_ns)
            self._governor.take(sent)
        self.moved.append(self._governor.step(now))
        self._tell(self.moved[-1], now, log_ns)

    def _made(self):
        self._renewed, self.moved = hasattr(self, "_governor"), getattr(self, "moved", [])
        return super()._made()


@pytest.fixture(autouse=True)
def types(monkeypatch):
    monkeypatch.setitem(live_bag.PARAMETERS, "governor", ROBOT)
    monkeypatch.setitem(TYPES, TWIST, "geometry_msgs/msg/TwistStamped")
    monkeypatch.setitem(TYPES, GOVERNED, "slosh_msgs/msg/GovernedMotion")
    monkeypatch.setitem(TYPES, FUSED, "slosh_msgs/msg/FusedEstimate")


def replayed(bag, folder, seconds=3.0):
    result = replay_bag(bag.write(folder / "bag", seconds), further=[governor_row()])
    return result, result.verified[GOVERNED]


@pytest.mark.parametrize("ahead", [0, AHEAD])
def test_its_steps_come_out_again_bit_for_bit(tmp_path, ahead):
    result, found = replayed(GovernedBag(ahead=ahead), tmp_path)
    assert found.exact, found.lines()
    assert found.recorded == 500
    assert check_result(result, Expectation(tolerance=0.0)).failures == ()


def test_misdated_commands_and_early_steps_come_out_again(tmp_path):
    bag = MisdatedBag()
    _, found = replayed(bag, tmp_path)
    assert found.exact, found.lines()
    assert {one.reason for one in bag.moved} >= {StopReason.NONE, StopReason.STAMP}
    pairs = list(zip(bag.moved[:-1], bag.moved[1:], strict=True))
    assert any(one.commands < two.commands and one.position == two.position and two.velocity[0]
               for one, two in pairs)  # fmt: skip


@pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
def test_steps_with_a_robot_come_out_again_bit_for_bit(tmp_path):
    bag = CarriedBag()
    _, found = replayed(bag, tmp_path)
    assert found.exact, found.lines()
    assert found.recorded == 500
    assert bag.reasons == {StopReason.NONE, StopReason.SILENT, StopReason.JOINTS,
                           StopReason.REQUESTED}  # fmt: skip


def test_targets_come_out_again_after_a_turn_and_another_container(tmp_path):
    bag = ToldBag()
    _, found = replayed(bag, tmp_path, 5.0)
    assert found.exact, found.lines()
    assert found.recorded == len(bag.moved)
    assert {one.reason for one in bag.moved} >= {StopReason.TURN, StopReason.REQUESTED}
    assert [one.steps for one in bag.moved].count(1) == 2
    assert bag.moved[-1].position[0] == pytest.approx(0.3, abs=0.003)


def test_a_difference_is_told(tmp_path):
    result, found = replayed(GovernedBag(wrong=1e-9), tmp_path)
    assert found.identical == found.recorded - 1
    assert found.first.field == "share"
    assert check_result(result, Expectation(tolerance=0.0)).failures


def test_a_recording_from_the_middle_is_not_compared(tmp_path):
    result = replay_bag(GovernedBag(cut=1.0).write(tmp_path / "bag"), further=[governor_row()])
    assert GOVERNED not in result.verified or not result.verified[GOVERNED].missing
    assert MODEL.modes == 1

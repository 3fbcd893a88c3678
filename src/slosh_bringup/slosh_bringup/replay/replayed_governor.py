"""Replays the governor node step by step, with the commands and fused estimates that it used."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from fractions import Fraction
from typing import Any, Final, NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_model.tray import TRAY, parse_tray
from slosh_msgs_py.topics import FUSED_ESTIMATE, GOVERNED_MOTION, TOPICS
from slosh_plan.errors import SloshPlanError
from slosh_plan.governor import Command, Governed, Governor, SeenLiquid, StopReason
from slosh_plan.governor.parameters import arm_of, governor_of
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import GivenLimits, parse_joint_limits
from slosh_plan.robot_file import CarryingRobot
from slosh_replay.recording.settings import NodeStart, model_of
from slosh_replay.replay.nodes import Moment, NodeTopic, ReplayedNode, Setting, recorded_name
from slosh_replay.replay.verification import Messages

NODE: Final = "governor"
_TYPES = {row.name: row.type for row in TOPICS}
_VECTORS = ("velocity", "acceleration", "position")
_NUMBERS = {
    "share": "share", "state": "state", "reason": "reason", "safe": "safe", "peak": "peak",
    "margin": "margin", "limit": "limit", "stop_duration": "rest", "command_age": "age",
    "steps": "steps", "commands_taken": "commands", "friction_use": "friction",
    "tipping_use": "tipping",
}  # fmt: skip
"""Fields of GovernedMotion.msg by the attributes of Governed."""
MOST = 8
"""Joints that are compared, at most."""
_ROWS = {
    "joint_velocity": ("joints", 0), "joint_acceleration": ("joints", 1),
    "joint_position": ("joints", 2), "target_velocity": ("wanted", 0), "target": ("wanted", 1),
}  # fmt: skip
"""Sequences of GovernedMotion.msg by the attributes of Governed and their rows."""
_AT_THE_DOOR = (StopReason.TURN, StopReason.FRAME)
"""Why the node refuses a command whose numbers it does not record."""
STEPS, TAKEN, REASON, AGE = "steps", "commands_taken", "reason", "command_age"
LIQUID = ("liquid_stamp.sec", "liquid_stamp.nanosec")
SINCE = ("unknown_since.sec", "unknown_since.nanosec")
"""Since when the unknown wave of the start decays; recordings without it began at rest."""
STARTS = tuple(f"joint_start[{k}]" for k in range(MOST))
"""Measured positions from which carrying joints go on; older recordings have none."""
_FIELDS = (
    *(f"{name}[{k}]" for name in _VECTORS for k in range(3)), *_NUMBERS,
    *(f"{name}[{k}]" for name in _ROWS for k in range(MOST)),
)  # fmt: skip


class _FromTheStart:
    """Selects the recorded steps that follow the governor's start without a gap."""

    def __init__(self) -> None:
        self._last = -1

    def __call__(self, messages: Messages) -> Messages:
        if not len(messages.stamps):
            return messages
        kept = np.zeros(len(messages.stamps), dtype=bool)
        for row, step in enumerate(messages.columns[STEPS].astype(np.int64).tolist()):
            kept[row] = step == 1 or (self._last > 0 and step == self._last + 1)
            self._last = step if kept[row] else -1
        return messages.rows(kept)


def governor_row() -> ReplayedNode:
    """Returns the governor's entry in the table of replayed nodes."""
    return ReplayedNode(
        NODE,
        ReplayedGovernor,
        outputs=(
            NodeTopic(
                GOVERNED_MOTION, _TYPES[GOVERNED_MOTION], (*_FIELDS, *LIQUID, *SINCE, *STARTS),
                known=_FromTheStart(),
                later=dict.fromkeys(STARTS, math.nan) | dict.fromkeys(SINCE, 0.0),
            ),
        ),
        needs_recorded=True,
    )  # fmt: skip


class _Step(NamedTuple):
    """The inputs that the governor had received at a recorded step.

    Attributes:
        stamp_ns: of the step [ns].
        step, taken: numbers of steps and commands.
        reason: why it stops.
        liquid_ns: stamp of the last fused estimate [ns].
        since_ns: from when on the unknown wave of the start decays [ns]; 0: there was none.
        age: of the command in force [s].
        velocity, target: of the last command; NaN: not given.
        places: joint positions.
        joint_start: measured positions from which carrying joints go on with it; NaN: none.
    """

    stamp_ns: int
    step: int
    taken: int
    reason: int
    liquid_ns: int
    since_ns: int
    age: float
    velocity: tuple[float, ...]
    target: tuple[float, ...]
    places: tuple[float, ...]
    joint_start: tuple[float, ...]

    def command(self, size: int) -> Command:
        """Returns the step's newest velocity command, with `size` coordinates."""
        sent = 0 if math.isnan(self.age) else self.stamp_ns - round(Fraction(self.age) * SECOND)
        velocity, target = self.velocity[:size], self.target[:size]
        if not any(map(math.isnan, target)):
            given = () if any(map(math.isnan, velocity)) else velocity
            return Command(sent, given, target)
        if self.reason in _AT_THE_DOOR and any(map(math.isnan, velocity)):
            return Command(sent, velocity, refused=StopReason(self.reason))
        return Command(sent, velocity)


class ReplayedGovernor:
    """Replays the governor; each recorded step shows which inputs had arrived before it.

    Args:
        setting: of the replay.
    """

    def __init__(self, setting: Setting) -> None:
        self._starts = deque(one for one in setting.starts if one.node == NODE and not one.changed)
        self._start: NodeStart | None = None
        self._governor: Governor | None = None
        self._liquids: deque[SeenLiquid] = deque()
        self._liquid_ns, self._last = 0, -1
        self._places: tuple[float, ...] = ()

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Processes recorded commands and liquid states; returns the replayed steps."""
        seen = moment.messages.get(recorded_name(FUSED_ESTIMATE))
        if seen is not None and len(seen.stamps):
            self._liquids.extend(_liquids(seen))
        moved = []
        for step in _steps(moment.messages[recorded_name(GOVERNED_MOTION)]):
            if step.step == 0:
                self._places = step.places
            if step.step == 1:
                self._begin(step)
            known = step.step == 1 or (self._last > 0 and step.step == self._last + 1)
            self._last = step.step if known else -1
            if known and self._governor is not None:
                moved.append(self._follow(step, self._governor))
        return {GOVERNED_MOTION: _messages(moved)} if moved else {}

    def _begin(self, step: _Step) -> None:
        """Creates the governor with the recorded settings that were in effect at a step."""
        while self._starts and self._starts[0].stamp_ns <= step.stamp_ns:
            self._start = self._starts.popleft()
            if self._starts and not self._starts[0].stamp_ns:
                break  # the next process
        before, self._governor, self._liquid_ns = self._governor, None, 0
        if self._start is None:
            return
        try:
            self._governor = _governor_of(self._start, self._places)
        except SloshPlanError:
            return  # the node refused these settings, too, and told so
        self._governor.wait_since(step.since_ns)
        if before is not None and self._start.stamp_ns:  # not another process
            self._governor.go_on(before)

    def _follow(self, step: _Step, governor: Governor) -> Governed:
        while governor.commands < step.taken:
            governor.take(step.command(len(governor.place)))
        if step.liquid_ns > self._liquid_ns:
            while self._liquids and self._liquids[0].stamp_ns < step.liquid_ns:
                self._liquids.popleft()
            while self._liquids and self._liquids[0].stamp_ns == step.liquid_ns:
                governor.see(self._liquids.popleft())
        self._liquid_ns = step.liquid_ns
        governor.lose(lost=step.reason == StopReason.JOINTS)
        joints = step.joint_start[: governor.joints.shape[1]]
        if joints and not any(map(math.isnan, joints)):
            governor.locate(joints)
        if step.reason == StopReason.REQUESTED:
            governor.stop()
        else:
            governor.release()
        return governor.step(step.stamp_ns)


def _governor_of(start: NodeStart, places: tuple[float, ...]) -> Governor:
    """Creates the governor from the settings that the node recorded at a start."""
    model, files = model_of(start), start.files
    arm = None
    if "urdf" in files:
        link = Arm(files["urdf"], start.parameters["tool_frame"])
        limits = files.get("joint_limits", "")
        robot = CarryingRobot(link, parse_joint_limits(limits) if limits else GivenLimits())
        arm = arm_of(robot, places[: len(link.carrying)], start.parameters)
    tray = parse_tray(files[TRAY]) if TRAY in files else None
    held = tray if tray is not None and tray.present else model
    return governor_of(held, start.parameters, arm)


def _steps(recorded: Messages) -> list[_Step]:
    if not len(recorded.stamps):
        return []
    columns = recorded.columns
    liquid, since = (
        [columns[name].astype(np.int64) for name in names] for names in (LIQUID, SINCE)
    )
    whole = [columns[name].astype(np.int64).tolist() for name in (STEPS, TAKEN, REASON)]
    rows = [
        np.column_stack([columns[f"{name}[{k}]"] for k in range(MOST)]).tolist()
        for name in ("target_velocity", "target", "joint_position", "joint_start")
    ]
    return [
        _Step(*numbers, *map(tuple, vectors))
        for *numbers, vectors in zip(
            recorded.stamps.tolist(), *whole, (liquid[0] * SECOND + liquid[1]).tolist(),
            (since[0] * SECOND + since[1]).tolist(), columns[AGE].tolist(),
            zip(*rows, strict=True), strict=True,
        )
    ]  # fmt: skip


def _liquids(seen: Messages) -> list[SeenLiquid]:
    """Converts recorded fused estimates to states of the liquid, as the node does."""
    modes = sum(name.startswith("modal_position[") for name in seen.columns) // 2
    modal = np.stack(
        [
            np.column_stack(
                [seen.columns[f"modal_{kind}[{2 * mode + axis}]"]
                 for kind in ("position", "velocity") for axis in range(2)]
            )
            for mode in range(modes)
        ],
        axis=1,
    )  # fmt: skip
    names = ("msh_stddev", "frequency_factor", "uncorrected")
    columns = (seen.columns[name].tolist() for name in names)
    return [
        SeenLiquid(stamp_ns, one, *numbers)
        for stamp_ns, one, *numbers in zip(seen.stamps.tolist(), modal, *columns, strict=True)
    ]


def _messages(moved: list[Governed]) -> Messages:
    columns: dict[str, Any] = {
        f"{name}[{k}]": np.array([getattr(one, name)[k] for one in moved])
        for name in _VECTORS
        for k in range(3)
    }
    for field, name in _NUMBERS.items():
        columns[field] = np.array([getattr(one, name) for one in moved])
    for field, (name, row) in _ROWS.items():
        found = np.full((len(moved), MOST), np.nan)
        for place, one in enumerate(moved):
            values = getattr(one, name)[row] if getattr(one, name) else ()
            found[place, : len(values)] = values
        columns |= {f"{field}[{k}]": found[:, k] for k in range(MOST)}
    return Messages(np.array([one.stamp_ns for one in moved], dtype=np.int64), columns)

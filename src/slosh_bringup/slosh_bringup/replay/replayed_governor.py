"""Replays the governor node step by step, from recorded commands and fused estimates."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py.topics import (
    DESIRED_POSE,
    DESIRED_TWIST,
    FUSED_ESTIMATE,
    GOVERNED_MOTION,
    TOPICS,
)
from slosh_plan.governor import Command, Governed, Governor, SeenLiquid, StopReason
from slosh_plan.governor.parameters import governor_of, velocity_command
from slosh_replay.recording.settings import model_of
from slosh_replay.replay.nodes import Moment, NodeTopic, ReplayedNode, Setting, recorded_name
from slosh_replay.replay.verification import Messages

NODE: Final = "governor"
_TYPES = {row.name: row.type for row in TOPICS}
_VECTORS = ("velocity", "acceleration", "position")
_NUMBERS = {
    "share": "share", "state": "state", "reason": "reason", "safe": "safe", "peak": "peak",
    "margin": "margin", "limit": "limit", "stop_duration": "rest", "command_age": "age",
    "steps": "steps", "commands_taken": "commands",
}  # fmt: skip
"""Fields of GovernedMotion.msg by the attributes of Governed."""
STEPS, TAKEN, REASON = "steps", "commands_taken", "reason"
LIQUID = ("liquid_stamp.sec", "liquid_stamp.nanosec")
_FIELDS = (*(f"{name}[{k}]" for name in _VECTORS for k in range(3)), *_NUMBERS)
_TWIST = tuple(f"twist.{part}.{axis}" for part in ("linear", "angular") for axis in "xyz")
_PLACE = tuple(f"pose.position.{axis}" for axis in "xyz")


class _FromTheStart:
    """Selects the recorded governor steps that follow its start without a gap."""

    def __init__(self) -> None:
        self._last = -1

    def __call__(self, messages: Messages) -> Messages:
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
        inputs=(
            NodeTopic(DESIRED_TWIST, _TYPES[DESIRED_TWIST], _TWIST),
            NodeTopic(DESIRED_POSE, _TYPES[DESIRED_POSE], _PLACE),
        ),
        outputs=(
            NodeTopic(
                GOVERNED_MOTION, _TYPES[GOVERNED_MOTION], (*_FIELDS, *LIQUID),
                known=_FromTheStart(),
            ),
        ),
        needs_recorded=True,
    )  # fmt: skip


class ReplayedGovernor:
    """Replays the governor; each recorded step tells which inputs had arrived before it.

    Args:
        setting: of the replay.
    """

    def __init__(self, setting: Setting) -> None:
        self._starts = deque(one for one in setting.starts if one.node == NODE and not one.changed)
        self._known = _FromTheStart()
        self._waiting: deque[tuple[int, ...]] = deque()
        self._governor: Governor | None = None
        self._pose = False
        self._commands: deque[Command] = deque()
        self._liquids: deque[SeenLiquid] = deque()
        self._taken = self._liquid_ns = self._begun_ns = 0

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Processes commands and states of the liquid; returns the replayed steps."""
        self._hear(moment)
        recorded = self._known(moment.messages[recorded_name(GOVERNED_MOTION)])
        if len(recorded.stamps):
            names = (STEPS, TAKEN, REASON, *LIQUID)
            columns = [recorded.columns[name].astype(np.int64).tolist() for name in names]
            self._waiting.extend(zip(recorded.stamps.tolist(), *columns, strict=True))
        moved = []
        while self._waiting:
            stamp_ns, step, taken, reason, *liquid = self._waiting[0]
            if step == 1 and self._begun_ns != stamp_ns:
                self._begin(stamp_ns)
            # A command whose sender's clock is ahead comes later.
            if taken - self._taken > len(self._commands) and not moment.final:
                break
            self._waiting.popleft()
            if self._governor is not None:
                moved.append(self._step(stamp_ns, taken, reason, liquid[0] * SECOND + liquid[1]))
        return {GOVERNED_MOTION: _messages(moved)} if moved else {}

    def _hear(self, moment: Moment) -> None:
        twists = moment.messages[DESIRED_TWIST]
        if len(twists.stamps):
            rows = np.column_stack([twists.columns[name] for name in _TWIST]).tolist()
            for stamp_ns, row in zip(twists.stamps.tolist(), rows, strict=True):
                self._commands.append(velocity_command(stamp_ns, tuple(row[:3]), tuple(row[3:])))
        poses = moment.messages[DESIRED_POSE]
        if len(poses.stamps):
            rows = np.column_stack([poses.columns[name] for name in _PLACE]).tolist()
            for stamp_ns, (x, y, z) in zip(poses.stamps.tolist(), rows, strict=True):
                self._commands.append(Command(stamp_ns, target=(x, y, z)))
        seen = moment.messages.get(recorded_name(FUSED_ESTIMATE))
        if seen is not None and len(seen.stamps):
            self._liquids.extend(_liquids(seen))

    def _begin(self, stamp_ns: int) -> None:
        """Creates the governor at the next start of its process or for another container."""
        self._begun_ns = stamp_ns
        if not self._starts:
            return
        start = self._starts.popleft()
        if start.is_process and self._governor is not None:
            self._taken = 0
            while self._commands and self._commands[0].stamp_ns < stamp_ns:
                self._commands.popleft()
        model = model_of(start)
        self._governor = None if model is None else governor_of(model, start.parameters)

    def _step(self, stamp_ns: int, taken: int, reason: int, liquid_ns: int) -> Governed:
        governor = self._governor
        assert governor is not None
        while self._taken < taken and self._commands:
            governor.take(self._commands.popleft())
            self._taken += 1
        if liquid_ns > self._liquid_ns:
            while self._liquids and self._liquids[0].stamp_ns < liquid_ns:
                self._liquids.popleft()
            if self._liquids and self._liquids[0].stamp_ns == liquid_ns:
                governor.see(self._liquids.popleft())
        self._liquid_ns = liquid_ns
        if reason == StopReason.REQUESTED:
            governor.stop()
        else:
            governor.release()
        return governor.step(stamp_ns)


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
    columns = (seen.columns[name].tolist() for name in ("msh_stddev", "frequency_factor"))
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
    return Messages(np.array([one.stamp_ns for one in moved], dtype=np.int64), columns)

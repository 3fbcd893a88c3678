"""The estimator in a replay: inputs, restarts, models and recorded states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.held_container import changed_place, empty_and_fresh
from slosh_estimator.inputs import InputSettings
from slosh_estimator.sample import Samples
from slosh_estimator.sampling import modes_of
from slosh_estimator.tray_estimator import TrayEstimates, TrayEstimator
from slosh_model.indices import POSE_COUNT
from slosh_msgs_py.topics import ESTIMATE, TRAY_ESTIMATE
from slosh_replay.recording.inputs import settings_of_start
from slosh_replay.recording.settings import (
    NodeStart,
    first,
    model_of,
    starts_at_rest,
    tray_of,
)
from slosh_replay.recording.states import RecordedState
from slosh_replay.replay.input_matching import Decision
from slosh_replay.replay.model_set import ModelHeights, ModelSet
from slosh_replay.replay.nodes import Moment, Setting
from slosh_replay.replay.verification import (
    Columns,
    Messages,
    estimate_columns,
    joined_messages,
    tray_columns,
)

SAMPLES: Final = "samples"
"""What the estimator's models are driven by, for nodes that run models of their own."""
TRAY_HEIGHTS: Final = "heights on the tray"
"""What is estimated of each container of a tray, for nodes that compare it with a camera."""
TRAY_HEIGHT_FIELDS: Final = (
    "msh", "azimuth", "flags", "linear_msh", "linear_reading", "reading", "delay"
)  # fmt: skip
_AXES = ("ax", "ay", "az")


class ReplayedEstimator:
    """Computes estimates from those inputs that the live node used.

    Args:
        setting: of the replay.

    Attributes:
        models: the estimators.
        unused: inputs that the live estimator did not use.
        untaken: why the estimator's recorded state cannot be taken up; empty: it can.
    """

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self.models = ModelSet(setting.model, at_rest=setting.at_rest)
        self._tray = setting.tray
        self._others = self._new_others(setting.at_rest)
        self._until_ns = 0
        self._answered_ns = self._again_until_ns = -(2**62)
        self.unused = 0
        self.untaken = ""
        self._changes = list(setting.changes)
        self._inputs: list[Messages] = []
        self._heights: list[ModelHeights] = []
        self._given: list[Messages] = []
        self._trays: list[Messages] = []
        self._tray_heights: list[Messages] = []
        started = first(setting.starts, "estimator")
        if started is not None and empty_and_fresh(started.parameters)[0]:
            self.models.empty()
        self._samples: list[Messages] = []
        setting.loaded.append(setting.model)
        setting.reader.carry(modes_of(setting.model))
        setting.outputs.begin(self.models.own_names, self.models.model.container.wall)

    def _new_others(self, at_rest: bool) -> TrayEstimator | None:
        return None if self._tray is None else TrayEstimator(self._tray, at_rest=at_rest)

    @property
    def longest_gap_ns(self) -> int:
        """Longest input gap [ns] that the models integrate across, over all recorded settings."""
        later = [self._input_settings(c) for c in self.setting.changes if c.changed]
        gaps = [round(one.gate.max_gap * 1e9) for one in later if one is not None]
        return max([self.setting.reader.max_gap_ns, *gaps])

    @property
    def waiting_ns(self) -> int | None:
        """Stamp [ns] of the first input that may or may not have been used live; None if none."""
        return int(self._inputs[0].stamps[0]) if self._inputs else None

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Adds recorded inputs; returns the estimates computed from the inputs that were used."""
        taken = moment.messages.get(self.setting.reader.kind)
        if taken is not None and len(taken.stamps):
            self._inputs.append(taken)
        self._estimate(moment.final)
        given, self._given = joined_messages(self._given), []
        samples, self._samples = joined_messages(self._samples), []
        trays, self._trays = joined_messages(self._trays), []
        tray_heights, self._tray_heights = joined_messages(self._tray_heights), []
        found = {
            ESTIMATE: given, SAMPLES: samples, TRAY_ESTIMATE: trays, TRAY_HEIGHTS: tray_heights
        }  # fmt: skip
        return {name: messages for name, messages in found.items() if len(messages.stamps)}

    def take_heights(self) -> list[ModelHeights]:
        """Returns the heights of all models since the last call."""
        heights, self._heights = self._heights, []
        return heights

    def _estimate(self, final: bool) -> None:
        """Computes estimates from the inputs that the live estimator is known to have used."""
        if not self._inputs:
            return
        inputs = joined_messages(self._inputs)
        stamps, columns = inputs
        matcher = self.setting.matcher
        everything = Decision(len(stamps), np.ones(len(stamps), dtype=bool), [])
        decision = matcher.decide(stamps, final=final) if matcher else everything
        count, used = decision.reached, decision.used
        self.unused += count - int(np.count_nonzero(used))
        # What belongs to the inputs before an index comes first.
        actions = self._known_again(stamps, decision)
        actions += self._due(stamps[:count], decision.restarts)
        start = 0
        for index, act in sorted(actions, key=lambda action: action[0]):
            self._take(stamps, columns, used, start, index)
            # A state may be that behind the last input that has come so far.
            behind = index == len(stamps)
            self._until_ns = int(stamps[-1]) if behind else int(stamps[index]) - 1
            act()
            start = index
        self._take(stamps, columns, used, start, count)
        self._inputs = [inputs.rows(slice(count, None))] if count < len(stamps) else []

    def _due(
        self, stamps: Integers, restarts: Sequence[int]
    ) -> list[tuple[int, Callable[[], None]]]:
        """Returns the restarts, model changes and parameter changes due at the given input stamps.

        Args:
            stamps: (N,) [ns].
            restarts: indices of inputs with which a new process began.
        """
        actions: list[tuple[int, Callable[[], None]]] = []
        waiting, begin = list(restarts), 0
        while self._changes:
            change = self._changes[0]
            if change.is_process:
                if not waiting:
                    break
                begin = waiting.pop(0)
                actions.append((begin, partial(self._restart, change)))
            else:
                later = np.flatnonzero(stamps[begin:] > change.stamp_ns)
                if not len(later):
                    break
                act = self._change if change.changed else self._load
                actions.append((begin + int(later[0]), partial(act, change)))
            self._changes.pop(0)
        return actions + [(index, self._restart) for index in waiting]

    def _known_again(
        self, stamps: Integers, decision: Decision
    ) -> list[tuple[int, Callable[[], None]]]:
        """Returns the actions that restore recorded liquid states, each with its input's index."""
        if self.setting.counter is not None:
            self.setting.counter.follow(stamps, decision)
        if self.setting.known is None:
            return []
        course = self.setting.known.follow(stamps, decision)
        actions: list[tuple[int, Callable[[], None]]] = []
        if course.unknown:
            actions.append((0, partial(self.models.restart, at_rest=False)))
        return actions + [(index, partial(self._take_up, state)) for index, state in course.states]

    def _take_up(self, state: RecordedState) -> None:
        self._others = None  # no state tells of a tray's further containers
        try:
            self.models.take_up(state.estimator)
            self.setting.reader.take_up(state.stamp_ns, state.memory)
        except SloshEstimatorError as error:
            self.untaken = str(error)
        # Where the live node lagged farther behind its input, the replay has answered what comes
        # next from an unknown state.
        self._again_until_ns = self._answered_ns
        if self.setting.known is not None:
            self.setting.known.find_later(state.estimator.sample.stamp_ns, self._answered_ns)

    def _load(self, change: NodeStart) -> None:
        empty, fresh = empty_and_fresh(change.parameters)
        place = self._carry(change)
        if self._others is not None and self._tray is not None:
            if place < 0:
                self._others.reset()
            else:
                self._others.change(self._tray, place, fresh=fresh)
        if place > 0:
            return
        model = model_of(change)
        self.models.load_model(model, fresh=fresh, empty=empty)
        self.setting.loaded.append(model)
        self.setting.reader.carry(modes_of(model))
        self.setting.outputs.begin(self.models.own_names, self.models.model.container.wall)

    def _carry(self, change: NodeStart) -> int:
        """Loads the recorded tray; returns the index of the replaced container, or -1 for all."""
        tray = tray_of(change) if self._tray is not None else None
        if tray is None or self._tray is None or tray.names != self._tray.names:
            return -1
        if tray != self._tray:
            self._tray = tray
            self.setting.trays.append((self._until_ns, tray))
        place = changed_place(change.parameters)
        return tray.names.index(place) if place in tray.names else -1

    def _change(self, change: NodeStart) -> None:
        settings = self._input_settings(change)
        if settings is not None:
            self.setting.reader.change(settings)

    def _input_settings(self, start: NodeStart) -> InputSettings | None:
        """Returns new input settings of the node, or None if the replay ignores them."""
        if not self.setting.follows_input or "input" not in start.parameters:
            return None
        return settings_of_start(start)

    def _restart(self, start: NodeStart | None = None) -> None:
        """Restarts the models and the input reader, as the node's process did."""
        if start is None:
            self.setting.reader.restart()
            self.setting.loaded.append(self.setting.loaded[-1])
        else:
            self.setting.reader.restart(self._input_settings(start))
            self._load(start)
        self.models.restart(at_rest=starts_at_rest(start))
        self._others = self._new_others(starts_at_rest(start))

    def _take(
        self, stamps: Integers, inputs: Columns, used: NDArray[np.bool_], start: int, end: int
    ) -> None:
        rows = start + np.flatnonzero(used[start:end])
        if not len(rows):
            return
        samples = self.setting.reader.samples(stamps, inputs, rows)
        again = samples.stamps <= self._again_until_ns
        if again.any():  # the models need them, nobody else does
            self.models.update_many(samples.rows(again))
            samples = samples.rows(~again)
        if not len(samples.stamps):
            return
        self._answered_ns, self._again_until_ns = int(samples.stamps[-1]), -(2**62)
        answers = self.models.update_many(samples)
        own = answers.own
        heights = answers.heights
        if self._others is not None:
            tray = self._others.update_many(samples, own)
            self._trays.append(Messages(own.stamps, tray_columns(tray)))
            self._tray_heights.append(Messages(own.stamps, _tray_heights(tray, own.accelerations)))
            heights = heights._replace(tray=tray.msh)
        elif self.setting.tray is not None:
            unknown = np.full((len(own.stamps), len(self.setting.tray.containers)), np.nan)
            heights = heights._replace(tray=unknown)
        self._given.append(Messages(own.stamps, estimate_columns(own)))
        self._samples.append(_columns(samples, own.flags, len(self.setting.loaded) - 1))
        self.setting.outputs.estimates(answers)
        self._heights.append(heights)


def samples_of(batch: Messages) -> Samples:
    """Returns the samples in a batch of replayed messages."""
    columns = batch.columns
    poses = np.column_stack([columns[f"pose{i}"] for i in range(POSE_COUNT)])
    return Samples(
        batch.stamps, np.column_stack([columns[name] for name in _AXES]), columns["yaw"],
        columns["restarted"], poses if np.isfinite(poses).all() else None,
    )  # fmt: skip


def _columns(samples: Samples, flags: Integers, start: int) -> Messages:
    count = len(samples.stamps)
    poses = np.full((count, POSE_COUNT), np.nan) if samples.poses is None else samples.poses
    return Messages(
        samples.stamps,
        {
            **{name: samples.accelerations[:, i] for i, name in enumerate(_AXES)},
            **{f"pose{i}": poses[:, i] for i in range(POSE_COUNT)},
            "yaw": samples.yaws, "restarted": samples.restarted, "flags": flags,
            "start": np.full(count, start),
        },
    )  # fmt: skip


def _tray_heights(tray: TrayEstimates, accelerations: Array) -> Columns:
    """Returns the fields of TrayEstimate.msg that a monitor of one container needs, (N,) each."""
    parts = (
        tray.msh, tray.azimuth, tray.flags, tray.linear_msh, tray.readings[..., 0],
        tray.readings[..., 1], tray.delays,
    )  # fmt: skip
    pairs = zip(TRAY_HEIGHT_FIELDS, parts, strict=True)
    columns = {f"{name}[{k}]": column for name, part in pairs for k, column in enumerate(part.T)}
    return {**columns, **{f"acceleration[{axis}]": accelerations[:, axis] for axis in range(3)}}

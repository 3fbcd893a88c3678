"""What all parts of a replay share: its settings, and who receives its results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slosh_estimator.comparison import Comparison
from slosh_estimator.limits import Event
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_model.tray import Tray
from slosh_model.wall import Wall
from slosh_motion.recorded.inputs import InputReader
from slosh_motion.recorded.settings import NodeStart
from slosh_replay.recording.heights import Measurements
from slosh_replay.replay.model_set import ModelSetEstimates


class Outputs:
    """Base class of receivers of a replay's results; ignores all results."""

    def begin(self, names: tuple[str, str], wall: Wall) -> None:
        """Sets the linear and nonlinear model's names, and the container wall's geometry."""

    def estimates(self, estimates: ModelSetEstimates) -> None:
        """Receives estimates in the order of their samples."""

    def comparisons(self, comparisons: list[Comparison]) -> None:
        """Receives comparisons of estimated and measured heights, in order."""

    def events(self, events: list[Event]) -> None:
        """Receives events at which limits are exceeded or kept again."""


class Setting(NamedTuple):
    """Settings that all parts of a replay share: model, input, limits and changes.

    Attributes:
        model: container, liquid and effects at the start.
        reader: of the input.
        limits: what the monitor watches at first.
        limit_changes: what it watches for data with stamps after these [ns], in order.
        at_rest: whether the liquid is still at the first sample.
        late: whether the recording begins in the middle of a run: the liquid's state is unknown
            until the first recorded state of the estimator.
        empty: whether the gripper is empty at the start.
        changes: starts of the estimator after its first, and changes of its parameters.
        follows_input: whether they also say how the input is read.
        tray: whose first container the model is of; None: there is none.
        outputs: receives all results.
    """

    model: Model
    reader: InputReader
    limits: MonitorSettings = MonitorSettings()
    limit_changes: Sequence[tuple[int, MonitorSettings]] = ()
    at_rest: bool = True
    late: bool = False
    empty: bool = False
    changes: tuple[NodeStart, ...] = ()
    follows_input: bool = True
    tray: Tray | None = None
    outputs: Outputs = Outputs()


_NONE, _NO_STAMPS = np.empty(0), np.empty(0, dtype=np.int64)
NO_MEASUREMENTS = Measurements(_NO_STAMPS, _NONE, _NO_STAMPS, _NONE, _NONE)

"""Replays the sensor node: heights of the wave from the recorded force."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from slosh_estimator.sensed.force_surface import ForceSurface, Motion, SensedWave
from slosh_estimator.sensed.payload import Payload, parse_payload
from slosh_estimator.sensed.surface import wave_fields
from slosh_model.model import Model
from slosh_msgs_py.topics import FORCE, FREE_SURFACE, SENSED_SURFACE
from slosh_replay.recording.settings import NodeStart
from slosh_replay.replay.nodes import Moment, Setting
from slosh_replay.replay.replayed_estimator import SAMPLES
from slosh_replay.replay.replayed_observer import SURFACES
from slosh_replay.replay.verification import Messages

AXES: Final = tuple(f"wrench.force.{axis}" for axis in "xyz")
"""Fields of a force that are read."""
SENSOR, PAYLOAD, BESIDE = "sensor", "payload", "beside_camera"
"""The node, its file of the payload, and its parameter for a camera beside it."""


def force_surface_topic(starts: Sequence[NodeStart]) -> str:
    """Returns the topic of heights computed from a force; empty unless one node did this."""
    sensors = [start for start in starts if start.node == SENSOR and PAYLOAD in start.files]
    if len(sensors) != 1:
        return ""
    return SENSED_SURFACE if sensors[0].parameters.get(BESIDE) else FREE_SURFACE


class ReplayedForce:
    """Replays the wave heights computed from a force, in the same blocks as the live node.

    Args:
        setting: of the replay.
    """

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        (start,) = (one for one in setting.starts if one.node == SENSOR and PAYLOAD in one.files)
        self._payload: Payload = parse_payload(start.files[PAYLOAD], PAYLOAD)
        self._topic = force_surface_topic(setting.starts)
        self._force: ForceSurface | None = None
        self._model: Model | None = None

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Processes forces and samples; returns the heights of complete blocks."""
        waves = list(self._waves(moment.messages[SAMPLES], moment.messages[FORCE]))
        if not waves or self._model is None:
            return {}
        reach = self._model.container.reaches[0]
        unknown = dict.fromkeys(SURFACES, math.nan) | {"flags": 0}
        rows = [unknown | wave_fields(wave, reach) for wave in waves]
        stamps = np.array([wave.stamp_ns for wave in waves], dtype=np.int64)
        return {
            self._topic: Messages(
                stamps, {name: np.array([row[name] for row in rows]) for name in SURFACES}
            )
        }

    def _waves(self, samples: Messages, forces: Messages) -> Iterator[SensedWave]:
        """Yields the waves that are computed from new forces and container motions."""
        if len(samples.stamps):
            for start in dict.fromkeys(samples.columns["start"].astype(np.int64).tolist()):
                model = self._setting.loaded[start]
                if model != self._model:
                    self._model, self._force = model, ForceSurface(model, self._payload)
                assert self._force is not None
                own = samples.rows(samples.columns["start"] == start)
                columns = (own.columns[name].tolist() for name in ("ax", "ay", "yaw"))
                for motion in zip(own.stamps.tolist(), *columns, strict=True):
                    yield from self._force.take_motion(Motion(*motion))
        if len(forces.stamps) and self._force is not None:
            columns = (forces.columns[name].tolist() for name in AXES)
            for force in zip(forces.stamps.tolist(), *columns, strict=True):
                yield from self._force.take_force(*force)

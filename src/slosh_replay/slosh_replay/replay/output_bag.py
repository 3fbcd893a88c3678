"""Writes the results of a replay to a new bag, for comparison with the recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from slosh_bag.bag_writer import BagWriter
from slosh_bag.columns.cdr_columns import write_messages
from slosh_bag.columns.cdr_layout import Layout, layout_of
from slosh_bag.definitions import Definitions
from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.comparison import Comparison
from slosh_estimator.estimate_kernel import MSH
from slosh_estimator.estimator import Estimates
from slosh_estimator.limits import Event
from slosh_model.wall import Wall, WallPlace
from slosh_replay.replay.model_set import ModelSetEstimates
from slosh_replay.replay.setting import Outputs
from slosh_replay.replay.verification import estimate_columns

ESTIMATE = "slosh_msgs/msg/SloshEstimate"
COMPARISON = "slosh_msgs/msg/SloshComparison"
LIMIT_EVENT = "slosh_msgs/msg/LimitEvent"
ESTIMATE_TOPIC = "/slosh/estimate"
FRAME = "container"
FACTS = {"content": "replay"}
"""How a bag of outputs is told from a recording."""


class OutputBag(Outputs):
    """Writes estimates, compared heights and limit events to a bag; a context manager.

    The messages are logged at their stamps: two replays of a bag give the same file.

    Args:
        folder: of the new bag; it must not hold a bag already.
    """

    def __init__(self, folder: Path) -> None:
        definitions = Definitions()
        self._writer = BagWriter(folder, definitions, FACTS)
        for topic, message_type in (
            ("estimate", ESTIMATE), ("comparison", COMPARISON), ("limit_event", LIMIT_EVENT)
        ):  # fmt: skip
            self._writer.add_topic(f"/slosh/{topic}", message_type)
        self._store = definitions.typestore
        self._names = ("", "")
        self._template: tuple[Layout, bytes] | None = None
        self._count = 0

    def __enter__(self) -> OutputBag:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def begin(self, names: tuple[str, str], wall: Wall) -> None:
        """Sets the linear and nonlinear model's names, and the container wall's geometry."""
        self._names, self._template, self._wall = names, None, wall

    def estimates(self, estimates: ModelSetEstimates) -> None:
        """Writes estimates as SloshEstimate messages to the bag."""
        own = estimates.own
        if not len(own.stamps):
            return
        if self._template is None:
            self._template = self._make_template(own)
        seconds, nanoseconds = np.divmod(own.stamps, SECOND)
        counted = self._count + 1 + np.arange(len(own.stamps))
        self._count += len(own.stamps)
        layout, template = self._template
        places = self._wall.places(own.heights[:, 1, MSH])
        packed = write_messages(
            layout,
            template,
            {
                **estimate_columns(own), **places, "samples_used": counted,
                "header.stamp.sec": seconds, "header.stamp.nanosec": nanoseconds,
            },
        )  # fmt: skip
        for stamp, data in zip(own.stamps.tolist(), packed, strict=True):
            self._writer.write(ESTIMATE_TOPIC, data.tobytes(), stamp)

    def comparisons(self, comparisons: list[Comparison]) -> None:
        """Writes comparisons of estimated and measured heights to the bag."""
        for comparison in comparisons:
            fields = comparison._asdict()
            stamp = fields.pop("stamp_ns")
            fields["state"] = int(fields["state"])
            self._write("comparison", COMPARISON, stamp, fields)

    def events(self, events: list[Event]) -> None:
        """Writes limit events as LimitEvent messages to the bag."""
        for event in events:
            fields = {
                "id": event.id, "kind": int(event.kind), "source": int(event.source),
                "limit": event.limit, "peak": event.peak,
                "peak_stamp": self._time(event.peak_stamp_ns),
                "duration": self._duration(max(event.duration_ns, 0)),
                "description": event.description,
            }  # fmt: skip
            self._write("limit_event", LIMIT_EVENT, event.stamp_ns, fields)

    def _write(self, topic: str, kind: str, stamp_ns: int, fields: dict[str, Any]) -> None:
        message = self._store.types[kind](header=self._header(stamp_ns), **fields)
        self._writer.write(
            f"/slosh/{topic}", bytes(self._store.serialize_cdr(message, kind)), stamp_ns
        )

    def _make_template(self, own: Estimates) -> tuple[Layout, bytes]:
        """Creates a message of a model's estimates, whose numbers each estimate replaces."""
        types = self._store.types
        modal = np.zeros(2 * own.modal.shape[2])
        models = [
            types["slosh_msgs/msg/ModelEstimate"](
                model=name, msh=0.0, azimuth=0.0, sh_x=0.0, sh_y=0.0,
                modal_position=modal, modal_velocity=modal,
            )
            for name in self._names
        ]  # fmt: skip
        message = types[ESTIMATE](
            header=self._header(0), linear=models[0], nonlinear=models[1],
            acceleration=np.zeros(3), jerk=0.0, yaw=0.0, flags=0, samples_used=0,
            samples_dropped=0, **dict.fromkeys(WallPlace._fields, 0.0),
        )  # fmt: skip
        data = bytes(self._store.serialize_cdr(message, ESTIMATE))
        return layout_of(self._store, ESTIMATE, data), data

    def _header(self, stamp_ns: int) -> Any:
        return self._store.types["std_msgs/msg/Header"](stamp=self._time(stamp_ns), frame_id=FRAME)

    def _time(self, stamp_ns: int) -> Any:
        seconds, nanoseconds = divmod(stamp_ns, SECOND)
        return self._store.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)

    def _duration(self, duration_ns: int) -> Any:
        seconds, nanoseconds = divmod(duration_ns, SECOND)
        return self._store.types["builtin_interfaces/msg/Duration"](
            sec=seconds, nanosec=nanoseconds
        )

"""Changes of the container while the estimator runs: service, schedule and topic."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.node import Node

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.held_container import HeldContainer, tray_holding
from slosh_estimator.nodes.requested_model import model_at
from slosh_model.model import Model
from slosh_model.model_text import format_model, parse_model
from slosh_model.tray import Tray, format_tray
from slosh_msgs.msg import ContainerChange
from slosh_msgs.srv import ChangeContainer
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_nanoseconds

MOST = 16
"""Changes that wait for their moment."""
TRAY_STAYS = "the cell carries a tray: call change_container, with tray_place"
FARTHEST_NS = 3600 * SECOND
"""A moment so far ahead is of another clock."""
_NAME = re.compile(r"[\w-][\w.-]*")


class _Waiting(NamedTuple):
    """A change of the container that applies to inputs after a stamp [ns]."""

    after_ns: int
    place: int
    held: HeldContainer


class ContainerChanges:
    """Serves `change_container`, schedules later changes, publishes the current container.

    Args:
        node: the estimator's.
        start: its tray, or its model as a tray of one.
        folder: of models by the containers' names; empty: there is none.
        now: the newest input's stamp, or the time before any input [ns].
        apply: makes a change of one place take effect; returns the stamp of the last input
            before it [ns].

    Attributes:
        tray: with what its places hold now.
        next_ns: inputs with later stamps have another container [ns]; 2**63: none has.
    """

    def __init__(
        self,
        node: Node,
        start: Tray,
        folder: str,
        now: Callable[[], int],
        apply: Callable[[int, HeldContainer, Tray], int],
    ) -> None:
        self._node, self._folder, self._now, self._apply = node, folder, now, apply
        self.tray = self._start = start
        self._held = [
            HeldContainer(one.model, empty=one.empty, standing=one.standing)
            for one in start.containers
        ]
        self._waiting: list[_Waiting] = []
        self.next_ns = 2**63
        self._publisher = node.create_publisher(
            ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM
        )
        self._publisher.publish(filled(ContainerChange, frame_id=self._frame, present=True))
        node.create_service(ChangeContainer, topics.CHANGE_CONTAINER, self._on_request)

    @property
    def _frame(self) -> str:
        return str(self._node.get_parameter("container_frame").value)

    def reach(self, stamp_ns: int) -> None:
        """Applies the changes that are due before an input with this stamp [ns] is used."""
        while stamp_ns > self.next_ns:
            due = self._waiting.pop(0)
            self._take(due.place, due.held)
            self._look_ahead()

    def facts(self) -> dict[str, str]:
        """Returns the current container and waiting changes, for the diagnostics."""
        waiting = {"changes ahead": str(len(self._waiting))} if self._waiting else {}
        if not self.tray.is_tray:
            return {"container": self._held[0].described, **waiting}
        pairs = zip(self.tray.names, self._held, strict=True)
        return {**{f"place {name}": held.described for name, held in pairs}, **waiting}

    def load(self, model: Model) -> None:
        """Replaces the model of the current container, for the service `load_model`.

        Raises:
            SloshEstimatorError: nothing can change.
            SloshModelError: the compiled code does not do what the model's equations say.
        """
        if self.tray.is_tray:
            raise SloshEstimatorError(TRAY_STAYS)
        (held,) = self._held
        self._take(0, HeldContainer(model, held.name, held.empty, limit=held.limit))

    def _take(self, index: int, held: HeldContainer) -> None:
        tray = tray_holding(self.tray, index, held, self._start.containers[index].limit)
        last_ns = self._apply(index, held, tray)
        self.tray, self._held[index] = tray, held
        place = f"place {tray.names[index]}: " if tray.is_tray else ""
        self._node.get_logger().info(f"from {last_ns * 1e-9:.3f} s on: {place}{held.described}")
        self._tell(last_ns, index)

    def _tell(self, last_ns: int, index: int) -> None:
        held, is_tray = self._held[0], self.tray.is_tray
        self._publisher.publish(
            filled(
                ContainerChange,
                stamp_ns=last_ns,
                frame_id=self._frame,
                present=not held.empty,
                name=held.name,
                model=format_model(held.model),
                fill_height=held.fill_height,
                limit=math.nan if is_tray else held.limit,
                tray_place=self.tray.names[index],
                tray=format_tray(self.tray) if is_tray else "",
            )
        )

    def _on_request(
        self, request: ChangeContainer.Request, response: ChangeContainer.Response
    ) -> ChangeContainer.Response:
        try:
            response.message = self._answer(request)
            response.success = True
        except ValueError as error:
            if not type(error).__module__.startswith("slosh_"):
                raise
            response.success, response.message = False, str(error)
        return response

    def _answer(self, request: ChangeContainer.Request) -> str:
        index = self._place(request.tray_place)
        after_ns, now_ns = to_nanoseconds(request.stamp), self._now()
        if after_ns > now_ns + FARTHEST_NS:
            at, ahead = after_ns * 1e-9, (after_ns - now_ns) * 1e-9
            raise SloshEstimatorError(
                f"stamp {at:.3f} s is {ahead:.0f} s ahead of the inputs' stamps: give "
                "it by their clock"
            )
        before = [one for one in self._waiting if one.after_ns <= after_ns]
        own = [one.held for one in before if one.place == index]
        held = self._requested(request, [self._held[index], *own][-1])
        if after_ns <= now_ns:
            self._take(index, held)
            late = (now_ns - after_ns) * 1e-9
            late_text = f", {late:.3f} s after the stamp given" if after_ns and late else ""
            return f"from the next input on{late_text}: {held.described}"
        if len(before) < len(self._waiting):
            raise SloshEstimatorError(
                "a later change waits already: give changes in the order of their stamps"
            )
        if len(self._waiting) >= MOST:
            raise SloshEstimatorError(f"{MOST} changes wait already")
        self._waiting.append(_Waiting(after_ns, index, held))
        self._look_ahead()
        return f"after {after_ns * 1e-9:.3f} s: {held.described}"

    def _place(self, name: str) -> int:
        """Returns the index of the tray place that a request names, from 0."""
        names = self.tray.names
        if name in names:
            return names.index(name)
        if not self.tray.is_tray:
            raise SloshEstimatorError(f"tray_place = {name!r:.60}: the cell carries no tray")
        raise SloshEstimatorError(
            f"tray_place = {name!r:.60} is no place of the tray ({', '.join(names)})"
        )

    def _requested(self, request: Any, before: HeldContainer) -> HeldContainer:
        """Returns the gripper's content after a requested change."""
        model = None
        if request.model:
            model = parse_model(request.model, "model")
        elif request.name and not request.empty:
            model = self._named(request.name)
        return before.changed(
            empty=request.empty, name=request.name, model=model,
            fill_height=request.fill_height, limit=request.limit,
            standing=request.standing,
        )  # fmt: skip

    def _named(self, name: str) -> Model:
        if not self._folder:
            raise SloshEstimatorError(
                f"name = {name!r:.60}: the estimator's parameter containers names no folder of "
                "models; or give the model"
            )
        if not _NAME.fullmatch(name):
            raise SloshEstimatorError(
                f"name = {name!r:.60} must be letters, digits, '_', '-', '.'"
            )
        path = f"{self._folder}/{name}.yaml"
        return model_at(path, self._node.get_logger().warning, topics.CHANGE_CONTAINER)

    def _look_ahead(self) -> None:
        self.next_ns = self._waiting[0].after_ns if self._waiting else 2**63

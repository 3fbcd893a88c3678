"""Changes of the container while the estimator runs: service, schedule and topic."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.node import Node

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.held_container import HeldContainer
from slosh_estimator.nodes.requested_model import model_at
from slosh_model.model import Model
from slosh_model.model_text import format_model, parse_model
from slosh_msgs.msg import ContainerChange
from slosh_msgs.srv import ChangeContainer
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_nanoseconds

MOST = 16
"""Changes that wait for their moment."""
FARTHEST_NS = 3600 * SECOND
"""A moment so far ahead is of another clock."""
_NAME = re.compile(r"[\w-][\w.-]*")


class _Waiting(NamedTuple):
    """A change of the container that applies to inputs after a stamp [ns]."""

    after_ns: int
    held: HeldContainer


class ContainerChanges:
    """Serves `change_container`, schedules later changes and publishes the current one.

    Args:
        node: the estimator's.
        start: its model.
        folder: of models by the containers' names; empty: there is none.
        now: the newest input's stamp, or the time before any input [ns].
        apply: makes a change take effect; returns the stamp of the last input before it [ns].
        fixed: why nothing can change; empty: it can.

    Attributes:
        held: what the gripper holds.
        next_ns: inputs with later stamps have another container [ns]; 2**63: none has.
    """

    def __init__(
        self,
        node: Node,
        start: Model,
        folder: str,
        now: Callable[[], int],
        apply: Callable[[HeldContainer], int],
        fixed: str = "",
    ) -> None:
        self._fixed = fixed
        self._node, self._folder, self._now, self._apply = node, folder, now, apply
        self.held = HeldContainer(start)
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
            self._take(self._waiting.pop(0).held)
            self._look_ahead()

    def facts(self) -> dict[str, str]:
        """Returns the current container and waiting changes, for the diagnostics."""
        waiting = {"container changes ahead": str(len(self._waiting))} if self._waiting else {}
        return {"container": self.held.described, **waiting}

    def load(self, model: Model) -> None:
        """Replaces the model of the current container, for the service `load_model`.

        Raises:
            SloshEstimatorError: nothing can change.
            SloshModelError: the compiled code does not do what the model's equations say.
        """
        self._refuse()
        held = self.held
        self._take(HeldContainer(model, held.name, held.empty, limit=held.limit))

    def _refuse(self) -> None:
        if self._fixed:
            raise SloshEstimatorError(self._fixed)

    def _take(self, held: HeldContainer) -> None:
        last_ns = self._apply(held)
        self.held = held
        self._node.get_logger().info(f"from {last_ns * 1e-9:.3f} s on: {held.described}")
        self._publisher.publish(
            filled(
                ContainerChange,
                stamp_ns=last_ns,
                frame_id=self._frame,
                present=not held.empty,
                name=held.name,
                model=format_model(held.model),
                fill_height=held.fill_height,
                limit=held.limit,
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
        self._refuse()
        after_ns, now_ns = to_nanoseconds(request.stamp), self._now()
        if after_ns > now_ns + FARTHEST_NS:
            at, ahead = after_ns * 1e-9, (after_ns - now_ns) * 1e-9
            raise SloshEstimatorError(
                f"stamp {at:.3f} s is {ahead:.0f} s ahead of the inputs' stamps: give "
                "it by their clock"
            )
        before = [one.held for one in self._waiting if one.after_ns <= after_ns]
        held = self._requested(request, [self.held, *before][-1])
        if after_ns <= now_ns:
            self._take(held)
            late = (now_ns - after_ns) * 1e-9
            late_text = f", {late:.3f} s after the stamp given" if after_ns and late else ""
            return f"from the next input on{late_text}: {held.described}"
        if len(before) < len(self._waiting):
            raise SloshEstimatorError(
                "a later change waits already: give changes in the order of their stamps"
            )
        if len(self._waiting) >= MOST:
            raise SloshEstimatorError(f"{MOST} changes wait already")
        self._waiting.append(_Waiting(after_ns, held))
        self._look_ahead()
        return f"after {after_ns * 1e-9:.3f} s: {held.described}"

    def _requested(self, request: Any, before: HeldContainer) -> HeldContainer:
        """Returns what the gripper will hold after a request."""
        model = None
        if request.model:
            model = parse_model(request.model, "model")
        elif request.name and not request.empty:
            model = self._named(request.name)
        return before.changed(
            empty=request.empty, name=request.name, model=model,
            fill_height=request.fill_height, limit=request.limit,
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

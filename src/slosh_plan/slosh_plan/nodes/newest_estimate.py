"""Reads the estimator's newest message only when it is needed."""

from __future__ import annotations

from typing import Any

import numpy as np
from rclpy.node import Node

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.validity import EstimateFlag
from slosh_model.tray import Tray
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.sampling import TOO_SLOW
from slosh_msgs.msg import FusedEstimate, ModelEstimate, SloshEstimate, TrayEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_plan import LiquidState
from slosh_plan.start import LiquidStates

OLDEST = 0.5
"""An estimate older than this [s] says nothing of the liquid now."""
UNKNOWN = (
    EstimateFlag.SETTLING
    | EstimateFlag.AFTER_GAP
    | EstimateFlag.DIVERGED
    | EstimateFlag.NO_CONTAINER
)
"""Flags of an estimate whose state is not that of the liquid."""


class NewestEstimate:
    """Subscribes to the estimator without a callback; its newest message is read when needed.

    A thousand messages a second must not wake the process. So the subscription is one of a hidden
    node that no executor has. A callback group that never executes is not enough: the events
    executor does not ask callback groups, and takes every message away.

    Args:
        node: the node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        # The name on the command line would be this node's name, too.
        self._reader = Node(
            f"_{node.get_name()}_newest_estimate", namespace=node.get_namespace(),
            context=node.context, use_global_arguments=False, enable_rosout=False,
            start_parameter_services=False,
        )  # fmt: skip
        self._estimates = self._subscribe(SloshEstimate, topics.ESTIMATE)
        self._fused = self._subscribe(FusedEstimate, topics.FUSED_ESTIMATE)
        self._trays = self._subscribe(TrayEstimate, topics.TRAY_ESTIMATE)
        self._last: dict[type, Any] = {}

    def _subscribe(self, kind: type, topic: str) -> Any:
        name = self._node.resolve_topic_name(topic)
        return self._reader.create_subscription(kind, name, lambda _: None, qos.NEWEST_IN)

    def state(self) -> LiquidState:
        """Returns the liquid's present state, from the observer if that is accurate enough.

        Raises:
            SloshEstimatorError: nobody tells, or what is told is old or no known state.
        """
        fused = self._newest(self._fused, FusedEstimate)
        if fused is not None and fused.trusted and self._age(fused) <= OLDEST:
            modal = modal_of(fused)
            return LiquidState(modal, modal)
        message = self._newest(self._estimates, SloshEstimate)
        self._check(message, self._estimates)
        _check_flags(message.flags)
        return LiquidState(modal_of(message.linear), modal_of(message.nonlinear))

    def state_for(self, tray: Tray) -> LiquidStates:
        """Returns the present state of the liquid in the gripper's container; see `state`.

        Returns:
            of a tray the state of each container that is there, by its name.

        Raises:
            SloshEstimatorError: as `state`, or the estimates are those of another tray.
        """
        if not tray.is_tray:
            return self.state()
        message = self._newest(self._trays, TrayEstimate)
        self._check(message, self._trays)
        if tuple(message.containers) != tray.names:
            raise SloshEstimatorError(
                f"{self._trays.topic_name} is of the containers {', '.join(message.containers)}, "
                f"not of {', '.join(tray.names)}"
            )
        found = {}
        for one, flags, state in zip(
            tray.containers, message.flags, tray_states(message), strict=True
        ):
            if one.empty:
                continue
            try:
                _check_flags(flags)
            except SloshMotionError as error:
                raise SloshEstimatorError(f"container {one.name}: {error}") from None
            found[one.name] = LiquidState(*state)
        return found

    def _check(self, message: Any, subscription: Any) -> None:
        """Raises SloshEstimatorError if no estimate has come, or if the last one is too old."""
        if message is None:
            raise SloshEstimatorError(
                f"no estimate has come on {subscription.topic_name}: the liquid's state is "
                "unknown; is the estimator running?"
            )
        age = self._age(message)
        if age > OLDEST:
            raise SloshEstimatorError(
                f"the last estimate is {age:.2f} s old: the liquid's state is unknown"
            )

    def _newest(self, subscription: Any, kind: type) -> Any:
        with subscription.handle:
            taken = subscription.handle.take_message(kind, False)
        if taken is not None:
            self._last[kind] = taken[0]
        return self._last.get(kind)

    def _age(self, message: Any) -> float:
        """Returns the age of a message [s]: the present time minus its stamp."""
        now = self._node.get_clock().now().nanoseconds
        return float(now - to_nanoseconds(message.header.stamp)) / SECOND


def _check_flags(flags: int) -> None:
    """Raises SloshEstimatorError if an estimate's flags mark its liquid state as invalid."""
    unknown = EstimateFlag(flags) & UNKNOWN
    if unknown:
        raise SloshEstimatorError(
            f"the estimate's flags {int(unknown):#x} say that the liquid's state is unknown; "
            "wait until it has settled"
        )
    if flags & EstimateFlag.INPUT_TOO_SLOW:
        raise SloshEstimatorError(f"{TOO_SLOW}, and so is the liquid's state")


def tray_states(message: TrayEstimate) -> list[tuple[Array, Array]]:
    """Returns each container's modal states (modes, 4) of the linear and the nonlinear model.

    Raises:
        SloshEstimatorError: the message has other states than containers.
    """
    ends = np.cumsum(np.asarray(message.modes, dtype=np.int64))
    sizes = {len(message.linear_modal), len(message.modal), 4 * int(ends[-1]) if len(ends) else 0}
    if len(ends) != len(message.containers) or len(sizes) > 1:
        raise SloshEstimatorError("the estimate of the tray has not one state for each container")
    linear, nonlinear = (
        np.split(np.array(values).reshape(-1, 4), ends[:-1])
        for values in (message.linear_modal, message.modal)
    )
    return list(zip(linear, nonlinear, strict=True))


def modal_of(answer: ModelEstimate | FusedEstimate) -> Any:
    """Returns each mode's state x, y, vx, vy (modes, 4) from a message [m, m/s]."""
    position = np.array(answer.modal_position).reshape(-1, 2)
    velocity = np.array(answer.modal_velocity).reshape(-1, 2)
    return np.hstack((position, velocity))

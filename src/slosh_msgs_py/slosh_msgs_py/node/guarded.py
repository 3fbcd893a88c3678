"""Node base class that keeps running after exceptions in callbacks.

Whatever others send, a node must not fall by it. What is known to be wrong is refused where it is
read, with its reason; here is the last catch, for what nobody thought of: the message is lost, the
node counts it, tells it and goes on.
"""

from __future__ import annotations

import functools
import traceback
from collections import Counter
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from slosh_base.files.plain_text import plain_line
from slosh_msgs_py.node.mismatches import Mismatches

Callback = Callable[..., Any]


class Faults:
    """Counts and reports exceptions raised in callbacks.

    Args:
        tell: is given a line the first time, the tenth, the hundredth, and so on.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._counts: Counter[str] = Counter()
        self._last = ""
        self._reported = 0

    @property
    def total(self) -> int:
        """Number of exceptions so far."""
        return self._counts.total()

    def add(self, where: str, error: Exception) -> str:
        """Counts an exception and returns it as a line of text.

        Args:
            where: the topic or service.
            error: what was raised.
        """
        place = traceback.extract_tb(error.__traceback__)[-1]
        file = place.filename.rpartition("/")[2]
        what = f"{type(error).__name__} in {file}:{place.lineno}"
        self._last = f"{where}: a message could not be handled: {what}"
        self._counts[self._last] += 1
        count = self._counts[self._last]
        if str(count).strip("0") == "1":
            # The error's own words may quote what a stranger sent; they stay in this log.
            self._tell(f"{self._last}: {str(error)[:200]} ({count} so far); the node continues")
        return self._last

    def news(self) -> str:
        """Returns the exceptions since the last call in one line; empty if there are none."""
        new, self._reported = self.total - self._reported, self.total
        return f"{self._last} ({new} since the last report)" if new else ""


class GuardedNode(Node):
    """A node that keeps running when a callback raises an exception.

    Attributes:
        faults: what they stumbled over.
        mismatches: who is not heard, or does not hear, for another QoS.
    """

    _plain_logger: PlainLogger | None = None

    def __init__(self, name: str, **options: Any) -> None:
        # Before the node, which makes services of its own.
        self.faults = Faults(lambda line: self.get_logger().error(line))
        self.mismatches = Mismatches(self)
        super().__init__(name, **options)

    def get_logger(self) -> PlainLogger:
        """Returns the node's logger, which prints each message as one line."""
        if self._plain_logger is None:
            self._plain_logger = PlainLogger(super().get_logger().name)
        return self._plain_logger

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callback,
        qos_profile: QoSProfile | int,
        **options: Any,
    ) -> Any:
        """Creates a subscription that survives callback exceptions and detects QoS mismatches."""
        guarded = self._guarded(callback, topic)
        if isinstance(qos_profile, QoSProfile):
            watch = self.mismatches.of_subscription(topic, qos_profile)
            options.setdefault("event_callbacks", watch)
        return super().create_subscription(msg_type, topic, guarded, qos_profile, **options)

    def create_publisher(
        self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, **options: Any
    ) -> Any:
        """Creates a publisher that detects QoS mismatches."""
        if isinstance(qos_profile, QoSProfile):
            watch = self.mismatches.of_publisher(topic, qos_profile)
            options.setdefault("event_callbacks", watch)
        return super().create_publisher(msg_type, topic, qos_profile, **options)

    def create_timer(
        self, timer_period_sec: float, callback: Callback, *arguments: Any, **options: Any
    ) -> Any:
        """Creates a timer that survives exceptions in its callback."""
        guarded = self._guarded(callback, "timer")
        return super().create_timer(timer_period_sec, guarded, *arguments, **options)

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callback, *arguments: Any, **options: Any
    ) -> Any:
        """Creates a service that reports exceptions in its callback to the client."""

        @functools.wraps(callback)
        def guarded(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                said = self.faults.add(srv_name, error)
                if hasattr(response, "success"):
                    response.success, response.message = False, said
                return response

        return super().create_service(srv_type, srv_name, guarded, *arguments, **options)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Sets parameters; explains what to do about those that can be set only at the start."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Sets all parameters or none; explains parameters that can be set only at the start."""
        fixed = [
            parameter.name
            for parameter in parameter_list
            if self.has_parameter(parameter.name)
            and self.describe_parameter(parameter.name).read_only
        ]
        if fixed:
            name = fixed[0]
            return SetParametersResult(
                successful=False,
                reason=f"{name} is read at the start only: restart the node with -p {name}:=VALUE",
            )
        return super().set_parameters_atomically(parameter_list)

    def _guarded(self, callback: Callback, where: str) -> Callback:
        @functools.wraps(callback)
        def guarded(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except Exception as error:
                self.faults.add(where, error)

        return guarded


class PlainLogger(RcutilsLogger):
    """A logger that prints every message as one line without control characters.

    One method for each severity: rclpy refuses two severities from one place in the sources.
    """

    def debug(self, message: str, **options: Any) -> bool:
        """Logs a message at level debug."""
        return bool(super().debug(plain_line(message), **options))

    def info(self, message: str, **options: Any) -> bool:
        """Logs a message at level info."""
        return bool(super().info(plain_line(message), **options))

    def warning(self, message: str, **options: Any) -> bool:
        """Logs a message at level warning."""
        return bool(super().warning(plain_line(message), **options))

    def error(self, message: str, **options: Any) -> bool:
        """Logs a message at level error."""
        return bool(super().error(plain_line(message), **options))

    def fatal(self, message: str, **options: Any) -> bool:
        """Logs a message at level fatal."""
        return bool(super().fatal(plain_line(message), **options))

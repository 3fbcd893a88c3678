"""Parameters: one declaration gives type, default, bounds and description.

A value that does not fit is refused with the reason, at start-up and later.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from slosh_msgs_py.errors import SloshMessageError

_TYPES = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
    list: Parameter.Type.DOUBLE_ARRAY,
}


@dataclass(frozen=True, slots=True)
class ParameterSpec:
    """A parameter of a node.

    Attributes:
        name: its name.
        default: its default; the type too. A list is one of doubles.
        description: one line with the unit.
        bounds: least and greatest value of a number.
        choices: allowed texts; empty: any.
        read_only: read at the start only; False: it can be changed while the node runs.
        length: length of a list.
    """

    name: str
    default: bool | int | float | str | list[float]
    description: str
    bounds: tuple[float, float] | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = True
    length: int | None = None

    def descriptor(self) -> ParameterDescriptor:
        """What `ros2 param describe` shows."""
        about = self.description
        if self.choices:
            about += f" (one of {', '.join(self.choices)})"
        descriptor = ParameterDescriptor(description=about, read_only=self.read_only)
        if self.bounds and isinstance(self.default, float):
            low, high = self.bounds
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        elif self.bounds and isinstance(self.default, int):
            first, last = (int(value) for value in self.bounds)
            descriptor.integer_range = [IntegerRange(from_value=first, to_value=last)]
        return descriptor

    def refusal(self, value: Any) -> str | None:
        """Why a value of the right type does not fit; None: it fits."""
        if self.choices and value not in self.choices:
            return f"{self.name} = {value!r} must be one of {', '.join(self.choices)}"
        if self.length is not None and len(value) != self.length:
            return f"{self.name} = {list(value)!r} must have {self.length} numbers"
        numbers = value if isinstance(self.default, list) else [value]
        if self.bounds and not all(
            self.bounds[0] <= number <= self.bounds[1] for number in numbers
        ):
            return f"{self.name} = {value!r} must lie in [{self.bounds[0]:g}, {self.bounds[1]:g}]"
        return None


def declare(
    node: Node,
    specs: Sequence[ParameterSpec],
    check: Callable[[Mapping[str, Any]], object] | None = None,
    apply: Callable[[tuple[str, ...]], object] | None = None,
) -> dict[str, Any]:
    """Declares the parameters of a node.

    A later change is checked first, and refused as a whole with the reason. It is applied after
    the node has accepted it.

    Args:
        node: the node.
        specs: its parameters.
        check: receives all values as they would be after a change; raises a ValueError of ours
            where they do not fit together. It must change nothing.
        apply: receives the names of the parameters whose values have changed.

    Returns:
        the values by name; the node's changes are made in it.

    Raises:
        SloshMessageError: a start-up value is refused; the text says which and why.
    """
    values = {spec.name: _declare_one(node, spec) for spec in specs}
    _name_unknown(node)
    by_name = {spec.name: spec for spec in specs}

    def known(changes: list[Parameter]) -> dict[str, Any]:
        return {c.name: _plain(c.value) for c in changes if c.name in by_name}

    def judge(changes: list[Parameter]) -> SetParametersResult:
        new = known(changes)
        reasons = [by_name[name].refusal(value) for name, value in new.items()]
        reason = next(filter(None, reasons), "")
        if new and check is not None and not reason:
            try:
                check({**values, **new})
            except ValueError as error:
                if not type(error).__module__.startswith("slosh_"):
                    raise
                reason = str(error)
        return SetParametersResult(successful=not reason, reason=reason)

    def take(changes: list[Parameter]) -> None:
        changed = {name: v for name, v in known(changes).items() if v != values[name]}
        values.update(changed)
        if changed and apply is not None:
            apply(tuple(changed))

    node.add_on_set_parameters_callback(judge)
    node.add_post_set_parameters_callback(take)
    return values


def _name_unknown(node: Node) -> None:
    """Names what was given and is no parameter of the node: ROS drops it without a word.

    It is no error: a file for several nodes may set, for all of them, what only one has.
    """
    # rclpy has no other way to ask.
    given = getattr(node, "_parameter_overrides", {})
    for name in given:
        if not node.has_parameter(name) and not name.startswith("qos_overrides."):
            node.get_logger().warning(f"parameter {name} is unknown to this node: it does nothing")


def _declare_one(node: Node, spec: ParameterSpec) -> Any:
    try:
        value = node.declare_parameter(spec.name, spec.default, spec.descriptor()).value
    except InvalidParameterTypeException as error:
        wanted = _TYPES[type(spec.default)].name.lower()
        hint = "; write 1.0 for 1" if wanted.startswith("double") else ""
        raise SloshMessageError(
            f"parameter {spec.name}: a {wanted} is needed{hint} ({_one_line(error)})"
        ) from None
    except InvalidParameterValueException as error:
        low, high = spec.bounds or (float("-inf"), float("inf"))
        raise SloshMessageError(
            f"parameter {spec.name} must lie in [{low:g}, {high:g}] ({_one_line(error)})"
        ) from None
    reason = spec.refusal(value)
    if reason:
        raise SloshMessageError(f"parameter {reason}")
    return _plain(value)


def _plain(value: Any) -> Any:
    """A value of a parameter as Python has it: rclpy gives an array for a list."""
    return value if isinstance(value, bool | int | float | str) else list(value)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())

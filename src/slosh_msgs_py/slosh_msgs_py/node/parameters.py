"""Declares ROS parameters with type, default, bounds and description.

A value that does not fit is refused with the reason, at start-up and later. An integer is accepted
where a float is needed, and a list of integers where a list of floats is.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.parameter import Parameter

from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.node.guarded import GuardedNode

_TYPES = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
    list: Parameter.Type.DOUBLE_ARRAY,
}
_INTEGERS = {
    Parameter.Type.DOUBLE: Parameter.Type.INTEGER,
    Parameter.Type.DOUBLE_ARRAY: Parameter.Type.INTEGER_ARRAY,
}
"""The type that is accepted in place of another, and converted."""


@dataclass(frozen=True, slots=True)
class ParameterSpec:
    """Declaration of a node's parameter: name, type, default, bounds, description.

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
        """Returns the descriptor that `ros2 param describe` shows."""
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

    def converted(self, given: Parameter) -> Parameter | None:
        """Converts integers to floats if needed; returns None for a wrong type."""
        wanted = _TYPES[type(self.default)]
        if given.type_ == wanted:
            return given
        if given.type_ != _INTEGERS.get(wanted):
            return None
        if isinstance(self.default, list):
            return Parameter(self.name, wanted, [float(number) for number in given.value])
        return Parameter(self.name, wanted, float(given.value))

    def wrong_type(self, given: Parameter) -> str:
        """Describes in one line which type was given and which is needed."""
        wanted, found = (
            kind.name.lower().replace("_", " ")
            for kind in (_TYPES[type(self.default)], given.type_)
        )
        if given.type_ == Parameter.Type.NOT_SET:
            return f"{self.name} has no value: type {wanted} is needed"
        value = list(given.value) if isinstance(given.value, array) else given.value
        return f"{self.name} = {value!r}: type {wanted} is needed, not {found}"

    def refusal(self, value: Any) -> str | None:
        """Returns why a value of the right type is invalid, or None if it is valid."""
        if self.choices and value not in self.choices:
            return f"{self.name} = {value!r} must be one of {', '.join(self.choices)}"
        if self.length is not None and len(value) != self.length:
            return f"{self.name} = {list(value)!r} must have {self.length} numbers"
        numbers = list(value) if isinstance(self.default, list) else [value]
        if self.bounds and not all(
            self.bounds[0] <= number <= self.bounds[1] for number in numbers
        ):
            shown = numbers if isinstance(self.default, list) else value
            return f"{self.name} = {shown!r} must lie in [{self.bounds[0]:g}, {self.bounds[1]:g}]"
        return None


def declare(
    node: GuardedNode,
    specs: Sequence[ParameterSpec],
    check: Callable[[Mapping[str, Any]], object] | None = None,
    apply: Callable[[tuple[str, ...]], object] | None = None,
) -> dict[str, Any]:
    """Declares the parameters of a node and checks their values.

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
    wrong: list[str] = []

    def convert(changes: list[Parameter]) -> list[Parameter]:
        """Converts changed values to the declared types; records values of a wrong type."""
        wrong.clear()
        return [_fitting(node, by_name.get(change.name), change, wrong) for change in changes]

    def known(changes: list[Parameter]) -> dict[str, Any]:
        return {c.name: _plain(c.value) for c in changes if c.name in by_name}

    def judge(changes: list[Parameter]) -> SetParametersResult:
        new = known(changes)
        reasons = [*wrong, *(by_name[name].refusal(value) for name, value in new.items())]
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
        if changed and node.journal is not None:
            node.journal.take_values(changed)
        values.update(changed)
        if changed and apply is not None:
            apply(tuple(changed))

    node.add_pre_set_parameters_callback(convert)
    node.add_on_set_parameters_callback(judge)
    node.add_post_set_parameters_callback(take)
    return values


def _fitting(
    node: GuardedNode, spec: ParameterSpec | None, change: Parameter, wrong: list[str]
) -> Parameter:
    """Converts a changed value to its type, or keeps the present value and adds an error."""
    converted = change if spec is None else spec.converted(change)
    if spec is None or converted is not None:
        return converted or change
    wrong.append(spec.wrong_type(change))
    return node.get_parameter(spec.name)


def _given(node: GuardedNode) -> dict[str, Parameter]:
    """Returns the parameters given at the node's start, which rclpy does not make public."""
    given: dict[str, Parameter] = getattr(node, "_parameter_overrides", {})
    return given


def _name_unknown(node: GuardedNode) -> None:
    """Warns of parameters given to the node that it does not declare.

    It is no error: a file for several nodes may set, for all of them, what only one has.
    """
    for name in _given(node):
        if not node.has_parameter(name) and not name.startswith("qos_overrides."):
            node.get_logger().warning(
                f"parameter {name} is unknown to this node and has no effect"
            )


def _declare_one(node: GuardedNode, spec: ParameterSpec) -> Any:
    given = _given(node)
    if spec.name in given:
        converted = spec.converted(given[spec.name])
        if converted is None:
            raise SloshMessageError(f"parameter {spec.wrong_type(given[spec.name])}")
        reason = spec.refusal(converted.value)
        if reason:
            raise SloshMessageError(f"parameter {reason}")
        given[spec.name] = converted
    return _plain(node.declare_parameter(spec.name, spec.default, spec.descriptor()).value)


def _plain(value: Any) -> Any:
    """Converts a parameter's value to built-in Python types; rclpy gives arrays for lists."""
    return value if isinstance(value, bool | int | float | str) else list(value)

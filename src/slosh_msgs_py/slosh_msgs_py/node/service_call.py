"""Calls a service by its name; the type is that which the graph tells."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import rclpy
from rclpy.node import Node

from slosh_base.files.nearest import did_you_mean
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.node.run import initialise, make_heard
from slosh_msgs_py.plain_fields import plain_fields, set_fields

_POLL = 0.05  # s


def call_service(
    name: str, fields: Mapping[str, Any], patience: float, answer_time: float
) -> dict[str, Any]:
    """Calls a service once, in a node of its own.

    Args:
        name: full name, such as /slosh/reset.
        fields: of the request, as `set_fields` takes them.
        patience: how long to wait for the service [s].
        answer_time: how long to wait for the answer [s].

    Returns:
        the answer's fields.

    Raises:
        SloshMessageError: no such service, a wrong field, or no answer in time.
    """
    initialise([])
    try:
        node = make_heard(
            lambda: rclpy.create_node(
                f"slosh_call_{os.getpid()}", start_parameter_services=False, enable_rosout=False
            )
        )
        kind = _type_of(node, name, patience)
        request = kind.Request()
        set_fields(request, fields)
        client = node.create_client(kind, name)
        if not client.wait_for_service(patience):
            raise SloshMessageError(f"{name}: nobody answers this service")
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future, timeout_sec=answer_time)
        if not future.done():
            raise SloshMessageError(
                f"{name}: no answer within {answer_time:g} s; whether it was done is unknown"
            )
        return plain_fields(future.result())
    finally:
        rclpy.try_shutdown()


def _type_of(node: Node, name: str, patience: float) -> Any:
    """Returns the class of a service's type, as soon as the graph tells it."""
    deadline = time.monotonic() + patience
    while True:
        known = dict(node.get_service_names_and_types())
        if name in known:
            break
        if time.monotonic() > deadline:
            raise SloshMessageError(
                f"{name}: no such service within {patience:g} s{_near(name, known)}"
            )
        rclpy.spin_once(node, timeout_sec=_POLL)
    if len(known[name]) > 1:
        raise SloshMessageError(f"{name}: has several types: {', '.join(known[name])}")
    package, _, kind = known[name][0].partition("/srv/")
    try:
        return getattr(import_module(f"{package}.srv"), kind)
    except (ImportError, AttributeError):
        raise SloshMessageError(
            f"{name}: its type {known[name][0]} is not installed here"
        ) from None


def _near(name: str, known: Mapping[str, object]) -> str:
    meant = did_you_mean(name, known)
    if meant:
        return meant
    beside = [one for one in sorted(known) if one.rpartition("/")[0] == name.rpartition("/")[0]]
    if beside:
        return f"; there are {', '.join(beside)}"
    return "; is its node running, with this ROS_DOMAIN_ID?"

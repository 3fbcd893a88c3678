"""`slosh call`: calls a service of a running node, as `ros2 service call` does."""

from __future__ import annotations

import argparse
import json
from typing import Any

from slosh_base.files.yaml_document import format_yaml, parse_yaml
from slosh_bringup.cli.quantities import time
from slosh_bringup.errors import SloshBringupError
from slosh_msgs_py.topics import NAMESPACE

_LONG = 20
"""Longer lists are not printed as text."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh call` to the argument parser."""
    parser.add_argument("service", metavar="SERVICE", help="name, such as reset or /slosh/reset")
    parser.add_argument(
        "fields", nargs="*", metavar="FIELD",
        help="fields of the request as YAML: 'name: mug' 'limit: 0.01', or one {name: mug, …}",
    )  # fmt: skip
    parser.add_argument(
        "--namespace",
        default=NAMESPACE,
        help=f"of a SERVICE without a leading / (default {NAMESPACE})",
    )
    parser.add_argument(
        "--wait", type=time(3600.0), default=5.0, metavar="S",
        help="longest wait for the service [s] (default 5)",
    )  # fmt: skip
    parser.add_argument(
        "--answer", type=time(3600.0), default=60.0, metavar="S",
        help="longest wait for its answer [s] (default 60)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the whole answer as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Prints the answer; 1 if the service says that it failed."""
    request = fields_of(arguments.fields)
    from slosh_msgs_py.node.service_call import call_service  # with ROS

    name = arguments.service
    if not name.startswith("/"):
        name = f"{arguments.namespace.rstrip('/')}/{name}"
    answer = call_service(name, request, arguments.wait, arguments.answer)
    if arguments.json:
        print(json.dumps(answer))
    elif answer:
        print(format_yaml(_short(answer), sort_keys=False, allow_unicode=True).rstrip())
    return 1 if _failed(answer) else 0


def fields_of(words: list[str]) -> dict[str, Any]:
    """Returns a request's fields from the words of a command line.

    Raises:
        SloshBringupError: a word holds no fields, or a field is given twice.
    """
    found: dict[str, Any] = {}
    for word in words:
        content = parse_yaml(word, "FIELD").value
        if not isinstance(content, dict):
            raise SloshBringupError(f"{word!r:.60}: is no field; write 'name: value', in quotes")
        twice = found.keys() & content.keys()
        if twice:
            raise SloshBringupError(f"{min(twice)}: is given twice")
        found |= content
    return found


def _failed(content: Any) -> bool:
    """Whether an answer, or a part of it, says that it did not succeed."""
    if isinstance(content, list):
        return any(map(_failed, content))
    if not isinstance(content, dict):
        return False
    said = any(content.get(key) is False for key in ("success", "successful"))
    return said or any(map(_failed, content.values()))


def _short(content: Any) -> Any:
    """Replaces long lists by their length."""
    if isinstance(content, dict):
        return {key: _short(value) for key, value in content.items()}
    if isinstance(content, list):
        return f"{len(content)} values" if len(content) > _LONG else [*map(_short, content)]
    return content

"""What the operator's page shows of the governor: how much of the command is followed."""

from __future__ import annotations

from typing import Any

from slosh_bringup.watch.state import Figure

DOING = ("following", "limited", "stopping", "at rest")
"""By GovernedMotion's `state`."""
STOPS = (
    "", "no command", "unusable command", "late clock", "stop requested", "joint states",
    "a turn", "too fast a command", "another frame", "an old command",
)  # fmt: skip
"""By its `reason`."""


def figure(message: Any) -> Figure:
    """Returns the figure of a GovernedMotion message."""
    doing, reason = _named(DOING, message.state), _named(STOPS, message.reason)
    unsafe = "" if message.safe else "no stop keeps the limit"
    words = " · ".join(filter(None, (doing, reason, unsafe)))
    return Figure("command followed", 100.0 * message.share, "%", words)


def _named(names: tuple[str, ...], number: int) -> str:
    return names[number] if number < len(names) else ""

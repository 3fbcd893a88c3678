"""The root exception of the package slosh_msgs_py."""

from __future__ import annotations


class SloshMessageError(ValueError):
    """Error of a message or a parameter with an invalid value; the message is one line."""

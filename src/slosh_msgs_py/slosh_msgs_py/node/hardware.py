"""Name or serial number of a cell for the diagnostics of its nodes; does not import ROS."""

from __future__ import annotations

from typing import Final

from slosh_base.files.plain_text import plain_line

HARDWARE_ID: Final = "SLOSH_HARDWARE_ID"
"""Environment variable with the name or serial number of the cell that a node belongs to."""


def hardware_id(namespace: str, given: str) -> str:
    """Returns the hardware_id of diagnostics: the configured text, or the cell's namespace.

    >>> hardware_id("/line_1/slosh", ""), hardware_id("/slosh", "SN 42")
    ('line_1/slosh', 'SN 42')

    Args:
        namespace: of the cell's nodes.
        given: name or serial number; empty: none is given.
    """
    return plain_line(given) or namespace.strip("/")

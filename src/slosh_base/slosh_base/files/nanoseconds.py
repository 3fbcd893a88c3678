"""The number of nanoseconds in a second, for time stamps."""

from __future__ import annotations

from typing import Final

SECOND: Final = 1_000_000_000
"""Nanoseconds of a second."""

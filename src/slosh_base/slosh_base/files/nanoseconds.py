"""Time stamps as whole nanoseconds, in every file and every core."""

from __future__ import annotations

from typing import Final

SECOND: Final = 1_000_000_000
"""Nanoseconds of a second."""

"""Constant for time stamps in whole nanoseconds."""

from __future__ import annotations

from typing import Final

SECOND: Final = 1_000_000_000
"""Nanoseconds of a second."""

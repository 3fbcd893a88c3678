"""Physical constants."""

from __future__ import annotations

from typing import Final

GRAVITY: Final = 9.81
"""Gravitational acceleration [m/s²], the value that DL22 and the reference data use."""

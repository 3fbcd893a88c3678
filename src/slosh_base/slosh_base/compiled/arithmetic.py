"""Distinguishes machines whose elementary functions round differently.

Sums, products and square roots are the same bits everywhere (IEEE 754); sines, arctangents and
hyperbolic functions come from the platform's library and may differ in the last bit.
"""

from __future__ import annotations

import hashlib
import math
import platform
from functools import cache

_SAMPLES = 257
"""Arguments per function: enough that two libraries that differ at all are seen to differ."""


@cache
def arithmetic_fingerprint() -> str:
    """Returns a short hash of how this machine rounds elementary functions.

    Returns:
        the machine's architecture and eight hexadecimal digits; equal on machines on which the
        same code gives the same bits.
    """
    digest = hashlib.sha256()
    for index in range(1, _SAMPLES):
        x = math.sqrt(index) * 0.0517
        values = (
            math.sin(x), math.cos(x), math.tanh(x), math.sinh(x), math.cosh(x),
            math.atan2(x, 1.3 - x), math.atan2(-1.0 / index, -x),
        )  # fmt: skip
        digest.update(" ".join(value.hex() for value in values).encode())
    return f"{platform.machine()}-{digest.hexdigest()[:8]}"

"""Memory that a node no longer needs."""

from __future__ import annotations

import ctypes
import gc


def give_back_memory() -> None:
    """Gives memory that is free in the process back to the system.

    A large message is unpacked into many small objects; when they are gone the C library keeps
    their memory. Only glibc can be asked for it; elsewhere nothing happens.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)

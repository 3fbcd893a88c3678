"""Suppresses messages that decoders of images, videos and robot descriptions print."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO, cast

from slosh_base.files.plain_text import PlainStream

_STDERR = 2


@contextmanager
def quiet_decoders() -> Iterator[None]:
    """Suppresses native libraries' output to standard error inside a `with` block.

    Decoders write there, one line and more for every damaged file, which gets its own line here.
    """
    before = sys.stderr
    with open(os.dup(_STDERR), "w", buffering=1) as terminal, open(os.devnull, "w") as nowhere:
        if _writes_to_standard_error(before):
            sys.stderr = cast("TextIO", PlainStream(terminal))
        os.dup2(nowhere.fileno(), _STDERR)
        try:
            yield
        finally:
            os.dup2(terminal.fileno(), _STDERR)
            sys.stderr = before


def _writes_to_standard_error(stream: TextIO) -> bool:
    try:
        return stream.fileno() == _STDERR
    except (OSError, ValueError):  # of a stream that is no file
        return False

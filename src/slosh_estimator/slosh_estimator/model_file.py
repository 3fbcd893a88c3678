"""Reads a `model.yaml`."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from slosh_estimator.errors import SloshEstimatorError
from slosh_model.model import Model
from slosh_model.model_text import LONGEST, parse_model


def read_model(path: str | Path) -> Model:
    """The model in a file.

    Raises:
        SloshEstimatorError: the file is no regular file, too large, or not readable text.
        SloshModelError: its content is no model; the text names the file and the key.
    """
    if not str(path):
        raise SloshEstimatorError("model: no file given; name a model.yaml")
    try:
        content = _content(str(path))
    except OSError as error:
        raise SloshEstimatorError(f"{path}: {error.strerror}") from None
    except ValueError as error:  # of a path with a zero byte
        raise SloshEstimatorError(f"{str(path)!r}: {error}") from None
    if content is None:
        raise SloshEstimatorError(f"{path}: no regular file")
    if len(content) > LONGEST:
        raise SloshEstimatorError(f"{path}: too large for a model file")
    try:
        text = content.decode()
    except UnicodeDecodeError:
        raise SloshEstimatorError(f"{path}: not a text file") from None
    return parse_model(text, str(path))


def _content(path: str) -> bytes | None:
    """The first bytes of a regular file; None: it is none. Waits for nobody."""
    # A named pipe without a writer, or a terminal, would hold up an ordinary open().
    with open(path, "rb", opener=_open_at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            return None
        return file.read(LONGEST + 1)


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC)

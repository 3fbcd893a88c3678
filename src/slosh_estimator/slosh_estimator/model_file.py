"""Reads model files."""

from __future__ import annotations

from pathlib import Path

from slosh_model.model import Model
from slosh_model.model_text import parse_model

from slosh_estimator.errors import SloshEstimatorError


def read_model(path: str | Path) -> Model:
    """Reads a model file.

    Raises:
        SloshEstimatorError: the file cannot be read.
        SloshModelError: its content is wrong; the text names the file, the key and the value.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise SloshEstimatorError(
            f"model file {str(path)!r} cannot be read: {error.strerror}"
        ) from None
    except UnicodeDecodeError as error:
        raise SloshEstimatorError(
            f"model file {str(path)!r} is not UTF-8 text: byte {error.start}"
        ) from None
    return parse_model(text, source=str(path))

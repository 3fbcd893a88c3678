"""Reads a `model.yaml`."""

from __future__ import annotations

from pathlib import Path

from slosh_estimator.errors import SloshEstimatorError
from slosh_model.model import Model
from slosh_model.model_text import parse_model

MAXIMUM_SIZE = 1_000_000  # bytes; a model is a page of text


def read_model(path: str | Path) -> Model:
    """The model in a file.

    Raises:
        SloshEstimatorError: the file is not readable text.
        SloshModelError: its content is no model; the text names the file and the key.
    """
    if not str(path):
        raise SloshEstimatorError("model: no file given; name a model.yaml")
    path = Path(path)
    try:
        if path.stat().st_size > MAXIMUM_SIZE:
            raise SloshEstimatorError(f"{path}: too large for a model file")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise SloshEstimatorError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SloshEstimatorError(f"{path}: not a text file") from None
    return parse_model(text, str(path))

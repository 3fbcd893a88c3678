"""Reads and writes a `model.yaml`."""

from __future__ import annotations

from pathlib import Path

from slosh_base.files import write_text
from slosh_base.files.errors import TextFileError
from slosh_base.files.text_file import read_text
from slosh_model.errors import ModelFileError
from slosh_model.model import Model
from slosh_model.model_text import LONGEST, format_model, parse_model


def read_model(path: str | Path) -> Model:
    """The model in a file.

    >>> from slosh_model import read_model
    >>> read_model("cup/model.yaml")
    Model(3D-NL, radius 40 mm, filled to 60 mm, 3.369 Hz, damping ratio 0.00603)

    Raises:
        ModelFileError: the file is no regular file, too large, or not readable text.
        SloshModelError: its content is no model; the text names the file, the line and the key.
    """
    if not str(path):
        raise ModelFileError("model: no file given; name a model.yaml")
    try:
        text = read_text(path, LONGEST)
    except TextFileError as error:
        raise ModelFileError(str(error)) from None
    return parse_model(text, str(path))


def write_model(path: str | Path, model: Model) -> None:
    """Writes a model that `read_model` reads back to an equal one.

    Raises:
        OSError: the file cannot be written; what was there is as it was.
    """
    write_text(Path(path), format_model(model))

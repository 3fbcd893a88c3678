"""Reads the model in a LoadModel request, whose content is untrusted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from slosh_estimator.errors import SloshEstimatorError
from slosh_model.errors import ModelFileError, SloshModelError
from slosh_model.model import Model
from slosh_model.model_text import parse_model, read_model
from slosh_model.tray import Tray, read_tray

T = TypeVar("T")


def requested_model(request: Any, tell: Callable[[str], object]) -> Model:
    """Returns the model of a LoadModel request.

    Args:
        request: of the service; a path or a text.
        tell: is told what is wrong with a file. The error that goes back does not say: a file's
            content is not for whoever asks.

    Raises:
        SloshEstimatorError, SloshModelError: there is none.
    """
    if bool(request.path) == bool(request.text):
        raise SloshEstimatorError("give either a path or a text")
    if request.text:
        return parse_model(request.text, "text")
    return model_at(request.path, tell, "load_model")


def model_at(path: str, tell: Callable[[str], object], service: str) -> Model:
    """Reads the model file that the caller of a service names."""
    return _read_at(read_model, path, tell, service)


def tray_at(path: str, tell: Callable[[str], object], service: str) -> Tray:
    """Reads the model or tray file that the caller of a service names.

    Args:
        path: of the file, on this machine.
        tell: as in `requested_model`.
        service: for what is told.

    Raises:
        SloshEstimatorError: there is none.
    """
    return _read_at(read_tray, path, tell, service)


def _read_at(
    read: Callable[[str], T], path: str, tell: Callable[[str], object], service: str
) -> T:
    try:
        return read(path)
    except ModelFileError as error:
        raise SloshEstimatorError(str(error)) from None
    except SloshModelError as error:
        tell(f"{service}: {error}")
        raise SloshEstimatorError(
            f"{path}: not a valid model; see the node's log for the line and the key"
        ) from None

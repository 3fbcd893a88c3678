"""The root exception of the package slosh_model."""

from __future__ import annotations


class SloshModelError(ValueError):
    """An error whose one-line text says why a container, model or input is impossible.

    >>> from slosh_model import Cylinder, SloshModelError
    >>> try:
    ...     Cylinder(radius=-0.04, fill_height=0.06)
    ... except SloshModelError as error:
    ...     print(error)
    container.radius = -0.04 m must lie in [0.0001, 10] m

    Attributes:
        keys: where the value stands in a model.yaml, such as ("effects", 0, "alpha"); empty: in
            no one place, or in none.
    """

    def __init__(self, text: str, keys: tuple[str | int, ...] = ()) -> None:
        super().__init__(text)
        self.keys = keys


class ModelFileError(SloshModelError):
    """An error that a model file cannot be read; its text does not reveal the content."""

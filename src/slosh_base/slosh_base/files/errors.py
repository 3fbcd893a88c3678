"""The package's exceptions."""

from __future__ import annotations


class SloshFileError(ValueError):
    """An output would destroy what is there, or an input is not what is to be read.

    The text is one line with the path.
    """


class TextFileError(SloshFileError):
    """A text file cannot be read.

    Attributes:
        reason: why, without the path.
    """

    def __init__(self, path: object, reason: str) -> None:
        super().__init__(f"{path}: {reason}")
        self.reason = reason

    def __reduce__(self) -> tuple[type[SloshFileError], tuple[str]]:
        # Errors travel between processes as their text.
        return SloshFileError, (str(self),)


class YamlError(SloshFileError):
    """A text is no YAML, stands for too much, or gives a key twice: `FILE:LINE: what`."""

"""Exceptions for files that cannot be read or written."""

from __future__ import annotations


class SloshFileError(ValueError):
    """Error of an output that would overwrite data, or of an input of the wrong kind.

    The text is one line with the path.
    """


class TextFileError(SloshFileError):
    """Error of a text file that cannot be read.

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
    """Error of invalid YAML; the message starts with file and line."""

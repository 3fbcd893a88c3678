"""The package's exceptions."""

from __future__ import annotations


class SloshFileError(ValueError):
    """An output would overwrite existing data, or an input has another kind.

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
    """Invalid YAML, too large a document, or a duplicate key: `FILE:LINE: what`."""

"""Template environment of all pages, scripts, and texts that HTML can hold."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import dataclass
from importlib import resources
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from slosh_report.page.frame import Frame

UNREADABLE = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\u202a-\u202e\u2066-\u2069]"
)
"""Control characters, halves of surrogate pairs, and overrides of the direction of writing."""


def make_environment(package: str) -> Environment:
    """Creates the template environment with a package's own and the common templates.

    Args:
        package: whose folder holds the page's own template.
    """
    environment = Environment(
        loader=ChoiceLoader(
            [
                PackageLoader(package, "."),
                PackageLoader("slosh_report.page", "."),
                PackageLoader("slosh_report", "uplot"),
            ]
        ),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=readable,
    )
    environment.filters.update(data_uri=data_uri)
    return environment


@dataclass(frozen=True, slots=True)
class Script:
    """A script embedded in a report page and allowed by its hash in the content security policy.

    Attributes:
        element: the <script> element.
        source: for the policy's script-src.
    """

    element: Markup
    source: str


def script(package: str, name: str) -> Script:
    """Reads a JavaScript file from the folder of a package.

    Args:
        package: whose folder holds it.
        name: of the file.
    """
    return script_of(resources.files(package).joinpath(name).read_text("utf-8"))


def script_of(text: str) -> Script:
    """Creates a script from its text, which must not contain `</script`."""
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
    # The text is the project's own and not a user's: it is not escaped, or it would be another.
    return Script(Markup(f"<script>{text}</script>"), f"'sha256-{digest}'")


def readable(value: Any) -> Any:
    """Replaces characters that HTML cannot contain or that reorder text."""
    return UNREADABLE.sub("\ufffd", value) if type(value) is str else value


def breakable(text: str) -> Markup:
    """Formats a name as HTML with line breaks allowed between its parts."""
    parts = re.split(r"(?<=[/._])", text)
    return Markup("<wbr>").join(readable(part) for part in parts if part)


def data_uri(frame: Frame) -> str:
    """Returns a frame's image as a data URI."""
    return image_uri(frame.image, frame.media_type)


def image_uri(image: bytes, media_type: str) -> str:
    """Returns an encoded image as a data URI."""
    return f"data:{media_type};base64,{base64.b64encode(image).decode('ascii')}"

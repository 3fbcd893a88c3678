"""Results of checks as JUnit XML, which every CI reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from slosh_bringup.errors import SloshBringupError


class Case(NamedTuple):
    """One thing that was looked at.

    Attributes:
        name: what it is.
        failure: why it is not as expected; empty: it is.
        error: why it could not be looked at; empty: it could.
    """

    name: str
    failure: str = ""
    error: str = ""


def write_junit(path: Path, title: str, suites: Sequence[tuple[str, Sequence[Case]]]) -> None:
    """Writes a JUnit file.

    Args:
        path: the file.
        title: of the whole.
        suites: name and cases of each suite.

    Raises:
        SloshBringupError: it cannot be written.
    """
    root = ElementTree.Element("testsuites", name=title)
    for name, cases in suites:
        suite = ElementTree.SubElement(
            root, "testsuite", name=name, tests=str(len(cases)),
            failures=str(sum(bool(case.failure) for case in cases)),
            errors=str(sum(bool(case.error) for case in cases)),
        )  # fmt: skip
        for case in cases:
            element = ElementTree.SubElement(
                suite, "testcase", classname=name, name=_legal(case.name)
            )
            for kind, text in (("failure", case.failure), ("error", case.error)):
                if text:
                    ElementTree.SubElement(element, kind, message=_legal(text)).text = _legal(text)
    ElementTree.indent(root)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise SloshBringupError(f"{path}: {error.strerror}") from None


def _legal(text: str) -> str:
    """Without the control characters that XML does not allow."""
    return "".join(c if c in "\t\n\r" or ord(c) >= 0x20 else "\ufffd" for c in text)

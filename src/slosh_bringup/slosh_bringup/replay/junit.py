"""Writes check results as JUnit XML, which CI systems read."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from slosh_base.files import NewFile

_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 does not allow: control characters, half surrogate pairs, two non-characters."""


class Case(NamedTuple):
    """One check in a JUnit file.

    Attributes:
        name: what it is.
        failure: why it is not as expected; empty: it is.
        error: why it could not be looked at; empty: it could.
    """

    name: str
    failure: str = ""
    error: str = ""


class Suite(NamedTuple):
    """A group of checks in a JUnit file.

    Attributes:
        name: of what was looked at.
        cases: in order.
        seconds: that it took.
    """

    name: str
    cases: Sequence[Case]
    seconds: float = 0.0


def write_junit(path: Path, title: str, suites: Sequence[Suite]) -> None:
    """Writes the results of checks as a JUnit XML file.

    Args:
        path: the file.
        title: of the whole.
        suites: what was looked at.

    Raises:
        OSError: it cannot be written; what was there is as it was.
    """
    root = ElementTree.Element("testsuites", {"name": _legal(title), **_totals(suites)})
    for suite in suites:
        name = _legal(suite.name)
        element = ElementTree.SubElement(root, "testsuite", {"name": name, **_totals([suite])})
        for number, case in enumerate(suite.cases):
            # A case that has no time of its own counts as nothing; the first one did the work.
            seconds = suite.seconds if number == 0 else 0.0
            _add_case(element, name, case, seconds)
    ElementTree.indent(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    with NewFile(path) as new, new.open() as stream:
        ElementTree.ElementTree(root).write(stream, encoding="utf-8", xml_declaration=True)


def _add_case(suite: ElementTree.Element, class_name: str, case: Case, seconds: float) -> None:
    element = ElementTree.SubElement(
        suite, "testcase", classname=class_name, name=_legal(case.name), time=f"{seconds:.3f}"
    )
    for kind, text in (("failure", case.failure), ("error", case.error)):
        if text:
            ElementTree.SubElement(element, kind, message=_legal(text)).text = _legal(text)


def _totals(suites: Sequence[Suite]) -> dict[str, str]:
    cases = [case for suite in suites for case in suite.cases]
    return {
        "tests": str(len(cases)),
        "failures": str(sum(bool(case.failure) for case in cases)),
        "errors": str(sum(bool(case.error) for case in cases)),
        "time": f"{sum(suite.seconds for suite in suites):.3f}",
    }


def _legal(text: str) -> str:
    return _ILLEGAL.sub("\ufffd", text)

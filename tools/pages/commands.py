"""Extracts from a documentation page its shell commands and the output that it shows."""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_FENCE = re.compile(r"^```(?P<language>[\w{}-]*)\n(?P<body>.*?)^```$", re.M | re.S)
_OWN = re.compile(r"(?:\w+=\S+ )*(?:slosh [a-z]+(?!:)\b|make [a-z]|(?:\$SLOSH/)?tools/run |cd )")
_CTRL_C = re.compile(r"\s+# Ctrl-C after \"(?P<after>.+)\"$")
_NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?")
_TYPED, _SHOWN = "sh", ""
# What two runs may differ by: a third, or in the last digits of what is small.
_PART, _LEAST = 1 / 3, 0.3


@dataclass(frozen=True, slots=True)
class Command:
    """A shell command on a documentation page, with its line number.

    Attributes:
        text: the line, with those that continue it.
        line: of the page, from 1.
        ctrl_c_after: Ctrl-C is pressed when this has been printed; empty: it ends by itself.
    """

    text: str
    line: int
    ctrl_c_after: str = ""


@dataclass(frozen=True, slots=True)
class Block:
    """Consecutive shell commands, and the lines that the page shows as their output."""

    commands: tuple[Command, ...]
    shown: tuple[str, ...] = ()


def blocks_of(page: Path) -> list[Block]:
    """Returns a page's shell blocks in order, each with the output block that follows it."""
    blocks: list[Block] = []
    text = page.read_text(encoding="utf-8")
    for fence in _FENCE.finditer(text):
        body, first = fence["body"], text.count("\n", 0, fence.start("body")) + 1
        if fence["language"] == _TYPED:
            blocks.append(Block(tuple(_commands(body, first))))
        elif fence["language"] == _SHOWN and blocks and not blocks[-1].shown:
            blocks[-1] = Block(blocks[-1].commands, tuple(filter(None, body.splitlines())))
    return blocks


def _commands(body: str, first: int) -> Iterator[Command]:
    """Yields a block's commands without comments; a backslash continues a line."""
    kept, start = "", first
    for number, line in enumerate(body.splitlines(), first):
        start = start if kept else number
        if line.endswith("\\"):
            kept += line[:-1].rstrip() + " "
            continue
        text, kept = (kept + line.strip()).strip().removeprefix("$ "), ""
        if text and not text.startswith("#"):
            ctrl_c = _CTRL_C.search(text)
            yield Command(_CTRL_C.sub("", text), start, ctrl_c["after"] if ctrl_c else "")


def words_of(command: str) -> list[str]:
    """Splits a command into words as a shell does, without comments after two spaces or a #."""
    return shlex.split(re.split(r"\s{2,}", command)[0], comments=True)


def not_said(shown: tuple[str, ...], said: str) -> list[str]:
    """Returns the lines of output that a page shows but that were not printed.

    Numbers may differ by a third or by 0.3; `…` in a shown line stands for anything.
    """
    lines = [" ".join(line.split()) for line in said.splitlines()]
    return [
        line for line in shown if not any(_alike(" ".join(line.split()), one) for one in lines)
    ]


def _alike(shown: str, said: str) -> bool:
    pattern = "".join(
        "(.*)" if part == "…" else rf"({_NUMBER.pattern})" if _NUMBER.fullmatch(part) else
        re.escape(part)
        for part in re.split(rf"(…|{_NUMBER.pattern})", shown)
    )  # fmt: skip
    found = re.fullmatch(pattern, said)
    if found is None:
        return False
    expected = re.findall(rf"…|{_NUMBER.pattern}", shown)
    return all(
        one == "…" or abs(float(one) - float(other)) <= max(_LEAST, _PART * abs(float(one)))
        for one, other in zip(expected, found.groups(), strict=True)
    )


def command_lines(page: Path) -> Iterator[Command]:
    """Yields all of this project's commands on a page, in fenced and in indented blocks.

    Commands are those of this project: `slosh`, `make`, `tools/run`, and `cd`. What stands before
    a colon, as in `slosh cell: stopped`, is an answer.
    """
    for body, first in _blocks_to_type(page.read_text(encoding="utf-8")):
        for command in _commands(body, first):
            if _OWN.match(command.text):
                yield command


def _blocks_to_type(text: str) -> Iterator[tuple[str, int]]:
    for fence in _FENCE.finditer(text):
        if fence["language"] in ("", _TYPED, "console", "bash"):
            yield fence["body"], text.count("\n", 0, fence.start("body")) + 1
    # Of the same length, so that lines stay where they are.
    rest = _FENCE.sub(lambda fence: "\n" * fence[0].count("\n"), text)
    for block in re.finditer(r"(?:^ {4,}\S.*\n)+", rest, re.M):
        yield textwrap.dedent(block[0]), rest.count("\n", 0, block.start()) + 1

"""Runs the commands of the first-steps tutorials in order and measures their time.

    python3 tools/tutorial.py [--home DIR]

It types what stands in the pages' shell blocks and nothing else, in a fresh clone as in any other,
and ends where a command fails or a page shows an answer that does not come. The home directory is
an empty one, so that nothing of one's own is touched. Needs the standard library alone.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from pages.commands import Block, blocks_of, not_said
from pages.shell import Shell, ShellError

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("cup", "camera", "robot")
PATIENCE = 900.0
"""For a single command [s]: the first sets everything up."""
NOT_INHERITED = (
    "PYTHON", "MAKE", "MFLAGS", "LD_", "AMENT_", "CMAKE_", "VIRTUAL_ENV", "SLOSH", "_ROS_WHEELS",
)  # fmt: skip
"""Variables that begin so belong to the workspace, or to what this process was started by."""


class TutorialError(Exception):
    """Error of a page whose commands fail; the text begins with page and line number."""


class Typed(NamedTuple):
    """A command that was run: its page, its text and its duration [s]."""

    page: str
    command: str
    seconds: float


def main(words: Sequence[str] | None = None) -> int:
    """Runs all tutorial pages; prints the duration of each command and each page."""
    parser = argparse.ArgumentParser(description="Types the first steps' commands.")
    parser.add_argument(
        "--home", type=Path, metavar="DIR", help="empty home folder (default: a new one)"
    )
    given = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as folder:
        try:
            with Shell(ROOT, environment(given.home or Path(folder)), PATIENCE) as shell:
                for page in PAGES:
                    total = 0.0
                    for typed in type_page(shell, page):
                        total += typed.seconds
                        print(f"{typed.seconds:7.1f} s  {typed.command}", flush=True)
                    print(f"{total:7.1f} s  the whole page {path_of(page)}\n", flush=True)
        except (TutorialError, ShellError) as error:
            print(f"tutorial: {error}", file=sys.stderr)
            return 1
    return 0


def path_of(page: str) -> Path:
    """Returns the path of a tutorial page, relative to the repository's root."""
    return Path("docs", "start", f"{page}.md")


def environment(home: Path) -> dict[str, str]:
    """Returns the environment of a new terminal with an empty home, except for caches."""
    cache = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(NOT_INHERITED)}
    outside = [part for part in kept["PATH"].split(":") if not Path(part).is_relative_to(ROOT)]
    return {**kept, "PATH": ":".join(outside), "HOME": str(home), "XDG_CACHE_HOME": cache}


def type_page(shell: Shell, page: str) -> Iterator[Typed]:
    """Runs all commands of a tutorial page.

    Raises:
        TutorialError: a command fails, or does not print what the page shows.
        ShellError: a command does not end.
    """
    for block in blocks_of(ROOT / path_of(page)):
        said = yield from _type_block(shell, page, block)
        missing = not_said(block.shown, said)
        if missing:
            line = block.commands[-1].line
            raise TutorialError(
                f"{path_of(page)}:{line}: the page shows what is not printed:\n"
                + "\n".join(missing) + f"\nprinted is:\n{said}"
            )  # fmt: skip


def _type_block(shell: Shell, page: str, block: Block) -> Generator[Typed, None, str]:
    """Runs the commands of one shell block; returns their combined output."""
    said = ""
    for command in block.commands:
        answer = shell.type(command.text, command.ctrl_c_after)
        said += answer.said
        if answer.code != 0:
            raise TutorialError(
                f"{path_of(page)}:{command.line}: {command.text}: exit code {answer.code}\n{said}"
            )
        yield Typed(page, command.text, answer.seconds)
    return said


if __name__ == "__main__":
    sys.exit(main())

"""In whichever order processes compile, live estimates, replays and simulations are the same bits.

Every process finds in the cache what those before it compiled, each in an order of its own.
What makes it so is tried in seconds beside the model: one name, one code (test_compilation.py).
"""

import functools
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

PROGRAM = Path(__file__).with_name("compiled_work.py")
WORKS = ("live", "simulate", "replay", "detect", "discover")
PATIENCE = 600.0


def start(work: str, folder: Path, cache: Path | None) -> subprocess.Popen[str]:
    """A work in a process of its own, with a compile cache of its own or the usual one."""
    own = {} if cache is None else {"NUMBA_CACHE_DIR": str(cache)}
    place = folder / f"{work}_{len(list(folder.iterdir()))}"
    place.mkdir()
    return subprocess.Popen(
        [sys.executable, str(PROGRAM), work, str(place)],
        env={**os.environ, **own},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: subprocess.Popen[str]) -> str:
    """What it printed; it ended well."""
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    return output


def compare(folder: Path, cache: Path | None) -> dict[str, Any]:
    """By effect: what differs, and a digest of all bits."""
    found: dict[str, Any] = json.loads(finish(start("compare", folder, cache)))
    return found


@functools.cache
def expected_bits() -> dict[str, Any]:
    """The bits with the cache that the set-up filled."""
    with tempfile.TemporaryDirectory() as folder:
        return compare(Path(folder), None)


def check(folder: Path, cache: Path) -> None:
    """Every effect gives the expected bits with this cache."""
    found, expected = compare(folder, cache), expected_bits()
    assert {name: one["differ"] for name, one in found.items()} == {name: [] for name in expected}
    assert found == expected


def work_in_turn(works: Sequence[str], folder: Path, cache: Path) -> None:
    """One work after the other."""
    for work in works:
        finish(start(work, folder, cache))


@pytest.mark.long
@pytest.mark.timeout(4 * PATIENCE)
@pytest.mark.parametrize(("turn", "backwards"), [(0, False), (1, True), (3, False)])
def test_all_of_them_in_turn(turn: int, backwards: bool, tmp_path: Path) -> None:
    works = (*WORKS[turn:], *WORKS[:turn])
    work_in_turn(works[::-1] if backwards else works, tmp_path, tmp_path / "cache")
    check(tmp_path, tmp_path / "cache")


@pytest.mark.long
@pytest.mark.timeout(4 * PATIENCE)
def test_all_of_them_at_once(tmp_path: Path) -> None:
    running = [start(work, tmp_path, tmp_path / "cache") for work in ("step", *WORKS)]
    for process in running:
        finish(process)
    check(tmp_path, tmp_path / "cache")

"""Tests that results are identical in whichever order processes compile the functions.

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
    """Starts a program of compiled_work.py in its own process, with a given compile cache."""
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
    """Waits for a process's success and returns its output."""
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    return output


def compare(folder: Path, cache: Path | None) -> dict[str, Any]:
    """Returns, for each modelled effect, what differs and a hash of all results."""
    found: dict[str, Any] = json.loads(finish(start("compare", folder, cache)))
    return found


@functools.cache
def expected_bits() -> dict[str, Any]:
    """Returns the result hashes with the compile cache of this installation."""
    with tempfile.TemporaryDirectory() as folder:
        return compare(Path(folder), None)


def check(folder: Path, cache: Path) -> None:
    """Checks that every modelled effect gives the expected results with a compile cache."""
    found, expected = compare(folder, cache), expected_bits()
    assert {name: one["differ"] for name, one in found.items()} == {name: [] for name in expected}
    assert found == expected


def work_in_turn(works: Sequence[str], folder: Path, cache: Path) -> None:
    """Runs several programs one after the other with the same compile cache."""
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

"""Cache of computed modes on disk, next to the compiled code."""

from __future__ import annotations

import contextlib
import hashlib
import json
from dataclasses import asdict
from functools import cache
from pathlib import Path

from slosh_base.compiled.compile_cache import cache_folder
from slosh_base.files import write_bytes
from slosh_model.errors import SloshModelError
from slosh_model.shapes.mode_numbers import ModeNumbers


@cache
def _version() -> str:
    """Returns a digest of the source code that computes the modes."""
    digest = hashlib.sha256()
    folder = Path(__file__).parent
    for path in (*sorted(folder.glob("*.py")), *sorted((folder.parent / "shapes").glob("*.py"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _path(key: str) -> Path:
    return cache_folder() / f"modes-{_version()}-{key}.json"


def read(key: str) -> tuple[ModeNumbers, ...] | None:
    """Reads modes from the cache, or returns None if they are missing or incomplete."""
    try:
        rows = json.loads(_path(key).read_bytes())
        return tuple(
            ModeNumbers(**{**row, "surface": tuple((r, h) for r, h in row["surface"])})
            for row in rows
        )
    except (OSError, ValueError, TypeError, KeyError, SloshModelError):
        return None


def write(key: str, modes: tuple[ModeNumbers, ...]) -> None:
    """Writes computed modes to the cache on disk; ignores write errors."""
    text = json.dumps([asdict(mode) for mode in modes])
    with contextlib.suppress(OSError):
        write_bytes(_path(key), text.encode(), sync=False)

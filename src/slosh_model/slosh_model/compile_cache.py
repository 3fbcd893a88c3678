"""Where compiled functions are kept between processes.

Numba notices an edit of the module that holds a cached function, but not of the modules whose
functions it calls. So the folder carries a hash of all sources of this package: an edit anywhere
compiles anew instead of running old code.
"""

from __future__ import annotations

import hashlib
import os
import platform
import stat
import tempfile
from pathlib import Path

import numba


def use_compile_cache() -> None:
    """Points Numba's disk cache to this package's own folder; call it before the first njit."""
    numba.config.CACHE_DIR = str(cache_folder())


def cache_folder() -> Path:
    """The folder for these sources, this Numba and this Python; made if it can be."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    root = Path(base) if base else Path(os.path.expanduser("~/.cache"))
    folders = [Path(tempfile.gettempdir()) / f"slosh-{os.getuid()}"]
    if root.is_absolute():  # without a home '~' stays
        folders.insert(0, root / "slosh")
    for folder in folders:
        candidate = folder / f"slosh_model-{sources_digest()}"
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            candidate.mkdir(mode=0o700, exist_ok=True)
        except OSError:
            continue
        if _ours_alone(folder) and _ours_alone(candidate):
            return candidate
    return Path(tempfile.mkdtemp(prefix="slosh-"))


def _ours_alone(folder: Path) -> bool:
    """True where we can write and no stranger can have put code there for us to run."""
    facts = folder.stat()
    open_to_all = bool(facts.st_mode & stat.S_IWOTH)
    return facts.st_uid == os.getuid() and not open_to_all and os.access(folder, os.W_OK)


def sources_digest() -> str:
    """A short hash of the package's sources and of what compiles them."""
    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()}".encode())
    folder = Path(__file__).resolve().parent
    for path in sorted(folder.rglob("*.py")):
        digest.update(str(path.relative_to(folder)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]

"""Where compiled functions are kept between processes.

Numba notices an edit of the module that holds a cached function, but not of the modules whose
functions it calls or the tables it takes from them. So the folder carries a hash of all sources of
the package, and of this one: an edit anywhere compiles anew instead of running old code.
"""

from __future__ import annotations

import hashlib
import os
import platform
import stat
import tempfile
from pathlib import Path

import numba

_THIS_PACKAGE = Path(__file__).resolve().parent


def use_compile_cache(package: Path = _THIS_PACKAGE) -> None:
    """Points Numba's disk cache to a folder for these sources; call it before the first njit.

    Args:
        package: folder of the package whose functions are compiled.
    """
    numba.config.CACHE_DIR = str(cache_folder(package))


def cache_folder(package: Path = _THIS_PACKAGE) -> Path:
    """The folder for these sources, this Numba and this Python; made if it can be."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    root = Path(base) if base else Path(os.path.expanduser("~/.cache"))
    folders = [Path(tempfile.gettempdir()) / f"slosh-{os.getuid()}"]
    if root.is_absolute():  # without a home '~' stays
        folders.insert(0, root / "slosh")
    for folder in folders:
        candidate = folder / f"{package.name}-{sources_digest(package)}"
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            candidate.mkdir(mode=0o700, exist_ok=True)
        except OSError:
            continue
        if _ours_alone(folder) and _ours_alone(candidate):
            return candidate
    return Path(tempfile.mkdtemp(prefix="slosh-"))


def holds_code(package: Path = _THIS_PACKAGE) -> bool:
    """Whether compiled functions of a package's present sources are kept there."""
    return any(cache_folder(package).rglob("*.nbi"))


def _ours_alone(folder: Path) -> bool:
    """True where we can write and no stranger can have put code there for us to run."""
    facts = folder.stat()
    open_to_all = bool(facts.st_mode & stat.S_IWOTH)
    return facts.st_uid == os.getuid() and not open_to_all and os.access(folder, os.W_OK)


def sources_digest(package: Path = _THIS_PACKAGE) -> str:
    """A short hash of a package's sources, of this package's and of what compiles them."""
    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()}".encode())
    for folder in sorted({package, _THIS_PACKAGE}):
        for path in sorted(folder.rglob("*.py")):
            digest.update(str(path.relative_to(folder)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]

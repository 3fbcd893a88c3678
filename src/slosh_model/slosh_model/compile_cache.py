"""Where compiled functions are kept between processes, and what tells one code from another."""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import os
import platform
import shutil
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
    folder = cache_folder() / f"{package.name}-{sources_digest(package)}"
    folder.mkdir(mode=0o700, exist_ok=True)
    numba.config.CACHE_DIR = str(folder)


def cache_folder() -> Path:
    """The folder for compiled code: NUMBA_CACHE_DIR, XDG_CACHE_HOME, ~/.cache, or a temporary one.

    It is made where that is possible. A folder that others may write to is not taken: what lies
    there is run. Where nothing can be kept from process to process, it goes with this one.
    """
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    root = Path(base) if base else Path(os.path.expanduser("~/.cache"))
    folders = [Path(tempfile.gettempdir()) / f"slosh-{os.getuid()}"]
    if root.is_absolute():  # without a home '~' stays
        folders.insert(0, root / "slosh")
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _ours_alone(folder):
                return folder
    return _folder_of_this_process()


@functools.cache
def _folder_of_this_process() -> Path:
    folder = tempfile.mkdtemp(prefix="slosh-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


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

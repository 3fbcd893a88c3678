"""Stores compiled functions on disk, with keys that identify their code.

Numba's own cache keeps an index per function beside the machine code, with a stamp of the source
file. Here the file's name alone says what is in it (`code_digest`), so that checkouts, branches
and environments share what is equal and never take turns in throwing each other's away; and a
checksum stands before the code, since the processor runs whatever it is given.
"""

from __future__ import annotations

import atexit
import contextlib
import fcntl
import functools
import hashlib
import io
import logging
import os
import pickle
import platform
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numba
from numba.core import environment
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

_THIS_FOLDER = Path(__file__).resolve().parent
_LOG = logging.getLogger(__name__)
_KEPT = 8
"""Versions of a function that stay: those that ran last."""


class CodeFile(_Cache):
    """Cache file of one compiled function, with the interface that Numba expects.

    Damaged code is thrown away with a warning; a disk that takes no more costs a warning and the
    next process a compilation.

    Args:
        name: of the function.
        digest: of all that its code comes from.
        check: called where there is no code that can be used, before it is compiled.
    """

    def __init__(self, name: str, digest: str, check: Callable[[], None]) -> None:
        self._name = name
        self._check = check
        self.path = cache_folder() / f"{name}_{digest}-{_processor()}.code"

    @property
    def cache_path(self) -> str:
        """Folder on disk that contains the cached machine code."""
        return str(self.path.parent)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Locks the cache against other processes, so that a function is compiled only once.

        The lock goes with the process, however it ends; where none can be had, both compile.
        """
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(OSError):
                lock = stack.enter_context(self.path.with_suffix(".lock").open("w"))
                fcntl.flock(lock, fcntl.LOCK_EX)
                # A child that was forked meanwhile holds the file open, but not the lock.
                stack.callback(fcntl.flock, lock, fcntl.LOCK_UN)
            yield

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Loads the function with its machine code, or returns None if there is no usable code."""
        # All that kept code needs. Numba would read in what it compiles with as well, two hundred
        # modules for a quarter of a second: it does so itself once it compiles.
        rtsys.initialize(target_context)
        found = self._load(target_context)
        if found is None:
            self._check()
        return found

    def _load(self, target_context: Any) -> Any:
        try:
            data = self.path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            _LOG.warning(
                "%s: compiled again, the cached code cannot be read: %s", self._name, error
            )
            return None
        with contextlib.suppress(OSError):
            os.utime(self.path)
        try:
            parts = _Unpickler(io.BytesIO(_checked(data))).load()
            return CompileResult._rebuild(target_context, *parts)
        except Exception as error:  # whatever a pickle may raise
            _LOG.warning("%s: compiled again, %s is damaged: %s", self._name, self.path, error)
            with contextlib.suppress(OSError):
                self.path.unlink()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Stores a compiled function in the cache.

        Raises:
            TypeError: the code is of no use to another process.
        """
        if data.library.has_dynamic_globals or data.lifted:
            raise TypeError(f"{self._name}: code that holds addresses of this process")
        new = self.path.with_suffix(".new")
        try:
            new.write_bytes(_with_checksum(dumps(data._reduce())))
            new.replace(self.path)
        except OSError as error:
            _LOG.warning("%s: compiled, but not cached: %s", self._name, error)
            with contextlib.suppress(OSError):
                new.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # another process may be at it
            self._prune()

    def _prune(self) -> None:
        """Removes the cached versions that have not been used for the longest time."""
        versions = [*self.path.parent.glob(f"{self._name}_{'?' * 16}-*.code")]
        versions.sort(key=lambda path: path.stat().st_mtime)
        for path in versions[:-_KEPT]:
            path.unlink(missing_ok=True)
            path.with_suffix(".lock").unlink(missing_ok=True)

    def enable(self) -> None:
        """Does nothing, since the cache is always enabled."""

    def disable(self) -> None:
        """Does nothing, since the cache is always enabled."""

    def flush(self) -> None:
        """Does nothing, since everything is written at once."""


class _Unpickler(pickle.Unpickler):
    """Unpickles Numba's data without importing the modules of Numba's own functions.

    Only code that runs Python objects looks into these; they load SciPy's linear algebra.
    """

    def find_class(self, module: str, name: str) -> Any:
        """Returns the object that a pickle refers to by module and name."""
        found = super().find_class(module, name)
        return _environment if found is environment._rebuild_env else found


def _environment(module: str, constants: Any, name: str) -> Any:
    """Rebuilds a function's constants as Numba does, without importing all of Numba."""
    if not module.startswith("numba."):
        return environment._rebuild_env(module, constants, name)
    known = environment.lookup_environment(name)
    if known is not None:
        return known
    made = environment.Environment({"__name__": module})
    made.consts[:] = constants
    made.env_name = name
    environment.Environment._memo[name] = made
    return made


def _with_checksum(code: bytes) -> bytes:
    return hashlib.sha256(code).digest() + code


def _checked(data: bytes) -> bytes:
    size = hashlib.sha256().digest_size
    if hashlib.sha256(data[size:]).digest() != data[:size]:
        raise ValueError("wrong checksum")
    return data[size:]


@functools.cache
def _processor() -> str:
    """Returns a hash of the processor's features, since machines may share a home folder."""
    traits = repr(cpu_target.target_context.codegen().magic_tuple())
    return hashlib.sha256(traits.encode()).hexdigest()[:8]


def cache_folder() -> Path:
    """Returns the cache folder: NUMBA_CACHE_DIR, XDG_CACHE_HOME, ~/.cache or a temporary one.

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
    """Whether the folder belongs to this user and no other user can write to it."""
    facts = folder.stat()
    open_to_all = bool(facts.st_mode & stat.S_IWOTH)
    return facts.st_uid == os.getuid() and not open_to_all and os.access(folder, os.W_OK)


def sources_digest(*packages: str) -> str:
    """Returns a short hash of packages' sources and of the compilers' versions.

    Args:
        packages: names of packages that can be imported.
    """
    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()}".encode())
    for folder in (*map(_folder, sorted(packages)), _THIS_FOLDER):
        for path in sorted(folder.rglob("*.py")):
            digest.update(str(path.relative_to(folder)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _folder(package: str) -> Path:
    """Returns the folder that contains a package's sources."""
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"no package {package}", name=package)
    return Path(spec.origin).parent

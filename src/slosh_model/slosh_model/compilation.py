"""How functions are compiled: equal names mean equal code, one signature each, kept on the disk.

Numba names what it compiles after the function's module and qualified name and a number that each
process counts for itself; of two equal names the linker keeps the first, silently. So here every
qualified name ends in a digest of all that the machine code comes from: the function's own code,
the constants that it reads and the compiled functions that it calls. Whichever process compiled
a function, and in whichever order, a name can mean one thing only; and an edit anywhere is
another name, so that no cached code outlives its source.

`compiled` makes a part, which is inlined where it is called. `entry_point` makes a function that
Python calls: it has one signature, is compiled or loaded when it is first needed, and cached.
"""

from __future__ import annotations

import builtins
import contextlib
import dis
import fcntl
import functools
import hashlib
import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core.errors import NumbaError

from slosh_model.compile_cache import cache_folder

OPTIONS: Mapping[str, Any] = {"error_model": "numpy"}
"""A division by zero gives inf or NaN, whose check would double the cost of a step."""
_DIGEST = "compiled_digest"  # attribute of a function that went through `compiled`
_DIGITS = 16
_LOG = logging.getLogger(__name__)
_LOCK = threading.RLock()
_NAMES: dict[str, str] = {}
_ENTRY_POINTS: dict[str, EntryPoint] = {}

Function = Callable[..., Any]


def compiled(function: Function) -> Any:
    """Makes a part of compiled functions of a function; it is inlined wherever it is called.

    Raises:
        TypeError: another function of the same qualified name was compiled before, or the
            function uses a name that is not defined yet.
    """
    _name(function, OPTIONS)
    return numba.njit(forceinline=True, **OPTIONS)(function)


def entry_point(signature: str | Any, **options: Any) -> Callable[[Function], EntryPoint]:
    """Makes a compiled function for Python to call; see `EntryPoint`.

    Args:
        signature: the only one that it has, as Numba writes it or as a Numba signature.
        options: of `numba.njit`, in addition to OPTIONS.

    Raises:
        TypeError: as `compiled`.
    """

    def decorate(function: Function) -> EntryPoint:
        return EntryPoint(function, signature, {"nogil": True, **OPTIONS, **options})

    return decorate


class EntryPoint:
    """A function that is compiled, or loaded from the cache, when it is first needed.

    Attributes:
        name: module and name, for people.
        function: the function as it was written.
    """

    def __init__(
        self, function: Function, signature: str | Any, options: Mapping[str, Any]
    ) -> None:
        self.name = f"{function.__module__}.{function.__qualname__}"
        self.function = function
        self.__doc__ = function.__doc__
        self._signature = signature
        self._options = dict(options)
        self._call: Function | None = None
        self._unchecked: Function | None = None
        self._checks: list[Callable[[], None]] = []
        _name(function, {**options, "signature": str(signature)})
        _ENTRY_POINTS[self.name] = self

    def __call__(self, *arguments: Any) -> Any:
        """Calls the compiled function."""
        return self.load()(*arguments)

    @property
    def loaded(self) -> bool:
        """Whether it can be called at once."""
        return self._call is not None

    @property
    def cached(self) -> bool:
        """Whether the cache holds it."""
        return any(self._files(cache_folder(), ".nbi"))

    def load(self) -> Function:
        """The compiled function itself: compiled, or loaded from the cache, and checked."""
        call = self._call
        if call is None:
            with _LOCK:
                call = self._call or self._unchecked or self._load_checked()
        return call

    def check_with(self, check: Callable[[], None]) -> None:
        """Has the function checked when it is first loaded; what the check raises, `load` does."""
        self._checks.append(check)

    def _load_checked(self) -> Function:
        call = self._unchecked = self._compile()
        try:
            for check in self._checks:
                check()
        finally:
            self._unchecked = None
        self._call = call
        return call

    def _compile(self) -> Function:
        if numba.config.DISABLE_JIT:
            return self.function
        folder = cache_folder()
        with _one_at_a_time(folder / f"{self.function.__qualname__}.lock"):
            try:
                return self._compile_to(folder)
            except NumbaError:
                raise
            except Exception as error:  # whatever damaged bytes make of a pickle
                _LOG.warning("%s: the cached code cannot be used: %r", self.name, error)
                for file in self._files(folder):
                    file.unlink(missing_ok=True)
        return self._fixed(numba.njit(**self._options)(self.function))

    def _compile_to(self, folder: Path) -> Function:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder)
        try:
            dispatcher = numba.njit(cache=True, **self._options)(self.function)
        finally:
            numba.config.CACHE_DIR = before
        try:
            return self._fixed(dispatcher)
        except OSError as error:
            if not dispatcher.overloads:
                raise
            # A full disk, say: what was compiled works, the next process compiles anew.
            _LOG.warning("%s: compiled, but not kept in %s: %s", self.name, folder, error)
            return self._closed(dispatcher)

    def _fixed(self, dispatcher: Any) -> Function:
        dispatcher.compile(self._signature)
        return self._closed(dispatcher)

    @staticmethod
    def _closed(dispatcher: Any) -> Function:
        """The dispatcher without leave to compile: no second signature, no second code."""
        dispatcher.disable_compile()
        call: Function = dispatcher
        return call

    def _files(self, folder: Path, ending: str = "") -> Iterator[Path]:
        module = self.function.__module__.rpartition(".")[2]
        return folder.glob(f"*/{module}.{self.function.__qualname__}-*{ending}")


class Progress(NamedTuple):
    """Which entry point is taken up next.

    Attributes:
        name: its name; empty at the end.
        done, total: how many are done, of how many.
        cached: whether the cache seems to hold it; else it is compiled, which takes seconds.
    """

    name: str
    done: int
    total: int
    cached: bool


def entry_points() -> tuple[EntryPoint, ...]:
    """All entry points of the modules that this process has imported."""
    return tuple(_ENTRY_POINTS.values())


def load_all(progress: Callable[[Progress], None] | None = None) -> float:
    """Compiles, or loads from the cache, every entry point that this process has imported.

    Args:
        progress: told before each of them, and at the end.

    Returns:
        how long it took [s].
    """
    tell = progress or (lambda step: None)
    started = time.monotonic()
    wanted = [one for one in entry_points() if not one.loaded]
    for done, one in enumerate(wanted):
        tell(Progress(one.name, done, len(wanted), one.cached))
        one.load()
    tell(Progress("", len(wanted), len(wanted), True))
    return time.monotonic() - started


@functools.cache
def uncompiled(function: Any) -> Function:
    """The same function and all that it calls as plain Python, for a second opinion.

    Args:
        function: what `compiled` or `entry_point` made.
    """
    plain: Function = _plain(function, {})
    return plain


def _plain(value: Any, known: dict[int, Any]) -> Any:
    function = (
        value.function if isinstance(value, EntryPoint) else getattr(value, "py_func", value)
    )
    if not (isinstance(function, FunctionType) and hasattr(function, _DIGEST)):
        return value
    if id(function) not in known:
        surroundings: dict[str, Any] = {}
        copy = FunctionType(
            function.__code__, surroundings, function.__name__, function.__defaults__
        )
        known[id(function)] = copy
        surroundings["__builtins__"] = builtins
        for name in _names(function.__code__):
            if name in function.__globals__:
                surroundings[name] = _plain_global(function.__globals__[name], known)
    return known[id(function)]


def _plain_global(value: Any, known: dict[int, Any]) -> Any:
    if isinstance(value, ModuleType) and value.__name__.startswith("slosh_"):
        plain = ModuleType(value.__name__)
        plain.__dict__.update({name: _plain(one, known) for name, one in vars(value).items()})
        return plain
    return _plain(value, known)


def _name(function: Function, options: Mapping[str, Any]) -> None:
    """Appends the digest to the function's qualified name, by which Numba names its code."""
    full = f"{function.__module__}.{function.__qualname__}"
    digest = _digest(function, options)
    if _NAMES.setdefault(full, digest) != digest:
        raise TypeError(f"{full}: a second compiled function of this name; names must be unique")
    setattr(function, _DIGEST, digest)
    function.__qualname__ = f"{function.__qualname__}_{digest}"


def _digest(function: Any, options: Mapping[str, Any]) -> str:
    if function.__closure__:
        raise TypeError(f"{function.__qualname__}: compiled functions cannot be closures")
    digest = hashlib.sha256(repr(sorted(options.items(), key=str)).encode())
    names = _names(function.__code__)
    for code in _codes(function.__code__):
        constants = [one for one in code.co_consts if not isinstance(one, CodeType)]
        digest.update(code.co_code)
        digest.update(repr((constants, code.co_names, code.co_varnames)).encode())
    for name in sorted(_global_names(function.__code__)):
        if name in function.__globals__:
            digest.update(f"{name}={_fact(function.__globals__[name], names)};".encode())
        elif not hasattr(builtins, name):
            raise TypeError(f"{function.__qualname__}: {name} is not defined before it")
    return digest.hexdigest()[:_DIGITS]


def _fact(value: Any, names: set[str]) -> str:
    """What a name that compiled code reads stands for, as text."""
    if isinstance(value, ModuleType):
        inside = sorted(name for name in names if name in vars(value))
        return f"{value.__name__}({[_fact(vars(value)[name], set()) for name in inside]})"
    function = getattr(value, "py_func", value)
    if hasattr(function, _DIGEST):
        return str(getattr(function, _DIGEST))
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    if callable(value):
        name = getattr(value, "__qualname__", type(value).__qualname__)
        return f"{getattr(value, '__module__', '')}.{name}"
    return repr(value)


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _names(code: CodeType) -> set[str]:
    return {name for one in _codes(code) for name in one.co_names}


def _global_names(code: CodeType) -> set[str]:
    return {
        step.argval
        for one in _codes(code)
        for step in dis.get_instructions(one)
        if step.opname == "LOAD_GLOBAL"
    }


@contextlib.contextmanager
def _one_at_a_time(path: Path) -> Iterator[None]:
    """Among all processes: the second one finds what the first has compiled.

    The lock goes with the process, however it ends; where none can be had, both compile.
    """
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            lock = stack.enter_context(path.open("w"))
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield

"""Compiles functions for one signature each and stores them by a hash of their code.

Numba names what it compiles after the function's module and qualified name and a number that each
process counts for itself; of two equal names the linker keeps the first, silently. So here every
qualified name ends in a digest of all that the machine code comes from, and the numbers, which
tell Numba's own functions apart, begin somewhere else in each process. Whichever process compiled
a function, and in whichever order, a name can mean one thing only; and an edit anywhere is another
name, so that no cached code outlives its source.

`compiled` makes a part, which is inlined where it is called. `entry_point` makes a function that
Python calls: it has one signature, is compiled or loaded when it is first needed, and cached.
"""

from __future__ import annotations

import builtins
import functools
import itertools
import os
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core.bytecode import FunctionIdentity
from numba.core.registry import CPUDispatcher
from numba.types import Array, float64

from slosh_base.compiled.code_digest import DIGEST, called, digest, paths, written
from slosh_base.compiled.compile_cache import CodeFile

OPTIONS: Mapping[str, Any] = {"error_model": "numpy"}
"""A division by zero gives inf or NaN, whose check would double the cost of a step."""
# What nobody calls from outside needs no code for that: half of the time of compiling.
_INLINED = {
    "forceinline": True,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "nopython": True,
    **OPTIONS,
}
_APART = {**_INLINED, "forceinline": False}
_CALLED = {"nogil": True, "no_cfunc_wrapper": True}
_OPTIONS = "compiled_with"  # attribute of compiled functions: their options
_LOCK = threading.RLock()
_NAMES: dict[str, str] = {}
_ENTRY_POINTS: dict[str, EntryPoint] = {}

Function = Callable[..., Any]


def _number_anew() -> None:
    FunctionIdentity._unique_ids = itertools.count(secrets.randbits(60))


_number_anew()
os.register_at_fork(after_in_child=_number_anew)


def compiled(function: Function) -> Any:
    """Decorator for a function that only other compiled functions call.

    Raises:
        TypeError: another function of the same qualified name was compiled before, or the
            function is a closure, uses a name that is not defined yet, or something that is
            neither compiled nor a constant.
    """
    return _part(function, _INLINED)


def compiled_apart(function: Function) -> Any:
    """Decorator like `compiled` for a large function, whose machine code its callers share.

    Raises:
        TypeError: as `compiled`.
    """
    return _part(function, _APART)


def _part(function: Function, options: Mapping[str, Any]) -> Any:
    _name(function, options)
    if numba.config.DISABLE_JIT:
        return function
    return _Part(function, targetoptions=dict(options))


class _Part(CPUDispatcher):
    """A compiled function that only compiled functions may call; Python code may not."""

    def __call__(self, *arguments: Any) -> Any:
        raise TypeError(
            f"{self.py_func.__module__}.{self.py_func.__name__} is a part of compiled functions; "
            "call it from one, or call `uncompiled` of it"
        )


def entry_point(signature: Any, **options: Any) -> Callable[[Function], EntryPoint]:
    """Decorator for a compiled function that Python code calls; see `EntryPoint`.

    Args:
        signature: the only one that it has, as Numba writes it or as a Numba signature.
        options: of `numba.njit`, in addition to OPTIONS.

    Raises:
        TypeError: as `compiled`.
    """

    def decorate(function: Function) -> EntryPoint:
        return EntryPoint(function, signature, {**_CALLED, **OPTIONS, **options})

    return decorate


def given(dtype: Any, axes: int, layout: str = "C") -> Any:
    """Returns Numba's type for a read-only array.

    Args:
        dtype: Numba's type of its numbers.
        axes: how many.
        layout: "C": contiguous; "A": of any strides.
    """
    return Array(dtype, axes, layout, readonly=True)


GIVEN_1, GIVEN_2, GIVEN_3 = (given(float64, axes) for axes in (1, 2, 3))
CHANGED_1, CHANGED_2, CHANGED_3 = (Array(float64, axes, "C") for axes in (1, 2, 3))
"""Contiguous arrays of floats with one, two and three axes that are read, or written to."""


class EntryPoint:
    """A function that is compiled, or loaded from the cache, when it is first called.

    It takes what its signature says. Arrays of another type are refused; numbers are converted
    as C converts them, so that a float given for an integer loses its fraction.

    Attributes:
        name: module and name, for people.
        function: the function as it was written.
    """

    def __init__(self, function: Function, signature: Any, options: Mapping[str, Any]) -> None:
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
        """Calls the compiled function; compiles or loads it first if necessary.

        Raises:
            TypeError: the arguments are not those of the signature.
        """
        return self.load()(*arguments)

    @property
    def loaded(self) -> bool:
        """Whether the function is in memory and can be called without compiling."""
        return self._call is not None

    @property
    def cached(self) -> bool:
        """Whether the cache on disk contains the function's machine code."""
        return self._file().path.exists()

    def load(self) -> Function:
        """Compiles the function, or loads it from the cache, and runs its check.

        Raises:
            TypeError: what it is compiled from was changed since it was defined.
        """
        call = self._call
        if call is None:
            with _LOCK:
                call = self._call or self._unchecked or self._load_checked()
        return call

    def check_with(self, check: Callable[[], None]) -> None:
        """Registers a function that checks the compiled code when it is first loaded."""
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
        dispatcher = numba.njit(**self._options)(self.function)
        dispatcher._cache = file = self._file()
        with file.locked():
            dispatcher.compile(self._signature)
        # No second signature, no second code.
        dispatcher.disable_compile()
        dispatcher._explain_matching_error = self._refuse
        call: Function = dispatcher
        return call

    def _file(self) -> CodeFile:
        return CodeFile(
            self.name, getattr(self.function, DIGEST), partial(_check_unchanged, self.function)
        )

    def _refuse(self, *arguments: Any) -> None:
        given_now = ", ".join(map(_described, arguments))
        raise TypeError(f"{self.name} takes {self._signature}, not ({given_now})")


def _described(value: Any) -> str:
    if not isinstance(value, np.ndarray):
        return type(value).__name__
    strides = "" if value.flags.c_contiguous else ", with strides"
    return f"array({value.dtype}, {value.ndim}d{strides})"


class CompileProgress(NamedTuple):
    """Progress of compiling: the function that comes next, and how many there are.

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
    """Returns all compiled functions of the modules imported in this process."""
    return tuple(_ENTRY_POINTS.values())


def load_all(
    progress: Callable[[CompileProgress], None] | None = None, package: str = ""
) -> float:
    """Compiles or loads all compiled functions of the imported modules.

    Args:
        progress: told before each of them, and at the end.
        package: only those of this package; empty: of all.

    Returns:
        how long it took [s].
    """
    tell = progress or (lambda step: None)
    started = time.monotonic()
    inside = f"{package}." if package else ""
    wanted = [one for one in entry_points() if not one.loaded and one.name.startswith(inside)]
    for done, one in enumerate(wanted):
        tell(CompileProgress(one.name, done, len(wanted), one.cached))
        one.load()
    tell(CompileProgress("", len(wanted), len(wanted), True))
    return time.monotonic() - started


def load_telling(tell: Callable[[str], None], package: str) -> None:
    """Runs `load_all` and reports each function that is compiled.

    Args:
        tell: is told before each function that has to be compiled.
        package: as in `load_all`; a module, too.
    """

    def told(step: CompileProgress) -> None:
        if step.name and not step.cached:
            tell(f"compiling {step.name}, {step.done + 1} of {step.total}")

    load_all(told, package)


@functools.cache
def uncompiled(function: Any) -> Function:
    """Returns a compiled function and all that it calls as plain Python functions.

    Args:
        function: what `compiled` or `entry_point` made.
    """
    plain: Function = _plain(function, {})
    return plain


def _plain(value: Any, known: dict[int, Any]) -> Any:
    function = value.function if isinstance(value, EntryPoint) else written(value)
    if isinstance(value, tuple) and type(value) is tuple:
        return tuple(_plain(one, known) for one in value)
    if not (isinstance(function, FunctionType) and hasattr(function, DIGEST)):
        return value
    if id(function) not in known:
        around: dict[str, Any] = {"__builtins__": builtins}
        copy = FunctionType(function.__code__, around, function.__name__, function.__defaults__)
        copy.__kwdefaults__ = function.__kwdefaults__
        known[id(function)] = copy
        for head, *rest in set(paths(function.__code__)):
            if head in function.__globals__:
                around[head] = _plain_global(
                    function.__globals__[head], rest, known, around.get(head)
                )
    return known[id(function)]


def _plain_global(value: Any, path: list[str], known: dict[int, Any], begun: Any) -> Any:
    """Returns a global value as plain Python code may use it; copies modules if needed."""
    if not (isinstance(value, ModuleType) and path):
        return _plain(value, known)
    module = ModuleType(value.__name__) if begun is None else begun
    head, *rest = path
    inside = _plain_global(getattr(value, head), rest, known, getattr(module, head, None))
    setattr(module, head, inside)
    return module


def _name(function: Function, options: Mapping[str, Any]) -> None:
    """Appends the code's hash to the function's name, which Numba uses as its key."""
    full = f"{function.__module__}.{function.__qualname__}"
    own = digest(function, options)
    if _NAMES.setdefault(full, own) != own:
        raise TypeError(f"{full}: a second compiled function of this name; names must be unique")
    setattr(function, DIGEST, own)
    setattr(function, _OPTIONS, options)
    function.__qualname__ = f"{function.__qualname__}_{own}"


def _check_unchanged(function: Any) -> None:
    """Raises an error if constants have changed since the function was defined."""
    if digest(function, getattr(function, _OPTIONS)) != getattr(function, DIGEST):
        raise TypeError(
            f"{function.__module__}.{function.__name__}: a constant that it reads was changed "
            "after its definition"
        )
    for part in called(function):
        _check_unchanged(part)

"""Computes a hash of everything that a compiled function's machine code depends on.

That is its own code, the constants that it reads, the compiled functions that it calls and their
modules, the options and what compiles it. Comments, docstrings, places of files and the order of
hashes are no part of it. What may change unseen is refused.
"""

from __future__ import annotations

import builtins
import dis
import hashlib
import sys
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from types import CodeType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.types import Type

Function = Callable[..., Any]
Path = tuple[str, ...]

DIGEST = "compiled_digest"
"""Attribute of compiled functions that holds their digest."""
_DIGITS = 16
_TOOLS = (
    numba.__version__,
    llvmlite.__version__,
    np.__version__,
    sys.implementation.cache_tag,
    numba.config.USING_SVML,
    numba.config.OPT,
    numba.config.BOUNDSCHECK,
)
_KNOWN_TO_NUMBA = sys.stdlib_module_names | {"numpy", "numba"}
_CACHE, _GLOBAL, _CONSTANTS = dis.opmap["CACHE"], dis.opmap["LOAD_GLOBAL"], frozenset(dis.hasconst)
_ATTRIBUTES = {
    dis.opmap[name]: shift
    for name, shift in (("LOAD_ATTR", int(sys.version_info >= (3, 12))), ("LOAD_METHOD", 0))
    if name in dis.opmap and dis.opmap[name] < 256
}
"""Instructions that read an attribute, and by how many bits the place of its name is shifted."""
_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), np.dtype, Type)


def digest(function: Any, options: Mapping[str, Any]) -> str:
    """Returns the hash of a function's source and dependencies.

    Args:
        function: as it was written; the compiled functions that it calls have theirs already.
        options: with which it is compiled.

    Raises:
        TypeError: the function is a closure, reads a name that is not defined yet, or reads
            something that may change unseen.
    """
    if function.__closure__:
        raise TypeError(f"{function.__qualname__}: compiled functions cannot be closures")
    parts = [_fact(_TOOLS), _fact(sorted(options.items()))]
    parts += [_fact(function.__defaults__), _fact(sorted((function.__kwdefaults__ or {}).items()))]
    parts += [_code_fact(code) for code in _codes(function.__code__)]
    for path in sorted(set(paths(function.__code__))):
        try:
            parts.append(f"{path}: {_fact(_value(function, path))}")
        except TypeError as error:
            raise TypeError(f"{function.__qualname__}: {'.'.join(path)} {error}") from None
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:_DIGITS]


def paths(code: CodeType) -> Iterator[Path]:
    """Yields the dotted names that code reads, as tuples: `np.pi` is ('np', 'pi')."""
    for one in _codes(code):
        path: list[str] = []
        for operation, argument in _steps(one):
            if path and operation in _ATTRIBUTES:
                path.append(one.co_names[argument >> _ATTRIBUTES[operation]])
            else:
                if path:
                    yield tuple(path)
                path = [one.co_names[argument >> 1]] if operation == _GLOBAL else []


def _steps(code: CodeType) -> Iterator[tuple[int, int]]:
    """Yields operation and argument of each instruction of code, without caches.

    `dis` says more of each, and takes a third of the time in which a node is imported.
    """
    raw, extended = code.co_code, 0
    for place in range(0, len(raw), 2):
        operation = raw[place]
        if operation == _CACHE:
            continue
        argument = raw[place + 1] | extended
        if operation == dis.EXTENDED_ARG:
            extended = argument << 8
        else:
            extended = 0
            yield operation, argument


def called(function: Any) -> Iterator[Any]:
    """Yields the compiled functions that a function calls directly."""
    for path in set(paths(function.__code__)):
        found = written(_value(function, path))
        if hasattr(found, DIGEST):
            yield found


def written(value: Any) -> Any:
    """Returns the Python function behind a compiled one; returns other values unchanged."""
    return getattr(value, "py_func", value)


def _value(function: Any, path: Path) -> Any:
    """Looks up a dotted name in a function's globals; follows attributes of modules only."""
    head, *rest = path
    if head not in function.__globals__:
        if not hasattr(builtins, head):
            raise TypeError("is not defined before it")
        return getattr(builtins, head)
    value = function.__globals__[head]
    for name in rest:
        if not isinstance(value, ModuleType):
            break
        if not hasattr(value, name):
            raise TypeError("is not defined before it")
        value = getattr(value, name)
    return value


def _fact(value: Any) -> str:
    """Returns a text that represents a value and is the same in every process."""
    function = written(value)
    if hasattr(function, DIGEST):
        # Kept code imports the modules of the functions that it calls.
        return f"{function.__module__} {getattr(function, DIGEST)}"
    if isinstance(value, (tuple, list)):
        return f"{type(value).__name__}[{', '.join(_fact(one) for one in value)}]"
    if isinstance(value, (set, frozenset)):
        return f"set{sorted(_fact(one) for one in value)}"
    if isinstance(value, Enum):
        return f"{type(value).__qualname__}.{value.name}={_fact(value.value)}"
    if isinstance(value, (np.ndarray, np.generic)) and not value.dtype.hasobject:
        flags = getattr(value, "flags", None)
        order = f"{flags.c_contiguous} {flags.f_contiguous}" if flags else ""
        content = hashlib.sha256(value.tobytes()).hexdigest()
        return f"{value.dtype!r} {value.shape} {order} {content}"
    if isinstance(value, _PLAIN):
        return f"{type(value).__name__} {value!r}"
    if isinstance(value, type):
        return _class_fact(value)
    if isinstance(value, np.ufunc):
        return f"numpy.ufunc {value.__name__}"
    if callable(value) and _root(value) in _KNOWN_TO_NUMBA and hasattr(value, "__qualname__"):
        return f"{value.__module__}.{value.__qualname__}"
    raise TypeError("is neither compiled nor a constant")


def _class_fact(value: Any) -> str:
    name = f"{value.__module__}.{value.__qualname__}"
    if issubclass(value, Enum):
        return f"{name}{[_fact(one) for one in value]}"
    if issubclass(value, tuple) and hasattr(value, "_fields"):
        return f"{name}{value._fields}"
    if _root(value) in _KNOWN_TO_NUMBA:
        return name
    raise TypeError("is neither compiled nor a constant")


def _root(value: Any) -> str:
    return str(value.__module__).partition(".")[0]


def _code_fact(code: CodeType) -> str:
    used = {argument for operation, argument in _steps(code) if operation in _CONSTANTS}
    constants = [
        _fact(one)
        for place, one in enumerate(code.co_consts)
        if place in used and not isinstance(one, CodeType)
    ]
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    names = code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars
    return f"{code.co_code.hex()} {code.co_exceptiontable.hex()} {constants} {counts} {names}"


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)

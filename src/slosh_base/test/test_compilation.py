"""Tests that each name identifies one compiled code, and which code is rejected."""

import dis
import importlib.util
import itertools
import os
import sys
import textwrap

import numpy as np
import pytest

from slosh_base.compiled import compilation
from slosh_base.compiled.code_digest import DIGEST, digest, paths, written
from slosh_base.compiled.compilation import EntryPoint, load_all, uncompiled
from slosh_model import kernel
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Simulator

HEAD = """
import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba.types import float64, int64

from slosh_base.compiled.compilation import compiled, entry_point, given
"""
_COUNT = itertools.count()


@pytest.fixture
def define(tmp_path, monkeypatch):
    """Returns a function that creates a module from a text, with a new name unless given one."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(compilation, "_ENTRY_POINTS", dict(compilation._ENTRY_POINTS))
    monkeypatch.setattr(compilation, "_NAMES", {})

    def make(text, name=None):
        name = name or f"throwaway_{next(_COUNT)}"
        path = tmp_path / f"{name}.py"
        path.write_text(HEAD + textwrap.dedent(text))
        spec = importlib.util.spec_from_file_location(name, path)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        return module

    return make


def function_of(one):
    return one.function if isinstance(one, EntryPoint) else written(one)


def digest_of(module, name="top"):
    return getattr(function_of(getattr(module, name)), DIGEST)


@pytest.fixture
def digests(define):
    """Returns the hashes of a text's compiled functions, as another process would see them."""

    def find(text):
        compilation._NAMES.clear()
        module = define(text, "always_the_same")
        functions = {name: function_of(one) for name, one in vars(module).items()}
        return {
            name: getattr(one, DIGEST) for name, one in functions.items() if hasattr(one, DIGEST)
        }

    return find


# What a name stands for.

BASE = '''
K = 2.0
TABLE = np.array([1.0, 2.0])
PAIR = (1, (2.0, "a"))

class Side(IntEnum):
    LEFT = 0
    RIGHT = 1

@compiled
def deep(x):
    """What it does."""
    return x + 1.0

@compiled
def part(x, n=3):
    return deep(x) * K + n

@entry_point(float64(float64))
def top(x):
    """What it does."""
    if x in (1.0, 2.0):
        return x
    return part(x) + TABLE[0] + PAIR[0] + math.pi + Side.RIGHT.value
'''
EDITS = {
    "own code": ("return x\n", "return -x\n"),
    "a constant in the code": ("in (1.0, 2.0)", "in (1.0, 3.0)"),
    "the sign of a zero": ("+ TABLE[0]", "+ 0.0 + TABLE[0]"),
    "an array": ("[1.0, 2.0]", "[1.0, 2.5]"),
    "an array's type": ("[1.0, 2.0]", "[1, 2]"),
    "a constant within a tuple": ('(2.0, "a")', '(2.5, "a")'),
    "an enumeration's value": ("RIGHT = 1", "RIGHT = 2"),
    "what a module has": ("math.pi", "math.tau"),
    "a part's constant": ("K = 2.0", "K = 2"),
    "a part's default": ("n=3", "n=4"),
    "a part two calls down": ("x + 1.0", "x + 1.5"),
    "the signature": ("float64(float64)", "float64(int64)"),
    "an option": ("float64(float64))", "float64(float64), fastmath=True)"),
    "one of an option's parts": ("float64(float64))", 'float64(float64), fastmath={"nnan"})'),
}


@pytest.mark.parametrize(("old", "new"), EDITS.values(), ids=EDITS)
def test_every_edit_that_changes_the_code_changes_the_name(digests, old, new):
    assert BASE.count(old) == 1
    assert digests(BASE)["top"] == digests(BASE)["top"]
    assert digests(BASE)["top"] != digests(BASE.replace(old, new))["top"]


def test_the_module_of_a_called_function_is_part_of_the_name(define):
    """Cached code imports the called function's module, so a moved module needs a new name."""
    text = "@compiled\ndef part(x):\n    return x + 1.0\n"
    caller = (
        "from {} import part\n\n@entry_point(float64(float64))\ndef top(x):\n    return part(x)\n"
    )
    names = []
    for module in ("moved_from", "moved_to"):
        define(text, module)
        compilation._NAMES.clear()
        names.append(digest_of(define(caller.format(module), "always_the_same")))
    assert names[0] != names[1]


NO_EDITS = {
    "comments": BASE.replace("K = 2.0", "# A comment.\n\n\nK = 2.0  # another"),
    "another docstring": BASE.replace("What it does", "What it does, said better"),
    "no docstring": BASE.replace('    """What it does."""\n', ""),
    "other code in the file": BASE.replace(
        "K = 2.0", "K = 2.0\n@compiled\ndef f(x):\n    return x"
    ),
}


@pytest.mark.parametrize("edited", NO_EDITS.values(), ids=NO_EDITS)
def test_edits_that_change_no_code_change_no_name(digests, edited):
    assert edited != BASE
    assert digests(BASE).items() <= digests(edited).items()
    assert len(digests(BASE)) == 3


def test_the_linker_knows_each_code_by_its_digest(define):
    """A running number in the name would differ between processes."""
    module = define(BASE)
    for name in ("deep", "part", "top"):
        function = function_of(getattr(module, name))
        assert function.__qualname__ == f"{name}_{getattr(function, DIGEST)}"
    symbol = next(iter(module.top.load().overloads.values())).fndesc.mangled_name
    assert digest_of(module) in symbol


# What is refused.

REFUSED = {
    "two compiled functions of one name": (
        "@compiled\ndef f(x):\n    return x\n@compiled\ndef f(x):\n    return -x",
        r"throwaway_\d+\.f: a second compiled function of this name",
    ),
    "two entry points of one name": (
        "@entry_point(float64(float64))\ndef f(x):\n    return x\n"
        "@entry_point(int64(int64))\ndef f(x):\n    return x",
        r"throwaway_\d+\.f: a second compiled function of this name",
    ),
    "closures": (
        "def make(k):\n    @compiled\n    def f(x):\n        return x + k\n    return f\nmake(1)",
        r"make.<locals>.f: compiled functions cannot be closures",
    ),
    "what is not defined yet": (
        "@compiled\ndef f(x):\n    return later(x)\n@compiled\ndef later(x):\n    return x",
        "f: later is not defined before it",
    ),
    "what a module does not have": (
        "@compiled\ndef f(x):\n    return math.nothing + x",
        r"f: math\.nothing is not defined before it",
    ),
    "plain functions": (
        "def plain(x):\n    return x\n@compiled\ndef f(x):\n    return plain(x)",
        "f: plain is neither compiled nor a constant",
    ),
    "what Numba alone has compiled": (
        "import numba\nalone = numba.njit(lambda x: x)\n@compiled\ndef f(x):\n    return alone(x)",
        "f: alone is neither compiled nor a constant",
    ),
    "entry points": (
        "@entry_point(float64(float64))\ndef e(x):\n    return x\n"
        "@compiled\ndef f(x):\n    return e(x)",
        "f: e is neither compiled nor a constant",
    ),
    "a module as a value": (
        "@compiled\ndef f(x):\n    m = math\n    return m.pi + x",
        "f: math is neither compiled nor a constant",
    ),
    "objects": (
        "class A:\n    pass\na = A()\n@compiled\ndef f(x):\n    return a",
        "f: a is neither compiled nor a constant",
    ),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_what_may_mean_two_things_is_refused(define, text, message):
    with pytest.raises(TypeError, match=message):
        define(text)


@pytest.mark.parametrize("name", ["K", "TABLE"])
def test_a_constant_that_is_set_anew_is_not_compiled_under_the_old_name(define, name):
    module = define(BASE)
    setattr(module, name, np.array([5.0, 6.0]) if name == "TABLE" else 5.0)
    for _ in range(2):
        with pytest.raises(TypeError, match=r"(top|part): a constant that it reads was changed"):
            module.top(3.0)


def test_nor_in_place_of_damaged_code(define, tmp_path):
    define(BASE, "twice").top.load()
    module = define(BASE, "twice")
    for path in (tmp_path / "cache").rglob("*.code"):
        path.write_bytes(b"")
    module.K = 5.0
    with pytest.raises(TypeError, match="part: a constant that it reads was changed"):
        module.top(3.0)


def test_code_that_points_into_its_process_is_not_kept(define, tmp_path):
    text = "LARGE = np.ones(10**6)\n@entry_point(float64(int64))\ndef top(k):\n    return LARGE[k]"
    with pytest.raises(TypeError, match=r"throwaway_\d+\.top: code that holds addresses"):
        define(text).top(3)
    assert not list((tmp_path / "cache").rglob("*.code"))


# What an entry point takes.

SUM = """
@compiled
def add(a, b):
    return a + b

@entry_point(float64(given(float64, 1), int64))
def top(values, n):
    total = 0.0
    for k in range(n):
        total = add(total, values[k])
    return total
"""
WRONG = {
    "single precision": np.ones(3, np.float32),
    "integers": np.ones(3, np.int64),
    "two axes": np.ones((3, 3)),
    "strides": np.ones(6)[::2],
    "a list": [1.0, 2.0, 3.0],
    "a number": 1.0,
}


def test_an_entry_point_takes_what_its_signature_says_alone(define):
    top = define(SUM).top
    for call in (top, top.load()):
        assert call(np.array([1.0, 2.0, 4.0]), 3) == 7.0
        frozen = np.array([1.0, 2.0, 4.0])
        frozen.flags.writeable = False
        assert call(frozen, 3) == 7.0
        for values in WRONG.values():
            with pytest.raises(TypeError, match=r"throwaway_\d+\.top takes .*float64.*, not \("):
                call(values, 3)
        with pytest.raises(TypeError, match="arguments"):
            call(np.ones(3))
    assert len(top.load().signatures) == 1


def test_all_of_a_package_are_loaded_with_progress(define):
    module = define(SUM)
    other = define(SUM)
    told = []
    assert load_all(told.append, module.__name__) > 0.0
    assert module.top.loaded
    assert not other.top.loaded
    assert [(step.name, step.done, step.total, step.cached) for step in told] == [
        (f"{module.__name__}.top", 0, 1, False),
        ("", 1, 1, True),
    ]


def test_old_versions_go_when_there_are_many(define, tmp_path):
    text = "K = {}\n@entry_point(float64(float64))\ndef {}(x):\n    return K + x"
    define(text.format(1.0, "another"), "other").another(1.0)
    for k in range(10):
        compilation._NAMES.clear()
        assert define(text.format(float(k), "top"), "versions").top(1.0) == k + 1.0
    code = list((tmp_path / "cache").rglob("*.code"))
    assert len([path for path in code if path.name.startswith("versions.top_")]) == 8
    assert len(code) == 9
    compilation._NAMES.clear()
    # The newest one is among those that stay.
    assert define(text.format(9.0, "top"), "versions").top.cached


# A second opinion.

NESTED = """
import lower
K = 1.5

@compiled
def part(x, n=2):
    def inner(y):
        return y * K + lower.part(y)
    return inner(x) / n

@entry_point(float64(float64))
def top(x):
    return part(x) + lower.K + math.sqrt(x) + np.hypot(x, 2.0)
"""


def test_uncompiled_is_plain_python_all_the_way_down(define, monkeypatch):
    define("K = 4.0\n@compiled\ndef part(x):\n    return x - K", "lower")
    module = define(NESTED)

    def compile_nothing(*_):
        raise AssertionError("compiled")

    plain = uncompiled(module.top)
    with monkeypatch.context() as patch:
        patch.setattr(type(module.part), "compile", compile_nothing)
        with pytest.raises(AssertionError, match="compiled"):
            module.top(1.0)
        found = [plain(x) for x in (0.0, 0.3, 7.7, 1e9)]
    assert found == [module.top(x) for x in (0.0, 0.3, 7.7, 1e9)]
    assert uncompiled(module.part)(4.0) == 3.0


def test_a_part_is_not_called_from_python(define):
    """A part has no machine code for calls from Python."""
    part = "@compiled\ndef part(x):\n    return x + 1.0\n"
    module = define(f"{part}@entry_point(float64(float64))\ndef top(x):\n    return part(x)\n")
    assert module.top(1.0) == 2.0
    with pytest.raises(TypeError, match=r"part is a part of compiled functions; call it from one"):
        module.part(1.0)


def test_the_models_own_step_is_the_same_uncompiled():
    model = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
    stores = [Simulator(model).store for _ in range(2)]
    steps = kernel.step, uncompiled(kernel.step)
    for k in range(50):
        inputs = 2e-3, 3.0 * np.sin(0.1 * k), 2.0 * np.cos(0.2 * k), -1.0
        first, second = (step(store, *inputs) for step, store in zip(steps, stores, strict=True))
        assert second == pytest.approx(first, rel=1e-12, abs=1e-15)
    assert abs(first[0]) > 1e-5


def described_by_dis(code):
    """Returns the dotted names that code reads, by `dis`."""
    found, path = set(), []
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_ATTR", "LOAD_METHOD") and path:
            path.append(step.argval)
        elif step.opname != "EXTENDED_ARG":
            found |= {tuple(path)} if path else set()
            path = [step.argval] if step.opname == "LOAD_GLOBAL" else []
    return found


def many_names():
    """Returns a function that reads more names than one byte counts."""
    lines = [f"    a = np.linalg.n{k} + math.m{k}(b.c{k}.d)" for k in range(300)]
    scope = {}
    exec("\n".join(["def f(a, b):", *lines, "    return 1.5 + a"]), scope)
    return scope["f"]


@pytest.mark.parametrize("function", [many_names(), digest, os.path.join, dis.dis])
def test_names_that_code_reads_are_those_that_dis_finds(function):
    code = function.__code__
    nested = [one for one in code.co_consts if hasattr(one, "co_code")]
    assert set(paths(code)) >= described_by_dis(code)
    assert nested or set(paths(code)) == described_by_dis(code)

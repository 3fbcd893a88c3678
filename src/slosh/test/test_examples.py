"""Tests that the example in each docstring works."""

import doctest
import importlib
import inspect
import re
from pathlib import Path

import pytest

LONG = {"slosh.discover", "slosh.identify"}
ROOT = Path(__file__).resolve().parents[2]
PUBLIC = sorted(
    init.parent.name for init in ROOT.glob("*/slosh*/__init__.py") if "__all__" in init.read_text()
)
NAMES = {
    f"{package}.{name}": (package, name)
    for package in PUBLIC
    for name in importlib.import_module(package).__all__
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.long) if name in LONG else name for name in NAMES],
)
def test_an_example_does_what_it_shows(name, folder):
    package, member = NAMES[name]
    text = inspect.getdoc(getattr(importlib.import_module(package), member))
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    assert len(example.examples) >= 2
    run_example(example)


def documented_examples():
    """Yields the examples of modules in docs/api that other tests do not run."""
    pages = (ROOT.parent / "docs" / "api").glob("*.md")
    modules = {m for page in pages for m in re.findall(r"automodule:: ([\w.]+)", page.read_text())}
    named = {member for _, member in NAMES.values()}
    for module in sorted(modules):
        loaded = importlib.import_module(module)
        for example in doctest.DocTestFinder(exclude_empty=True).find(loaded, module):
            if example.examples and example.name.removeprefix(f"{module}.") not in named:
                yield pytest.param(example, id=example.name)


@pytest.mark.parametrize("example", list(documented_examples()))
def test_an_example_of_a_documented_module_does_what_it_shows(example, folder):
    run_example(example)


def run_example(example):
    told = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    runner.run(example, out=told.append)
    assert not told, "".join(told)

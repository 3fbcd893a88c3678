"""The example in each name's docstring does what it shows."""

import doctest
import inspect

import pytest

import slosh

LONG = {"discover"}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.long) if name in LONG else name
     for name in slosh.__all__],
)  # fmt: skip
def test_an_example_does_what_it_shows(name, folder):
    text = inspect.getdoc(getattr(slosh, name))
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    assert len(example.examples) >= 2
    told = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    runner.run(example, out=told.append)
    assert not told, "".join(told)

"""What a short text can stand for is bounded before anything is made of it."""

import tracemalloc

import pytest
import yaml

from slosh_base.files.errors import YamlError
from slosh_base.files.yaml_document import parse_yaml

LEVELS = range(1, 40)
ALIASES = "a0: &a0 [1, 1]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in LEVELS)
MERGES = "a0: &a0 {x0: 1, y0: 1}\n" + "".join(
    f"a{n}: &a{n} {{<<: [*a{n - 1}, *a{n - 1}], x{n}: 1}}\n" for n in LEVELS
)


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (ALIASES, "it stands for more than 200000 values"),
        (MERGES, "it stands for more than 200000 values"),
        ("a: &a [*a]", r"\*a refers to itself or to nothing"),
        ("a: *b", "b"),
        ("[" * 51 + "]" * 51, "it has more than 50 levels"),
        ("[" + "1," * 200_000 + "]", "it stands for more than 200000 values"),
        ("x" * 1_000_001, "the text is longer than 1000000 characters"),
    ],
)
def test_too_much_is_refused_with_the_reason(text: str, problem: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(YamlError, match=problem):
            parse_yaml(text, "f.yaml")
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "text", ["", "a: 1", "a: &x [1, 2]\nb: *x", "a: &x {p: 1}\nb: {<<: *x, q: 2}", "- {a: [1.5]}"]
)
def test_the_rest_is_what_yaml_reads(text: str) -> None:
    assert parse_yaml(text, "f.yaml").value == yaml.safe_load(text)

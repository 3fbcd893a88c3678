"""Tests that YAML is read strictly, written without loss, and errors give the line."""

import pickle
import tracemalloc

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_base.files.errors import SloshFileError, TextFileError, YamlError
from slosh_base.files.yaml_document import format_yaml, parse_yaml, read_yaml, shown


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("2e1", 20.0), ("1e-4", 1e-4), (".5", 0.5), ("+1.E2", 100.0), ("010", 10), ("-3", -3),
        (".inf", float("inf")), ("1:30", "1:30"), ("0x1f", "0x1f"), ("1_000", "1_000"),
        ("yes", True), ("~", None), ("'2e1'", "2e1"), ("!!str 5", "5"),
    ],
)  # fmt: skip
def test_numbers_are_those_of_the_current_version_of_yaml(written, value):
    found = parse_yaml(f"a: {written}", "f.yaml").value["a"]
    assert found == value
    assert type(found) is type(value)


def test_a_key_is_a_name_as_it_is_written():
    assert list(parse_yaml("{0012: 1, 1e5: 2, null: 3, yes: 4}", "f.yaml").value) == [
        "0012", "1e5", "null", "yes",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\nb: 2\na: 3", "f.yaml:3: a: given twice"),
        ("a:\n- x: 1\n- {y: 1,\n   y: 2}", "f.yaml:4: a[1].y: given twice"),
        ("a: &x {p: 1}\nb:\n  <<: *x\n  <<: *x", "f.yaml:4: b.<<: given twice"),
        ("a:\n  ? [1]\n  : 2", "f.yaml:2: a: a key is a collection; keys are names"),
        ("a: 1\n\tb: 2", "f.yaml:2: not YAML: found a tab character that violates indentation"),
        ("a: {", "f.yaml:1: not YAML: did not find expected node content"),
        ("é: 1\nb: \x07", "f.yaml:2: not YAML: character #x07: control characters are not"),
        ("a: \ud800", "f.yaml:1: not YAML: surrogates not allowed"),
        ("a:\n  b: !!float ''", "f.yaml:2: not YAML: '' is no float"),
        ("a: 1\n---\nb: 1", "f.yaml:2: not YAML: expected a single document in the stream, but"),
        ('"a\\nb": {c: 1, c: 2}', "f.yaml:1: a b.c: given twice"),
    ],
)
def test_a_mistake_is_one_line_with_its_place(text, said):
    with pytest.raises(YamlError) as caught:
        parse_yaml(text, "f.yaml")
    assert str(caught.value).startswith(said)
    assert len(str(caught.value).splitlines()) == 1


def test_the_line_of_every_key_is_known():
    document = parse_yaml("a: &x\n  p: 1\nb:\n  <<: *x\n  q: [1,\n   2]\n  r:\n  - s: 1", "f.yaml")
    assert document.value["b"] == {"p": 1, "q": [1, 2], "r": [{"s": 1}]}
    assert document.at("b", "q", 1) == "f.yaml:6: b.q[1]"
    assert document.where("b", "r", 0, "s") == "f.yaml:8"
    assert document.where("b", "p") == "f.yaml:2"  # where it comes from
    assert document.at("b", "t") == "f.yaml:3: b.t"  # what is missing: where it should be
    assert document.at("t") == "f.yaml: t"
    assert parse_yaml("", "f.yaml").where("a") == "f.yaml"


def test_keys_of_the_mapping_itself_count_before_those_that_are_merged():
    document = parse_yaml("a: &x {p: 1}\nb:\n  <<: *x\n  p: 2", "f.yaml")
    assert document.value["b"] == {"p": 2}
    assert document.where("b", "p") == "f.yaml:4"


plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=12)
    | st.from_regex(r"\A[-+]?0?[0-9_:.]{1,4}(e[-+]?[0-9])?\Z"),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("019e_.~y"), inner),
    max_leaves=6,
)


@pytest.mark.long
@settings(max_examples=300, deadline=None)
@given(plain)
def test_what_is_written_reads_the_same_here_and_by_any_reader(value):
    text = format_yaml(value, allow_unicode=True)
    assert parse_yaml(text, "f.yaml").value == value
    assert yaml.safe_load(text) == value


def test_values_are_shown_briefly():
    assert shown("a") == "'a'"
    assert shown([1] * 1000) == "a list"
    assert len(shown("a" * 1000)) == 61


def test_what_cannot_be_read_is_told(tmp_path):
    path = tmp_path / "f.yaml"
    with pytest.raises(TextFileError, match=r"f\.yaml: No such file") as caught:
        read_yaml(path)
    # Errors of worker processes come back pickled.
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    path.write_bytes(b"a: 1\nb: \xff")
    with pytest.raises(TextFileError, match=r"f\.yaml: is not UTF-8 text \(line 2\)"):
        read_yaml(path)
    path.write_text("#" * 1_000_001)
    with pytest.raises(SloshFileError, match=r"f\.yaml: too large, more than 1000000 bytes"):
        read_yaml(path)


# What a short text can stand for is bounded before anything is made of it.


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

"""Files of older versions are read and rewritten; newer ones are refused in one line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_base.files.errors import YamlError
from slosh_base.files.file_version import (
    CAMERA,
    CELL,
    FORMATS,
    MODEL,
    FileFormat,
    RenamedKey,
    migrated,
    parse_versioned,
)
from slosh_base.files.yaml_document import parse_yaml

# A format with two versions more than the real ones have today.
LATER = FileFormat(
    "later.yaml",
    ("container",),
    (
        (),
        (RenamedKey(("container", "radius"), "inner_radius"),),
        (RenamedKey(("effects", "*", "alpha"), "stiffness"),),
    ),
)
OLD = """\
# Größe: the cup
---
container:
  radius: 5.0e-2   # of glass
effects:
  - name: a
    "alpha": 0.58  # fitted
  - {name: b, alpha: 1}
"""
NEW = """\
# Größe: the cup
---
version: 3
container:
  inner_radius: 5.0e-2   # of glass
effects:
  - name: a
    stiffness: 0.58  # fitted
  - {name: b, stiffness: 1}
"""


@pytest.mark.parametrize("version", [0, 1])
def test_older_files_are_read_as_those_of_today(version):
    text = OLD.replace("container:", f"version: {version}\ncontainer:", 1) if version else OLD
    found = parse_versioned(text, "cup.yaml", LATER)
    assert found.value == parse_versioned(NEW, "cup.yaml", LATER).value
    assert "version" not in found.value
    # Errors name the line in the file as it is, under the key's new name.
    assert found.at("container", "inner_radius").startswith(f"cup.yaml:{4 + version}:")


def test_rewritten_files_keep_comments_order_and_numbers():
    assert migrated(OLD, "cup.yaml", [LATER]).text == NEW
    text = OLD.replace("container:", "version: 2\ncontainer:", 1)
    text = text.replace("radius", "inner_radius")
    assert migrated(text, "cup.yaml", [LATER]).text == NEW
    assert migrated(NEW, "cup.yaml", [LATER]) == (LATER, 3, NEW)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("container: {radius: 1}", "version: 1\ncontainer: {radius: 1}"),
        ("# a\r\ncontainer: {r: 1}\r\n", "# a\r\nversion: 1\r\ncontainer: {r: 1}\r\n"),
        ("  container: 1\n  effects: []\n", "  version: 1\n  container: 1\n  effects: []\n"),
        ("{container: 1}", "{version: 1, container: 1}"),
        ("container: 1\nversion: 0 # old\n", "container: 1\nversion: 1 # old\n"),
        ("\ufeffcontainer: 1\n", "\ufeffversion: 1\ncontainer: 1\n"),
    ],
)
def test_the_version_comes_before_the_first_key(text, wanted):
    found = migrated(text, "cup.yaml")
    assert (found.file_format, found.version, found.text) == (MODEL, 0, wanted)


@pytest.mark.parametrize("file_format", FORMATS, ids=lambda one: one.name)
def test_newer_files_are_refused_with_a_remedy(file_format):
    newer = file_format.current + 1
    text = f"{file_format.marks[0]}: {{}}\nversion: {newer}\n"
    for read in (
        lambda: parse_versioned(text, "f.yaml", file_format),
        lambda: migrated(text, "f.yaml"),
    ):
        with pytest.raises(YamlError) as caught:
            read()
        assert str(caught.value) == (
            f"f.yaml:2: version = {newer}: written for a newer slosh, this one reads "
            f"{file_format.name} up to version {file_format.current}; install a newer slosh"
        )


@pytest.mark.parametrize("value", ["-1", "1.0", "true", "'1'", "null", "[1]", "2024-01-01"])
def test_what_is_no_version_is_named(value):
    with pytest.raises(YamlError, match=r"f\.yaml:1: version = .* must be a whole number from 0"):
        parse_versioned(f"version: {value}\nmodel: a.yaml", "f.yaml", CELL)


def test_a_file_is_known_by_its_keys():
    """A camera's file has a container too."""
    assert migrated("camera_matrix: {}\ncontainer: {}", "f").file_format == CAMERA
    for text in ("", "[1]", "radius: 1", "5"):
        with pytest.raises(YamlError, match="f: none of the files that have a version"):
            migrated(text, "f")


@given(
    st.dictionaries(
        st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), max_size=4),
        st.integers() | st.text(st.characters(codec="utf-8"), max_size=5),
        max_size=3,
    )
)
def test_rewriting_changes_nothing_else_and_twice_is_once(entries):
    from slosh_base.files.yaml_document import format_yaml

    document = {**entries, "container": {"radius": 0.05}}
    document.pop("version", None)
    if not {"camera_matrix", "bags", "model"}.isdisjoint(document):
        return
    text = format_yaml(document, sort_keys=False, allow_unicode=True)
    new = migrated(text, "f")
    assert parse_yaml(new.text, "f").value == {"version": 1, **parse_yaml(text, "f").value}
    assert migrated(new.text, "f").text == new.text

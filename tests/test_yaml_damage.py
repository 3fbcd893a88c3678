"""Tests that a damaged YAML file is read, or refused in one line that names the file."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_folder import bag_files
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.parameter_file import check_parameter_file
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_any_calibration
from slosh_camera.calibrate.intrinsics import read_known_camera
from slosh_camera.errors import SloshCameraError
from slosh_model.errors import SloshModelError
from slosh_model.model_text import read_model
from slosh_motion.errors import SloshMotionError
from slosh_motion.recorded.settings import node_start
from slosh_replay.manifest import read_manifest

BAGS = Path(__file__).resolve().parent.parent / "bags"
CELL = """\
model: model.yaml
calibration: camera.yaml
parameters: parameters.yaml
namespace: /cup
remap:
  accel: /arm/accel
  camera/image_raw: /arm/image
"""
SETTINGS = """\
files: {model: "container: {radius: 0.05, fill_height: 0.07}"}
parameters: {measured_limit: 0.02, release: 0.9, hold: 0.5, input: accel}
topics: {accel: /slosh/accel}
"""


def read_settings(path: Path) -> object:
    stamp = SimpleNamespace(sec=1, nanosec=0)
    message = SimpleNamespace(
        header=SimpleNamespace(stamp=stamp), document=path.read_text(), node="a", code="",
        arithmetic="",
    )  # fmt: skip
    return node_start(message, 0, str(path))


def read_bag(path: Path) -> object:
    metadata = path.with_name("metadata.yaml")
    shutil.copyfile(path, metadata)
    return bag_files(metadata.parent)


class Kind(NamedTuple):
    """A kind of YAML file: a valid text, its reader, and the errors that it may raise."""

    text: str
    read: Callable[[Path], Any]
    errors: tuple[type[Exception], ...]


def shipped(name: str) -> str:
    return (config_folder() / name).read_text()


def shipped_metadata() -> str:
    return next(BAGS.glob("*/metadata.yaml")).read_text()


KINDS = {
    "model": Kind(shipped("model.yaml"), read_model, (SloshModelError, SloshMotionError)),
    "camera": Kind(shipped("camera.yaml"), read_any_calibration, (SloshCameraError,)),
    "intrinsics": Kind(shipped("camera.yaml"), read_known_camera, (SloshCameraError,)),
    "cell": Kind(CELL, read_setup, (SloshBringupError,)),
    "parameters": Kind(
        shipped("cell.yaml"),
        lambda path: check_parameter_file(path, "/slosh"),
        (SloshBringupError,),
    ),
    "manifest": Kind((BAGS / "manifest.yaml").read_text(), read_manifest, (SloshBagError,)),
    "settings": Kind(SETTINGS, read_settings, (SloshBagError,)),
    "metadata": Kind(shipped_metadata(), read_bag, (SloshBagError,)),
}

WORDS = st.sampled_from(
    [
        "a: &x 1", "b: *x", "? [1]", "<<: {a: 1}", "<<: *x", "- 1", "{", "[", "'", '"', "|", "\t",
        ":", "...", "---", "%YAML 1.2", "!!float ''", "!!bool 5", "!!set {a}", "!!omap [x]", "=",
        "!!python/name:os.system", "2e1", ".nan", "1e999", "9" * 400, "9" * 5000, "~", "yes",
        "2024-01-01", "!!binary a", "!!timestamp x", "\u2028", "\x85", "\0", "\ufeff", "é",
        "[" * 60 + "]" * 60, "{a: " * 45 + "1" + "}" * 45, "? a\n  b\n: 1", "'a\n\n b': 1",
        '"a\\nb": 1', '"\\0": 1', '"\\ud800"', '"/a\\0"', "&r [*r]", "&y [1, 1]", "/" + "a" * 5000,
    ]
)  # fmt: skip


@st.composite
def damages(draw: st.DrawFn) -> Callable[[str], bytes]:
    """Hypothesis strategy of functions that change lines of a text, then its bytes."""
    changes = draw(st.lists(st.tuples(
        st.sampled_from(["delete", "double", "swap", "value", "insert", "indent", "word"]),
        st.integers(0, 10_000), st.integers(0, 10_000), WORDS,
    ), min_size=1, max_size=4))  # fmt: skip
    noise = draw(st.lists(st.tuples(st.integers(0, 10_000), st.binary(max_size=3)), max_size=2))

    def damage(text: str) -> bytes:
        lines = text.splitlines()
        for what, place, other, word in changes:
            change_lines(lines, what, place % max(len(lines), 1), other, word)
        content = bytearray("\n".join(lines).encode())
        for place, snippet in noise:
            at = place % (len(content) + 1)
            content[at : at + len(snippet)] = snippet
        return bytes(content)

    return damage


def change_lines(lines: list[str], what: str, at: int, other: int, word: str) -> None:
    if not lines:
        lines.append(word)
        return
    line = lines[at]
    if what == "delete":
        del lines[at]
    elif what == "double":
        lines.insert(other % (len(lines) + 1), line)
    elif what == "swap":
        lines[at], lines[other % len(lines)] = lines[other % len(lines)], line
    elif what == "value":
        lines[at] = f"{line.partition(':')[0]}: {word}"
    elif what == "insert":
        lines.insert(at, line[: len(line) - len(line.lstrip())] + word)
    elif what == "indent":
        lines[at] = " " * (other % 5) + line
    else:
        middle = other % (len(line) + 1)
        lines[at] = line[:middle] + word + line[middle:]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Returns a folder with the files that a cell file names, shared by all examples."""
    folder = tmp_path_factory.mktemp("cell")
    for name, kind in (("model", "model"), ("camera", "camera"), ("parameters", "parameters")):
        (folder / f"{name}.yaml").write_text(KINDS[kind].text)
    (folder / "bag_0.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(99))
    return folder


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_whole_is_read(folder, kind):
    (folder / "whole.yaml").write_text(KINDS[kind].text)
    KINDS[kind].read(folder / "whole.yaml")


@pytest.mark.first(2)
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=150, deadline=None)
@given(damage=damages())
def test_a_damaged_file_gives_a_value_or_one_line(folder, kind, damage):
    text, read, errors = KINDS[kind]
    path = folder / "damaged.yaml"
    path.write_bytes(damage(text))
    if kind == "settings":
        try:  # it comes as a text, never as bytes
            path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            return
    try:
        read(path)
    except errors as error:
        said = str(error)
        assert said.startswith(str(path))
        assert len(said.splitlines()) == 1
        assert len(said) < 2000


@pytest.mark.parametrize("kind", sorted(KINDS.keys() - {"metadata", "settings"}))
@pytest.mark.parametrize("place", ["/dev/zero", "pipe", "."])
def test_what_is_no_regular_file_is_refused_at_once(folder, kind, place, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(KINDS[kind].errors, match=r"regular file|directory"):
        KINDS[kind].read(tmp_path / place)


@pytest.mark.parametrize("kind", sorted(KINDS.keys() - {"metadata", "settings"}))
@pytest.mark.parametrize(
    ("added", "said"),
    [
        ("\nsame: 1\nsame: 2\n", "same: given twice"),
        ("\n\tx: 1\n", "there is a tab here"),
        ("\nx: " + "[" * 60 + "]" * 60, "it has more than 50 levels"),
        ("\nx: *nothing\n", "refers to itself or to nothing"),
    ],
)
def test_the_same_mistake_is_told_alike_in_every_file(folder, kind, added, said):
    text = KINDS[kind].text.rstrip("\n")
    path = folder / "mistaken.yaml"
    path.write_text(text + added)
    with pytest.raises(KINDS[kind].errors) as caught:
        KINDS[kind].read(path)
    line = text.count("\n") + 1 + (2 if "same" in added else 1)
    assert str(caught.value).startswith(f"{path}:{line}: ")
    assert said in str(caught.value)

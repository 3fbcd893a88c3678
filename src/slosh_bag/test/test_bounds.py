"""Tests that excessive sizes are rejected, and sizes just at the limit are accepted."""

import bz2
import gzip

import lz4.frame
import pytest
import zstandard

from slosh_bag import unpacking
from slosh_bag.definitions import MOST_VALUES, read_types
from slosh_bag.errors import SloshBagError
from slosh_bag.unpacking import UnpackingError, unpack
from slosh_base.files import bounded_text as texts
from slosh_base.files.bounded_text import bounded_text
from slosh_base.files.errors import SloshFileError

CONTENT = bytes(range(250)) * 40
PACKED = {
    "": CONTENT,
    "lz4": lz4.frame.compress(CONTENT),
    "lz4 without a size": lz4.frame.compress(CONTENT, store_size=False),
    "zstd": zstandard.compress(CONTENT),
    "zstd without a size": zstandard.ZstdCompressor(write_content_size=False).compress(CONTENT),
    "zstd in two frames": zstandard.ZstdCompressor(write_content_size=False).compress(CONTENT[:99])
    + zstandard.ZstdCompressor(write_content_size=False).compress(CONTENT[99:]),
    "bz2": bz2.compress(CONTENT),
    "bz2 in two streams": bz2.compress(CONTENT[:99]) + bz2.compress(CONTENT[99:]),
}


@pytest.mark.parametrize("name", PACKED)
def test_no_more_is_unpacked_than_is_let_in(monkeypatch, name):
    stored, kind = PACKED[name], name.split(" ")[0]
    assert unpack(kind, memoryview(stored), len(CONTENT)) == CONTENT
    for size in (len(CONTENT) - 1, len(CONTENT) + 1, 0):
        with pytest.raises(UnpackingError):
            unpack(kind, stored, size)
    monkeypatch.setattr(unpacking, "MOST_UNPACKED", len(CONTENT))
    assert unpack(kind, stored) == CONTENT
    monkeypatch.setattr(unpacking, "MOST_UNPACKED", len(CONTENT) - 1)
    with pytest.raises(UnpackingError, match=f"more than {len(CONTENT) - 1}"):
        unpack(kind, stored)


@pytest.mark.parametrize("name", [name for name in PACKED if name])
def test_what_is_cut_off_is_not_taken_for_the_whole(name):
    with pytest.raises(UnpackingError):
        unpack(name.split(" ")[0], PACKED[name][:-3], len(CONTENT))


def nested(levels):
    parts = [f"{'=' * 80}\nMSG: a/T{n}\nT{n + 1} x\n" for n in range(levels - 1)]
    return f"T0 x\n{''.join(parts)}{'=' * 80}\nMSG: a/T{levels - 1}\nint8 x\n"


def array_of(count):
    return f"C[{count}] c\n{'=' * 80}\nMSG: a/C\nint8 x\nfloat64[1000000000] y\n"


@pytest.mark.parametrize("text", ["int8 x\n" * 3, nested(49), array_of((MOST_VALUES - 1) // 2)])
def test_a_large_type_is_read(text):
    assert "a/msg/B" in read_types("ros2msg", text, "a/msg/B")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("B b\n", "a/msg/B contains itself"),
        ("B[] b\n", "a/msg/B contains itself"),
        (nested(60), "levels"),
        (array_of(MOST_VALUES), "values"),
        ("int8 x\n" * 6000, "declares"),
        ("# " + "x" * 600_000 + "\nint8 x\n", "characters"),
    ],
)
def test_a_type_that_is_too_large_is_refused(text, reason):
    with pytest.raises(SloshBagError, match=reason):
        read_types("ros2msg", text, "a/msg/B")


@pytest.mark.parametrize("ending", [".csv", ".csv.gz"])
def test_text_is_read_up_to_its_bounds(monkeypatch, tmp_path, ending):
    content = b"a,b\n" * 100 + b"c" * 50 + b"\r\nd"
    path = tmp_path / f"t{ending}"
    path.write_bytes(gzip.compress(content) if ending == ".csv.gz" else content)

    def read():
        with bounded_text(path, "it is none") as text:
            return text.read()

    exact = {"MOST_TEXT": len(content), "MOST_CELLS": 202, "LONGEST_LINE": 50}
    for name, bound in exact.items():
        monkeypatch.setattr(texts, name, bound)
    assert read() == content.decode()
    for name, bound in exact.items():
        monkeypatch.setattr(texts, name, bound - 1)
        with pytest.raises(SloshFileError, match=f"{path.name}: has more than {bound - 1} "):
            read()
        monkeypatch.setattr(texts, name, bound)

"""A model's file: what cannot be read is told with the file's name."""

import os
from pathlib import Path

import pytest

from slosh_model.errors import ModelFileError, SloshModelError
from slosh_model.model_text import read_model


def test_model_files_are_named_in_every_error(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match="no file given"):
        read_model("")
    with pytest.raises(ModelFileError, match=r"absent\.yaml"):
        read_model(tmp_path / "absent.yaml")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelFileError, match=r"binary\.yaml"):
        read_model(binary)
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path, tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(ModelFileError, match=r"regular file|directory"):
            read_model(place)
    with pytest.raises(ModelFileError, match="null byte"):
        read_model("a\0b")
    (tmp_path / "large").write_bytes(b"#" * 100_000)
    with pytest.raises(ModelFileError, match="too large, more than 64000 bytes"):
        read_model(tmp_path / "large")
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("container: {shape: cylinder, radius: 0.05, fill_height: 0.07, colour: 1}")
    with pytest.raises(SloshModelError, match=r"wrong\.yaml.*colour"):
        read_model(wrong)

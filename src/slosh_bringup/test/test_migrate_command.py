"""`slosh migrate` and the versions of the files that the commands read and write."""

import shutil
from pathlib import Path

import pytest

from slosh_base.files.file_version import migrated
from slosh_bringup.cli.main import main
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import format_calibration, read_calibration
from slosh_model import format_model, read_model
from slosh_replay.manifest import Expectation, read_manifest, write_manifest


@pytest.fixture
def cup(tmp_path):
    """Creates the files of a new cup without their versions, as slosh 0.1.0 wrote them."""
    folder = tmp_path / "cup"
    new = ["new", str(folder), "--radius", "0.05", "--fill-height", "0.07", "--wall", "0.002"]
    assert main(new) == 0
    for path in folder.iterdir():
        text = path.read_text()
        assert text.count("\nversion: 1\n") == 1
        path.write_text(text.replace("version: 1\n", ""))
    return folder


def test_files_are_rewritten_once(cup, capsys):
    files = sorted(cup.iterdir())
    before = [path.read_text() for path in files]
    words = ["migrate", *map(str, files)]
    capsys.readouterr()
    assert main([*words, "--dry-run"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{path}: {path.name}, version 0 -> 1: would be rewritten" for path in files
    ]
    assert [path.read_text() for path in files] == before
    assert main(words) == 0
    after = [path.read_text() for path in files]
    assert [text.replace("version: 1\n", "") for text in after] == before
    assert "rewritten" in capsys.readouterr().out
    assert main(words) == 0
    assert capsys.readouterr().out.count("version 1 already") == len(files)
    assert [path.read_text() for path in files] == after


def test_old_and_new_files_are_read_alike(cup):
    old = read_setup(cup / "cell.yaml"), read_model(cup / "model.yaml")
    assert main(["migrate", str(cup / "cell.yaml"), str(cup / "model.yaml")]) == 0
    assert (read_setup(cup / "cell.yaml"), read_model(cup / "model.yaml")) == old


def test_none_is_rewritten_if_one_cannot_be(cup, capsys):
    (cup / "cell.yaml").write_text("model: model.yaml\nversion: 7\n")
    before = (cup / "model.yaml").read_text()
    assert main(["migrate", str(cup / "model.yaml"), str(cup / "cell.yaml")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "cell.yaml:2: version = 7: written for a newer slosh" in line
    assert (cup / "model.yaml").read_text() == before


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("model.yaml", ["modes", "FILE"]),
        ("cell.yaml", ["cell", "--config", "FILE"]),
        ("camera.yaml", ["detect", "STILL", "--camera", "FILE", "-o", "OUT"]),
        ("manifest.yaml", ["replay", "BAG", "--check"]),
    ],
)
def test_commands_refuse_newer_files_in_one_line(file, words, cup, tmp_path, capsys):
    path = cup / file
    if file == "manifest.yaml":
        shutil.copytree(Path(__file__).parents[3] / "bags" / "l", cup / "bag")
        path.write_text("bags: {}\n")
    path.write_text(path.read_text() + "version: 99\n")
    places = {"FILE": path, "STILL": tmp_path / "x.png", "OUT": tmp_path / "o", "BAG": cup / "bag"}
    capsys.readouterr()
    assert main([str(places.get(word, word)) for word in words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{path}:" in line
    assert line.endswith("install a newer slosh")


def test_what_is_written_and_shipped_has_the_current_version(tmp_path):
    write_manifest(tmp_path / "manifest.yaml", {"a": Expectation(images=3)})
    assert read_manifest(tmp_path / "manifest.yaml")["a"].images == 3
    folder = config_folder()
    texts = [
        (tmp_path / "manifest.yaml").read_text(),
        format_model(read_model(folder / "model.yaml")),
        format_calibration(read_calibration(folder / "camera.yaml")),
        *((folder / name).read_text() for name in ("model.yaml", "truth.yaml", "camera.yaml")),
    ]
    for text in texts:
        found = migrated(text, "f")
        assert found.version == found.file_format.current

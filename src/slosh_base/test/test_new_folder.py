"""Tests folders filled under a temporary name, and outputs that are also inputs."""

import os
import signal
import subprocess
import sys

import pytest

from slosh_base.files import (
    SloshFileError,
    check_apart,
    check_free,
    check_outside,
    new_folder,
    remove_unfinished,
)


def fill(room, names=("bag_0.mcap", "metadata.yaml")):
    for name in names:
        (room / name).write_text(f"new {name}")


def fail_in(context):
    """Raises an exception while a folder is being filled."""
    with context as room:
        fill(room)
        raise ZeroDivisionError


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_an_empty_folder_is_filled_in_place(tmp_path, monkeypatch):
    """The folder may be a shell's working folder or a mount point, so it must stay the same."""
    before = tmp_path.stat().st_ino
    monkeypatch.chdir(tmp_path)
    with new_folder(tmp_path.relative_to(tmp_path)) as room:
        assert room.name == tmp_path.name
        fill(room)
    assert names(tmp_path) == ["bag_0.mcap", "metadata.yaml"]
    assert os.stat(".").st_ino == before == tmp_path.stat().st_ino


def test_an_error_leaves_nothing_not_even_the_folders_above(tmp_path):
    with pytest.raises(ZeroDivisionError):
        fail_in(new_folder(tmp_path / "a" / "b"))
    assert names(tmp_path) == []


def test_ctrl_c_leaves_nothing(tmp_path):
    program = """
import sys, time
from pathlib import Path
from slosh_base.files import new_folder
with new_folder(Path(sys.argv[1])) as room:
    (room / "half").write_text("half")
    print("writing", flush=True)
    time.sleep(600)
"""
    command = [sys.executable, "-c", program, str(tmp_path / "bag")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "writing\n"
    assert names(tmp_path) == ["bag"]
    process.send_signal(signal.SIGINT)
    process.communicate()
    assert names(tmp_path) == []


def test_a_folder_that_holds_something_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    for check in (lambda: check_free(tmp_path), new_folder(tmp_path).__enter__):
        with pytest.raises(SloshFileError, match=r"exists already and holds notes\.txt; choose"):
            check()
    assert names(tmp_path) == ["notes.txt"]
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_file_is_no_folder(tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    for path in (file, file / "below"):
        with pytest.raises(SloshFileError, match="file: is not a folder"):
            new_folder(path).__enter__()
    with pytest.raises(SloshFileError, match="is not a folder"):
        check_free(file)
    check_free(tmp_path / "none")
    assert file.read_text() == "mine"


def test_what_is_replaced_goes_when_the_new_is_whole(tmp_path):
    fill(tmp_path, ["bag_0.mcap", "bag_1.mcap", "metadata.yaml"])
    (tmp_path / "bag_0.mcap").write_text("old")
    with pytest.raises(ZeroDivisionError):
        fail_in(new_folder(tmp_path, replace=True))
    assert names(tmp_path) == ["bag_0.mcap", "bag_1.mcap", "metadata.yaml"]
    with new_folder(tmp_path, replace=True) as room:
        fill(room)
        assert (tmp_path / "bag_0.mcap").read_text() == "old"
    assert names(tmp_path) == ["bag_0.mcap", "metadata.yaml"]
    assert (tmp_path / "bag_0.mcap").read_text() == "new bag_0.mcap"


def test_two_that_replace_leave_the_work_of_the_last(tmp_path):
    fill(tmp_path)
    with new_folder(tmp_path, replace=True) as first:
        with new_folder(tmp_path, replace=True) as second:
            fill(second, ["bag_0.mcap", "second"])
        fill(first)
    assert set(names(tmp_path)) >= {"bag_0.mcap", "metadata.yaml"}


def test_what_killed_writers_left_is_removed_and_nothing_else(tmp_path):
    fill(tmp_path, ["bag_0.mcap", ".slosh-1.csv", ".slosh-2", ".hidden"])
    (tmp_path / ".slosh-3" / "bag").mkdir(parents=True)
    remove_unfinished(tmp_path)
    assert names(tmp_path) == [".hidden", ".slosh-1.csv", "bag_0.mcap"]
    remove_unfinished(tmp_path, (".csv",))
    remove_unfinished(tmp_path / "none")
    assert names(tmp_path) == [".hidden", "bag_0.mcap"]


def test_errors_of_the_system_name_the_folder(tmp_path):
    folder = tmp_path / "bag"
    with pytest.raises(OSError, match="No such file") as caught, new_folder(folder) as room:
        (room / "none" / "file").write_text("")
    assert caught.value.filename == str(folder)
    with pytest.raises(OSError, match="No such file") as caught, new_folder(folder):
        (tmp_path / "other").read_text()
    assert caught.value.filename == str(tmp_path / "other")


def names_of_one_file(folder):
    """Returns a file under every possible name."""
    file = folder / "in.csv"
    file.write_text("t")
    (folder / "link.csv").symlink_to(file)
    os.link(file, folder / "hard.csv")
    return [file, file.relative_to(os.getcwd()), folder / "link.csv", folder / "hard.csv",
            folder / ".." / folder.name / "in.csv"]  # fmt: skip


def test_an_output_is_no_input_by_any_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    paths = names_of_one_file(tmp_path)
    other = tmp_path / "other.csv"
    other.write_text("t")
    for given in paths:
        for wanted in paths:
            with pytest.raises(SloshFileError, match="is the input"):
                check_apart([other, wanted], [None, given])
        check_apart([other, None, tmp_path / "new.csv"], [given])


def test_two_outputs_are_two_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    paths = names_of_one_file(tmp_path)
    for first in paths:
        for second in paths:
            with pytest.raises(SloshFileError, match="given for two outputs"):
                check_apart([first, second], [])
    new = tmp_path / "new.csv"
    with pytest.raises(SloshFileError, match="given for two outputs"):
        check_apart([new, new.relative_to(tmp_path)], [])


def test_pipes_and_terminals_are_input_and_output_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    check_apart([tmp_path / "pipe"] * 2, [tmp_path / "pipe"])


def test_a_folder_lies_outside_of_the_inputs(tmp_path):
    bag = tmp_path / "bag"
    bag.mkdir()
    (tmp_path / "link").symlink_to(bag)
    for output in (bag / "new", bag / "a" / "b", tmp_path / "link" / "new"):
        with pytest.raises(SloshFileError, match="is inside the input"):
            check_outside(output, [bag])
    for output in (bag, tmp_path / "link"):
        with pytest.raises(SloshFileError, match="is the input; choose another"):
            check_outside(output, [bag])
    check_outside(tmp_path, [bag])
    check_outside(tmp_path / "bag_2", [bag, tmp_path / "none"])

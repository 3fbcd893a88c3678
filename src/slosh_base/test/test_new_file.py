"""Tests files written under a temporary name, after success and after failure."""

import os
import resource
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from slosh_base.files import new_text, write_text

OLD = b"what was there\n"


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "table.csv"
    path.write_bytes(OLD)
    return path


def python(program, *words, **options):
    """Starts a Python process whose program begins with the required imports."""
    head = "import os, sys\nfrom pathlib import Path\nfrom slosh_base.files import *\n"
    command = [sys.executable, "-c", head + program, *map(str, words)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **options)


def alone(file):
    """Returns whether a file is alone in its folder, without temporary files."""
    return list(file.parent.iterdir()) == [file]


def test_the_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "table.csv"
    with new_text(path) as text:
        text.write("t,µ\r\n")
        text.flush()
        assert not path.exists()
    assert path.read_bytes() == "t,µ\r\n".encode()
    assert alone(path)


def test_an_error_leaves_the_old_file_and_nothing_else(file):

    def fail():
        with new_text(file) as text:
            text.write("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert file.read_bytes() == OLD
    assert alone(file)


@pytest.mark.parametrize("size", [10, 100_000])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(file, size):
    program = "write_bytes(Path(sys.argv[1]), bytes(int(sys.argv[2])))"

    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (5, 5))

    process = python(program, file, size, preexec_fn=limited)
    told = process.communicate()[1]
    assert f"File too large: '{file}'" in told
    assert file.read_bytes() == OLD
    assert alone(file)


def test_a_killed_process_leaves_the_old_file(file):
    program = """
with NewFile(Path(sys.argv[1])) as new, new.open() as stream:
    stream.write(b"half")
    stream.flush()
    os.kill(os.getpid(), 9)
"""
    process = python(program, file)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert file.read_bytes() == OLD


def test_what_is_written_is_on_the_disk_before_it_has_the_name(file, tmp_path):
    """Checks the order of system calls: fsync of the new file, then its rename."""
    trace = tmp_path / "trace"
    command = ["strace", "-f", "-o", trace, "-e", "trace=fsync,rename,renameat,renameat2"]
    program = "from slosh_base.files import *; from pathlib import Path; import sys\n"
    program += "write_text(Path(sys.argv[1]), 'new')"
    try:
        subprocess.run([*command, sys.executable, "-c", program, file], check=True)
    except FileNotFoundError:
        pytest.skip("needs strace")
    lines = trace.read_text().splitlines()
    synced = next(number for number, line in enumerate(lines) if "fsync(" in line)
    renamed = next(number for number, line in enumerate(lines) if str(file) in line)
    assert synced < renamed


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_a_new_file_has_the_mode_that_umask_says(tmp_path, mask):
    before = os.umask(mask)
    try:
        write_text(tmp_path / "new", "")
        plain = tmp_path / "plain"
        plain.open("w").close()
    finally:
        os.umask(before)
    assert (tmp_path / "new").stat().st_mode == plain.stat().st_mode


@pytest.mark.parametrize("mode", [0o600, 0o664, 0o755])
def test_mode_and_owner_of_an_old_file_are_kept(file, mode):
    file.chmod(mode)
    if os.getuid() == 0:
        os.chown(file, 12345, 23456)
    before = file.stat()
    write_text(file, "new")
    after = file.stat()
    assert file.read_text() == "new"
    assert stat.S_IMODE(after.st_mode) == mode
    assert (after.st_uid, after.st_gid) == (before.st_uid, before.st_gid)


@pytest.mark.skipif(os.getuid() != 0, reason="needs root, to become somebody else")
@pytest.mark.parametrize("mode", [0o444, 0o644])
def test_what_one_may_not_write_is_not_replaced(mode):
    # Beside pytest's folders, which nobody else may enter.
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "table.csv"
        file.write_bytes(OLD)
        file.chmod(mode)
        file.parent.chmod(0o777)
        told = python(
            "os.setuid(12345)\nwrite_text(Path(sys.argv[1]), 'new')", file
        ).communicate()[1]
        assert f"PermissionError: [Errno 13] Permission denied: '{file}'" in told
        assert file.read_bytes() == OLD
        assert alone(file)


def test_a_link_stays_a_link_and_its_target_is_replaced(file, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / "elsewhere" / "link.csv"
    link.symlink_to("../table.csv")
    write_text(link, "new")
    assert link.is_symlink()
    assert file.read_text() == "new"
    assert list((tmp_path / "elsewhere").iterdir()) == [link]


@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"])
def test_standard_output_in_a_file_takes_what_is_written_between_what_is_printed(tmp_path, name):
    log = tmp_path / "log"
    program = "print('before')\nwrite_text(Path(sys.argv[1]), 'table\\n')\nprint('after')"
    buffered = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    with log.open("w") as stream:
        process = python(program, name, stdout=stream, env=buffered)
        process.communicate()
    assert log.read_text() == "before\ntable\nafter\n"
    assert alone(log)


def test_standard_output_in_a_pipe_and_standard_error():
    program = "write_text(Path('/dev/stdout'), 'out')\nwrite_text(Path('/dev/stderr'), 'error')"
    assert python(program, stdout=subprocess.PIPE).communicate() == ("out", "error")


@pytest.mark.parametrize(
    ("name", "reason"),
    [("", "Is a directory"), ("none/x.csv", "No such file"), ("table.csv/x", "Not a directory")],
)
def test_what_cannot_be_written_is_told_with_the_name_that_was_given(file, name, reason):
    path = file.parent / name
    with pytest.raises(OSError, match=reason) as caught:
        write_text(path, "new")
    assert caught.value.filename == str(path)
    assert file.read_bytes() == OLD
    assert alone(file)

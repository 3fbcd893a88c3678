"""Tests that other users cannot change what commands and nodes write, with any umask."""

import stat
import subprocess
import sys
from pathlib import Path

import pytest

from slosh_base.files.new_file import OTHERS_WRITE
from slosh_bringup.processes import NodeProcess, node_environment
from slosh_testing.live_processes import PATIENCE, until

BAG = Path(__file__).resolve().parents[1] / "bags" / "l"
ANY = 'umask 000; exec "$@"'


def open_to_others(folder: Path) -> list[str]:
    """Returns the files below a folder that group or others may write."""
    return [
        f"{path}: {stat.filemode(path.lstat().st_mode)}"
        for path in folder.rglob("*")
        if path.lstat().st_mode & OTHERS_WRITE and not path.is_symlink()
    ]


@pytest.mark.long
def test_a_command_writes_nothing_that_others_may_change(tmp_path: Path) -> None:
    for words in (
        ("new", "cup", "--radius", "0.04", "--fill-height", "0.06"),
        ("replay", str(BAG), "-o", "page"),
    ):
        command = ["sh", "-c", ANY, "sh", sys.executable, "-m", "slosh_bringup.cli", *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "cup" / "model.yaml").stat().st_mode & 0o777 == 0o644
    assert len(list((tmp_path / "page").rglob("*.html"))) > 0
    assert not open_to_others(tmp_path)


def test_a_node_writes_nothing_that_others_may_change(tmp_path: Path, domain: int) -> None:
    node = NodeProcess("recorder", parameters={"output": str(tmp_path / "made" / "bag")})
    command = ["sh", "-c", ANY, "sh", *node.command("/modes")]
    with subprocess.Popen(command, env=node_environment(domain)) as running:
        try:
            until(lambda: list(tmp_path.rglob("*.mcap")), "the recording", PATIENCE)
        finally:
            running.terminate()
    assert running.returncode == 0
    assert not open_to_others(tmp_path)

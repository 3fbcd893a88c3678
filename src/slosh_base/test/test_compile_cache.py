"""Where compiled code is kept: ours, writable, and nobody else's."""

import os
import tempfile
from pathlib import Path

import pytest

from slosh_base.compiled import compile_cache
from slosh_base.compiled.compile_cache import cache_folder, sources_digest


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """No variable of the surroundings counts; the temporary folder is the test's."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))


def test_the_users_choices_come_first(tmp_path, monkeypatch):
    assert cache_folder() == tmp_path / "xdg" / "slosh"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    assert cache_folder().is_relative_to(tmp_path / "numba")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_folder().is_relative_to(tmp_path / "home" / ".cache")


def test_a_folder_that_cannot_be_made_is_replaced(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert cache_folder().is_relative_to(tmp_path / "tmp")


def test_no_home_is_no_obstacle(tmp_path, monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert cache_folder().is_relative_to(tmp_path / "tmp")


def test_a_folder_that_all_may_write_is_not_trusted(tmp_path):
    planted = tmp_path / "xdg" / "slosh"
    planted.mkdir(parents=True)
    planted.chmod(0o777)
    assert cache_folder().is_relative_to(tmp_path / "tmp")
    (tmp_path / "tmp" / f"slosh-{os.getuid()}").chmod(0o777)
    last = cache_folder()
    assert last.is_dir()
    assert last.name.startswith("slosh-")


def test_a_strangers_folder_is_not_trusted(tmp_path, monkeypatch):
    cache_folder()
    mine = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: mine + 1)
    assert not cache_folder().is_relative_to(tmp_path / "xdg")


def test_the_digest_follows_every_source(tmp_path, monkeypatch):
    before = sources_digest()
    package = Path(compile_cache.__file__).parent
    copy = tmp_path / "copy"
    for path in package.rglob("*.py"):
        target = copy / path.relative_to(package)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(path.read_bytes())
    monkeypatch.setattr(compile_cache, "_THIS_PACKAGE", copy)
    assert sources_digest(copy) == before
    (copy / "effects" / "base.py").write_text("# another")
    assert sources_digest(copy) != before


def test_the_digest_follows_another_package_and_this_one(tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / "tables.py").write_text("TABLE = 1")
    before = sources_digest(other)
    assert before != sources_digest()
    (other / "tables.py").write_text("TABLE = 2")
    assert sources_digest(other) != before

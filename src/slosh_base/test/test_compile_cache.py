"""Tests that compiled code is cached in a writable folder that no other user can change."""

import os
import tempfile

import pytest

from slosh_base.compiled.compile_cache import cache_folder, sources_digest


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Removes the environment variables that influence the cache folder."""
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
    monkeypatch.syspath_prepend(tmp_path)
    folder = tmp_path / "throwaway_package"
    (folder / "room").mkdir(parents=True)
    (folder / "__init__.py").touch()
    (folder / "room" / "tables.py").write_text("TABLE = 1")
    before = sources_digest("throwaway_package")
    assert before != sources_digest()
    assert before == sources_digest("throwaway_package")
    (folder / "room" / "tables.py").write_text("TABLE = 2")
    assert before != sources_digest("throwaway_package")
    with pytest.raises(ModuleNotFoundError, match="no package throwaway_other"):
        sources_digest("throwaway_other")

"""Fixtures that the tests of this package share."""

from pathlib import Path

import matplotlib as mpl
import pytest

from slosh_bringup.cli.main import main

mpl.use("Agg")
ROOT = Path(__file__).resolve().parents[3]
CUP = ["--diameter", "0.08", "--fill-height", "0.06", "--rim-height", "0.11"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Working folder with the model and the recordings of the page 'my cup'."""
    (tmp_path / "bags").symlink_to(ROOT / "bags")
    monkeypatch.chdir(tmp_path)
    assert main(["new", "cup", *CUP]) == 0
    assert main(["motion", "quintic", "--speed", "20", "--stroke", "0.3", "-o", "move.csv"]) == 0
    return tmp_path

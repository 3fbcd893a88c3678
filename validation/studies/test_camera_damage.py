"""Tests that no damaged or unsuitable image gives a wrong height without a flag."""

import importlib
import sys
from pathlib import Path

import pytest

STUDIES = Path(__file__).parent
NAMES = ("A_planar", "A_rotating", "B_rotating", "D_rotating")


@pytest.fixture
def damage(monkeypatch):
    """Imports the study camera_damage by its plain name."""
    monkeypatch.syspath_prepend(str(STUDIES))
    yield importlib.import_module("camera_damage")
    sys.modules.pop("camera_damage", None)


@pytest.fixture
def sequences(damage):
    """Reads the rendered sequences of the shared data; skips the test without them."""
    folders = damage.shared_sequences()
    if not folders:
        pytest.skip("no rendered sequences in the shared data")
    return [damage.read_sequence(folder) for folder in folders]


@pytest.mark.parametrize("half", [0, pytest.param(1, marks=pytest.mark.long)])
def test_no_picture_that_does_not_fit_is_measured(damage, sequences, half):
    for sequence in sequences if half else sequences[:1]:
        found: dict[str, list] = {}
        for name, outcome in damage.misfits(sequence, half):
            found.setdefault(name, []).append(outcome)
        whole = found.pop("as it is")
        alike = found.pop("mirrored left to right")
        for near in ("3 px down", "5 px down"):  # about as far as nothing is said
            del found[near]
        assert not all(one.flagged for one in whole)
        assert not any(one.wrong for one in (*whole, *alike))
        for name, outcomes in found.items():
            assert all(one.flagged for one in outcomes), name


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_no_damaged_file_is_wrong_in_silence(damage, sequences, name):
    (sequence,) = (one for one in sequences if one.name == name)
    found = list(damage.damaged_files(sequence, 1, 20))
    assert len(found) >= 200
    assert sum(one.refused for _, one in found) > 0.7 * len(found)
    assert not [(kind, one.error) for kind, one in found if one.wrong]

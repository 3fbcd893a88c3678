"""Tests the identification of a robot's measured cup; skipped without the measurements."""

import math

import pytest
from identified_runs import CUP, DATA, free_decay, untilted_runs

from slosh_discovery.identify import identify

FOLDER = DATA / "antisloshing"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="no measured runs here")


@pytest.fixture(scope="module")
def runs():
    return untilted_runs(FOLDER)


@pytest.mark.long
def test_decays_of_two_runs_tell_the_same_frequency_as_geometry(runs):
    found = [
        identify([free_decay(runs[name])], CUP).overall.parameters[0]
        for name in ("RD_2D_0.3m_6.8s_720deg", "RD_3D_0.3m_6.8s_720deg")
    ]
    one, other = found
    assert abs(one.value - other.value) < 3.0 * math.hypot(one.error, other.error)
    for entry in found:
        assert entry.value == pytest.approx(CUP.mode_frequency(1), rel=0.015)
        assert entry.error < 0.003 * entry.value

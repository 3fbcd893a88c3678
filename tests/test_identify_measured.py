"""A robot's measured cup, identified: skipped where the measurements are not there."""

import math

import pytest
from identified_runs import CUP, DATA, driven_model, free_decay, sigma_of, untilted_runs

from slosh_discovery.identify import identify

FOLDER = DATA / "antisloshing"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="no measured runs here")
FITTED = ("RD_3D_0.3m_6.5s_720deg", "TRD_2D_0.3m_2.2s_270deg", "TRD_3D_0.3m_2.9s_270deg")
HELD_OUT = ("RD_3D_0.3m_6.8s_720deg", "TRD_3D_0.3m_3s_270deg")


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


@pytest.mark.long
def test_half_of_the_runs_predict_the_other_half(runs):
    base = driven_model()
    found = identify([runs[name] for name in FITTED], base).overall
    frequency, damping = found.parameters
    assert frequency.value == pytest.approx(CUP.mode_frequency(1), rel=0.02)
    assert 0.0 <= damping.lower < damping.value < 0.05
    rest = [runs[name] for name in HELD_OUT]
    before, after = sum(sigma_of(base, rest)), sum(sigma_of(found.model, rest))
    assert after < 1.03 * before
    assert after < 2 * 2.5e-3

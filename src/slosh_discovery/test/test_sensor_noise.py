"""Tests estimation and whitening of sensor noise that is neither white nor uniform."""

from dataclasses import replace

import numpy as np
import pytest

from slosh_discovery.discover.colour import Whitening, neighbours_in
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.problem import HeightNoise, prepare
from slosh_discovery.discover.sensor_noise import Leftovers, dressed, estimate_sensor
from slosh_model.simulate import Inputs

RATE, COUNT = 60.0, 300
T = np.arange(COUNT) / RATE
INPUTS = Inputs(T, np.zeros((COUNT, 3)))


def remembering(random, stddev, correlation, shape=(COUNT,)):
    fresh = random.normal(0.0, stddev, shape)
    fresh[1:] *= np.sqrt(1.0 - correlation**2)
    for i in range(1, shape[0]):
        fresh[i] += correlation * fresh[i - 1]
    return fresh


def swing(t):
    return 0.015 * np.sin(2.0 * np.pi * 3.0 * t) * np.exp(-0.2 * t)


def leftovers(
    random, motions=5, noise=3e-4, correlation=0.7, jitter=0.0, left=0.0, outliers=0, drift=0.0,
    zero=None,
):  # fmt: skip
    """Returns residuals of a model that lacks an oscillation and a drift of given sizes."""
    found = []
    for _ in range(motions):
        true = T - random.uniform(-1.0, 1.0, COUNT) * jitter * np.sqrt(3.0)
        heights = swing(true) + left * np.sin(2.0 * np.pi * 2.6 * T)
        heights = heights + remembering(random, noise, correlation)
        if drift:
            heights = heights + remembering(random, drift, 0.97)
        struck = random.choice(COUNT, outliers, replace=False)
        heights[struck] += 3e-3 * random.choice([-1.0, 1.0], outliers)
        heights[random.random(COUNT) < 0.1] = np.nan
        heights = heights + (zero or 0.0)
        motion = prepare(MeasuredMotion("swing", INPUTS, T, msh=heights, level_known=zero is None))
        found.append(Leftovers.of(motion, swing(motion.t)[:, np.newaxis]))
    return found


def covariance(before, lags, stddev, correlation, forgotten):
    """Returns the noise covariance of one series with gaps."""
    places = np.cumsum(np.where(before >= 0, lags, 0))
    apart = np.abs(places[:, np.newaxis] - places)
    return stddev**2 * correlation**apart + np.diag(forgotten)


@pytest.fixture
def series():
    random = np.random.default_rng(3)
    kept = (random.random(80) > 0.2)[:, np.newaxis]
    t = np.arange(80) / RATE
    count = int(kept.sum())
    return neighbours_in(t, kept), random.uniform(0.0, 4.0, count), random.normal(size=count)


def test_a_whitened_residual_has_the_likelihood_of_the_whole_covariance(series):
    neighbours, forgotten, values = series
    whitening = Whitening.of(neighbours, 1.3, 0.6, forgotten)
    dense = covariance(neighbours.before, neighbours.lags, 1.3, 0.6, forgotten)
    white = np.linalg.solve(np.linalg.cholesky(dense), values)
    assert whitening.applied(values) == pytest.approx(white)
    assert np.sum(np.log(whitening.spread)) == pytest.approx(0.5 * np.linalg.slogdet(dense)[1])
    assert whitening.undone(white) == pytest.approx(values)
    two = np.column_stack([values, 2.0 * values])
    assert whitening.applied(two)[:, 1] == pytest.approx(2.0 * white)


def test_azimuths_are_series_of_their_own():
    random = np.random.default_rng(5)
    kept = random.random((60, 3)) > 0.2
    heights = np.where(kept, random.normal(0.0, 0.2, (60, 3)), np.nan)
    inputs = Inputs(T[:60], np.zeros((60, 3)))
    azimuths = np.array([0.0, 2.0, 4.0])
    motion = prepare(MeasuredMotion("wall", inputs, T[:60], eta_azimuth=azimuths, eta=heights))
    law = HeightNoise(0.6, np.full(len(motion.t), 2.0), np.full(motion.kept.shape, 0.5))
    motion = replace(motion, law=law)
    white = motion.laid(motion.in_noises(motion.heights[motion.kept]))
    neighbours = neighbours_in(motion.t, motion.kept[:, :1])
    own = Whitening.of(neighbours, 2.0, 0.6, np.full(len(neighbours.before), 0.5))
    expected = own.applied(motion.heights[motion.kept[:, 0], 0])
    assert white[motion.kept[:, 0], 0] == pytest.approx(expected)
    back = motion.in_metres(motion.in_noises(motion.heights[motion.kept]))
    assert back == pytest.approx(motion.heights[motion.kept])


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("noise", "correlation", "jitter"),
    [(3e-4, 0.7, 0.0023), (6e-4, 0.5, 0.0), (2e-4, 0.7, 0.0023)],
)
def test_colour_and_jitter_are_told_apart(noise, correlation, jitter):
    random = np.random.default_rng(11)
    found = estimate_sensor(leftovers(random, 6, noise, correlation, jitter, outliers=3))
    assert found is not None
    assert found.correlation == pytest.approx(correlation, abs=0.12)
    assert found.stddev == pytest.approx(noise, rel=0.25)
    assert found.jitter == pytest.approx(jitter, abs=3e-4)
    assert found.outliers == pytest.approx(0.011, abs=0.006)


@pytest.mark.long
def test_white_noise_is_plain():
    assert estimate_sensor(leftovers(np.random.default_rng(1), correlation=0.0)) is None


@pytest.mark.long
def test_what_the_model_lacks_is_no_noise():
    """Tests that a large oscillation in the residual is not taken for noise."""
    random = np.random.default_rng(2)
    assert estimate_sensor(leftovers(random, correlation=0.0, left=3e-3)) is None
    found = estimate_sensor(leftovers(random, jitter=0.0023, left=3e-3))
    assert found is not None
    assert found.stddev < 1e-3
    assert found.jitter == pytest.approx(0.0023, abs=5e-4)


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_drift_beside_the_noise_does_not_make_it_plain(seed):
    """Tests that a drift in addition to noise does not spoil the noise estimate."""
    random = np.random.default_rng(seed)
    found = estimate_sensor(leftovers(random, 4, 3e-4, jitter=0.0023, outliers=3, drift=6e-4))
    assert found is not None
    assert found.correlation < 0.9
    assert found.jitter == pytest.approx(0.0023, abs=6e-4)


def test_outliers_are_left_out_and_the_rest_is_white():
    random = np.random.default_rng(4)
    found = leftovers(random, jitter=0.0023, outliers=4)
    sensor = estimate_sensor(found)
    for one in found:
        motion = dressed(one, sensor)
        residual = one.residual[:, 0]
        large = np.abs(residual) > 2.5e-3
        assert not motion.kept[large & (np.abs(one.speed[:, 0]) < 0.05), 0].any()
        assert np.count_nonzero(np.isfinite(residual) & ~motion.kept[:, 0]) <= 7
        white = motion.in_noises(residual[motion.kept[:, 0]])
        assert np.std(white) == pytest.approx(1.0, abs=0.15)
        assert abs(np.mean(white[1:] * white[:-1])) < 0.2


@pytest.mark.first(1)
@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_a_sensors_own_claim_weighs_its_heights(correlation):
    random = np.random.default_rng(6)
    claimed = np.where(T < 2.5, 1.0e-4, 1.0e-3)
    found = []
    for _ in range(5):
        heights = swing(T) + claimed * remembering(random, 2.0, correlation)
        motion = prepare(MeasuredMotion("two", INPUTS, T, msh=heights, stddev=claimed))
        found.append(Leftovers.of(motion, swing(motion.t)[:, np.newaxis]))
    sensor = estimate_sensor(found)
    assert sensor.correlation == pytest.approx(correlation, abs=0.12)
    motion = dressed(found[0], sensor)
    assert motion.law.stddev[-1] == pytest.approx(10.0 * motion.law.stddev[0])
    white = motion.in_noises(found[0].residual[motion.kept])
    early, late = np.split(white, 2)
    assert np.std(early) == pytest.approx(np.std(late), rel=0.3)


def test_a_claim_that_does_not_hold_is_not_believed():
    random = np.random.default_rng(7)
    claimed = np.where(np.arange(COUNT) % 2, 1.0e-4, 1.0e-3)
    found = []
    for _ in range(3):
        heights = swing(T) + random.normal(0.0, 3e-4, COUNT)
        motion = prepare(MeasuredMotion("wrong", INPUTS, T, msh=heights, stddev=claimed))
        found.append(Leftovers.of(motion, swing(motion.t)[:, np.newaxis]))
    assert estimate_sensor(found) is None

"""Medians of few numbers against NumPy's."""

import numpy as np

from slosh_camera.cylinder.medians import median


def test_medians_have_the_bits_of_numpys():
    random = np.random.default_rng(1)
    for count in range(1, 40):
        values = random.normal(size=count).round(1)
        assert median(values) == np.median(values)
        assert median(values[::2]) == np.median(values[::2])
    values[3] = np.nan
    assert np.isnan(median(values))
    assert np.isnan(median(np.empty(0)))

"""Tests parts of the discovery: priors, wrong clock offsets and cross-validation."""

import math

import numpy as np
import pytest
from example_effects import in_fitting_container
from example_motions import BASE, NOISE, measured

from slosh_discovery.discover.clock import first_offset, slipped_offsets
from slosh_discovery.discover.evidence import (
    columns_together,
    correlation_length,
)
from slosh_discovery.discover.explanation import Explanation, starts
from slosh_discovery.discover.fitting import fit
from slosh_discovery.discover.problem import prepare
from slosh_discovery.discover.search import Search
from slosh_discovery.discover.tuning import TUNING
from slosh_model.effects.registry import EFFECTS

RANDOM = np.random.default_rng(3)


def test_residuals_that_go_together_count_once():
    one = RANDOM.normal(size=(2000, 1))
    assert columns_together([np.repeat(one, 8, axis=1)]) == pytest.approx(8.0)
    steps = np.repeat(one, 10, axis=0)  # ten neighbours alike: their correlations add up to ten
    assert correlation_length([steps]) == pytest.approx(10.0, rel=0.15)


def test_before_any_data_an_effect_is_at_work_one_time_in_three():
    """Tests that the prior probability of any effect is about one third."""
    nothing = math.prod(1.0 - TUNING.effect_prior * effect.odds for effect in EFFECTS.values())
    anything = 1.0 - nothing
    assert anything == pytest.approx(1.0 / 3.0, abs=0.06)


@pytest.mark.long
def test_an_unlikely_effect_is_named_only_after_all_others_were_tried_in_its_place(monkeypatch):
    """Tests that an improbable effect is named only after all other effects were tried."""
    truth = BASE.with_effect("fill_level", delta=0.02).with_effect("height_scale", gain=1.1)
    motions = [prepare(measured(truth, seed), noise=NOISE) for seed in range(2)]
    wanted = Explanation(BASE).with_effect("fill_level", {}).with_effect("height_scale", {})
    unlikely = Explanation(BASE).with_effect("frequency_mismatch", {})
    search = Search(BASE, motions, [0.0, 0.0], lambda text, share: None, 1)

    def only_that(pool):
        one = fit(unlikely, motions, unlikely.centres, [0.0, 0.0])
        two = unlikely.with_effect("height_scale", {})
        pool.fits = {((), ()): pool.base} | {one.explanation.key: one}
        pool.add([fit(two, motions, two.centres, [0.0, 0.0], evaluations=30)])

    monkeypatch.setattr(search, "_add_effects", only_that)
    monkeypatch.setattr(search, "_add_foretold", lambda pool: None)
    pool = search.run()
    assert pool.find(wanted) is not None
    assert "frequency_mismatch" not in pool.ranked()[0].explanation.effects


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_every_effect_has_starts_within_its_bounds(name):
    for values, choices in starts(name):
        explanation = Explanation(in_fitting_container(BASE, name)).with_effect(name, choices)
        model = explanation.model(explanation.vector(lambda *_, of=values: of))
        assert model is not None
        assert model.has(name)


@pytest.mark.parametrize("offset", [-2.0, 0.4, 90.0])
def test_an_unknown_clock_is_found_from_the_heights_alone(offset):
    motion = measured(BASE.with_effect("height_scale", gain=0.7), 2, offset=offset, level=0.01)
    assert first_offset(prepare(motion, noise=NOISE), BASE) == pytest.approx(offset, abs=0.02)


def test_a_clock_caught_beside_the_right_one_is_found_out():
    motion = prepare(measured(BASE, 3, offset=0.4), noise=NOISE)
    wrong = fit(Explanation(BASE), [motion], np.zeros(0), [0.4 + 0.33])
    assert abs(wrong.clock_offsets[0] - 0.4) > 0.1
    (found,) = slipped_offsets(wrong, [motion]) or [np.nan]
    assert found == pytest.approx(0.4, abs=0.02)
    right = fit(Explanation(BASE), [motion], np.zeros(0), [0.4])
    assert slipped_offsets(right, [motion]) is None


@pytest.mark.parametrize("name", EFFECTS)
def test_what_is_usually_wrong_is_plausible(name):
    for parameter in EFFECTS[name].parameters:
        if parameter.spread is not None:
            low, high = parameter.plausible
            told = parameter.expected
            centre = parameter.neutral if told is None else told
            assert low < centre - parameter.spread
            assert centre + parameter.spread < high

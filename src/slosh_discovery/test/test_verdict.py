"""How far a verdict may be trusted, by what the best explanation leaves."""

import pytest

from slosh_discovery.discover.search import Leftover
from slosh_discovery.discover.tuning import TUNING
from slosh_discovery.discover.verdict import trust_in

GAP = Leftover(mean_square=0.8, stddev=0.03)
"""Of a base: hardly as large as the noise."""


def test_what_leaves_nothing_but_noise_is_trusted():
    assert trust_in(GAP, Leftover(mean_square=0.01, stddev=0.02)) == 1.0


def test_a_name_that_explains_only_part_of_a_small_gap_is_not_certain():
    """Little beside the noise, and yet a third of the gap's amplitude: a law that is nearly it."""
    rest = Leftover(mean_square=0.9 * TUNING.adequate**2, stddev=0.005)
    assert rest.adequate
    assert trust_in(GAP, rest) < 0.9


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_the_more_of_a_gap_is_left_the_less_is_sure(share):
    """Down to a share of what is closed: half of a gap explained is something."""
    trust = trust_in(Leftover(4.0, 0.0), Leftover(4.0 * share, 0.0))
    assert trust == pytest.approx(0.85 * (1.0 - share))

"""Tests the share of the error that a model removes, in text, page and JSON."""

import json
import math
import re
from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slosh_discovery.discover.finding import Finding, HeightGap, Role
from slosh_discovery.discover.gap import closed_share, is_worse, total_gap
from slosh_discovery.discover.search import Leftover
from slosh_discovery.discover.tuning import TUNING
from slosh_discovery.discover.verdict import trust_in
from slosh_report.page.units import shown
from slosh_testing.example_finding import (
    example_finding,
    example_report,
    forms_of,
)

NAN = float("nan")
HEIGHTS = st.floats(0.0, 1.0)
COUNTS = st.integers(1, 10**6)


@given(HEIGHTS, HEIGHTS, HEIGHTS, HEIGHTS, COUNTS)
def test_a_smaller_gap_after_never_closes_less(before, one, other, noise, samples):
    smaller, larger = sorted((one, other))
    shares = [closed_share(before, after, noise, samples) for after in (smaller, larger)]
    assume(not math.isnan(shares[0]))
    assert shares[0] >= shares[1]


@given(HEIGHTS, HEIGHTS, HEIGHTS, COUNTS)
def test_whether_it_is_known_does_not_depend_on_the_gap_after(before, after, noise, samples):
    share = closed_share(before, after, noise, samples)
    assert math.isnan(share) == math.isnan(closed_share(before, 0.0, noise, samples))


def test_noise_that_is_left_counts_as_closed_and_more_is_not_possible():
    assert closed_share(5e-3, 1e-3, 1e-3, 100) == pytest.approx(1.0)
    assert closed_share(5e-3, 0.9e-3, 1e-3, 100) == 1.0


def test_a_gap_within_the_noise_has_no_closed_share():
    assert math.isnan(closed_share(0.9e-3, 0.5e-3, 1e-3, 100))
    assert math.isnan(closed_share(1.1e-3, 1.0e-3, 1e-3, 30))  # few samples: chance
    assert closed_share(1.1e-3, 1.0e-3, 1e-3, 30_000) == pytest.approx(1.0)
    # However many samples: the noise itself is known only so well.
    edge = 1e-3 * math.sqrt(1.0 + TUNING.least_gap**2)
    assert math.isnan(closed_share(0.999 * edge, 1.0e-3, 1e-3, 10**9))
    assert closed_share(1.001 * edge, 1.0e-3, 1e-3, 10**9) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "unknown", [(NAN, 1e-3, 1e-3), (2e-3, NAN, 1e-3), (2e-3, 1e-3, NAN), (math.inf, 1e-3, 1e-3)]
)
def test_what_is_not_known_has_no_closed_share(unknown):
    assert math.isnan(closed_share(*unknown, 100))
    assert math.isnan(closed_share(2e-3, 1e-3, 1e-3, 0))
    assert math.isnan(closed_share(0.0, 0.0, 0.0, 100))


def found(finding: Finding) -> Finding:
    """Returns the discovery result with the error that its motions give."""
    return replace(finding, gap=total_gap(finding.motions))


def percents(text: str, row: str) -> str:
    """Returns the removed share of the error [%] from a row of the text's table."""
    line = next(line for line in text.splitlines() if line.startswith(f"{row} "))
    return line.split()[-2]


@pytest.mark.first(1)
@pytest.mark.parametrize("held", [True, False])
def test_text_page_and_json_tell_one_share(held):
    finding = example_finding()
    if not held:
        motions = tuple(replace(each, role=Role.FIT) for each in finding.motions)
        finding = replace(finding, motions=motions)
    finding = found(finding)
    report = replace(example_report(), finding=finding)
    document, text, page = forms_of(report)
    gap = json.loads(document)["gap"]

    assert gap["closed"] == gap["holdout_closed" if held else "fit_closed"] == finding.gap.closed
    assert percents(text, "fit") == shown(gap["fit_closed"], "% of")
    if held:
        assert percents(text, "held out") == shown(gap["closed"], "% of")
    value = re.search(r'<data[^>]*data-path="/gap/closed"[^>]*>([^<]*)<', page)
    assert value is not None
    assert value[1] == shown(gap["closed"], "% of")
    assert f"{shown(gap['closed'], '% of')} % of what a better model could remove" in page


@pytest.mark.parametrize(
    ("before", "after", "worse"),
    [
        (2.0, 2.0, False),
        (2.0, 2.5, False),  # a little worse may be chance
        (2.0, 3.0, True),
        (1.0, 1.2, False),  # of noise
        (0.9, 1.3, False),  # less than noise is noise
        (1.0, 1.5, True),
        (3.0, 1.0, False),
        (math.nan, math.nan, False),  # nothing was held out
    ],
)
def test_worse_is_what_noise_does_not_explain(before, after, worse):
    for unit in (1.0, 1e-3):
        gap = HeightGap(
            noise=unit, fit_before=unit, fit_after=unit,
            holdout_before=before * unit, holdout_after=after * unit,
            fit_closed=math.nan, holdout_closed=math.nan,
        )  # fmt: skip
        assert is_worse(gap) is worse


# How far a verdict may be trusted, by what the best explanation leaves.


GAP = Leftover(mean_square=0.8, stddev=0.03)
"""Of a base: hardly as large as the noise."""


def test_what_leaves_nothing_but_noise_is_trusted():
    assert trust_in(GAP, Leftover(mean_square=0.01, stddev=0.02)) == 1.0


def test_a_name_that_explains_only_part_of_a_small_gap_is_not_certain():
    """Tests that an effect is uncertain if it leaves a third of a small error."""
    rest = Leftover(mean_square=0.9 * TUNING.adequate**2, stddev=0.005)
    assert rest.adequate
    assert trust_in(GAP, rest) < 0.9


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_the_more_of_a_gap_is_left_the_less_is_sure(share):
    """Tests that the confidence falls with the share of the error that remains."""
    trust = trust_in(Leftover(4.0, 0.0), Leftover(4.0 * share, 0.0))
    assert trust == pytest.approx(0.85 * (1.0 - share))

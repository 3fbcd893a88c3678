"""Tests the comparison of recorded and replayed messages by stamp and bits."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_bag.errors import SloshBagError
from slosh_estimator.estimator import Estimates
from slosh_replay.replay.verification import (
    Verifier,
    estimate_columns,
    estimate_fields,
    same_bits,
)

TOPIC = "/slosh/estimate"
COUNT = 40


def columns(stamps, **changes):
    """Returns columns of messages with given changes."""
    found = {
        "linear.msh": np.sin(stamps * 0.1),
        "nonlinear.msh": np.cos(stamps * 0.1),
        "flags": stamps % 3,
    }
    for field, values in changes.items():
        name = field.replace("_msh", ".msh")
        for stamp, value in values.items():
            found[name] = np.where(stamps == stamp, value, found[name])
    return found


def pick(stamps, table, rows):
    return stamps[rows], {name: column[rows] for name, column in table.items()}


def compared(recorded, replayed):
    """Returns the comparison of messages that are added all at once."""
    verifier = Verifier(TOPIC)
    verifier.add_recorded(*recorded)
    verifier.add_replayed(*replayed)
    verifier.compare(final=True)
    return verifier.result()


STAMPS = np.arange(100, 100 + COUNT)


def whole(**changes):
    return STAMPS, columns(STAMPS, **changes)


def test_equal_messages_are_exact():
    found = compared(whole(), whole())
    assert found.exact
    assert found.within(0.0)
    assert (found.recorded, found.identical, found.missing, found.extra) == (COUNT, COUNT, 0, 0)
    assert found.lines() == (f"{TOPIC}: {COUNT} of {COUNT} messages bit for bit",)


def test_missing_and_extra_messages_are_counted():
    """What was replayed before and behind all recorded ones speaks against nobody."""
    stamps, table = whole()
    kept = [*range(5, 20), *range(24, COUNT - 2)]
    found = compared(pick(stamps, table, kept), pick(stamps, table, [*range(30), COUNT - 1]))
    assert (found.recorded, found.missing, found.extra) == (21, COUNT - 32, 4)
    assert not found.exact
    assert not found.within(1.0)
    assert "8 missing" in found.lines()[0]


def test_nan_equals_itself_and_nothing_else(recwarn):
    unknown = whole(linear_msh={110: np.nan})
    assert compared(unknown, unknown).exact
    found = compared(unknown, whole())
    assert found.largest == {"linear.msh": math.inf}
    assert not found.within(1e9)
    endless = whole(linear_msh={110: np.inf})
    assert compared(endless, endless).exact
    assert compared(endless, whole(linear_msh={110: -np.inf})).largest["linear.msh"] == math.inf
    assert not recwarn.list


def test_rows_texts_and_masked_values_are_compared_bit_for_bit():
    rows = np.array([[0.0, 1.0], [0.0, 1.0], [np.nan, 1.0]])
    other = np.array([[-0.0, 1.0], [0.0, 1.0], [np.nan, 1.0]])
    assert same_bits(rows, other).tolist() == [False, True, True]
    words = np.array(["a", "b"], dtype=object)
    assert same_bits(words, np.array(["a", "c"], dtype=object)).tolist() == [True, False]
    masked = np.ma.array([1, 2, 3], mask=[True, False, False])
    assert same_bits(masked, np.ma.array([9, 2, 3], mask=[1, 0, 1])).tolist() == [
        True,
        True,
        False,
    ]
    assert same_bits(rows, rows[:, :1]).tolist() == [False] * 3


def test_the_first_is_the_earliest_and_the_largest_is_by_field():
    changes = {"linear_msh": {105: 9.0, 107: 3.0}, "nonlinear_msh": {104: 2.0}}
    found = compared(whole(), whole(**changes))
    assert (found.first.stamp_ns, found.first.field) == (104, "nonlinear.msh")
    assert found.largest["linear.msh"] == pytest.approx(9.0 - math.sin(10.5))
    assert found.counts == {"linear.msh": 2, "nonlinear.msh": 1}
    assert found.identical == COUNT - 3
    assert "largest difference: linear.msh" in "\n".join(found.lines())


places = st.lists(st.integers(0, COUNT), max_size=6)
some_stamps = st.dictionaries(st.sampled_from(STAMPS.tolist()), st.floats(-1, 1), max_size=4)


@settings(max_examples=80, deadline=None)
@given(
    st.sets(st.integers(0, COUNT - 1), max_size=8), st.sets(st.integers(0, COUNT - 1), max_size=8),
    some_stamps, some_stamps, places, places, st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_parts_give_what_the_whole_gives(unheard, unmade, linear, nonlinear, cuts_a, cuts_b, seed):
    stamps, table = whole()
    recorded = pick(stamps, table, [i for i in range(COUNT) if i not in unheard])
    other = columns(stamps, linear_msh=linear, nonlinear_msh=nonlinear)
    replayed = pick(stamps, other, [i for i in range(COUNT) if i not in unmade])
    verifier = Verifier(TOPIC)
    sides = []
    for add, (own, values), cuts in (
        (verifier.add_recorded, recorded, cuts_a), (verifier.add_replayed, replayed, cuts_b)
    ):  # fmt: skip
        ends = [0, *sorted(cuts), len(own)]
        sides.append([(add, pick(own, values, slice(a, b))) for a, b in pairwise(ends)])
    random = np.random.default_rng(seed)
    while any(sides):
        side = sides[int(random.integers(2))] or sides[0] or sides[1]
        add, part = side.pop(0)
        add(*part)
        if random.random() < 0.7:
            verifier.compare()
    verifier.compare(final=True)
    assert verifier.result() == compared(recorded, replayed)


def test_a_field_that_was_not_recorded_is_named():
    stamps, table = whole()
    less = {name: column for name, column in table.items() if name != "flags"}
    with pytest.raises(SloshBagError, match="no field flags"):
        compared((stamps, less), (stamps, table))


def test_modes_that_were_not_recorded_are_not_compared():
    stamps, table = whole()
    nothing = np.full(COUNT, np.nan)
    old = {**table, "linear.modal_position[1]": nothing, "linear.modal_position[2]": nothing}
    new = {**table, "linear.modal_position[1]": nothing, "linear.modal_position[2]": nothing + 1}
    new["linear.modal_position[2]"] = np.zeros(COUNT)
    assert compared((stamps, old), (stamps, new)).exact
    new["linear.modal_position[1]"] = np.zeros(COUNT)
    assert not compared((stamps, old), (stamps, new)).exact


@pytest.mark.parametrize("modes", [1, 2, 3])
def test_every_number_of_an_estimate_has_a_column(modes):
    rng = np.random.default_rng(0)
    estimates = Estimates(
        np.arange(5), rng.random((5, 2, 4)), rng.random((5, 2, modes, 4)), rng.random(5),
        np.arange(5), rng.random((5, 3)), rng.random(5),
    )  # fmt: skip
    found = estimate_columns(estimates)
    assert tuple(found) == estimate_fields(modes)
    numbers = np.concatenate([column for name, column in found.items() if name != "flags"])
    everything = [*estimates[1:4], *estimates[5:7]]
    np.testing.assert_array_equal(
        np.sort(numbers), np.sort(np.concatenate([part.ravel() for part in everything]))
    )
    mode = modes - 1
    assert (
        found[f"nonlinear.modal_velocity[{2 * mode + 1}]"] == estimates.modal[:, 1, mode, 3]
    ).all()
    assert (found["linear.azimuth"] == estimates.heights[:, 0, 1]).all()

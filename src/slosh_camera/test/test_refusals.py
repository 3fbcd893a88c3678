"""Tests which evidence a calibrated pose needs and which contradictions it may have."""

from types import SimpleNamespace

import numpy as np
import pytest

from slosh_camera.calibrate.curves import Curve
from slosh_camera.calibrate.refusals import find_fault, is_corroborated
from slosh_camera.optics.cup import Cup, Wall

SEEN = {
    Curve.LEFT: 1.0,
    Curve.RIGHT: 1.0,
    Curve.LEFT_EMPTY: 0.9,
    Curve.RIGHT_EMPTY: 0.9,
    Curve.FRONT: 0.9,
    Curve.REAR: 0.9,
    Curve.BASE: 0.9,
}


def fit(**shares):
    """Returns a fit with given visible fractions of its curves; other fractions are high."""
    shown = SEEN | {Curve[name.upper()]: share for name, share in shares.items()}
    return SimpleNamespace(
        share=shown.__getitem__,
        cup=Cup(0.05, 0.07, 0.002),
        place=SimpleNamespace(distance=0.45),
    )


def answer(residual=0.3):
    return SimpleNamespace(residual=residual, height_stddev=dict.fromkeys(Wall, 0.3e-3))


NO_FLOOR = {"base": 0.2}
FAINT_GLASS = {"left_empty": 0.42, "right_empty": 0.3}


@pytest.mark.parametrize(("rear", "enough"), [(0.8, True), (0.3, False), (np.nan, False)])
def test_faint_glass_speaks_for_two_lines_of_the_level_and_not_for_one(rear, enough):
    assert is_corroborated(fit(**NO_FLOOR, **FAINT_GLASS, rear=rear)) == enough
    fault = find_fault(fit(**NO_FLOOR, **FAINT_GLASS, rear=rear), answer(), False, False)
    assert ("neither the glass above the level nor the floor" in fault) != enough


def test_the_floor_or_clear_glass_speaks_for_one_line():
    assert is_corroborated(fit(**FAINT_GLASS, rear=np.nan))
    assert is_corroborated(fit(**NO_FLOOR, rear=np.nan))


@pytest.mark.parametrize(
    "shares", [NO_FLOOR | {"rear": 0.65}, {"left": 0.6, "rear": 0.1}, NO_FLOOR | {"right": 0.6}]
)
def test_three_things_that_are_off_at_once_are_too_many(shares):
    poor = fit(**shares)
    assert "is poor" in find_fault(poor, answer(0.64), False, False)
    # Where the distance is told it is the container all the same.
    assert not find_fault(poor, answer(0.64), True, False)


@pytest.mark.parametrize(
    ("shares", "residual"),
    [
        ({"rear": 0.65}, 0.64),
        (NO_FLOOR, 0.64),
        (NO_FLOOR | {"rear": 0.65}, 0.5),
        ({"left": 0.6, "right": 0.6}, 0.7),
    ],
)
def test_two_of_them_are_a_matter_of_warnings(shares, residual):
    assert not find_fault(fit(**shares), answer(residual), False, False)


def test_a_floor_outside_the_image_speaks_neither_way():
    assert not find_fault(fit(base=np.nan, rear=0.65), answer(0.64), False, False)

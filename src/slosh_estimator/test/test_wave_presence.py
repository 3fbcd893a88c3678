"""A wave that one side shows and the other does not is told, by time and not by motions."""

import cmath
import math

import numpy as np
import pytest

from slosh_estimator.wave_presence import Pair, PresenceWatch

MS = 1_000_000
NAN = float("nan")


def watched(
    seen: float,
    told: float,
    *,
    seconds: float = 10.0,
    decay: float = 0.0,
    rotary: bool = False,
    vectors: bool = True,
    watch: PresenceWatch | None = None,
) -> PresenceWatch:
    """A watch over waves of two amplitudes [m] at 2.4 Hz, seen 50 times a second with noise."""
    watch = watch or PresenceWatch()
    random = np.random.default_rng(4)
    for k in range(round(50 * seconds)):
        t = 0.02 * k
        phase = cmath.exp(15j * t) if rotary else math.cos(15.0 * t)
        wave, expected = (size * math.exp(-decay * t) * phase for size in (seen, told))
        wave += complex(*random.normal(0.0, 1e-5, 2))
        known = (complex(wave), complex(expected)) if vectors else (complex(NAN),) * 2
        watch.add(Pair(20 * k * MS, abs(wave), 1e-4, abs(expected), *known))
    return watch


@pytest.mark.parametrize("rotary", [False, True])
def test_a_dead_accelerometer_is_told(rotary: bool) -> None:
    said = watched(8.9e-3, 0.0, rotary=rotary).warning
    assert said == (
        "the camera sees a wave of 8.9 mm while the estimator's input shows no motion: check "
        "the accelerometer"
    )
    if not rotary:  # a height alone does not tell a wave that goes round
        assert watched(8.9e-3, 0.0, vectors=False).warning == said


def test_an_accelerometer_in_g_is_told() -> None:
    said = watched(8.9e-3, 0.9e-3).warning
    assert "wave of 8.9 mm while the model expects 0.9 mm: check the accelerometer's unit" in said


def test_waves_of_one_size_rest_and_low_waves_are_right() -> None:
    assert watched(9e-3, 8e-3).warning == ""
    assert watched(9e-3, 3e-3).warning == ""  # judged motion by motion
    assert watched(0.0, 0.0).warning == ""
    assert watched(0.9e-3, 0.0).warning == ""


def test_a_warning_stands_until_both_sides_show_a_wave() -> None:
    watch = watched(8.9e-3, 0.0)
    watch.forget()
    assert watched(0.0, 0.0, watch=watch).warning
    watch.forget()
    assert not watched(9e-3, 9e-3, watch=watch).warning


def test_images_that_are_too_few_or_far_apart_are_not_judged() -> None:
    watch = PresenceWatch()
    for k in range(60):
        watch.add(Pair(3_000 * k * MS, 0.01 * (k % 2), 1e-4, 0.0))
    assert watch.warning == ""

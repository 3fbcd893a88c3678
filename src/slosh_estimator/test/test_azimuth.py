"""Tests the comparison of the directions of measured and expected waves."""

import cmath
import math

import numpy as np
import pytest

from slosh_estimator.azimuth import Surfaces, measured_waves, wave_offset
from slosh_estimator.sight import SurfaceFlag
from slosh_estimator.wave_presence import Pair, PresenceWatch
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate

CUP = Model(Cylinder(0.05, 0.07), damping_ratio=0.01).spatial().nonlinear()
NOISE = 2e-4
T = np.arange(0.0, 4.0, 1.0 / 60.0)
NOT_SIDE = np.full(len(T), np.nan)


def waves(kind: str, late: float = 0.0) -> np.ndarray:
    """Returns the liquid's wave as complex vectors [m] during 2 s of motion, with a delay [s]."""
    t = np.arange(0.0, 4.0, 0.002)
    swell = np.where(t < 2.0, np.sin(0.5 * np.pi * t) ** 2, 0.0)
    along = {"planar": 0.0, "rotary": 1.5, "mixed": 0.6}[kind]
    push = np.column_stack((1.5 * np.sin(15.0 * t), along * np.cos(15.0 * t), 0.0 * t))
    response = simulate(CUP, Inputs(t, swell[:, None] * push))[0]
    return np.interp(T - late, t, response.msh * np.exp(1j * response.azimuth))


def seen(wave: np.ndarray, turn: float, seed: int = 0) -> np.ndarray:
    """Returns a wave as a camera measures it that is turned by an angle [rad], with noise."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE, (2, len(wave)))
    return wave * np.exp(1j * turn) + noise[0] + 1j * noise[1]


@pytest.mark.parametrize("kind", ["planar", "rotary", "mixed"])
@pytest.mark.parametrize("degrees", [-135, -90, 90, 180])
def test_a_large_turn_is_told_with_its_size(kind: str, degrees: int) -> None:
    measured, expected = seen(waves(kind), math.radians(degrees)), waves(kind)
    found = wave_offset(T, measured, expected, NOT_SIDE, NOISE)
    assert found is not None
    assert found.disagrees
    error = math.degrees(found.turn) - degrees
    assert abs((error + 180.0) % 360.0 - 180.0) < max(1.0, 3.0 * math.degrees(found.stddev))
    assert f"{abs(degrees)} degrees from the estimated one" in found.sentence
    assert "sensor_rotation" in found.sentence
    assert "camera.yaml" in found.sentence


@pytest.mark.parametrize("kind", ["planar", "rotary", "mixed"])
@pytest.mark.parametrize("late", [-0.04, 0.0, 0.04])
@pytest.mark.parametrize("degrees", [0, 10])
def test_a_small_turn_or_a_late_camera_is_none(kind: str, late: float, degrees: int) -> None:
    measured = seen(waves(kind, late), math.radians(degrees))
    found = wave_offset(T, measured, waves(kind), NOT_SIDE, NOISE)
    assert found is not None
    assert not found.disagrees


def test_low_short_and_unlike_waves_have_no_azimuth() -> None:
    wave = waves("planar")
    turned = 1j * wave
    assert wave_offset(T, turned, 0.01 * wave, NOT_SIDE, NOISE) is None
    assert wave_offset(T, 0.03 * turned, 0.03 * wave, NOT_SIDE, NOISE) is None
    assert wave_offset(T, turned, wave, NOT_SIDE, 0.01) is None
    assert wave_offset(T[60:80], turned[60:80], wave[60:80], NOT_SIDE[60:80], NOISE) is None
    noise = np.random.default_rng(3).normal(0.0, 0.005, (2, len(T)))
    assert wave_offset(T, noise[0] + 1j * noise[1], wave, NOT_SIDE, NOISE) is None
    assert wave_offset(T, np.full(len(T), np.nan + 0j), wave, NOT_SIDE, NOISE) is None


def test_a_side_view_tells_a_side_and_a_plane() -> None:
    wave, axis = waves("planar"), np.zeros(len(T))
    diagonal = wave * np.exp(0.25j * math.pi)
    along = diagonal.real + 0j  # all that such a view shows
    same = wave_offset(T, along, diagonal, axis, NOISE)
    assert same is not None
    assert not same.disagrees
    other_side = wave_offset(T, -along, diagonal, axis, NOISE)
    assert other_side is not None
    assert abs(other_side.turn) == pytest.approx(math.pi)
    across = wave_offset(T, wave, 1j * wave, axis, NOISE)
    assert across is not None
    assert math.degrees(across.turn) == pytest.approx(90.0)
    assert across.disagrees


def surfaces(**given: float) -> Surfaces:
    nothing = np.array([np.nan])
    known = {name: nothing for name in Surfaces._fields if name != "flags"}
    columns = {name: np.array([value]) for name, value in given.items()}
    return Surfaces(**{**known, "flags": np.array([0]), **columns})


def test_the_fitted_surface_tells_the_direction_and_hidden_lines_tell_none() -> None:
    fitted = {"fitted_msh": 0.01, "fitted_azimuth": math.pi / 2.0}
    spot = {"msh": 0.008, "azimuth": math.pi}
    assert measured_waves(surfaces(**spot, **fitted))[0][0] == pytest.approx(0.01j)
    assert measured_waves(surfaces(**spot))[0][0] == pytest.approx(-0.008)
    hidden = int(SurfaceFlag.OCCLUDED)
    assert np.isnan(measured_waves(surfaces(**spot, flags=hidden))[0][0])
    assert measured_waves(surfaces(**spot, **fitted, flags=hidden))[0][0] == pytest.approx(0.01j)
    for flag in (SurfaceFlag.SATURATED, SurfaceFlag.NOT_FOUND, SurfaceFlag.AMBIGUOUS):
        assert np.isnan(measured_waves(surfaces(**spot, **fitted, flags=int(flag)))[0][0])


# A wave that one side shows and the other does not is told, by time and not by motions.


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
    """Returns a watch that has seen two waves at 2.4 Hz with different amplitudes [m]."""
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


def test_a_camera_that_sees_nothing_is_told() -> None:
    assert "expects a wave of 9.0 mm, but the camera sees none" in watched(0.0, 9e-3).warning


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

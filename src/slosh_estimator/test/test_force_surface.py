"""Tests wave heights from a force, for any offset, axes and delay of the sensor."""

import json
import math

import numpy as np
import pytest

from slosh_estimator.sensed.force_surface import ForceSurface, Motion
from slosh_estimator.sensed.payload import parse_payload
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate

CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
SECOND = 1_000_000_000
START = 5 * SECOND
MASS, DELAY, ZERO = 1.2, 0.021, 3.0
SLOSHING = CUP.container.mass_ratio(1) * CUP.container.volume * CUP.liquid.density


def document(**changes):
    """Returns the identified payload of a cup, for a sensor that is turned by 90 degrees."""
    found = {
        "natural_frequency": {"value": CUP.mode_frequency(1)},
        "sloshing_mass": {"value": SLOSHING},
        "payload_mass": {"value": MASS, "error": 0.002},
        "delay": {"value": DELAY},
        "directions": [
            {"container": [1.0, 0.0, 0.0], "sensor": [0.0, 1.0, 0.0]},
            {"container": [0.0, 1.0, 0.0], "sensor": [-1.0, 0.0, 0.0]},
        ],
        "residual_at_rest": 0.01,
        "residual_in_motion": 0.05,
    }
    return json.dumps(found | changes)


@pytest.fixture(scope="module")
def run():
    """Returns a plane motion, the measured force, and the heights at +x and +y."""
    t = np.arange(0.0, 8.0, 0.002)
    share = np.clip((t - 2.0) / 0.5, 0.0, 1.0)
    pulse = np.sin(2.0 * np.pi * share) * ((share > 0.0) & (share < 1.0))
    acceleration = np.outer(pulse, [1.0, -0.5, 0.0])
    response, _ = simulate(CUP, Inputs(t, acceleration))
    relative = np.gradient(response.modal[:, 0, 2:4], 0.002, axis=0)
    force = MASS * acceleration[:, :2] + SLOSHING * relative
    late = np.column_stack([np.interp(t - DELAY, t, column) for column in force.T])
    seen = np.column_stack([-late[:, 1] - ZERO, late[:, 0] + ZERO, np.full(len(t), MASS * 9.81)])
    return t, acceleration, seen, response


def followed(surface, run, *, forces_first=False):
    t, acceleration, seen = run[0], run[1], run[2].tolist()
    waves = []
    for k, moment in enumerate(t.tolist()):
        stamp = START + round(moment * SECOND)
        ax, ay, _ = acceleration[k].tolist()
        takes = [
            lambda s=stamp, x=ax, y=ay: surface.take_motion(Motion(s, x, y, 0.0)),
            lambda s=stamp, f=seen[k]: surface.take_force(s, *f),
        ]
        for take in reversed(takes) if forces_first else takes:
            waves += take()
    return waves


def test_the_wave_comes_out_again(run):
    waves = followed(ForceSurface(CUP, parse_payload(document(), "it")), run)
    t, _, _, response = run
    at = np.array([1e-9 * (wave.stamp_ns - START) for wave in waves])
    found = np.array(
        [(w.height * math.cos(w.azimuth), w.height * math.sin(w.azimuth)) for w in waves]
    )
    truth = np.column_stack([np.interp(at, t, h) for h in (response.sh_x, response.sh_y)])
    later = at > 3.0
    assert response.msh.max() > 8e-3
    assert np.abs(found - truth)[later].max() < 0.1 * response.msh[t > 3.0].max()
    assert np.sqrt(np.mean((found - truth)[later] ** 2)) < 4e-4
    assert 20 < len(waves) / 7.0 < 26
    assert all(0.0 < wave.stddev < 1e-2 for wave in waves)


def test_the_order_in_which_messages_come_changes_nothing(run):
    payload = parse_payload(document(), "it")
    one = followed(ForceSurface(CUP, payload), run)
    assert one == followed(ForceSurface(CUP, payload), run, forces_first=True)


def test_one_direction_gives_a_signed_height_along_it(run):
    only = [{"container": [1.0, 0.0, 0.0], "sensor": [0.0, 1.0, 0.0]}]
    payload = parse_payload(document(directions=only), "it")
    waves = followed(ForceSurface(CUP, payload), run)
    assert {wave.azimuth for wave in waves} == {0.0}
    assert min(wave.height for wave in waves) < -3e-3 < 3e-3 < max(wave.height for wave in waves)
    assert not waves[0].turned


def test_other_units_are_read(run):
    t, acceleration, seen, response = run
    payload = parse_payload(document(newton=9.80665), "it")
    one = followed(ForceSurface(CUP, payload), (t, acceleration, seen / 9.80665, response))
    two = followed(ForceSurface(CUP, parse_payload(document(), "it")), run)
    assert [w.height for w in one] == pytest.approx([w.height for w in two], abs=1e-9)


@pytest.mark.parametrize(
    ("factor", "says"),
    [
        (1.0, ""),
        (-1.0, "its sign is reversed"),
        (1.0 / 9.80665, "it seems to be in kgf"),
        (1e3, "it seems to be in mN"),
        (0.01, "axes, unit or payload are others"),
    ],
)
def test_a_force_that_is_not_the_payload_s_is_named_and_tells_no_wave(run, factor, says):
    t, acceleration, seen, response = run
    surface = ForceSurface(CUP, parse_payload(document(), "it"))
    waves = followed(surface, (t, acceleration, factor * seen, response))
    assert says in surface.wrong
    assert bool(surface.wrong) == bool(says)
    assert (1e-9 * (waves[-1].stamp_ns - START) > 7.0) == (not says)


def test_nonsense_gaps_and_a_clock_that_is_set_back_are_survived(run):
    surface = ForceSurface(CUP, parse_payload(document(), "it"))
    assert surface.take_force(START, math.nan, 0.0, 0.0) == []
    assert surface.take_motion(Motion(START, math.inf, 0.0, 0.0)) == []
    first = followed(surface, run)
    far = START + 1000 * SECOND
    assert surface.take_force(far, 0.0, 0.0, 0.0) == []
    assert len(surface.take_motion(Motion(far, 0.0, 0.0, 0.0))) < 3
    for stamp in (START, START + SECOND):
        surface.take_force(stamp, 0.0, 0.0, 0.0)
        surface.take_motion(Motion(stamp, 0.0, 0.0, 0.0))
    assert len(followed(surface, run)) == pytest.approx(len(first), abs=30)
    assert surface.refused > 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "is no JSON"),
        ("[]", "holds no sloshing mass"),
        (document(sloshing_mass={"value": -1.0}), "sloshing_mass.value = -1 must be at least"),
        (document(delay={"value": None}), "delay.value = None must be a number"),
        (document(directions=[]), "no direction along the floor"),
        (document(directions=[{"container": [1, 0, 0]}]), "has no sensor"),
        (document(directions=[{"container": [3, 0, 0], "sensor": [1, 0, 0]}]), "length 3"),
    ],
)
def test_a_document_that_cannot_be_is_refused_with_its_place(text, says):
    with pytest.raises(ValueError, match=r"^a\.json: ") as refusal:
        parse_payload(text, "a.json")
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)

"""Tests loosely standing containers against statics and rigid-body mechanics."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slosh_model import Cylinder, Inputs, Model, Rectangle, SloshModelError
from slosh_model.standing import Standing
from slosh_model.standing_use import StandingMasses, liquid_centre, standing_use
from slosh_model.tray import format_tray, parse_tray

G = 9.81
RADIUS, FILL = 0.05, 0.07
STANDING = Standing(mass=0.2, centre_height=0.06, base_radius=0.04, friction=0.3)
CUP = Model(Cylinder(RADIUS, FILL), damping_ratio=0.2, modes=5)
LIQUID = np.pi * RADIUS**2 * FILL * CUP.liquid.density
TOTAL = STANDING.mass + LIQUID
CENTRE = (STANDING.mass * STANDING.centre_height + LIQUID * 0.5 * FILL) / TOTAL


def pushed(acceleration, seconds=8.0):
    """Returns an acceleration [m/s²] that rises so slowly that no waves arise."""
    t = np.arange(0.0, seconds, 0.002)
    return Inputs(t, np.outer(np.clip(t / (0.6 * seconds), 0.0, 1.0), acceleration))


def test_a_constant_push_needs_friction_by_its_share_of_gravity():
    use = standing_use(CUP, STANDING, pushed([1.5, 2.0, 0.0]))
    assert use.friction == pytest.approx(2.5 / G / STANDING.friction, rel=2e-3)


def test_a_constant_push_moves_the_centre_of_pressure_by_statics():
    """Tests that an inclined surface moves the liquid's centre of mass by I/V a/g."""
    a = 1.2
    second_moment = np.pi * RADIUS**4 / 4.0
    moment = TOTAL * CENTRE * a + CUP.liquid.density * second_moment * a
    use = standing_use(CUP, STANDING, pushed([a, 0.0, 0.0]))
    expected = moment / (TOTAL * G) / STANDING.base_radius
    assert use.tipping == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("gone", [0.0, 0.4])
def test_a_shake_far_above_the_liquids_frequency_carries_less_mass(gone):
    """Tests that fast shaking moves only the mass that does not slosh."""
    t = np.arange(0.0, 1.0, 2.5e-4)
    inputs = Inputs(t, np.outer(np.sin(2.0 * np.pi * 60.0 * t), [2.0, gone, 0.0]))
    masses = StandingMasses.of(CUP, STANDING)
    rigid = TOTAL - masses.modal[:, 0].sum()
    use = standing_use(replace(CUP, damping_ratio=0.005), STANDING, inputs)
    expected = rigid * np.hypot(2.0, gone) / (TOTAL * G) / STANDING.friction
    assert use.friction == pytest.approx(expected, rel=0.03)


def test_on_an_inclined_tray_it_slides_at_the_angle_of_friction():
    t = np.arange(0.0, 6.0, 0.002)
    angle = 0.2 * np.clip(t / 3.0, 0.0, 1.0)
    attitude = Rotation.from_rotvec(np.outer(angle, [0.0, 1.0, 0.0])).as_quat()
    use = standing_use(
        CUP.with_gravity_tilt(), STANDING, Inputs(t, np.zeros((len(t), 3)), attitude)
    )
    assert use.friction == pytest.approx(np.tan(0.2) / STANDING.friction, rel=5e-3)
    assert use.words == "stands"


def test_a_container_away_from_the_axis_feels_the_centripetal_force():
    t = np.arange(0.0, 8.0, 0.002)
    rate = 2.5 * np.clip(t / 5.0, 0.0, 1.0)
    turning = np.outer(rate, [0.0, 0.0, 1.0])
    inputs = Inputs(t, np.zeros((len(t), 3)), angular_velocity=turning)
    place = np.array([0.3, 0.0, 0.0])
    model = CUP.with_effect("lever_arm", x=0.3, y=0.0, z=0.0)
    use = standing_use(model, STANDING, inputs, place)
    # In the container's axes the force is steady, and so is the liquid.
    assert use.friction == pytest.approx(2.5**2 * 0.3 / G / STANDING.friction, rel=0.01)


@pytest.mark.parametrize(
    ("acceleration", "standing", "word"),
    [
        ([0.0, 0.0, -10.5], STANDING, "lifts off"),
        ([4.0, 0.0, 0.0], STANDING, "slides"),
        ([4.0, 0.0, 0.0], replace(STANDING, friction=2.0, base_radius=0.012), "tips"),
        ([0.0, 0.0, 5.0], STANDING, "stands"),
    ],
)  # fmt: skip
def test_what_it_does_has_a_name(acceleration, standing, word):
    use = standing_use(CUP, standing, pushed(acceleration))
    assert use.words == word
    assert use.stands == (word == "stands")


def test_the_liquids_centre_of_containers_with_straight_walls_is_half_the_fill():
    assert liquid_centre(Cylinder(RADIUS, FILL)) == pytest.approx(0.5 * FILL, rel=1e-6)
    assert liquid_centre(Rectangle(0.08, 0.06, FILL)) == pytest.approx(0.5 * FILL, rel=1e-6)


TRAY = """containers:
  - name: left
    standing: {mass: 0.2, centre_height: 0.06, base_radius: 0.04, friction: 0.3}
    model:
      container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
"""


def test_a_tray_file_says_how_its_containers_stand():
    tray = parse_tray(TRAY)
    assert tray.first.standing == STANDING
    assert parse_tray(format_tray(tray)).first.standing == STANDING


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("friction: 0.3", "friction: -0.3", "standing.friction = -0.3 must lie in"),
        ("friction: 0.3", "friction: high", "standing.friction = 'high' must be a number"),
        (", friction: 0.3", "", "standing must be a mapping with mass, centre_height"),
        ("base_radius: 0.04", "base_radius: 40", "did you mean 40 mm, 0.04?"),
        ("mass: 0.2", "mass: .nan", "standing.mass = nan kg must lie in"),
    ],
)
def test_an_impossible_standing_is_one_line_with_its_place(old, new, said):
    with pytest.raises(SloshModelError) as caught:
        parse_tray(TRAY.replace(old, new), "tray.yaml")
    text = str(caught.value)
    assert said in text
    assert text.startswith("tray.yaml:2")
    assert "\n" not in text

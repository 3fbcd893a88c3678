"""Compares the truth simulator with closed forms and with SciPy's DOP853."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from slosh_model.simulate import Inputs
from validation.blind import gauss, theory
from validation.blind.truth import equilibrium, heights, simulate
from validation.blind.truth_model import Truth

G = theory.GRAVITY
RADIUS, DEPTH, ZETA = 0.05, 0.07, 0.02
CUP = Truth(RADIUS, DEPTH, damping_ratio=ZETA)
NL = {"surface_nonlinearity": {"alpha": 0.58}}
SPATIAL = {"vertical_acceleration": {}}
OMEGA = float(np.sqrt(theory.frequency_squared(RADIUS, np.array(DEPTH))[0]))
GAIN = float(theory.planar_gain(RADIUS, np.array(DEPTH))[0])


def cup(**effects):
    return Truth(RADIUS, DEPTH, damping_ratio=ZETA, effects=effects)


def motion(rate=250.0, size=3.0, lift=2.0):
    t = np.arange(0.0, 4.0, 1.0 / rate)
    inside = (t > 0.3) & (t < 2.8)
    swell = np.where(inside, np.sin(np.pi * (t - 0.3) / 2.5) ** 4, 0.0)
    waves = [size * np.sin(17.0 * t), 0.6 * size * np.cos(15.0 * t), lift * np.sin(24.0 * t)]
    return Inputs(t, np.column_stack([swell * wave for wave in waves]))


def turning(inputs, yaw=0.0, lean=0.0):
    """Returns a motion in which the cup yaws smoothly and leans in a fixed direction."""
    angle = 0.5 - 0.5 * np.cos(np.pi * inputs.t / inputs.t[-1])
    zero = np.zeros_like(angle)
    side = np.array([0.6, 0.8, 0.0])
    spin = Rotation.from_rotvec(np.column_stack([zero, zero, yaw * angle]))
    attitude = Rotation.from_rotvec(np.outer(lean * angle, side)) * spin
    return Inputs(inputs.t, inputs.acceleration, attitude.as_quat())


def lagrange_solution(truth, inputs, times):
    """Returns the sloshing masses' positions (M, 2) by DOP853, from DL22's eq. (14).

    Everything is in metres; the terms beyond DL22 are added as forces.
    """
    omega2 = float(theory.frequency_squared(truth.radius, np.array(truth.fill_height))[0])
    zeta, radius = truth.damping_ratio, truth.radius
    nonlinear = truth.has("surface_nonlinearity")
    k = omega2 * radius / G * nonlinear / radius
    alpha = truth.value("surface_nonlinearity", "alpha", 0.0)
    drive = CubicSpline(inputs.t, inputs.acceleration)

    def slope(t, state):
        q, v = state[:2], state[2:]
        a = drive(t)
        qv, qq, vv = q @ v, q @ q, v @ v
        mass = np.eye(2) + k**2 * np.outer(q, q)
        lift = a[2] / G * truth.has("vertical_acceleration")
        force = -2.0 * zeta * np.sqrt(omega2) * (v + k**2 * qv * q) - k**2 * vv * q
        force -= omega2 * q * (1.0 + alpha * qq / radius**2 + lift) + a[:2]
        force -= truth.value("quadratic_damping", "beta", 0.0) / radius * np.sqrt(vv) * v
        e = truth.value("anisotropic_stiffness", "e", 0.0)
        axis = truth.value("anisotropic_stiffness", "axis", 0.0)
        along = np.array([np.cos(axis), np.sin(axis)])
        across = np.array([-np.sin(axis), np.cos(axis)])
        change = e * ((q @ along) * along - (q @ across) * across)
        force -= omega2 * change * (1.0 + alpha * qq / radius**2 + lift)
        rate = truth.value("coriolis", "rate", 0.0)
        force += rate * np.array([v[1], -v[0]])
        friction = truth.value("contact_line_friction", "mu", 0.0) * G
        force -= friction * v / np.sqrt(vv + gauss.CREEP**2)
        return np.concatenate([v, np.linalg.solve(mass, force)])

    span = (inputs.t[0], inputs.t[-1])
    done = solve_ivp(
        slope, span, np.zeros(4), "DOP853", times, rtol=1e-10, atol=1e-13, max_step=0.05
    )
    return done.y[:2].T


@pytest.mark.parametrize(
    "effects",
    [
        {},
        {**NL, **SPATIAL},
        {**SPATIAL, "quadratic_damping": {"beta": 0.2}},
        {**NL, "anisotropic_stiffness": {"e": 0.1, "axis": 0.4}},
        {**NL, "contact_line_friction": {"mu": 0.005}},
        {"coriolis": {"rate": 1.5}},
    ],
    ids=lambda effects: "+".join(effects) or "linear",
)
def test_the_momentum_form_gives_what_the_lagrange_form_gives(effects):
    truth, inputs = cup(**effects), motion()
    wave = simulate(truth, inputs)
    every = slice(0, None, 50)
    expected = lagrange_solution(truth, inputs, wave.t[every])
    scale = np.abs(expected).max()
    assert scale > 0.004
    assert np.abs(wave.states[every, :2] - expected).max() < 1e-6 * scale


def test_a_linear_cup_answers_a_long_sine_as_an_oscillator_does():
    drive, size, zeta = 14.0, 1.0, 0.1
    t = np.arange(0.0, 12.0, 0.004)
    a = np.zeros((len(t), 3))
    a[:, 0] = size * np.sin(drive * t)
    late = t[t > 10.0]
    seen = heights(Truth(RADIUS, DEPTH, damping_ratio=zeta), Inputs(t, a), late, np.array([0.0]))[
        :, 0
    ]
    answer = -GAIN * size / (OMEGA**2 - drive**2 + 2j * zeta * OMEGA * drive)
    expected = np.imag(answer * np.exp(1j * drive * late))
    assert np.abs(seen - expected).max() < 2e-6 * np.abs(answer)


def test_damping_as_published_is_twice_zeta_omega_times_the_momentum():
    wave = simulate(CUP, motion())
    free = wave.t > 3.0
    envelope = np.hypot(OMEGA * wave.states[free, 0], wave.states[free, 2])
    slope = np.polyfit(wave.t[free], np.log(envelope), 1)[0]
    assert slope == pytest.approx(-ZETA * OMEGA, rel=0.03)


def test_without_damping_the_nonlinear_cup_keeps_its_energy():
    truth = Truth(RADIUS, DEPTH, damping_ratio=1e-12, effects=NL)
    wave = simulate(truth, motion())
    free = wave.states[wave.t > 2.9]
    q, p, k = free[:, :2], free[:, 2:4], OMEGA**2 / G
    r2 = np.sum(q**2, axis=1)
    inner = np.sum(q * p, axis=1) ** 2 * k**2 / (1.0 + k**2 * r2)
    energy = 0.5 * (np.sum(p**2, axis=1) - inner)
    energy += 0.5 * OMEGA**2 * r2 + 0.25 * 0.58 * OMEGA**2 * r2**2 / RADIUS**2
    assert np.ptp(energy) < 1e-10 * energy.mean()


def test_gains_are_the_papers():
    plane, bessel = (
        float(gain(RADIUS, np.array(DEPTH))[0])
        for gain in (theory.planar_gain, theory.bessel_gain)
    )
    assert plane / bessel == pytest.approx(4.0 / 1.8412**2, rel=1e-4)  # DL22, section 3.3
    # The linear static answer of the Bessel surface: 2/(ξ² - 1) · R a/g.
    assert bessel * G / OMEGA**2 == pytest.approx(2.0 * RADIUS / (1.8412**2 - 1), rel=1e-4)


def test_at_rest_the_surface_of_a_tilted_cup_is_level():
    truth = cup(static_tilt={"roll": 0.0, "pitch": 0.03})
    t = np.arange(0.0, 2.0, 0.005)
    seen = heights(truth, Inputs(t, np.zeros((len(t), 3))), t[::3], np.radians([0.0, 180.0]))
    # Pitched nose down about +y, the cup's +x side is the lower one: the liquid is high there.
    static = GAIN * G * np.sin(0.03) / OMEGA**2
    assert np.allclose(seen, [static, -static], rtol=0, atol=1e-9)


@pytest.mark.parametrize("effects", [{}, NL])
def test_a_lean_with_the_apparent_gravity_leaves_the_liquid_where_it_is(effects):
    """A waiter's tray: an acceleration a along x and a lean of atan(a/g) cancel."""
    a = 2.0
    lean = np.arctan2(a, G)
    t = np.arange(0.0, 2.0, 0.005)
    along = np.tile([a, 0.0, 0.0], (len(t), 1))
    attitude = Rotation.from_rotvec(np.tile([0.0, lean, 0.0], (len(t), 1))).as_quat()
    tilted = cup(gravity_tilt={}, **effects)
    assert simulate(tilted, Inputs(t, along, attitude)).msh.max() < 1e-12
    assert simulate(cup(**effects), Inputs(t, along, attitude)).msh.max() > 0.005


def test_equilibrium_under_a_constant_acceleration_does_not_move():
    t = np.arange(0.0, 3.0, 0.005)
    a = np.tile([1.5, -0.7, 1.0], (len(t), 1))
    wave = simulate(cup(**NL, **SPATIAL), Inputs(t, a))
    assert np.ptp(wave.msh) < 1e-10
    assert wave.msh[0] > 0.005


def test_a_liquid_dragged_wholly_by_the_yaw_is_seen_as_if_the_world_turned():
    inputs = motion(lift=0.0)
    turned = turning(inputs, yaw=2.0)
    azimuths = np.radians([0.0, 90.0])
    free = heights(CUP, turned, inputs.t, azimuths)
    unturned = heights(CUP, inputs, inputs.t, azimuths)
    yaw = 2.0 * (0.5 - 0.5 * np.cos(np.pi * inputs.t / inputs.t[-1]))
    c, s = np.cos(yaw), np.sin(yaw)
    # Not dragged: only the wall under the wave turns.
    assert np.allclose(free[:, 0], c * unturned[:, 0] + s * unturned[:, 1], atol=2e-6)
    # Dragged: the equations hold in the cup's own axes, with the acceleration seen from there.
    own = np.zeros_like(inputs.acceleration)
    own[:, 0] = c * inputs.acceleration[:, 0] + s * inputs.acceleration[:, 1]
    own[:, 1] = c * inputs.acceleration[:, 1] - s * inputs.acceleration[:, 0]
    dragged = heights(cup(yaw_coupling={"kappa": 1.0}), turned, inputs.t, azimuths)
    assert np.allclose(dragged, heights(CUP, Inputs(inputs.t, own), inputs.t, azimuths), atol=2e-6)


def test_a_lever_arm_adds_the_rigid_bodys_acceleration():
    inputs = turning(motion(size=0.0, lift=0.0), yaw=6.0, lean=0.2)
    arm = {"x": 0.1, "y": -0.2, "z": 0.15}
    at = Rotation.from_quat(inputs.attitude).apply([0.1, -0.2, 0.15])
    acceleration = CubicSpline(inputs.t, at)(inputs.t, 2)
    expected = simulate(CUP, Inputs(inputs.t, acceleration))
    wave = simulate(cup(lever_arm=arm), inputs)
    inner = (wave.t > 0.1) & (wave.t < 3.9)
    assert expected.msh.max() > 1e-3
    # The start of the turn differs: there the spline of the places has no end condition.
    assert np.abs(wave.msh - expected.msh)[inner].max() < 0.02 * expected.msh.max()


def test_the_servo_follows_with_the_second_order_gain():
    drive, own, ratio = 14.0, 40.0, 0.7
    t = np.arange(0.0, 12.0, 0.004)
    a = np.zeros((len(t), 3))
    a[:, 0] = np.sin(drive * t)
    inputs, late = Inputs(t, a), t[t > 10.0]
    damped = Truth(RADIUS, DEPTH, damping_ratio=0.1)
    servo = damped.plus("robot_dynamics", {"frequency": own, "damping_ratio": ratio})
    plain, slow = (heights(truth, inputs, late)[:, 0].max() for truth in (damped, servo))
    expected = abs(own**2 / (own**2 - drive**2 + 2j * ratio * own * drive))
    assert slow / plain == pytest.approx(expected, rel=1e-3)


def test_a_second_mode_adds_as_a_vector():
    truth, inputs = cup(second_mode={"damping_ratio": 0.02}), motion()
    wave = simulate(truth, inputs)
    gains = theory.planar_gain(RADIUS, np.array(DEPTH))
    total = gains[0] * wave.states[:, :2] + gains[1] * wave.states[:, 4:6]
    assert np.allclose(wave.height, total)
    assert np.abs(gains[1] * wave.states[:, 4:6]).max() > 2e-4
    assert np.allclose(wave.states[:, :2], simulate(CUP, inputs).states[:, :2])


def sampled(**effects):
    inputs = motion()
    at = np.arange(0.0, 3.99, 1 / 60)
    return heights(cup(**effects), inputs, at)[:, 0]


def test_what_the_sensor_does():
    true = sampled()
    gain = sampled(height_scale={"gain": 1.2}, height_offset={"offset": 0.001})
    assert np.allclose(gain, 1.2 * true + 0.001)
    assert np.allclose(sampled(frame_saturation={"cap": 0.006}), np.minimum(true, 0.006))
    crest = sampled(crest_asymmetry={"kappa": 0.5})
    assert np.allclose(crest, true + 0.5 * true**2 / RADIUS)
    assert np.allclose(sampled(time_offset={"tau": 1 / 60})[1:], true[:-1], atol=1e-8)
    whole = sampled(visible_arc={"centre": 0.3, "width": 2 * np.pi})
    assert np.allclose(whole, true, atol=1e-9)
    point = sampled(visible_arc={"centre": np.pi / 2, "width": 1e-9})
    side = heights(CUP, motion(), np.arange(0.0, 3.99, 1 / 60), np.array([np.pi / 2]))[:, 0]
    assert np.allclose(point, side, atol=1e-8)


def test_a_film_falls_no_faster_than_it_drains():
    true, film = sampled(), sampled(draining_film={"speed": 0.03})
    assert np.all(film >= true - 5e-6)
    assert np.diff(film).min() * 60.0 == pytest.approx(-0.03, rel=1e-3)
    assert np.abs(film - true).max() > 2e-3


def test_a_slow_sensor_follows_by_the_first_order_equation():
    time = 0.04
    true, read = sampled(), sampled(sensor_lag={"time": time})
    # Samples of 60 Hz: the slope by central differences is good to some percent.
    slope = np.gradient(read, 1.0 / 60.0)
    assert np.abs(read - true).max() > 2e-3
    assert np.abs(time * slope + read - true)[1:-1].max() < 0.06 * np.abs(true).max()


def test_a_leak_lowers_the_level_from_the_start_on():
    t = np.arange(0.0, 3.0, 0.005)
    still = Inputs(t, np.zeros((len(t), 3)))
    seen = heights(cup(fill_loss={"rate": 0.001}), still, t[::4])[:, 0]
    assert np.allclose(seen, -0.001 * t[::4])


def test_a_lower_fill_swings_slower_and_stands_at_its_own_level():
    lower = Truth(RADIUS, DEPTH - 0.03, damping_ratio=ZETA)
    both = [heights(truth, motion(), np.arange(0, 3.9, 0.02)) for truth in (lower, CUP)]
    changed = heights(cup(fill_level={"delta": -0.03}), motion(), np.arange(0, 3.9, 0.02))
    assert np.allclose(changed, both[0])
    assert not np.allclose(both[0], both[1], atol=1e-3)


def test_the_equilibrium_of_a_still_upright_cup_is_zero():
    node = np.zeros(gauss.NODE_WIDTH)
    node[gauss.FRAME : gauss.SPIN] = np.eye(3).ravel()
    assert not equilibrium(CUP, node, np.zeros(gauss.CONSTANTS)).any()

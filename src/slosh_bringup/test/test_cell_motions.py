"""The simulated cell's motions, liquid and camera."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson

from slosh_bringup.cell.motion_law import PEAK, modified_trapezoid
from slosh_bringup.cell.motions import LEVELS, MOTIONS, VERTICAL_LEVELS, make_motion
from slosh_bringup.cell.renderer import Appearance, CupRenderer
from slosh_bringup.cell.truth import integrate_truth
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.processes import config_folder
from slosh_camera.calibration import read_calibration
from slosh_camera.detector import FreeSurfaceDetector
from slosh_camera.measurement import PeakSide
from slosh_estimator.model_file import read_model

CALIBRATION = read_calibration(config_folder() / "camera.yaml")


def test_the_law_is_its_own_derivatives_integral():
    u = np.linspace(0.0, 1.0, 4001)
    position, velocity, acceleration = modified_trapezoid(u)
    assert cumulative_simpson(acceleration, x=u, initial=0) == pytest.approx(velocity, abs=1e-6)
    assert cumulative_simpson(velocity, x=u, initial=0) == pytest.approx(position, abs=1e-9)
    assert (position[0], position[-1]) == pytest.approx((0.0, 1.0))
    assert (velocity[0], velocity[-1]) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert acceleration.max() == pytest.approx(PEAK) == -acceleration.min()
    assert np.max(np.abs(np.diff(acceleration))) < 0.02  # continuous


@pytest.mark.parametrize("name", MOTIONS)
def test_motions_start_and_end_at_rest_and_move_as_they_accelerate(name):
    motion = make_motion(name)
    velocity = cumulative_simpson(motion.acceleration, x=motion.t, axis=0, initial=0)
    position = cumulative_simpson(velocity, x=motion.t, axis=0, initial=0)
    assert velocity[-1] == pytest.approx(np.zeros(3), abs=1e-4)
    assert position == pytest.approx(motion.position, abs=1e-3)
    assert not motion.acceleration[motion.t < 0.99].any()
    assert not motion.acceleration[motion.t > motion.t[-1] - 2.9].any()


@pytest.mark.parametrize("path", LEVELS)
def test_levels_are_those_of_the_paper(path):
    for level in LEVELS[path]:
        a = make_motion(f"{path}-{level}").acceleration
        assert np.hypot(a[:, 0], a[:, 1]).max() == pytest.approx(level, rel=1e-3)
        assert not a[:, 2].any()
    for vertical in VERTICAL_LEVELS:
        a = make_motion(f"{path}3-{vertical}").acceleration
        assert np.abs(a[:, 2]).max() == pytest.approx(vertical, rel=1e-3)
        assert np.hypot(a[:, 0], a[:, 1]).max() == pytest.approx(LEVELS[path][1], rel=1e-3)


@pytest.mark.parametrize("name", MOTIONS)
def test_jerk_stays_within_the_papers_range(name):
    motion = make_motion(name)
    jerk = np.linalg.norm(np.diff(motion.acceleration, axis=0), axis=1) / np.diff(motion.t)
    assert jerk.max() < 74.0


def test_a_wrong_name_lists_the_right_ones():
    with pytest.raises(SloshBringupError, match=r"'x7' \(known: c, c-5.8"):
        make_motion("x7")


def test_the_truth_is_the_models_response():
    model = read_model(config_folder() / "truth.yaml")
    motion = make_motion("c3")
    truth = integrate_truth(model, motion)
    middle = len(motion.t) // 2
    assert truth.at(motion.t[middle]) == (truth.sh_x[middle], truth.sh_y[middle])
    assert truth.at(0.5) == (0.0, 0.0)


def edge_row(image, column, dark_below=True):
    """Sub-pixel row where a column crosses the middle of its extreme grey levels, from above."""
    values = image[:, column].astype(float)
    middle = 0.5 * (values.max() + values.min())
    index = int(np.flatnonzero(values < middle)[0])
    before, after = values[index - 1], values[index]
    return index - 1 + (before - middle) / (before - after)


@pytest.mark.parametrize("height", [-0.02, 0.0, 0.013, 0.03])
def test_the_front_line_lies_where_the_projection_says(height):
    """Straight from the camera's side: the wall nearest to the camera, a tilt towards it."""
    view = CALIBRATION.view
    clean = Appearance(noise=0.0, blur=0.0, surface=205.0)
    azimuth = view.camera_azimuth
    image = CupRenderer(view, clean).render(height * math.cos(azimuth), height * math.sin(azimuth))
    ((u, v),) = view.project_wall(azimuth, height)
    assert edge_row(image, round(u)) == pytest.approx(v, abs=0.1)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.005, 0.035), st.floats(-math.pi, math.pi))
def test_the_detector_reads_what_was_drawn(height, azimuth):
    renderer = CupRenderer(CALIBRATION.view)
    image = renderer.render(height * math.cos(azimuth), height * math.sin(azimuth))
    measurement = FreeSurfaceDetector(CALIBRATION).update(0, image)
    assert measurement.msh == pytest.approx(height, abs=0.0015)
    away = azimuth - CALIBRATION.view.camera_azimuth
    if math.cos(away) > 0.5:
        assert measurement.peak_side is PeakSide.FRONT
    if math.cos(away) < -0.5:
        assert measurement.peak_side is PeakSide.REAR


def test_noise_differs_from_frame_to_frame_and_repeats_with_its_seed():
    first, again = CupRenderer(CALIBRATION.view), CupRenderer(CALIBRATION.view)
    one, two = first.render(0.0, 0.0), first.render(0.0, 0.0)
    assert not np.array_equal(one, two)
    assert np.array_equal(one, again.render(0.0, 0.0))

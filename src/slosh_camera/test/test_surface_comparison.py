from types import SimpleNamespace

import numpy as np
import pytest

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.cylinder.surface import SHAPES, Prior
from slosh_camera.cylinder.surface_comparison import CandidateSurface, Sighting, SurfaceComparison
from slosh_camera.cylinder.surface_memory import ExpectedMode
from slosh_camera.measurement import Flag

MM = 1e-3
FRAME = 1_000_000_000 // 60
ZERO = np.zeros(SHAPES)


class NothingElse:
    """Test double that finds no further candidate surfaces."""

    def fit_several(self, view, points, prior):
        return []

    def fit_near(self, view, points, prior, start):
        return []

    def fit_levels(self, view, points, at_rest, moving):
        return []

    def surprise(self, heights, prior):
        return prior.surprise(heights, 0.05)

    def plausible(self, view, fit, prior):
        return 0.3


def surface(x, y, plausible, edges=100):
    heights = ZERO.copy()
    heights[1:3] = x, y
    return CandidateSurface(None, SimpleNamespace(heights=heights, edges=edges), plausible)


FRONT, REAR = (0.0, -15.0 * MM), (0.0, 15.0 * MM)


def choose(candidates, expected, *, certain=False, at_rest=-np.inf):
    comparison = SurfaceComparison(NothingElse(), Prior(ZERO, 0.02), 0.5 * MM, at_rest)
    return comparison.choose(Sighting(((None, None),), tuple(candidates), certain), expected)


def expects(place, stddev=3.0 * MM):
    return ExpectedMode(np.array(place), stddev)


def test_the_image_before_chooses_between_surfaces_that_agree_nearly_alike():
    exchanged, true = surface(*REAR, 0.50), surface(*FRONT, 0.40)
    alone = choose([exchanged, true], None)
    assert alone.candidate is exchanged
    assert not alone.decided
    told = choose([exchanged, true], expects((0.0, -13.0 * MM)))
    assert told.candidate is true
    assert told.decided
    # Where it agrees with the picture's own choice it has decided nothing.
    agreed = choose([exchanged, true], expects((0.0, 13.0 * MM)))
    assert agreed.candidate is exchanged
    assert not agreed.decided


def test_another_surface_that_agrees_hardly_less_is_a_doubt_unless_the_images_before_tell():
    alike = [surface(*FRONT, 0.30), surface(0.0, -7.0 * MM, 0.29)]
    assert choose(alike, None).doubtful
    assert not choose(alike, expects(FRONT)).doubtful
    assert choose(alike, expects((0.0, -11.0 * MM))).doubtful
    assert not choose([alike[0], surface(0.0, -14.0 * MM, 0.29)], None).doubtful
    assert not choose([alike[0], surface(0.0, -7.0 * MM, 0.10)], None).doubtful


def test_a_clear_picture_wins_over_the_image_before_and_says_so():
    true, exchanged = surface(*FRONT, 0.9), surface(*REAR, 0.1)
    choice = choose([true, exchanged], expects(REAR))
    assert choice.candidate is true
    assert choice.jumped


def test_a_poor_picture_is_believed_where_the_image_before_foretold_it():
    poor, other = surface(*FRONT, -0.05), surface(*REAR, -0.25)
    assert not choose([poor, other], None).believed
    told = choose([poor, other], expects(FRONT))
    assert (told.candidate, told.believed, told.decided) == (poor, True, True)
    # Not a worse one, and not one that was not foretold.
    assert not choose([surface(*FRONT, -0.2)], expects(FRONT)).believed
    assert not choose([poor], expects((4.0 * MM, -15.0 * MM))).believed


def test_a_certain_front_line_is_asked_again_where_it_was_not_foretold():
    sure = surface(*FRONT, np.inf)
    assert not choose([sure], expects(FRONT), certain=True).jumped
    assert choose([sure], expects(REAR), certain=True).jumped


# The detector: the same object live, in replay and offline.


@pytest.fixture
def stream(make_scene):
    """Detectors, and images of oscillating liquid by frame number."""
    scene = make_scene(noise=2.0, camera_height=0.08)
    omega = 18.9

    def image(number):
        phase = omega * number / 60.0
        return scene.draw(0.02 * abs(np.cos(phase)), 1.5 if np.cos(phase) > 0.0 else 1.5 - np.pi)

    return lambda: FreeSurfaceDetector(scene.calibration()), image


def values(measurement):
    return (measurement.msh, measurement.msh_stddev, measurement.fitted_msh, measurement.flags)


def test_the_same_images_give_the_same_bits_again_after_a_new_beginning(stream):
    make, image = stream
    detector = make()
    images = [image(number) for number in range(6)]
    first = [values(detector.update(k * FRAME, one)) for k, one in enumerate(images)]
    # The recording runs again: its first stamp lies before the last one.
    again = [values(detector.update(k * FRAME, one)) for k, one in enumerate(images)]
    assert again == first


@pytest.mark.long
def test_a_wrong_image_is_flagged_and_not_held_on_to(stream):
    make, image = stream
    detector = make()
    for number in range(4):
        detector.update(number * FRAME, image(number))
    wrong = detector.update(4 * FRAME, image(0))
    assert Flag.AMBIGUOUS in wrong.flags
    after = [detector.update(k * FRAME, image(k)) for k in range(5, 9)]
    alone = [detector.measure(0, image(k)) for k in range(5, 9)]
    for one, single in zip(after, alone, strict=True):
        assert one.msh == pytest.approx(single.msh, abs=0.3 * MM)
    assert [one.flags for one in after[2:]] == [Flag.NONE] * 2


@pytest.mark.long
def test_looking_and_following_is_updating(stream):
    make, image = stream
    detector, other = make(), make()
    for number in range(4):
        looked = other.follow(number * FRAME, other.look(image(number)))
        assert values(looked) == values(detector.update(number * FRAME, image(number)))

"""Tests the measurement of a cup that was filled or emptied since the image at rest."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.measurement import Flag
from slosh_camera.nodes.camera_node import LevelChanges

MM = 1e-3
FRAME = 1_000_000_000 // 60
# Up to this change it may count as an error of the height, and from the second on it is told [m].
ERROR, TOLD = 0.9 * MM, 1.3 * MM
# A camera at the still level sees both lines of a lower one as one edge, anywhere between them.
MERGED = {"level": 0.25}
SCENES = {
    "level": {},
    "pitched": {"camera_height": 0.08},
    "steep": {"camera_height": 0.2},
    "low contrast": {"camera_height": 0.08, "background": 120, "surface": 75},
    "bright liquid": {"camera_height": 0.06, "liquid": 210, "surface": 130, "background": 50},
    "bright surface": {"camera_height": 0.08, "surface": 170},
    "scattering": {"camera_height": 0.08, "surface": 65},
    "far, turned": {"camera_azimuth": 0.4, "distance": 0.6, "focal": 1300.0, "camera_height": 0.1},
}
FEW = [*product(("level", "pitched", "scattering"), (-10.0, -3.0, 2.0)), ("pitched", 0.5)]
ALL = [
    pytest.param(name, level, marks=pytest.mark.long)
    for name, level in product(SCENES, np.arange(-10.0, 10.5, 0.5).tolist())
    if (name, level) not in FEW
]


@pytest.fixture(scope="module")
def learnt(make_scene):
    """Returns a scene with noise, and a detector initialised with its image at rest."""
    made = {}

    def make(name):
        if name not in made:
            scene = make_scene(noise=2.0, **SCENES[name])
            detector = FreeSurfaceDetector(scene.calibration())
            detector.learn_still(scene.draw())
            made[name] = scene, detector
        return made[name]

    return make


@pytest.mark.parametrize(("name", "level"), [*FEW, *ALL])
def test_liquid_at_rest_at_another_level_is_no_wave(learnt, name, level):
    scene, detector = learnt(name)
    level *= MM
    found = detector.measure(0, scene.draw(level=level))
    others = found.flags & ~Flag.LEVEL_CHANGED
    allowed = max(0.4 * MM, 3.0 * found.msh_stddev, -MERGED.get(name, 0.0) * level)
    assert found.msh == pytest.approx(level, abs=allowed)
    if Flag.LEVEL_CHANGED in found.flags:
        assert abs(level) > ERROR
        allowed = max(0.2 * MM, 3.0 * found.level_change_stddev)
        assert found.level_change == pytest.approx(level, abs=allowed)
        assert found.level_change_stddev < 1.0 * MM
    else:
        assert others or abs(level) < TOLD
        assert np.isnan(found.level_change)


@pytest.mark.first(6)
@pytest.mark.parametrize("level", [-4.0, 2.0, 5.0])
@pytest.mark.parametrize("azimuth", [-2.4, 0.0, 1.5])
@pytest.mark.parametrize("size", [4.0, 12.0])
def test_waves_on_a_changed_level(learnt, make_wave, level, azimuth, size):
    """Heights refer to the level at rest, whether or not the changed level is flagged."""
    scene, detector = learnt("pitched")
    wave = make_wave(size * MM, azimuth, level * MM)
    found = detector.measure(0, scene.draw_wave(wave))
    others = found.flags & ~Flag.LEVEL_CHANGED
    height = (size + level) * MM
    assert others or found.msh == pytest.approx(height, abs=max(0.8 * MM, 3.0 * found.msh_stddev))


def test_a_cup_is_filled_up_before_the_camera(learnt):
    scene, detector = learnt("pitched")
    heights, flags = [], []
    for index, level in enumerate((0.0, 0.0, 3.0, 3.0, 3.0, 0.0)):
        image = replace(scene, seed=index).draw(level=level * MM)
        found = detector.update(index * FRAME, image)
        heights.append(found.msh)
        flags.append(found.flags)
    np.testing.assert_allclose(heights, np.array([0.0, 0.0, 3.0, 3.0, 3.0, 0.0]) * MM, atol=3e-4)
    changed = [Flag.LEVEL_CHANGED in flag for flag in flags]
    assert changed == [False, False, True, True, True, False]
    assert flags[0] == flags[-1] == Flag.NONE


def test_the_node_tells_a_change_that_most_images_show(learnt):
    scene, detector = learnt("pitched")
    changes = LevelChanges()
    risen, usual = (detector.measure(0, scene.draw(level=z)) for z in (0.003, 0.0))
    for found in (usual, risen, risen):
        changes.add(found)
    assert "has changed by +3.0 ± 0.1 mm since the still image (2 of 3 images)" in (
        changes.report(3)
    )
    assert not changes.report(3)  # each report begins anew
    for found in (usual, usual, risen):
        changes.add(found)
    assert not changes.report(3)

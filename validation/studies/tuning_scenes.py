"""The test scenes for changed tuning numbers, and how they are measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import with_tools  # noqa: F401

from slosh_testing import drawn_cup

ROOT = Path(__file__).resolve().parents[2]
RENDERED = ROOT / "tests" / "scenes"
FRAME = 40_000_000  # [ns]
AT_REST = ("nonlinear_dark", "highlights", "clear_20")
"""The last one is refused."""


class Scene(NamedTuple):
    """Input of a test: calibration, image at rest and stamped images, or a bag."""

    source: Any
    still: Any = None
    images: Sequence[Any] = ()
    stamps: Sequence[int] = range(0, 2**40, FRAME)


class Answer(NamedTuple):
    """Result for one image or bag: lengths [m], and flags as text."""

    lengths: tuple[float, ...]
    flags: str


def detected(scene: Scene) -> Iterator[Answer]:
    """Yields the detector's measurements of a scene's images."""
    from slosh_camera.detection.detectors import detector_for

    detector = detector_for(scene.source)
    detector.learn_still(scene.still)
    for stamp, image in zip(scene.stamps, scene.images, strict=False):
        found = detector.update(stamp, image)
        names = ("msh", "msh_stddev", "fitted_msh", "fitted_msh_stddev", "sh_left", "sh_right")
        yield Answer(tuple(float(getattr(found, name)) for name in names), str(found.flags))


def calibrated(scene: Scene) -> Iterator[Answer]:
    """Yields the pose calibrated from a scene's image at rest, and the stated height errors."""
    from slosh_camera.calibrate.still import calibrate_by_edges

    view = scene.source.view
    fit = calibrate_by_edges(scene.still, view.camera, view.cup, view.camera_azimuth)
    yield Answer((*fit.view.pose.translation.tolist(), *fit.height_stddev.values()), "")


def replayed(scene: Scene) -> Iterator[Answer]:
    """Yields the models' heights at a bag's images, and the monitor's results."""
    from slosh_replay import replay_bag

    result = replay_bag(scene.source)
    said = result.events, result.counters, result.warnings, result.verification, result.comparisons
    yield Answer(tuple(np.concatenate([*result.heights.values()]).tolist()), str(said))


def bags() -> dict[str, Scene]:
    """Returns the shipped example bags as scenes."""
    return {path.parent.name: Scene(path.parent) for path in ROOT.glob("bags/*/metadata.yaml")}


def rendered() -> dict[str, Scene]:
    """Returns rendered sequences as scenes, also with every third disturbance."""
    from camera_disturbances import all_disturbances
    from camera_sequences import read_image, read_sequence, sequences_in

    scenes, sequences = {}, {path.name: read_sequence(path) for path in sequences_in(RENDERED)}
    for name, one in sequences.items():
        still, images = read_image(one.still or Path()), [read_image(f.path) for f in one.frames]
        stamps = [frame.stamp_ns for frame in one.frames]
        scenes[name] = Scene(one.calibration, still, images, stamps)
    for index, disturb in enumerate(all_disturbances()[::3]):
        name = ("steep", "nonlinear_dark")[index % 2]
        sequence, scene, truth = sequences[name], scenes[name], sequences[name].frames[6]
        still = disturb(scene.still, sequence, None)
        images = [disturb(scene.images[6], sequence, truth)]
        scenes[disturb.name] = Scene(disturb.calibration(scene.source), still, images)
    return scenes


def at_rest() -> dict[str, Scene]:
    """Returns three rendered images at rest, as a calibration takes seconds."""
    return {name: scene for name, scene in rendered().items() if name in AT_REST}


def drawn() -> dict[str, Scene]:
    """Returns scenes with drawn cups, as the camera's tests use them.

    Waves, one of them over the rim, other levels, a torn image, and one that comes again.
    """
    plain = drawn_cup.Scene(noise=2.0)
    looks: dict[str, dict[str, Any]] = {
        "level": {},
        "pitched": {"camera_height": 0.12},
        "faint": {"camera_height": 0.08, "liquid": 165, "surface": 185},
        "scattering": {"camera_height": 0.08, "surface": 65},
        "cut off": {"aim": -0.09},
    }
    moving = (12e-3, 0.5, 0.0), (20e-3, -1.4, 0.0), (80e-3, 0.5, 0.0)
    waves = *moving, (0.0, 0.0, 3e-3), (8e-3, 1.5, 4e-3)
    random, scenes = np.random.default_rng(8), {}
    for name, look in looks.items():
        cup = dataclasses.replace(plain, **look)
        images = [dataclasses.replace(cup, seed=k).draw(*wave) for k, wave in enumerate(waves)]
        images.append(np.vstack((images[0][:230], images[1][230:])))
        for _ in range(0 if look else 21):
            images.append(cv2.add(images[0], random.integers(0, 3, images[0].shape, np.uint8)))
        scenes[name] = Scene(cup.calibration(), cup.draw(), images)
    return scenes


def traced() -> dict[str, Scene]:
    """Returns scenes with ray-traced side views, one of them torn."""
    from side_view_tables import CASES, random_liquid

    from slosh_testing.side_view_scene import draw, still

    generator, scenes = np.random.default_rng(11), {}
    for name, (setup, look) in CASES.items():
        images = [draw(setup, random_liquid(generator), look, seed) for seed in range(2)]
        images.append(np.vstack((images[0][:190], images[1][190:])))
        scenes[name] = Scene(setup.calibration(), still(setup, look), images)
    return scenes

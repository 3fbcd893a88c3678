"""Measures one experiment of the TM20 study with the whole camera: rendered side views."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tm20.design import DEPTH, FILL_HEIGHT, IDENTIFICATION
from tm20.experiments import NO_NOISE, Experiment, geometry_of, true_amplitudes

from slosh_camera.rectangle.detector import SideViewDetector
from slosh_motion.signals.metrics import line_slopes
from slosh_testing.side_view_scene import Liquid, Look, Setup, draw, still

Array = NDArray[np.float64]

LOOK = Look(noise=4.0, blur=0.8)
EVERY = 25
"""One image in so many is rendered."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Camera results of an experiment by frame: line slopes and height errors.

    Attributes:
        slopes: (N, 2) θ of the line by the true profile and by the measured one.
        errors: (N, P) measured minus true heights [m].
        x: (P,) their places [m].
    """

    slopes: Array
    errors: Array
    x: Array


def sample(geometry: int, speed: int) -> Sample:
    """Renders and measures one repetition of an experiment."""
    experiment = Experiment(geometry, IDENTIFICATION.law, speed, 1, NO_NOISE, Path())
    amplitudes = true_amplitudes(experiment, np.random.default_rng(speed))[::EVERY, 0]
    width = geometry_of(experiment).width
    # One pixel is 0.25 mm, as with a machine's camera that sees all of a container.
    setup = Setup(
        width, DEPTH, FILL_HEIGHT, rim_height=FILL_HEIGHT + 0.04, elevation=-0.05,
        columns=int(1.2 * width / 0.25e-3),
    )  # fmt: skip
    detector = SideViewDetector(setup.calibration())
    detector.learn_still(still(setup, LOOK))
    slopes, errors = [], []
    x = np.empty(0)
    for number, modes in enumerate(amplitudes):
        liquid = Liquid(modes=tuple(modes))
        found = detector.measure(0, draw(setup, liquid, LOOK, number))
        x = found.profile_x
        if not len(x):
            continue
        true = liquid.at(x, width)
        errors.append(found.profile_height - true)
        slopes.append(
            [line_slopes(x, each[np.newaxis])[0] for each in (true, found.profile_height)]
        )
    return Sample(np.array(slopes), np.array(errors), x)

"""Simulates one experiment of the study: a moved tank, its surface and measured profiles.

The truth is potential flow to the third order. It varies from
repetition to repetition as a real series does: how full the container is, how strongly it damps,
and what is left of the motion before. Measured is with the noise of edges found to a whole
pixel, as the paper's are; our own camera's is a tenth of it (`camera_sample`).
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tm20.design import FILL_HEIGHT, FRAMES, GEOMETRIES, PLACES, RATIO, STROKE, Geometry

from slosh_base.files.new_file import NewFile
from slosh_model.motion_profiles import Cycle
from slosh_motion.signals.metrics import line_approximation_error, line_slopes
from slosh_testing.multimodal import Tanks, simulate_tanks

Array = NDArray[np.float64]

ORDER, MODES = 3, 7
"""More modes break where a wave is steep: in the expansion, not in the container. Seven are told
apart from nine by less than 2 % of ε̄."""
TENSION = 0.0
"""σ/ρ of the surface [m³/s²]. Clean water's, 7.3e-5, would quicken the first wave of 40 mm by
2.3 %, that of 79 mm by 0.6 %. The paper measured frequencies up to 1.5 % *below* those without it:
boundary layers and a contact line that sticks slow the wave by as much. Neither is taken."""
STEPS = 2  # samples of the acceleration per image
FILL_SCATTER = 0.3e-3  # m, standard deviation between repetitions
DAMPING_SCATTER = 0.03  # of the damping ratio
LEFT_OVER = 0.1e-3  # m, of the first mode at a cycle's start


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of a measured profile's errors.

    Attributes:
        point: of each point by itself [m].
        level: of the whole profile, up or down [m].
        slope: of the whole profile [1].
    """

    point: float
    level: float
    slope: float


EDGES = Noise(0.1e-3, 0.1e-3, 1e-3)
"""A pixel of 0.25 mm gives 0.07 mm by rounding alone; the liquid's edge on a wall that was wet
before lies as far off again, over the whole width, and the container sways on its drive."""
NO_NOISE = Noise(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Experiment:
    """A container moved at one speed, with several repetitions.

    Attributes:
        geometry: its number.
        law: of the motion.
        speed: n [1/min].
        repetitions: how many.
        noise: of the measurement.
        folder: where the result is written.
    """

    geometry: int
    law: str
    speed: int
    repetitions: int
    noise: Noise
    folder: Path

    @property
    def file(self) -> Path:
        """Path of the result; its name depends on all settings."""
        truth = (ORDER, MODES, TENSION, STEPS, FILL_SCATTER, DAMPING_SCATTER, LEFT_OVER)
        settings = (replace(self, folder=Path()), truth, FRAMES, PLACES, geometry_of(self))
        digest = zlib.crc32(repr(settings).encode())
        return self.folder / f"G{self.geometry}_{self.law}_{self.speed:02d}_{digest:08x}.npz"

    @property
    def cycle(self) -> Cycle:
        """The machine cycle of the experiment's motion."""
        return Cycle(self.law, self.speed, STROKE, RATIO)

    @property
    def times(self) -> Array:
        """Times (FRAMES,) of the images [s]."""
        return np.linspace(0.0, self.cycle.cycle_time, FRAMES)


@dataclass(frozen=True, slots=True)
class Measured:
    """Measured profiles of an experiment's K repetitions, as slopes and line errors.

    Attributes:
        experiment: it.
        slopes: (K, FRAMES) θ of the nearest lines [1]; empty: the wave broke in most repetitions.
            Single ones in which it does are left out.
        errors: (K,) ε̄ of the motion phase [m].
        dwell: (K, D, PLACES) profiles of the dwell [m].
    """

    experiment: Experiment
    slopes: Array
    errors: Array
    dwell: Array

    @property
    def broke(self) -> bool:
        """Whether the wave broke in most repetitions."""
        return not self.slopes.size

    @property
    def dwell_times(self) -> Array:
        """Times (D,) of the images during the dwell [s]."""
        times = self.experiment.times
        return times[times >= self.experiment.cycle.motion_time]


def geometry_of(experiment: Experiment) -> Geometry:
    """Returns the container of an experiment."""
    return GEOMETRIES[experiment.geometry - 1]


def places(geometry: Geometry) -> Array:
    """Returns the positions (PLACES,) of a profile's points from the middle [m]."""
    return np.linspace(-0.5, 0.5, PLACES) * geometry.width


def true_amplitudes(experiment: Experiment, rng: np.random.Generator) -> Array:
    """Simulates the modal amplitudes (FRAMES, K, MODES) [m]; NaN after a wave breaks."""
    count = experiment.repetitions
    geometry = geometry_of(experiment)
    tanks = Tanks.of(
        geometry.width,
        FILL_HEIGHT + rng.normal(0.0, FILL_SCATTER, count),
        geometry.published.damping_ratio * (1.0 + rng.normal(0.0, DAMPING_SCATTER, count)),
        TENSION,
    )
    interval = experiment.cycle.cycle_time / (STEPS * (FRAMES - 1))
    at = np.linspace(0.0, experiment.cycle.cycle_time, STEPS * (FRAMES - 1) + 1)
    acceleration = np.repeat(experiment.cycle.at(at)[2][:, np.newaxis], count, axis=1)
    acceleration[-1] = 0.0  # the next cycle would begin there
    start = np.zeros((count, MODES))
    start[:, 0] = rng.normal(0.0, LEFT_OVER, count)
    surfaces = simulate_tanks(
        tanks, acceleration, interval, order=ORDER, modes=MODES, start=start, may_break=True
    )
    return surfaces.amplitudes[::STEPS]


def measure(experiment: Experiment) -> Path:
    """Runs an experiment unless its result exists; returns the result's file."""
    if experiment.file.exists():
        return experiment.file
    rng = np.random.default_rng([experiment.geometry, experiment.speed, len(experiment.law)])
    amplitudes = true_amplitudes(experiment, rng)
    whole = np.asarray(np.isfinite(amplitudes).all(axis=(0, 2)))
    slopes = errors = dwell = np.empty(0)
    if 2 * np.count_nonzero(whole) > len(whole):
        slopes, errors, dwell = _columns(experiment, amplitudes[:, whole], rng)
    with NewFile(experiment.file, sync=False) as file, file.open() as stream:
        np.savez_compressed(stream, slopes=slopes, errors=errors, dwell=dwell.astype(np.float32))
    return experiment.file


def _columns(
    experiment: Experiment, amplitudes: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    geometry, noise = geometry_of(experiment), experiment.noise
    x = places(geometry)
    order = np.arange(1, MODES + 1)
    shapes = np.cos(np.pi * np.outer(order, x / geometry.width + 0.5))
    profiles = np.moveaxis(amplitudes @ shapes, 1, 0)
    profiles += rng.normal(0.0, noise.point, profiles.shape)
    profiles += rng.normal(0.0, noise.level, profiles.shape[:2])[..., np.newaxis]
    profiles += rng.normal(0.0, noise.slope, profiles.shape[:2])[..., np.newaxis] * x
    moving = experiment.times < experiment.cycle.motion_time
    slopes = np.array([line_slopes(x, profile) for profile in profiles])
    errors = np.array([line_approximation_error(x, profile[moving]) for profile in profiles])
    return slopes, errors, profiles[:, ~moving]


def read(experiment: Experiment) -> Measured:
    """Reads the result of an experiment."""
    with np.load(experiment.file) as columns:
        return Measured(
            experiment,
            columns["slopes"],
            columns["errors"],
            columns["dwell"].astype(np.float64),
        )

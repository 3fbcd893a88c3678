"""Writes robot runs in the format of published data: poses and heights, two clocks.

What a measured run has and a simulation has not is put in on purpose, and known: the liquid has a
second mode and quadratic damping, the cameras see two thirds of the wall, their noise and their
outliers are there, and how far the two clocks are apart is written down. So what is tested on
measurements is tested where no measurements are, and against a truth that measurements lack.
"""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import scipy.io
from numpy.typing import NDArray

from slosh_bringup.cell.motions import make_motion
from slosh_model.measure import measured_heights
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate

Array = NDArray[np.float64]

CUP = Model(Cylinder(0.049, 0.078))
RUNS = {"own_l3": 7.3, "own_e3": 4.1, "own_c3": 5.6}
"""Their names, and the camera's time at which the command's clock begins [s]."""
IDLE, DWELL = 1.0, 9.0
"""Rest before the motion, and after it as long as the camera looks [s]."""
POSES, FRAMES = 500.0, 59.96
"""Rate of the commands and of the cameras [Hz]."""
NOISE, OUTLIER = 0.25e-3, 6e-3
"""Standard deviation of a height, and the size of a wrong one [m]; two in a hundred are wrong."""


def truth() -> Model:
    """Returns the model that generated the data, with the wall's arc that the cameras see."""
    liquid = CUP.spatial().nonlinear().with_effect("second_mode", damping_ratio=0.02)
    return liquid.with_effect("quadratic_damping", beta=0.02).with_effect(
        "visible_arc", centre=0.5, width=4.4
    )


def write_runs(folder: Path) -> Path:
    """Writes the pose file and the height file of each run.

    Args:
        folder: gets `heights/` and `poses/`.

    Returns:
        the folder.
    """
    (folder / "heights").mkdir(parents=True)
    (folder / "poses").mkdir()
    for number, (name, begins) in enumerate(RUNS.items()):
        motion = make_motion(name.removeprefix("own_"), POSES)
        idle = round(IDLE * POSES)
        position = np.vstack([np.repeat(motion.position[:1], idle, axis=0), motion.position])
        _write_poses(folder / "poses" / f"{name}.csv.gz", position)
        t, heights = _seen(motion.acceleration, begins + IDLE, np.random.default_rng(number))
        scipy.io.savemat(
            folder / "heights" / f"{name}.mat", {"slosh_times": t, "slosh_heights": 1e3 * heights}
        )
    return folder


def _write_poses(path: Path, position: Array) -> None:
    t = np.arange(len(position)) / POSES
    upright = np.tile((0.0, 0.0, 0.0, 1.0), (len(t), 1))
    rows = np.column_stack([t, position, upright])
    lines = "\n".join(";".join(f"{value:.9g}" for value in row) for row in rows)
    path.write_bytes(gzip.compress(f"{lines}\n".encode(), mtime=0))


def _seen(acceleration: Array, start: float, random: np.random.Generator) -> tuple[Array, Array]:
    """Returns camera times [s] and heights [m]; the motion begins at `start` [s]."""
    still = round(DWELL * POSES)
    driven = np.vstack([acceleration, np.zeros((still, 3))])
    t = np.arange(len(driven)) / POSES
    response, _ = simulate(truth(), Inputs(t, driven))
    seen = measured_heights(truth(), response)[:, 0]
    stamps = np.arange(0.0, start + t[-1], 1.0 / FRAMES)
    heights = np.interp(stamps - start, t, seen, left=0.0)
    heights += random.normal(0.0, NOISE, len(stamps))
    wrong = random.random(len(stamps)) < 0.02
    heights[wrong] += random.choice((-OUTLIER, OUTLIER), wrong.sum())
    return stamps, heights

"""Tests what the detector makes of images torn between two moments, and of whole images.

    tools/run python validation/studies/torn_images.py [--half 0|1] [--scenes 24]

Sequences are drawn of many views, looks and motions; every fourth image is torn at a row that lies
in the container: one part of it is of an earlier moment whose image was never shown. Rendered
sequences in the shared data are torn alike. One half of the scenes is to tune by, the other to
report.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import read_image, read_sequence, shared_sequences
from numpy.typing import NDArray

from slosh_bringup.cell.renderer import CupRenderer, GreyLevels
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.measurement import Flag, Measurement
from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.camera import look_at
from slosh_camera.optics.cup import CupView

CAMERA = Path(__file__).resolve().parents[2] / "src" / "slosh_bringup" / "config" / "camera.yaml"
Image = NDArray[np.uint8]
WRONG = 1e-3  # m
EVERY = 4
IMAGES = 40
DIFFERS = 12  # grey levels by which a pixel is seen to be of another moment


@dataclass
class Tally:
    """Counts of whole and torn images, and of wrong judgements of each."""

    honest: int = 0
    false: int = 0
    torn: int = 0
    wrong: int = 0
    unflagged: list[tuple[str, float, int, int]] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    flags: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class Frame:
    """An image with its exact height; for a torn image also the whole one."""

    stamp_ns: int
    image: Image
    msh: float
    whole: Image | None = None
    new: int = 0
    old: int = 0


def motion(random: np.random.Generator, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Draws first-mode heights (N, 2) [m] at +x and +y over time, for a driven wave."""
    omega, damping, step = random.uniform(16.0, 21.0), random.uniform(0.005, 0.03), 1e-3
    strength, period = random.uniform(0.8, 4.0), random.uniform(0.25, 0.9)
    turn, spin = random.uniform(-np.pi, np.pi), random.choice([0.0, 0.0, 1.0])
    ends = random.uniform(0.4, 1.2) * times[-1]
    state = np.zeros((2, 2))
    along = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([-np.sin(turn), np.cos(turn)])
    steps = []
    for t in np.arange(0.0, times[-1] + step, step):
        phase = 2.0 * np.pi * t / period
        push = strength * (np.sin(phase) * along + spin * np.cos(phase) * across) * (t < ends)
        steps.append(state[0].copy())
        state[1] += step * (1.8 * push - omega**2 * state[0] - 2 * damping * omega * state[1])
        state[0] += step * state[1]
    path = np.array(steps)
    highest = np.max(np.hypot(*path.T))
    path *= min(1.0, random.uniform(0.006, 0.026) / highest)
    grid = step * np.arange(len(path))
    return np.column_stack([np.interp(times, grid, path[:, k]) for k in (0, 1)])


def drawn(seed: int) -> tuple[FreeSurfaceDetector, list[Frame]]:
    """Draws a random sequence with torn images, and its initialised detector."""
    random = np.random.default_rng(seed)
    shipped = read_calibration(CAMERA)
    azimuth, elevation = random.uniform(-np.pi, np.pi), np.radians(random.uniform(0.0, 25.0))
    distance = random.uniform(0.36, 0.5)
    away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
                     np.sin(elevation)])  # fmt: skip
    centre = distance * away
    view = CupView(shipped.view.camera, look_at(tuple(centre), (0.0, 0.0, 0.0)), shipped.view.cup)
    dark = random.uniform(30.0, 70.0)
    look = GreyLevels(
        background=random.uniform(150.0, 225.0), liquid=dark,
        surface=dark + random.uniform(30.0, 90.0), noise=random.uniform(0.5, 4.0),
        blur=random.uniform(0.4, 1.2), glint=random.uniform(0.0, 12.0), seed=seed,
    )  # fmt: skip
    renderer, clean = CupRenderer(view, look), CupRenderer(view, replace(look, noise=0.0))
    detector = FreeSurfaceDetector(Calibration(view, "drawn"))
    detector.learn_still(renderer.render(0.0, 0.0))
    rate = random.choice([15.0, 30.0, 60.0])
    times = np.arange(IMAGES) / rate
    ages = random.uniform(0.3, 5.0, IMAGES) / rate
    ages = np.minimum(ages, times)
    path = motion(random, np.concatenate((times, times - ages, [times[-1]])))
    new, old = path[:IMAGES], path[IMAGES : 2 * IMAGES]
    rows = view.project_wall(np.linspace(-np.pi, np.pi, 90), 0.0)[:, 1]
    reach = 0.03 / distance * view.camera.fy
    frames = []
    for k in range(IMAGES):
        image, stamp = renderer.render(*new[k]), round(1e9 * times[k])
        msh = float(np.hypot(*new[k]))
        if k < 8 or k % EVERY:
            frames.append(Frame(stamp, image, msh))
            continue
        row = int(random.uniform(rows.min() - reach, rows.max() + reach))
        part = slice(0, row) if random.random() < 0.5 else slice(row, None)
        of_old = renderer.render(*old[k])
        changed = np.abs(
            clean.render(*new[k]).astype(int) - clean.render(*old[k]).astype(int)
        ) > DIFFERS  # fmt: skip
        frames.append(_torn(Frame(stamp, image, msh), of_old, changed, part))
    return detector, frames


def _torn(frame: Frame, old: Image, changed: NDArray[np.bool_], part: slice) -> Frame:
    image = frame.image.copy()
    image[part] = old[part]
    stale = int(np.count_nonzero(changed[part]))
    fresh = int(np.count_nonzero(changed)) - stale
    return replace(frame, image=image, whole=frame.image, new=fresh, old=stale)


def rendered(folder: Path, seed: int) -> tuple[FreeSurfaceDetector, list[Frame]]:
    """Returns a rendered sequence with torn images, and its initialised detector."""
    random = np.random.default_rng(seed)
    sequence = read_sequence(folder)
    detector = FreeSurfaceDetector(sequence.calibration)
    if sequence.still is not None:
        detector.learn_still(read_image(sequence.still))
    view = sequence.calibration.view
    rows = view.project_wall(np.linspace(-np.pi, np.pi, 90), 0.0)[:, 1]
    reach = 0.6 * (rows.max() - rows.min()) + 30.0
    frames: list[Frame] = []
    for k, truth in enumerate(sequence.frames):
        image = read_image(truth.path)
        msh = float("nan") if truth.touches_top or truth.peak_outside else truth.msh
        frame = Frame(truth.stamp_ns, image, msh)
        if k < 3 or k % EVERY != seed % EVERY:
            frames.append(frame)
            continue
        old = read_image(sequence.frames[max(k - int(random.integers(1, 6)), 0)].path)
        row = int(random.uniform(max(rows.min() - reach, 0), rows.max() + reach))
        part = slice(0, row) if random.random() < 0.5 else slice(row, None)
        changed = np.any(np.abs(image.astype(int) - old.astype(int)) > 2 * DIFFERS, axis=2)
        frames.append(_torn(frame, old, changed, part))
    return detector, frames


def scenes(half: int, count: int) -> Iterator[tuple[str, FreeSurfaceDetector, list[Frame]]]:
    """Yields the sequences of one half: drawn and rendered ones."""
    for seed in range(half, 2 * count, 2):
        yield f"drawn {seed}", *drawn(seed)
    for number, folder in enumerate(shared_sequences()):
        for seed in range(4):
            if (number + seed) % 2 == half:
                yield f"{folder.name} {seed}", *rendered(folder, seed)


def measure(name: str, detector: FreeSurfaceDetector, frames: list[Frame], tally: Tally) -> None:
    """Counts the detector's results for a sequence, with torn and with whole images."""
    for frame in frames:
        image = frame.image if frame.whole is None else frame.whole
        found: Measurement = detector.follow(frame.stamp_ns, detector.look(image))
        tally.honest += 1
        if found.flags != Flag.NONE and Flag.SATURATED not in found.flags:
            tally.false += 1
            tally.flags[f"{name}: {found.flags!r}"] += 1
    for frame in frames:
        found = detector.follow(frame.stamp_ns, detector.look(frame.image))
        off = abs(found.msh - frame.msh)
        flagged = found.flags != Flag.NONE
        if frame.whole is None:
            continue
        tally.torn += 1
        if not off > WRONG:
            continue
        tally.wrong += 1
        if flagged:
            continue
        if frame.new == 0:
            tally.whole.append(off)
        else:
            tally.unflagged.append((name, 1e3 * off, frame.new, frame.old))


def main() -> None:
    """Runs all sequences of one half and prints the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--half", type=int, choices=(0, 1), default=1)
    parser.add_argument("--scenes", type=int, default=24)
    given = parser.parse_args()
    tally = Tally()
    for name, detector, frames in scenes(given.half, given.scenes):
        measure(name, detector, frames, tally)
    print(f"honest images {tally.honest}, flagged {tally.false}")
    for line, count in tally.flags.items():
        print(f"    {count} x {line}")
    print(
        f"torn images {tally.torn}, wrong by more than 1 mm {tally.wrong}, of which unflagged "
        f"{len(tally.unflagged)}, and {len(tally.whole)} whose liquid is all of an old moment"
    )
    for one in sorted(tally.unflagged, key=lambda one: -one[1]):
        print("    {}: {:.1f} mm, pixels of the new moment {}, of the old one {}".format(*one))


if __name__ == "__main__":
    main()

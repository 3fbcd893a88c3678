"""Measures the detector's time per image, compared with plain edge detection.

    tools/run python benchmarks/bench_camera_detector.py [--frames 60] [--turns 5]
        [--folder DIR --camera CAMERA.yaml]

One core, 1280 x 720. The detector's `measure` and `cv2.GaussianBlur` (5 x 5) with `cv2.Canny`
take turns on the same frames of a moving liquid, and the processor's time counts, so that a busy
machine disturbs neither. The blur and Canny run over the region of
interest, the box around the container in the image, and for comparison over the full image. The
claim is the ratio of the medians.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

# isort: off
import slosh_camera.nodes  # noqa: F401  before NumPy, for as many threads as in the node

# isort: on
import cv2
import numpy as np
from measuring import parsed
from numpy.typing import NDArray

from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_camera.detection.detectors import detector_for
from slosh_camera.images.colour import to_gray
from slosh_camera.images.decoding import read_image
from slosh_camera.optics.calibration import Calibration

GOAL = 3.0
WIDTH, HEIGHT = 1280, 720
WARM_UP = 5
RATE = 60.0
FREQUENCY = 3.0  # Hz; near the first mode of the cell's cup
KINDS = ("grey", "colour")
Image = NDArray[np.uint8]


def main() -> int:
    """Measures and prints times per image [ms] and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--folder", type=Path, help="measure its frame_*.jpg and calib.jpg too")
    parser.add_argument("--camera", type=Path, help="their camera.yaml")
    arguments = parsed(parser, frames=2, turns=1)
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    cv2.setNumThreads(1)
    good = True
    for name, (calibration, (still, *images)) in cases(arguments):
        result = compare(calibration, still, images, arguments.turns)
        print(json.dumps({"images": name, **result}), flush=True)
        good &= result["ratio"] <= GOAL
    return 0 if good else 1


def cases(arguments: argparse.Namespace) -> Iterator[tuple[str, tuple[Calibration, list[Image]]]]:
    """Yields test sequences: name, calibration, image at rest and further images."""
    for kind in KINDS:
        yield kind, rendered(kind, arguments.frames)
    if arguments.folder:
        calibration = larger(read_calibration(arguments.camera))
        files = [arguments.folder / "calib.jpg", *sorted(arguments.folder.glob("frame_*.jpg"))]
        for kind in KINDS:
            images = [scaled(read_image(file), kind) for file in files]
            yield f"{arguments.folder.name}, {kind}", (calibration, images)


def larger(calibration: Calibration) -> Calibration:
    """Returns the calibration for 1280 x 720 pixels, with the cup equally high in the image."""
    camera = calibration.view.camera
    zoom = HEIGHT / camera.height
    shift = (WIDTH - round(zoom * camera.width)) // 2
    other = replace(
        camera,
        width=WIDTH,
        height=HEIGHT,
        fx=zoom * camera.fx,
        fy=zoom * camera.fy,
        cx=zoom * (camera.cx + 0.5) - 0.5 + shift,
        cy=zoom * (camera.cy + 0.5) - 0.5,
    )
    view = replace(calibration.view, camera=other)
    return Calibration(
        view,
        calibration.camera_name,
        calibration.region,
        calibration.detection,
        calibration.still_image,
    )


def scaled(image: Image, kind: str) -> Image:
    """Scales an image to 1280 x 720 pixels; extends its left and right edges."""
    width = round(HEIGHT / image.shape[0] * image.shape[1])
    left = (WIDTH - width) // 2
    if kind == "grey":
        image = to_gray(image)
    picture = cv2.resize(image, (width, HEIGHT), interpolation=cv2.INTER_CUBIC)
    sides = (0, 0, left, WIDTH - width - left)
    wide = cv2.copyMakeBorder(picture, *sides, cv2.BORDER_REPLICATE)
    return np.asarray(wide, dtype=np.uint8)


def rendered(kind: str, count: int) -> tuple[Calibration, list[Image]]:
    """Renders images of the liquid at rest, then of a swirling wave up to 25 mm high."""
    calibration = larger(read_calibration(config_folder() / "camera.yaml"))
    renderer = CupRenderer(calibration.view)
    render = renderer.render if kind == "grey" else renderer.render_colour
    t = np.arange(count) / RATE
    amplitude = 0.025 * np.sin(np.pi * t / t[-1])
    x = amplitude * np.cos(2.0 * np.pi * FREQUENCY * t)
    y = 0.6 * amplitude * np.sin(2.0 * np.pi * FREQUENCY * t)
    heights = zip([0.0, *x], [0.0, *y], strict=True)
    return calibration, [render(float(sh_x), float(sh_y)) for sh_x, sh_y in heights]


def region(calibration: Calibration) -> tuple[slice, slice]:
    """Returns rows and columns of the image rectangle around the container."""
    pixels = calibration.view.outline()
    low, high = np.floor(np.nanmin(pixels, axis=0)), np.ceil(np.nanmax(pixels, axis=0))
    left, top = (max(int(value), 0) for value in low)
    return slice(top, min(int(high[1]) + 1, HEIGHT)), slice(left, min(int(high[0]) + 1, WIDTH))


def compare(
    calibration: Calibration, still: Image, images: list[Image], turns: int
) -> dict[str, Any]:
    """Measures detector, edges in the region and edges in the full image, in turns."""
    detector = detector_for(calibration)
    detector.learn_still(still)
    rows, columns = region(calibration)
    works: dict[str, Callable[[Image], object]] = {
        "detector": lambda image: detector.measure(0, image),
        "region": lambda image: edges(image[rows, columns]),
        "full": edges,
    }
    for image in images[:WARM_UP]:
        for work in works.values():
            work(image)
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(turns):
        # All images with one work, then with the next: as in a run, each finds its own code and
        # tables in the cache, and not what another left there.
        for name, work in works.items():
            for image in images:
                started = time.process_time()
                work(image)
                times[name].append(1e3 * (time.process_time() - started))
    medians = {name: statistics.median(values) for name, values in times.items()}
    found = sum(np.isfinite(detector.measure(0, image).msh) for image in images)
    return {
        "region [px]": f"{columns.stop - columns.start} x {rows.stop - rows.start}",
        "frames measured": f"{found} of {len(images)}",
        "detector [ms]": round(medians["detector"], 2),
        "detector, 95th percentile [ms]": round(float(np.percentile(times["detector"], 95)), 2),
        "blur and Canny, region [ms]": round(medians["region"], 2),
        "blur and Canny, full image [ms]": round(medians["full"], 2),
        "ratio": round(medians["detector"] / medians["region"], 2),
        "ratio to full image": round(medians["detector"] / medians["full"], 2),
        "goal": GOAL,
    }


def edges(image: Image) -> Image:
    """Detects edges by Gaussian blur and Canny, in grey or colour images."""
    return np.asarray(cv2.Canny(cv2.GaussianBlur(image, (5, 5), 0), 50, 150), dtype=np.uint8)


if __name__ == "__main__":
    sys.exit(main())

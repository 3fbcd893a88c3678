"""Measures the accuracy of views through inclined walls on rendered scenes.

    tools/run python validation/scenes/render.py tapered -o out/tapered
    tools/run python validation/studies/tapered_camera.py out/tapered

Scenes of odd number are the report, those of even number are for tuning (--tuning). The pose is
the true one; the zero is learnt from the image of the liquid at rest.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.decoding import read_image
from slosh_camera.measurement import Flag
from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.cup import Cup, CupView
from slosh_model.model_text import parse_container

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
from result_tables import fill  # noqa: E402

SILENT = 1.5e-3
"""An error beyond this [m] must be told by a flag or the standard deviation."""
DOUBTS = Flag.SATURATED | Flag.BLURRED | Flag.AMBIGUOUS | Flag.OCCLUDED | Flag.LEVEL_CHANGED
AT_REST = 1e-4
NUMBER = re.compile(r"tapered_([0-9]+)")


@dataclass(frozen=True)
class Height:
    """Error [m], standard deviation [m] and flags of an image's highest point."""

    error: float
    stddev: float
    flags: Flag

    @property
    def silent(self) -> bool:
        """Whether the error is too large although neither flag nor standard deviation shows it."""
        told = bool(self.flags & DOUBTS) or abs(self.error) < 3.0 * self.stddev
        return abs(self.error) > SILENT and not told


@dataclass(frozen=True)
class SceneResult:
    """Height errors in one scene, by image.

    Attributes:
        kind: of container.
        images: with moving liquid.
        heights: of those in which the surface was found.
        refused: why the image at rest was refused; empty: it was not.
    """

    kind: str
    images: int
    heights: tuple[Height, ...]
    refused: str = ""


def view_of(truth: dict[str, Any]) -> CupView:
    """Returns the exact camera view of a scene."""
    camera = truth["camera"]
    lens = PinholeCamera(
        camera["width"], camera["height"], camera["focal"], camera["focal"],
        camera["cx"], camera["cy"], (camera["k1"], 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    cup = Cup.of(
        parse_container(truth["container"], Path()), truth["wall_thickness"], truth["n_wall"]
    )
    pose = Pose(np.array(camera["R_cup2cam"]), np.array(camera["t_cup2cam"]))
    return CupView(lens, pose, cup)


def measured(folder: Path) -> SceneResult:
    """Measures all images of a scene in order."""
    truth = json.loads((folder / "truth.json").read_text())
    kind = truth["about"].partition(",")[0]
    moving = [frame for frame in truth["frames"] if frame["MSH"] > AT_REST]
    detector = FreeSurfaceDetector(Calibration(view_of(truth)))
    try:
        detector.learn_still(read_image(folder / truth["static"]["file"]))
    except SloshCameraError as error:
        return SceneResult(kind, len(moving), (), f"{folder.name}: {error}")
    heights = []
    for frame in moving:
        found = detector.update(round(1e9 * frame["t"]), read_image(folder / frame["file"]))
        if Flag.NOT_FOUND not in found.flags and np.isfinite(found.msh):
            heights.append(Height(found.msh - frame["MSH"], found.msh_stddev, found.flags))
    return SceneResult(kind, len(moving), tuple(heights))


def table(results: list[SceneResult]) -> str:
    """Formats the accuracy by kind of container as a Markdown table."""
    lines = [
        "| container | images | lost | flagged | unflagged: rms, largest | all: rms, largest "
        "| silent |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    for kind in (*sorted({result.kind for result in results}), "all"):
        those = [result for result in results if kind in (result.kind, "all")]
        heights = [height for result in those for height in result.heights]
        images = sum(result.images for result in those)
        plain = [height for height in heights if not height.flags & DOUBTS]
        silent = sum(height.silent for height in heights)
        cells = (
            kind, images, images - len(heights), len(heights) - len(plain), _errors(plain),
            _errors(heights), silent,
        )  # fmt: skip
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def _errors(heights: list[Height]) -> str:
    errors = np.array([height.error for height in heights])
    if not errors.size:
        return "–"
    return f"{1e3 * np.sqrt((errors**2).mean()):.2f}, {1e3 * np.abs(errors).max():.2f} mm"


def main() -> int:
    """Measures the scenes in a folder and prints or writes the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", type=Path, help="folder of the rendered scenes")
    parser.add_argument(
        "--tuning", action="store_true", help="use the scenes of even number, for tuning"
    )
    parser.add_argument("--each", action="store_true", help="print each scene's errors")
    parser.add_argument("--docs", action="store_true", help="write the table into docs/")
    args = parser.parse_args()
    folders = [
        folder for folder in sorted(args.scenes.iterdir())
        if (match := NUMBER.fullmatch(folder.name)) and (folder / "truth.json").exists()
        and int(match[1]) % 2 == (0 if args.tuning else 1)
    ]  # fmt: skip
    if not folders:
        parser.error(f"{args.scenes}: no such scenes")
    results = [measured(folder) for folder in folders]
    if args.each:
        for folder, result in zip(folders, results, strict=True):
            errors = (f"{1e3 * one.error:+.2f}±{1e3 * one.stddev:.2f}{'!' * bool(one.flags)}"
                      for one in result.heights)  # fmt: skip
            print(folder.name, result.kind, result.images, *errors)
    text = table(results)
    print(text, *(result.refused for result in results if result.refused), sep="\n")
    if args.docs:
        fill(ROOT / "docs" / "camera.md", "tapered", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

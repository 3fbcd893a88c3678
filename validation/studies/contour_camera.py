"""Measures the accuracy of side views of bodies of revolution on rendered scenes.

    tools/run python validation/scenes/render.py contours -o out/contours
    tools/run python validation/studies/contour_camera.py out/contours

Scenes of odd number are the report, those of even number are for tuning (--tuning). Each is
calibrated as a user does it: by two clicks on the still level's ends, half a pixel off, and the
camera's distance, 5 % off.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slosh_camera.calibrate.scale import calibrate_by_scale
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.decoding import read_image
from slosh_camera.measurement import Flag
from slosh_camera.optics.calibration import SideCalibration
from slosh_camera.optics.round_body import RoundBody
from slosh_camera.rectangle.detector import SideViewDetector
from slosh_model.model_text import parse_container

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
from result_tables import fill  # noqa: E402

CLICK, DISTANCE = 0.5, 0.05
SILENT = 1.5e-3
"""An error beyond this [m] must be told by a flag or the standard deviation."""
AT_REST = 1e-4
NUMBER = re.compile(r"contour_([0-9]+)")


@dataclass(frozen=True)
class Height:
    """A measured height's kind, error [m] and standard deviation [m], and if a flag doubts it."""

    kind: str
    error: float
    stddev: float
    doubted: bool

    @property
    def silent(self) -> bool:
        """Whether the error is too large although neither flag nor standard deviation shows it."""
        return abs(self.error) > SILENT and not self.doubted and abs(self.error) > 3 * self.stddev


def calibration(truth: dict[str, Any], number: int) -> SideCalibration:
    """Returns a calibration as from `slosh calibrate --scale`, with typical user errors."""
    rng = np.random.default_rng(number)
    camera, body = truth["camera"], parse_container(truth["container"], Path())
    seen = RoundBody.of(body, truth["wall_thickness"], truth["n_wall"])
    half, distance = 0.5 * seen.width, camera["distance"]
    pitch, roll = (math.radians(camera[name]) for name in ("pitch", "roll"))
    # The silhouette's two rays, about the level of the camera that looks down by its pitch.
    across = half / math.sqrt(distance**2 - half**2)
    down = camera["above_level"] / distance - math.tan(pitch)
    middle = 0.5 * np.array([camera["width"] - 1, camera["height"] - 1])
    turn = np.array([[math.cos(roll), math.sin(roll)], [-math.sin(roll), math.cos(roll)]])
    ends = [
        middle + camera["focal"] * (turn @ [side * across, down]) + rng.normal(0.0, CLICK, 2)
        for side in (-1.0, 1.0)
    ]
    return calibrate_by_scale(
        (camera["width"], camera["height"]), tuple(ends[0]), tuple(ends[1]), seen.width,
        body.fill_height, body=seen, distance=distance * (1.0 + DISTANCE * rng.uniform(-1.0, 1.0)),
    )  # fmt: skip


def measured(folder: Path, number: int) -> tuple[dict[str, Any], list[Height], int, str]:
    """Measures a scene; returns exact heights, measured ones, failed images, and any refusal."""
    truth = json.loads((folder / "truth.json").read_text())
    detector = SideViewDetector(calibration(truth, number))
    heights: list[Height] = []
    lost = 0
    try:
        detector.learn_still(read_image(folder / truth["static"]["file"]))
    except SloshCameraError as error:
        return truth, [], len(truth["frames"]), str(error)
    moving = [frame for frame in truth["frames"] if frame["MSH"] > AT_REST]
    for frame in moving:
        found = detector.measure(0, read_image(folder / frame["file"]))
        if Flag.NOT_FOUND in found.flags:
            lost += 1
            continue
        doubted = bool(found.flags & (Flag.SATURATED | Flag.BLURRED))
        ambiguous = doubted or Flag.AMBIGUOUS in found.flags
        rows = (
            ("ends", found.sh_left - frame["SH_left"], found.fitted_msh_stddev, doubted),
            ("ends", found.sh_right - frame["SH_right"], found.fitted_msh_stddev, doubted),
            ("msh", found.msh - frame["MSH"], found.msh_stddev, ambiguous),
        )
        heights += [Height(*row) for row in rows if np.isfinite(row[1])]
    return truth, heights, lost, ""


def table(folders: list[Path]) -> tuple[str, list[str]]:
    """Formats the accuracy by kind of container as a Markdown table; lists refusals."""
    by_kind: dict[str, list[Height]] = {}
    images: dict[str, tuple[int, int]] = {}
    refusals = []
    for folder in folders:
        match = NUMBER.fullmatch(folder.name)
        assert match is not None
        truth, heights, lost, refused = measured(folder, int(match[1]))
        kind = truth["about"].partition(",")[0]
        by_kind.setdefault(kind, []).extend(heights)
        seen, missed = images.get(kind, (0, 0))
        moving = sum(frame["MSH"] > AT_REST for frame in truth["frames"])
        images[kind] = seen + moving, missed + lost
        if refused:
            refusals.append(f"{folder.name}: {refused}")
    by_kind["all"] = [height for heights in by_kind.values() for height in heights]
    seen, missed = (sum(column) for column in zip(*images.values(), strict=True))
    images["all"] = seen, missed
    lines = [
        "| container | images | lost | at both ends: rms, largest | MSH: rms, largest | silent |",
        "|---|--:|--:|--:|--:|--:|",
    ]
    for kind, heights in by_kind.items():
        seen, lost = images[kind]
        cells = [kind, str(seen), str(lost), *(_errors(heights, what) for what in ("ends", "msh"))]
        silent = sum(one.silent for one in heights)
        lines.append(f"| {' | '.join(cells)} | {silent} |")
    return "\n".join(lines), refusals


def _errors(heights: list[Height], kind: str) -> str:
    errors = np.array([one.error for one in heights if one.kind == kind])
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
    parser.add_argument("--docs", action="store_true", help="write the table into docs/")
    args = parser.parse_args()
    folders = [
        folder for folder in sorted(args.scenes.iterdir())
        if (match := NUMBER.fullmatch(folder.name)) and (folder / "truth.json").exists()
        and int(match[1]) % 2 == (0 if args.tuning else 1)
    ]  # fmt: skip
    if not folders:
        parser.error(f"{args.scenes}: no such scenes")
    text, refusals = table(folders)
    print(text, *refusals, sep="\n")
    if args.docs:
        fill(ROOT / "docs" / "side_view.md", "bodies", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

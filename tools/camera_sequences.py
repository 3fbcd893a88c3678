"""Reads rendered image sequences with exact heights, for measuring the camera's accuracy.

A folder holds truth.json, the frames it names and, as a rule, an image of the liquid at rest. The
format is that of `rendered/README.md` in the shared data; truth.json states its conventions.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.still import calibrate_by_edges
from slosh_camera.calibrate.still_fit import StillFit
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import PeakSide
from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.camera import Pose, camera_from_info
from slosh_camera.optics.cup import Cup, CupView

Image = NDArray[np.uint8]

ROOT = Path(__file__).resolve().parents[1]
_SIDES = {"front": PeakSide.FRONT, "rear": PeakSide.REAR}
# Two modes and, where the truth has them, the second-order parts that sharpen a crest.
_WAVES = (("A1", "phi", 1), ("A2", "phi2", 1), ("A20", "phi", 0), ("A22", "phi", 2))


@dataclass(frozen=True, slots=True)
class FrameTruth:
    """Exact heights and visibility of the surface in one rendered image.

    Attributes:
        index: of the frame.
        path: its image.
        stamp_ns: middle of the exposure [ns].
        msh: highest point of the free surface on the wall above the still level [m].
        azimuth: of that point [rad]; NaN where the surface is level.
        side: the wall that carries it; UNKNOWN beside the image plane.
        sh_left: wall height at the left apparent edge of the container [m].
        sh_right: at the right edge [m].
        touches_top: liquid is seen in the image's first row: heights are cut off.
        peak_outside: the highest point projects outside the image.
        waves: parts of the wall's line: amplitude [m], azimuth [rad], periods around the wall.
    """

    index: int
    path: Path
    stamp_ns: int
    msh: float
    azimuth: float
    side: PeakSide
    sh_left: float
    sh_right: float
    touches_top: bool
    peak_outside: bool
    waves: tuple[tuple[float, float, int], ...]

    def height(self, azimuth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the exact height of the contact line on the wall [m] at azimuths [rad]."""
        line = np.zeros(np.shape(azimuth))
        for size, phase, periods in self.waves:
            line = line + size * np.cos(periods * (azimuth - phase))
        return np.asarray(line)


@dataclass(frozen=True, slots=True, eq=False)
class RenderedSequence:
    """A folder with rendered images of a container, their calibration and exact heights.

    Attributes:
        name: of the folder.
        calibration: camera, pose and cup from truth.json.
        still: image of the liquid at rest; None: there is none.
        frames: in the order of time.
    """

    name: str
    calibration: Calibration
    still: Path | None
    frames: tuple[FrameTruth, ...]


def shared_sequences() -> list[Path]:
    """Returns the folders of rendered sequences in the shared data (SLOSH_SHARED_DATA)."""
    data = Path(os.environ.get("SLOSH_SHARED_DATA", ROOT.parent / "shared" / "data"))
    return sorted(path.parent for path in (data / "rendered").glob("*/truth.json"))


def sequences_in(folder: Path) -> list[Path]:
    """Returns the sequences' folders in a folder; the folder itself if it contains none."""
    return sorted(path.parent for path in folder.glob("*/truth.json")) or [folder]


def read_sequence(folder: Path) -> RenderedSequence:
    """Reads a sequence's truth.json; its images are read later, when they are measured.

    Raises:
        SloshCameraError: the file cannot be read or lacks a key; the message names it.
    """
    path = folder / "truth.json"
    try:
        truth = json.loads(path.read_text(encoding="utf-8"))
        frames = tuple(_frame(folder, truth, entry) for entry in truth["frames"])
        calibration = Calibration(_view(truth), folder.name)
        still = folder / (truth.get("static") or {}).get("file", "calib.jpg")
    except OSError as error:
        raise SloshCameraError(f"{path}: cannot be read: {error.strerror}") from error
    except KeyError as error:
        raise SloshCameraError(f"{path}: lacks the key {error}") from error
    except (ValueError, TypeError) as error:
        raise SloshCameraError(f"{path}: {error}") from error
    name = folder.resolve().name
    return RenderedSequence(name, calibration, still if still.is_file() else None, frames)


def fit_still(sequence: RenderedSequence) -> StillFit:
    """Calibrates the camera's pose from a sequence's image of the liquid at rest.

    Raises:
        SloshCameraError: there is none, or it does not determine the pose.
    """
    if sequence.still is None:
        raise SloshCameraError("there is no image of the liquid at rest")
    truth = sequence.calibration.view
    return calibrate_by_edges(
        read_image(sequence.still), truth.camera, truth.cup, truth.camera_azimuth
    )


def read_image(path: Path, *, grey: bool = False) -> Image:
    """Reads an image as the detector takes it: in blue-green-red order, or grey.

    Raises:
        SloshCameraError: the file is missing or no image.
    """
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR)
    if image is None:
        raise SloshCameraError(f"{path}: is missing or no image")
    return np.asarray(image, dtype=np.uint8)


def _view(truth: Mapping[str, Any]) -> CupView:
    camera = truth["camera"]
    cup: dict[str, float] = {
        "radius": truth["R"],
        "fill_height": truth["h"],
        "wall_thickness": truth["wall_thickness"],
        "rim_height": truth["h"] + truth["rim_z"],
        "wall_refractive_index": truth["n_wall"],
    }
    known = {entry.name for entry in fields(Cup)}
    # Heights are those above the liquid's line at rest, which a meniscus lifts.
    rotation = np.array(camera["R_cup2cam"])
    translation = np.array(camera["t_cup2cam"]) + rotation[:, 2] * truth.get("meniscus", 0.0)
    return CupView(
        camera_from_info(
            np.ravel(camera["K"]).tolist(), camera["dist"], camera["width"], camera["height"]
        ),
        Pose(rotation, translation),
        Cup(**{key: value for key, value in cup.items() if key in known}),
    )


def _frame(folder: Path, truth: Mapping[str, Any], entry: Mapping[str, Any]) -> FrameTruth:
    waves = tuple(
        (float(entry.get(size, 0.0)), math.radians(entry.get(phase) or 0.0), periods)
        for size, phase, periods in _WAVES
    )
    return FrameTruth(
        index=entry["index"],
        path=folder / entry["file"],
        stamp_ns=round(1e9 * entry["t"]),
        msh=entry["MSH"],
        azimuth=math.nan if entry["peak_az"] is None else math.radians(entry["peak_az"]),
        side=_SIDES.get(entry["peak_half"], PeakSide.UNKNOWN),
        sh_left=entry["SH_left"],
        sh_right=entry["SH_right"],
        touches_top=bool(entry["liquid_touches_frame_top"]),
        peak_outside=bool(entry["peak_out_of_frame"]),
        waves=waves,
    )

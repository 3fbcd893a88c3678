"""Renders test sequences of a sloshing cup: render.py --list | NAME... -o DIR [--frames N]."""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import clear
import contours
import cv2
import liquids
import numpy as np
import povray
import tapered
import unkind
from definitions import SCENES, Scene
from numpy.typing import NDArray
from optics import View
from povray import Image
from surface import MODE_2, Surface, Wave, natural_frequency
from truth import frame_truth, header, mask_truth

STILL = "calib.jpg"
# Parts of the picture between which a rolling shutter's time steps.
STRIPS = 8
# Scenes as those of `sequences` and of `stills`, of any number.
FURTHER = {
    "sequence": unkind.sequence,
    "still": unkind.still,
    "contour": contours.contour,
    "tapered": tapered.tapered_cup,
}
NUMBERED = re.compile(r"(sequence|still|contour|tapered)_([0-9]{2,6})")
GROUPS = {
    "all": list(SCENES.values()),
    "stills": unkind.stills(),
    "sequences": unkind.sequences(),
    "liquids": liquids.liquids(),
    "clear": clear.clear(),
    "contours": contours.contours(),
    "tapered": tapered.tapered(),
}


def view_of(scene: Scene) -> View:
    """Returns the scene's camera and cup, in metres."""
    rotation, centre = povray.axes(scene.camera)
    camera, cup = scene.camera, scene.cup
    return View(
        rotation,
        -rotation @ centre * 1e-3,
        (camera.focal, camera.focal),
        (
            (camera.width - 1) / 2 + camera.offset[0],
            (camera.height_px - 1) / 2 + camera.offset[1],
        ),
        (camera.width, camera.height_px),
        camera.k1,
        cup.radius * 1e-3,
        cup.wall * 1e-3,
        cup.rim * 1e-3,
        cup.index,
    )


def wave_at(scene: Scene, time: float, duration: float) -> Wave | contours.ContourWave:
    """Returns the surface at `time` [s]: still in the first frames, then growing waves."""
    motion, radius = scene.motion, scene.cup.radius * 1e-3
    start = scene.still_frames / motion.frame_rate - 0.02 * duration
    rise = min(1.0, max(0.0, (time - start) / (0.65 * (duration - start)))) ** 1.3
    beat = 1 - 0.12 * math.sin(2 * math.pi * time / duration * 1.7) ** 2
    size = motion.peak * 1e-3 * rise * beat
    turn = 2 * math.pi * natural_frequency(radius, scene.cup.fill * 1e-3) * time + 0.4
    axis = math.radians(motion.phi)
    along = size * math.cos(turn)
    across = 0.0 if motion.kind == "planar" else size * motion.minor * math.sin(turn)
    if motion.kind == "planar":
        a1, phi = along, axis
    else:
        a1, phi = math.hypot(along, across), axis + math.atan2(across, along)
    if scene.cup.profile:
        return contours.contour_wave(scene, a1, phi)
    second = 2 * math.pi * natural_frequency(radius, scene.cup.fill * 1e-3, MODE_2) * time
    a2 = motion.second * size * math.cos(second)
    mean, double = (part * a1 * a1 / radius for part in motion.sharpening)
    return Wave(radius, a1, phi, a2, axis if a2 else 0.0, mean, double)


class Renderer:
    """Renders the frames and masks of one scene with lens distortion."""

    def __init__(self, scene: Scene, folder: Path) -> None:
        self._scene, self._folder, self._view = scene, folder, view_of(scene)
        self._rng = np.random.default_rng(1000 + scene.room.seed)
        self._maps, self._size = self._lens()
        povray.paint_board(scene, folder / "board.png")
        povray.paint_surroundings(scene, folder / "around.png")

    def _lens(self) -> tuple[tuple[NDArray[np.float32], NDArray[np.float32]], tuple[int, int]]:
        """Returns each pixel's position in an undistorted image, and that image's size [px]."""
        view = self._view
        wide, high = view.size
        grid = np.stack(np.meshgrid(np.arange(wide), np.arange(high)), -1)
        bent = (grid - view.centre) / view.focal
        straight = bent.copy()
        for _ in range(60):
            square = np.sum(straight**2, axis=-1, keepdims=True)
            straight = bent / (1 + view.k1 * square)
        straight = straight * view.focal
        half = np.abs(straight).max(axis=(0, 1)) + 3
        size = (2 * math.ceil(half[0]), 2 * math.ceil(half[1]))
        at = straight + np.array([(size[0] - 1) / 2, (size[1] - 1) / 2])
        return (at[..., 0].astype(np.float32), at[..., 1].astype(np.float32)), size

    def photograph(
        self, surface: Callable[[float], Surface], times: list[float], shift: float
    ) -> NDArray[np.uint8]:
        """Renders the image (BGR) that a camera takes, with blur, noise and compression.

        Args:
            surface: the wave by time (s).
            times: the exposure's instants, those of the middle row for a rolling shutter.
            shift: of the board (mm).
        """
        photo = self._scene.photo
        light = np.mean([self._instant(surface, time, shift) for time in times], axis=0)
        seen = cv2.remap(light.astype(np.float32), *self._maps, cv2.INTER_CUBIC)
        image: Image = np.asarray(seen, np.float32)
        if photo.lens_blur:
            image = np.asarray(cv2.GaussianBlur(image, (0, 0), photo.lens_blur), np.float32)
        hunt = 1.0 + photo.hunting * math.sin(2 * math.pi * 1.7 * times[0])
        image = np.clip(image * photo.gain * hunt, 0, 1.5)
        spread = np.sqrt(photo.shot**2 * image + photo.read**2)
        noisy = image + spread * self._rng.standard_normal(image.shape)
        return povray.to_srgb(np.asarray(noisy, np.float64))[..., ::-1]

    def _instant(self, surface: Callable[[float], Surface], time: float, shift: float) -> Image:
        """Renders the linear light of one moment, in strips for a rolling shutter."""
        readout, high = self._scene.photo.readout_s, self._size[1]
        if not readout:
            return self._drawn(surface(time), shift, None)
        ends = np.linspace(0, high, STRIPS + 1).astype(int)
        image: Image = np.zeros((high, self._size[0], 3), np.float32)
        for first, end in pairwise(int(row) for row in ends):
            late = readout * ((first + end) / (2 * high) - 0.5)
            strip = self._drawn(surface(time + late), shift, (first, end))
            image[first:end] = strip[first:end]
        return image

    def _drawn(self, wave: Surface, shift: float, rows: tuple[int, int] | None) -> Image:
        text = povray.photo_text(self._scene, wave, self._size, shift, self._folder)
        return povray.run(text, self._size, self._folder, smooth=True, rows=rows)

    def mask(self, wave: Surface) -> NDArray[np.uint8]:
        """Renders the classes: 0 nothing, 1 liquid through the wall, 2 free surface, 3 floor."""
        text = povray.mask_text(self._scene, wave, self._size)
        drawn = povray.run(text, self._size, self._folder, smooth=False)
        colours = cv2.remap(drawn, *self._maps, cv2.INTER_NEAREST)
        mask = np.argmax(colours, axis=-1).astype(np.uint8) + 1
        mask[colours.max(axis=-1) < 0.5] = 0
        return np.asarray(mask, np.uint8)


def render(scene: Scene, out: Path, *, masks: bool = True) -> None:
    """Renders a scene's images and truth.json; without masks, visibility stays unknown."""
    out.mkdir(parents=True, exist_ok=True)
    view = view_of(scene)
    contoured = bool(scene.cup.profile)
    truth = contours.header(scene, view) if contoured else header(scene, view)
    masks = masks and not contoured
    rate = scene.motion.frame_rate
    duration = scene.frames / rate
    quality = [cv2.IMWRITE_JPEG_QUALITY, scene.photo.quality]
    with tempfile.TemporaryDirectory() as temporary:
        renderer = Renderer(scene, Path(temporary))
        still = contours.contour_wave(scene, 0.0, 0.0) if contoured else Wave(view.radius)
        cv2.imwrite(str(out / STILL), renderer.photograph(lambda _: still, [0.0], 0.0), quality)
        if masks:
            cv2.imwrite(str(out / "calib_mask.png"), renderer.mask(still))
        for index in range(scene.frames):
            time = index / rate
            wave = wave_at(scene, time, duration)
            count = scene.photo.sub_frames
            instants = [
                time + scene.photo.exposure_s * ((k + 0.5) / count - 0.5) for k in range(count)
            ]
            shift = scene.room.moving * math.sin(2 * math.pi * 0.9 * time)
            surface = partial(wave_at, scene, duration=duration)
            file, mask_file = f"frame_{index:03d}.jpg", f"mask_{index:03d}.png"
            cv2.imwrite(str(out / file), renderer.photograph(surface, instants, shift), quality)
            entry = {"index": index, "file": file, "mask": mask_file, "t": time}
            if contoured:
                assert isinstance(wave, contours.ContourWave)
                truth["frames"].append(entry | contours.frame_truth(wave))
                continue
            assert isinstance(wave, Wave)
            entry |= frame_truth(view, wave)
            mask = renderer.mask(wave) if masks else np.zeros(view.size[::-1], np.uint8)
            if masks:
                cv2.imwrite(str(out / mask_file), mask)
            truth["frames"].append(entry | mask_truth(mask, entry))
            print(f"\r{scene.name}: {index + 1} of {scene.frames}", end="", file=sys.stderr)
    print(file=sys.stderr)
    (out / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


def main() -> int:
    """Lists or renders the scenes named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"scenes, or {', '.join(GROUPS)}")
    parser.add_argument("--list", action="store_true", help="list the scenes")
    parser.add_argument("-o", "--out", type=Path, help="folder for the sequences")
    parser.add_argument("--frames", type=int, help="frames per sequence")
    parser.add_argument(
        "--no-masks", action="store_true", help="render only photographs, which takes less time"
    )
    args = parser.parse_args()
    if args.list:
        for scene in SCENES.values():
            print(f"{scene.name:16} {scene.about}")
        return 0
    scenes = {scene.name: scene for group in GROUPS.values() for scene in group}
    groups = {name: [scene.name for scene in group] for name, group in GROUPS.items()}
    names = [name for given in args.names for name in groups.get(given, [given])]
    further = [found for name in names if (found := NUMBERED.fullmatch(name))]
    scenes |= {found[0]: FURTHER[found[1]](int(found[2])) for found in further}
    unknown = [name for name in names if name not in scenes]
    if unknown or not names or args.out is None:
        parser.error(f"unknown scene {unknown[0]}" if unknown else "give NAME... and -o DIR")
    for name in names:
        scene = replace(scenes[name], frames=args.frames or scenes[name].frames)
        render(scene, args.out / name, masks=not args.no_masks)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except povray.RenderError as error:
        sys.exit(f"render: {error}")

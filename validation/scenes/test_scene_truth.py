"""Tests the exact heights of rendered scenes against slosh_camera's own geometry."""

import importlib
import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from slosh_camera.optics.cup import Wall

SCENES = Path(__file__).parent
NAMES = ("definitions", "optics", "surface", "truth", "povray", "render", "check_truth")
MM = 1e-3


@pytest.fixture
def scenes(monkeypatch):
    """Imports the modules of validation/scenes and the reader of sequences by plain names."""
    monkeypatch.syspath_prepend(str(SCENES))
    modules = {name: importlib.import_module(name) for name in NAMES}
    yield SimpleNamespace(sequences=importlib.import_module("camera_sequences"), **modules)
    for name in NAMES:
        sys.modules.pop(name, None)


def written(scenes, folder, scene, waves):
    """Writes a folder with truth.json but without images; returns it and its view."""
    view = scenes.render.view_of(scene)
    truth = scenes.truth.header(scene, view)
    for index, wave in enumerate(waves):
        name = {"index": index, "file": f"frame_{index:03d}.jpg", "t": index / 25}
        seen = {"liquid_touches_frame_top": False}
        truth["frames"].append(name | scenes.truth.frame_truth(view, wave) | seen)
    (folder / "truth.json").write_text(json.dumps(truth))
    return view, truth


def sharp_wave(scenes, azimuth_deg):
    phi = math.radians(azimuth_deg)
    return scenes.surface.Wave(50 * MM, 20 * MM, phi, 2 * MM, phi - 0.7, 1 * MM, 3 * MM)


@pytest.mark.parametrize("name", ["milk", "steep", "below", "wide_close"])
def test_wall_points_are_seen_where_the_detector_s_geometry_sees_them(scenes, tmp_path, name):
    view, _ = written(scenes, tmp_path, scenes.definitions.SCENES[name], [])
    cup_view = scenes.sequences.read_sequence(tmp_path).calibration.view
    for turn, height in [(0.3, -9), (-1.2, 12), (2.6, 10), (-2.0, 15)]:
        azimuth = view.azimuth + turn
        mine = view.seen(azimuth, height * MM)
        wall = Wall.FRONT if abs(turn) < 1.5 else Wall.REAR
        assert mine == pytest.approx(
            cup_view.project_wall(azimuth, height * MM, wall)[0], abs=0.01
        )
        straight = view.project(view.wall_point(azimuth, height * MM))
        assert straight == pytest.approx(
            cup_view.project(cup_view.wall_points(azimuth, height * MM))[0], abs=1e-6
        )
        # The glass moves a point seen through it by far more than the two may differ.
        through = view.project_refracted(azimuth, height * MM)
        assert math.dist(through, straight) > 0.1


@pytest.mark.parametrize(("towards", "side"), [(-90, "front"), (90, "rear"), (0, "side")])
def test_highest_point_and_its_side(scenes, tmp_path, towards, side):
    wave = sharp_wave(scenes, towards)
    _, truth = written(scenes, tmp_path, scenes.definitions.BASE, [wave])
    entry = truth["frames"][0]
    around = np.linspace(-math.pi, math.pi, 100_001)
    line = wave.wall(around)
    assert entry["MSH"] == pytest.approx(line.max(), abs=1e-9)
    assert entry["MSH"] > 24 * MM
    assert math.radians(entry["peak_az"]) == pytest.approx(around[line.argmax()], abs=1e-4)
    assert entry["peak_half"] == side
    frame = scenes.sequences.read_sequence(tmp_path).frames[0]
    degrees = np.radians(np.arange(360.0))
    assert frame.height(degrees) == pytest.approx(np.array(entry["wall_profile"]), abs=1e-7)


def test_no_part_of_the_surface_adds_liquid_or_leans_on_the_wall(scenes):
    wave = sharp_wave(scenes, 20)
    angle = np.radians(np.arange(0.5, 360))
    r = (np.arange(200) + 0.5) * wave.radius / 200
    height = wave.height(r[:, None], angle[None, :])
    assert abs(np.average(height.mean(axis=1), weights=r)) < 1e-6
    step = 1e-6
    wall, inside = wave.wall(angle), wave.height(np.array(wave.radius - step), angle)
    assert np.max(np.abs(wall - inside)) / step < 1e-3


def test_sequences_start_at_rest_and_reach_their_amplitude(scenes):
    for scene in scenes.definitions.SCENES.values():
        rate = scene.motion.frame_rate
        duration = scene.frames / rate
        waves = [scenes.render.wave_at(scene, i / rate, duration) for i in range(scene.frames)]
        peaks = [wave.peak()[0] for wave in waves]
        assert max(peaks[:2]) < 1e-9
        assert 0.05 * MM < peaks[2] < 3 * MM
        assert max(peaks) > 0.8 * MM * scene.motion.peak
        assert max(peaks) < MM * scene.cup.rim


@pytest.mark.usefixtures("ray_tracer")
def test_traced_masks_show_the_line_where_the_geometry_sees_it(scenes, tmp_path):
    base = scenes.definitions.SCENES["wide_close"]
    camera = replace(base.camera, width=200, height_px=150, focal=162.5)
    renderer = scenes.render.Renderer(replace(base, camera=camera), tmp_path)
    view = scenes.render.view_of(replace(base, camera=camera))
    # A peak at the rear hides neither line.
    wave = scenes.surface.Wave(view.radius, 8 * MM, view.azimuth + math.radians(160))
    mask = renderer.mask(wave)
    for rear in (False, True):
        gaps = scenes.check_truth.edge_gaps(view, wave, mask, rear)
        assert gaps.size > 50
        assert abs(np.mean(gaps)) < 0.15
        assert np.max(np.abs(gaps)) < 0.8

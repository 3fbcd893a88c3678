"""The glass wall against Fermat's principle, the straight limit and the ray-traced sequences."""

import itertools
import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from slosh_camera.optics.camera import PinholeCamera, camera_from_info
from slosh_camera.optics.cup import Cup, CupView, Wall
from slosh_camera.optics.pose import Pose, look_at
from slosh_camera.optics.refraction import GlassWall

SEQUENCES = (
    Path(os.environ.get("SLOSH_SHARED_DATA", Path(__file__).parents[4] / "shared" / "data"))
    / "rendered"
)
CAMERA = PinholeCamera(640, 480, 1000.0, 1000.0, 319.5, 239.5)
FRONT = {-100.0, -60.0, -20.0, -8.0}
REAR = {20.0, 90.0, 140.0, 175.0}


def view(height=0.1, thickness=0.003, index=1.49):
    pose = look_at((0.0, -0.45, height), (0.0, 0.0, 0.0))
    return CupView(CAMERA, pose, Cup(0.05, 0.07, thickness, None, index))


def optical_length(places, target, origin, glass):
    """Length of the path through a point of the outer wall and, for the rear, one of the inner."""
    path = [origin, _on(glass.outer_radius, *places[:2])]
    if len(places) == 4:
        path.append(_on(glass.radius, *places[2:]))
    path.append(target)
    lengths = [np.linalg.norm(b - a) for a, b in itertools.pairwise(path)]
    return sum(n * length for n, length in zip((1.0, glass.index, 1.0), lengths, strict=False))


def _on(radius, angle, height):
    return np.array([radius * np.cos(angle), radius * np.sin(angle), height])


@pytest.mark.parametrize("azimuth", sorted(FRONT | REAR))
def test_light_takes_the_quickest_way(azimuth):
    # Through the front wall, or through the front wall and the air: a stationary optical length.
    glass = GlassWall(0.05, 0.003, 1.49)
    origin = np.array([0.0, -0.45, 0.1])
    target = _on(0.05, np.radians(azimuth), 0.02)
    rear = azimuth in REAR
    direction = glass.sight(origin, target[np.newaxis], np.array([rear]))
    facing = np.radians(-90.0) if rear else np.radians(azimuth)
    start = [facing, 0.04, facing, 0.04] if rear else [facing, 0.04]
    best = minimize(
        optical_length, start, (target, origin, glass), method="BFGS", options={"gtol": 1e-10}
    )
    seen = _on(glass.outer_radius, *best.x[:2]) - origin
    apparent = direction[0] / np.linalg.norm(direction[0])
    assert apparent == pytest.approx(seen / np.linalg.norm(seen), abs=2e-6)


@given(
    azimuth=st.floats(-np.pi, np.pi),
    height=st.floats(-0.06, 0.06),
    camera_height=st.floats(-0.1, 0.4),
    thickness=st.floats(0.0, 0.006),
    index=st.floats(1.0, 1.9),
    wall=st.sampled_from(Wall),
)
def test_a_projected_point_is_found_where_it_was(
    azimuth, height, camera_height, thickness, index, wall
):
    cup = view(camera_height, thickness, index)
    pixel = cup.project_wall(azimuth, height, wall)
    if np.isnan(pixel).any():
        return
    found_azimuth, found_height = cup.on_wall(pixel, wall)
    # Straight rays are projected whichever wall they meet first.
    if np.isnan(found_azimuth[0]) or not cup._glass.bends:
        return
    turn = found_azimuth[0] - azimuth
    assert np.arctan2(np.sin(turn), np.cos(turn)) == pytest.approx(0.0, abs=1e-6)
    assert found_height[0] == pytest.approx(height, abs=1e-8)


def test_a_wall_of_no_thickness_or_index_one_is_not_there():
    azimuth = np.linspace(-np.pi, np.pi, 61)
    straight = view(thickness=0.0).project_wall(azimuth, 0.01)
    assert view(index=1.0).project_wall(azimuth, 0.01) == pytest.approx(straight)
    thin = view(thickness=1e-9).project_wall(np.radians([-90.0, -30.0, 60.0]), 0.01)
    assert thin == pytest.approx(
        view(thickness=0.0).project_wall(np.radians([-90, -30, 60]), 0.01)
    )


@pytest.mark.skipif(not SEQUENCES.is_dir(), reason=f"no rendered sequences in {SEQUENCES}")
@pytest.mark.parametrize("name", ["A_planar", "A_rotating", "B_rotating", "D_rotating"])
def test_peaks_are_projected_where_the_ray_tracer_shows_them(name):
    truth = json.loads((SEQUENCES / name / "truth.json").read_text())
    camera = truth["camera"]
    cup = CupView(
        camera_from_info(np.ravel(camera["K"]), camera["dist"], camera["width"], camera["height"]),
        Pose(np.array(camera["R_cup2cam"]), np.array(camera["t_cup2cam"])),
        Cup(truth["R"], truth["h"], truth["wall_thickness"], None, truth["n_wall"]),
    )
    frames = [f for f in truth["frames"] if f["peak_px"] and not f["peak_out_of_frame"]]
    azimuth = np.radians([frame["peak_az"] for frame in frames])
    pixels = cup.project_wall(azimuth, [frame["MSH"] for frame in frames])
    assert pixels == pytest.approx(np.array([frame["peak_px"] for frame in frames]), abs=1e-5)
    # Without the wall they would be some pixels away.
    bare = CupView(cup.camera, cup.pose, Cup(truth["R"], truth["h"]))
    straight = np.array([frame["peak_px_norefraction"] for frame in frames])
    assert bare.project_wall(azimuth, [f["MSH"] for f in frames]) == pytest.approx(
        straight, abs=1e-5
    )
    assert np.max(np.abs(straight - pixels)) > 1.0


def test_over_the_rim_rays_go_straight_and_sight_finds_them_again():
    glass = GlassWall(0.05, 0.003, 1.49, rim=0.03)
    origin = np.array([0.0, -0.4, 0.3])
    points = np.array([[0.01, 0.0489898, -0.06], [0.01, 0.0489898, 0.02]])
    through, over = glass.sight(origin, points)
    straight = points - origin
    straight /= np.hypot(straight[:, 0], straight[:, 1])[:, np.newaxis]
    # The lower point is seen through the glass, the upper one past it.
    assert np.linalg.norm(through - straight[0]) > 1e-3
    assert over == pytest.approx(straight[1], abs=1e-12)
    trace = glass.trace(origin, np.vstack((through, over)))
    assert trace.rear == pytest.approx(points, abs=1e-7)
    assert trace.front[0, 2] < 0.03 < trace.front[1, 2]

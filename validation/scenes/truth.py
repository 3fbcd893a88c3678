"""Creates the entries of truth.json: exact heights and visibility of rendered frames."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from definitions import Scene
from numpy.typing import NDArray
from optics import View, wrap
from surface import MODE_2, Wave, natural_frequency

# Below this height (m) the azimuth of the peak means nothing.
NO_PEAK = 1e-4
# The cosine of an azimuth 10 deg in front of the image plane.
SIDE = 0.1736

CONVENTIONS = {
    "cup_frame": "origin = centre of the STATIC FREE SURFACE on the cup axis; z up; azimuth 0 = "
    "x, +90 deg = y; cup floor (inside) at z=-h",
    "eta": "eta(r,th)=A1*J1(1.84118 r/R)/J1(1.84118)*cos(th-phi)"
    "+A2*J1(5.33144 r/R)/J1(5.33144)*cos(th-phi2)"
    "+A20*J0(3.83171 r/R)/J0(3.83171)+A22*J2(3.05424 r/R)/J2(3.05424)*cos(2(th-phi)); "
    "A1 is signed for planar sequences, >=0 otherwise",
    "camera": "OpenCV: x right, y down, z forward; X_cam = R_cup2cam X_cup + t_cup2cam; pixel "
    "(0,0) = centre of top-left pixel; x_d = x(1+k1 r^2)",
    "t": "t = mid-exposure time; with readout_time > 0 that of the middle row",
    "meniscus": "height of the liquid's line on the wall above the level of the surface at rest",
    "azimuth": "theta from +x towards +y; the camera stands at azimuth_of_camera",
    "MSH": "maximum over azimuth of the wall height, all terms of eta; peak_az where it is",
    "wall_profile": "eta(R, th) at th = 0, 1, ... 359 deg",
    "SH_left_right": "wall height at theta_left/right = inner-wall azimuth seen at the apparent "
    "(refracted) edges of the cup; *_tangent = plain tangent azimuths of the inner circle",
    "peak_half": "front: cos(az-az_cam)>0.1736; rear: < -0.1736; side: within 10 deg of the image "
    "plane; peak_front_cos is that cosine; peak_on_visible_front_wall = az inside "
    "[theta_left, theta_right] as seen from the camera",
    "peak_px": "projection of the peak wall point THROUGH the refracting wall (front wall: glass "
    "only; rear wall: glass + air, or air alone where it is seen over the front rim), null if no "
    "ray reaches it; peak_px_norefraction: straight",
    "peak_visible": "the peak's pixel is in the frame and within 6 px of liquid in the mask",
    "mask": "0 nothing, 1 liquid seen through the wall, 2 free surface seen from above, 3 cup "
    "floor of the liquid, seen through the refracting, non-reflecting cup, no blur, no label or "
    "droplets; liquid_top_px = topmost pixel of the largest part of classes 1 and 2",
}


def header(scene: Scene, view: View) -> dict[str, Any]:
    """Returns the data in truth.json that hold for the whole sequence."""
    cup, camera, photo = scene.cup, scene.camera, scene.photo
    left, right = view.edges()
    left_tangent, right_tangent = view.tangents()
    radius, fill = cup.radius * 1e-3, cup.fill * 1e-3
    return {
        "sequence": scene.name,
        "about": scene.about,
        "units": "m, s, deg, px",
        "R": radius,
        "h": fill,
        "wall_thickness": cup.wall * 1e-3,
        "R_outer": radius + cup.wall * 1e-3,
        "base_thickness": cup.base * 1e-3,
        "eccentricity": [offset * 1e-3 for offset in cup.eccentricity],
        "meniscus": cup.meniscus * 1e-3,
        "rim_z": cup.rim * 1e-3,
        "n_wall": cup.index,
        "n_liquid": 1.33,
        "frame_rate": scene.motion.frame_rate,
        "exposure_time": photo.exposure_s,
        "readout_time": photo.readout_s,
        "conventions": CONVENTIONS,
        "camera": {
            "width": camera.width,
            "height": camera.height_px,
            "fx": view.focal[0],
            "fy": view.focal[1],
            "cx": view.centre[0],
            "cy": view.centre[1],
            "k1": view.k1,
            "dist": [view.k1, 0, 0, 0, 0],
            "K": [
                [view.focal[0], 0, view.centre[0]],
                [0, view.focal[1], view.centre[1]],
                [0, 0, 1],
            ],
            "R_cup2cam": view.rotation.tolist(),
            "t_cup2cam": view.translation.tolist(),
            "centre_in_cup": view.position.tolist(),
            "azimuth_of_camera": camera.azimuth,
        },
        "theta_left_deg": math.degrees(left),
        "theta_right_deg": math.degrees(right),
        "theta_left_tangent_deg": math.degrees(left_tangent),
        "theta_right_tangent_deg": math.degrees(right_tangent),
        "static": {"file": "calib.jpg", "mask": "calib_mask.png"},
        "motion": {"kind": scene.motion.kind, "peak": scene.motion.peak},
        "natural_frequency_hz": natural_frequency(radius, fill),
        "mode2_frequency_hz": natural_frequency(radius, fill, MODE_2),
        "appearance": _appearance(scene),
        "frames": [],
    }


def _appearance(scene: Scene) -> dict[str, Any]:
    label = scene.label
    return {
        "absorption_per_m": list(scene.liquid.absorption),
        "liquid_colour": list(scene.liquid.colour),
        "liquid_opacity": scene.liquid.opacity,
        "wall_tint": [1, 1, 1],
        "label": label is not None,
        "dirt": scene.dirt,
        "label_az_z_mm": [label.azimuth, label.z, label.width, label.height] if label else None,
        "droplets": bool(scene.droplets),
        "noise_shot_read": [scene.photo.shot, scene.photo.read],
        "jpeg_quality": scene.photo.quality,
        "moving_background_mm": scene.room.moving,
    }


def frame_truth(view: View, wave: Wave) -> dict[str, Any]:
    """Returns the exact heights of a frame that follow from surface and camera."""
    height, azimuth = wave.peak()
    left, right = view.edges()
    left_tangent, right_tangent = view.tangents()
    entry: dict[str, Any] = {
        "A1": wave.a1,
        "phi": math.degrees(wrap(wave.phi)),
        "A2": wave.a2,
        "phi2": math.degrees(wrap(wave.phi2)),
        "A20": wave.mean,
        "A22": wave.double,
        "MSH": height,
        "SH_left": float(wave.wall(left)),
        "SH_right": float(wave.wall(right)),
        "SH_left_tangent": float(wave.wall(left_tangent)),
        "SH_right_tangent": float(wave.wall(right_tangent)),
        "wall_profile": np.round(wave.wall(np.radians(np.arange(360.0))), 8).tolist(),
    }
    if height < NO_PEAK:
        nothing = ("peak_az", "peak_front_cos", "peak_half", "peak_px", "peak_px_norefraction")
        return entry | dict.fromkeys(nothing) | {"peak_out_of_frame": False}
    cosine = math.cos(azimuth - view.azimuth)
    refracted = view.seen(azimuth, height)
    straight = view.project(view.wall_point(azimuth, height))
    seen = refracted or straight
    return entry | {
        "peak_az": math.degrees(azimuth),
        "peak_front_cos": cosine,
        "peak_half": "front" if cosine > SIDE else "rear" if cosine < -SIDE else "side",
        "peak_on_visible_front_wall": abs(wrap(azimuth - view.azimuth))
        < abs(wrap(left - view.azimuth)),
        "peak_px": list(refracted) if refracted else None,
        "peak_px_norefraction": list(straight) if straight else None,
        "peak_out_of_frame": seen is None or not view.contains(seen),
    }


def largest_part(there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Returns the largest connected region of a mask, without small specks."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        there.astype(np.uint8), connectivity=8
    )
    if count < 2:
        return there
    return np.asarray(labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))


def mask_truth(mask: NDArray[np.uint8], entry: dict[str, Any]) -> dict[str, Any]:
    """Returns what follows from the mask: topmost liquid row, and visibility of the peak."""
    body = largest_part((mask == 1) | (mask == 2))
    if not body.any():
        return {"liquid_top_px": None, "liquid_touches_frame_top": False, "peak_visible": None}
    row = int(np.argmax(body.any(axis=1)))
    column = int(np.median(np.flatnonzero(body[row])))
    seen = entry["peak_px"] or entry["peak_px_norefraction"]
    visible = None
    if seen is not None:
        # The rim may stand before the surface and part it.
        rows, columns = np.nonzero((mask == 1) | (mask == 2))
        gap = np.hypot(columns - seen[0], rows - seen[1]).min()
        visible = bool(gap < 6.0) and not entry["peak_out_of_frame"]
    return {
        "liquid_top_px": {"u": column, "v": row, "cls": int(mask[row, column])},
        "liquid_touches_frame_top": row == 0,
        "peak_visible": visible,
    }

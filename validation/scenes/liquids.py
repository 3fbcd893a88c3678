"""Scenes with different packaged liquids, otherwise equal, for testing the detector.

Only the liquid differs, or what stands between it and the camera: a label over the still line, a
bottle that is smudged all over.
"""

from __future__ import annotations

from dataclasses import replace

from definitions import Camera, Label, Liquid, Motion, Room, Scene

_SCENE = Scene(
    "",
    "",
    camera=Camera(width=480, height_px=360, focal=780.0, height=50.0, pitch=6.5),
    room=Room(seed=31, wall=(0.55, 0.55, 0.53), things=4, contrast=0.5),
    motion=Motion(phi=25.0, minor=0.7, peak=22.0, sharpening=(0.05, 0.15)),
    frames=10,
)
_PATTERNED = Room(seed=31, wall=(0.42, 0.40, 0.36), things=7, texture=0.18)
_DETERGENT = Liquid(absorption=(120, 60, 12), colour=(0.02, 0.05, 0.14), opacity=0.25)

_LIQUIDS = {
    "water": ("clear water", Liquid((1.5, 0.6, 0.4), (0.0, 0.0, 0.0), 0.0)),
    "oil": ("sunflower oil, pale yellow", Liquid((2, 6, 45), (0.3, 0.2, 0.02), 0.02)),
    "tea": ("tea", Liquid((3, 9, 26), (0.2, 0.1, 0.03), 0.0)),
    "juice": ("orange juice, cloudy", Liquid((10, 40, 120), (0.9, 0.35, 0.05), 0.7, 0.4)),
    "milk": ("milk", Liquid((0, 0, 0), (0.85, 0.83, 0.78), 0.97, 0.45)),
    "detergent": ("blue detergent", _DETERGENT),
    "cola": ("cola", Liquid((90, 150, 200), (0.05, 0.03, 0.02), 0.1)),
}


def liquids() -> list[Scene]:
    """Returns one scene for each liquid, and scenes with a label or a smudged wall."""
    plain = [
        replace(_SCENE, name=f"liquid_{name}", about=about, liquid=liquid)
        for name, (about, liquid) in _LIQUIDS.items()
    ]
    detergent = replace(_SCENE, liquid=_DETERGENT)
    return [
        *plain,
        replace(
            plain[0],
            name="liquid_water_pattern",
            about="clear water before a patterned board",
            room=_PATTERNED,
        ),
        replace(
            detergent,
            name="liquid_label",
            about="blue detergent, a paper label over the still line",
            label=Label(azimuth=-75.0, z=-4.0, width=34.0, height=24.0),
        ),
        replace(
            detergent,
            name="liquid_smudged",
            about="blue detergent, half-transparent bottle: smudged all over, droplets",
            dirt=70,
            droplets=30,
        ),
    ]

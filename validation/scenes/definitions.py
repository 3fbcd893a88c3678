"""Data types of rendered scenes, and the scenes; lengths in mm unless noted."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Cup:
    """A glass cup; `base` is the thickness of its floor, `rim` its height above the liquid.

    Attributes:
        eccentricity: of the outer wall against the bore (x, y), so that the wall's thickness
            differs around the cup.
        meniscus: height to which the liquid climbs at the wall.
        profile: (r, z above the inner floor) of a body of revolution, from the floor's centre to
            the rim; empty: a cylinder. `radius` is then that of the still surface.
        container: of it, as a model file has it.
    """

    radius: float = 50.0
    wall: float = 2.0
    fill: float = 70.0
    rim: float = 50.0
    base: float = 3.0
    index: float = 1.49
    eccentricity: tuple[float, float] = (0.0, 0.0)
    meniscus: float = 0.0
    profile: tuple[tuple[float, float], ...] = ()
    container: dict[str, float | str] = field(default_factory=dict)


@dataclass(frozen=True)
class Liquid:
    """A liquid that absorbs light (per metre, red green blue) and scatters at its surface.

    Attributes:
        absorption: absorption coefficients, 1/m.
        colour: linear colour of what it scatters.
        opacity: share of light that its boundary scatters: 0 clear, 1 paint.
        glow: share of `colour` that it shows even in shadow (light from all sides).
    """

    absorption: Colour = (70, 125, 175)
    colour: Colour = (0.07, 0.04, 0.03)
    opacity: float = 0.4
    glow: float = 0.3


@dataclass(frozen=True)
class Camera:
    """A pinhole camera that looks at the cup's axis.

    Attributes:
        azimuth: where it stands, deg; -90 is in front.
        distance: horizontal distance from the axis.
        height: above the still level.
        pitch: downward tilt, deg.
        roll: clockwise turn of the camera, deg.
    """

    width: int = 640
    height_px: int = 480
    focal: float = 1066.7
    azimuth: float = -90.0
    distance: float = 450.0
    height: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    k1: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Photo:
    """Camera properties between light and file: gain, noise, blur, JPEG, rolling shutter.

    Attributes:
        hunting: relative amplitude with which an automatic exposure changes the gain.
        readout_s: time from the first to the last row of a rolling shutter; 0: global.
    """

    gain: float = 1.0
    shot: float = 0.004
    read: float = 0.0022
    quality: int = 92
    lens_blur: float = 0.0
    exposure_s: float = 1 / 480
    sub_frames: int = 1
    hunting: float = 0.0
    readout_s: float = 0.0


@dataclass(frozen=True)
class Room:
    """Background board, table and illumination of a scene, in linear colours.

    Attributes:
        wall: colour of the board behind the cup; `things` shows blurred objects before it.
        posters: sheets with sharp edges on the board, lighter or darker than it.
        slope: brightness at the left and right end of the board, relative.
        texture: relative strength of a fine pattern on the board.
        moving: amplitude of the board's motion.
        sun: brightness of the lamp, `lamp_azimuth` where it stands.
        behind: brightness of what the cup reflects.
        glass_behind: place of a second, half-filled glass, to the right of the cup and behind it.
    """

    wall: Colour = (0.75, 0.75, 0.73)
    table: Colour = (0.06, 0.06, 0.07)
    things: int = 5
    posters: int = 0
    contrast: float = 0.8
    seed: int = 1
    slope: tuple[float, float] = (1.0, 1.0)
    texture: float = 0.0
    moving: float = 0.0
    sun: float = 0.6
    lamp_azimuth: float = -140.0
    behind: float = 0.7
    glass_behind: tuple[float, float] | None = None


@dataclass(frozen=True)
class Label:
    """A paper label on the outer wall, centred at an azimuth [deg] and height z [mm]."""

    azimuth: float
    z: float
    width: float
    height: float


@dataclass(frozen=True)
class Motion:
    """How the liquid's surface moves in a scene: direction, amplitude and modes.

    Attributes:
        kind: "rotating" or "planar".
        peak: first-mode amplitude at the end of the rise.
        phi: azimuth of the (major) axis, deg.
        minor: minor over major axis; its sign is the sense of rotation.
        second: amplitude of the second mode over the first's.
        sharpening: second-order amplitude over A1^2/R: mean and cos 2 theta part.
    """

    kind: str = "rotating"
    peak: float = 28.0
    phi: float = 0.0
    minor: float = 0.85
    second: float = 0.0
    sharpening: tuple[float, float] = (0.0, 0.0)
    frame_rate: float = 25.0


@dataclass(frozen=True)
class Scene:
    """A complete scene: cup, liquid, camera, room and the surface's motion."""

    name: str
    about: str
    cup: Cup = field(default_factory=Cup)
    liquid: Liquid = field(default_factory=Liquid)
    camera: Camera = field(default_factory=Camera)
    photo: Photo = field(default_factory=Photo)
    room: Room = field(default_factory=Room)
    motion: Motion = field(default_factory=Motion)
    label: Label | None = None
    droplets: int = 0
    dirt: int = 0
    frames: int = 20
    still_frames: int = 2


BASE = Scene("replica_A", "like the shared A_rotating: dark liquid, level camera")

SCENES: dict[str, Scene] = {
    scene.name: scene
    for scene in (
        BASE,
        replace(
            BASE,
            name="milk",
            about="white opaque liquid before a dark background, pitch 8 deg",
            liquid=Liquid(colour=(0.85, 0.83, 0.78), opacity=0.97, glow=0.45),
            camera=Camera(height=65, pitch=8),
            room=Room(wall=(0.11, 0.12, 0.13), table=(0.15, 0.10, 0.06), seed=2, behind=0.3),
            motion=Motion(phi=40, minor=-0.7, second=0.08),
        ),
        replace(
            BASE,
            name="orange",
            about="orange liquid as bright as its background: contrast in colour only",
            liquid=Liquid(colour=(0.99, 0.27, 0.025), opacity=0.93, glow=0.45),
            camera=Camera(height=40, pitch=5),
            room=Room(
                wall=(0.215, 0.237, 0.28),
                table=(0.22, 0.22, 0.21),
                things=3,
                contrast=0.15,
                seed=3,
                behind=0.4,
            ),
            motion=Motion(phi=-30, minor=0.6, second=0.05),
        ),
        replace(
            BASE,
            name="label_droplets",
            about="paper label across the still level, droplets above it, k1 = -0.15, pitch 5",
            camera=Camera(height=40, pitch=5, k1=-0.15),
            room=Room(seed=4, wall=(0.6, 0.6, 0.55)),
            motion=Motion(phi=20, minor=0.8, peak=26),
            label=Label(azimuth=-78, z=-6, width=18, height=26),
            droplets=28,
        ),
        replace(
            BASE,
            name="steep",
            about="pitched down 29 deg from 0.4 m, green half-clear liquid",
            liquid=Liquid(absorption=(45, 9, 38), colour=(0.10, 0.35, 0.12), opacity=0.12),
            camera=Camera(distance=340, height=190, pitch=29, focal=1000),
            room=Room(seed=5, table=(0.35, 0.30, 0.25)),
            motion=Motion(phi=70, minor=-0.8, second=0.06),
        ),
        replace(
            BASE,
            name="below",
            about="low fill, camera 3 cm below the still level and looking up a little",
            liquid=Liquid(absorption=(60, 80, 40), colour=(0.04, 0.02, 0.06)),
            cup=Cup(fill=45, rim=60),
            camera=Camera(height=-30, pitch=-4),
            room=Room(seed=6, wall=(0.55, 0.58, 0.6)),
            motion=Motion(phi=110, minor=0.9),
        ),
        replace(
            BASE,
            name="bright_uneven",
            about="light from one side, moving background, tea that absorbs little, blur",
            liquid=Liquid(absorption=(3, 9, 26), colour=(0.2, 0.1, 0.03), opacity=0.0),
            camera=Camera(height=25, pitch=3),
            photo=Photo(gain=1.3, shot=0.008, sub_frames=3, exposure_s=0.004, quality=85),
            room=Room(
                seed=7, slope=(0.25, 1.3), moving=60, things=8, wall=(0.7, 0.7, 0.68), behind=1.0
            ),
            motion=Motion(phi=0, minor=0.5, second=0.06),
        ),
        replace(
            BASE,
            name="wide_close",
            about="larger cup, camera at 0.25 m and azimuth -60 deg, short lens, k1 = -0.25",
            cup=Cup(radius=60, wall=3, fill=60, rim=45, base=4),
            liquid=Liquid(absorption=(120, 60, 20), colour=(0.02, 0.04, 0.10)),
            camera=Camera(azimuth=-60, distance=250, height=35, pitch=8, focal=520, k1=-0.25),
            room=Room(seed=8),
            motion=Motion(phi=15, minor=-0.75, peak=26),
        ),
        replace(
            BASE,
            name="nonlinear_dark",
            about="second-order crest sharpening, MSH up to 30 mm",
            camera=Camera(height=20, pitch=2),
            room=Room(seed=9, wall=(0.5, 0.52, 0.5)),
            motion=Motion(peak=24, minor=0.9, second=0.06, sharpening=(0.12, 0.30), phi=-60),
        ),
        replace(
            BASE,
            name="planar_towards",
            about="planar slosh along the optical axis, pitch 4",
            camera=Camera(height=30, pitch=4),
            room=Room(seed=10, wall=(0.65, 0.6, 0.55)),
            motion=Motion(kind="planar", phi=90, peak=28),
        ),
        replace(
            BASE,
            name="crop_top",
            about="the frame's top cuts high peaks, pitch 17",
            camera=Camera(height=55, pitch=17),
            room=Room(seed=11),
            motion=Motion(phi=-20, minor=0.8, peak=30),
        ),
        replace(
            BASE,
            name="far_small",
            about="the cup is only about 120 px wide",
            liquid=Liquid(absorption=(200, 90, 90), colour=(0.12, 0.02, 0.02)),
            camera=Camera(distance=950, focal=1066.7, height=60, pitch=3.5),
            photo=Photo(lens_blur=0.6, quality=88, shot=0.008, read=0.004),
            room=Room(seed=12),
            motion=Motion(phi=55, minor=-0.85),
        ),
        replace(
            BASE,
            name="clear_textured",
            about="clear water before a patterned board: contrast by refraction alone",
            liquid=Liquid(absorption=(1.5, 0.6, 0.4), colour=(0.0, 0.0, 0.0), opacity=0.0),
            camera=Camera(height=35, pitch=5),
            room=Room(seed=14, wall=(0.42, 0.4, 0.36), things=7, texture=0.18),
            motion=Motion(phi=-75, minor=0.7, peak=26),
        ),
        replace(
            BASE,
            name="hd",
            about="1280x720, pitch 6",
            camera=Camera(width=1280, height_px=720, focal=1780, height=47, pitch=6),
            room=Room(seed=13),
            motion=Motion(phi=35, minor=0.9),
            frames=14,
        ),
        replace(
            BASE,
            name="motion_blur",
            about="exposures of 10 ms: the line is smeared over up to 13 px",
            liquid=Liquid(absorption=(40, 90, 160), colour=(0.10, 0.05, 0.02)),
            camera=Camera(height=35, pitch=5),
            photo=Photo(exposure_s=0.010, sub_frames=5, lens_blur=0.5),
            room=Room(seed=15, wall=(0.55, 0.57, 0.6)),
            motion=Motion(phi=10, minor=0.8),
            frames=14,
        ),
    )
}

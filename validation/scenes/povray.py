"""Describes a scene in POV-Ray's language and renders it; lengths in mm, linear light.

The glass is one solid that contains the liquid; a film of glass (FILM thick) lies over the free
surface. So each ray crosses exactly one boundary at a time with the true index on both sides,
and nothing coincides. The mask is the same scene with flat, non-reflecting colours.
"""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import cv2
import numpy as np
from definitions import Camera, Colour, Cup, Scene
from numpy.typing import NDArray
from surface import Surface

FILM = 0.01  # mm
RINGS, SECTORS = 40, 240
MARGIN = 1.02  # the surface's mesh reaches this far beyond the wall
CAPILLARY = 2.7  # mm, over which a meniscus decays
BOARD = (2600.0, 1700.0)  # mm

Image = NDArray[np.float32]


class RenderError(Exception):
    """Error of a failed POV-Ray run."""


def surface_mesh(wave: Surface, top: float, meniscus: float = 0.0) -> str:
    """Returns a closed mesh of the space from the liquid's surface up to `top` [mm]."""
    radius = 1e3 * wave.reach
    angles = np.arange(SECTORS) * 2 * math.pi / SECTORS
    near = 1 - np.geomspace(0.3, 12.0, 12 if meniscus else 0) / radius
    rings = np.append(np.union1d(np.linspace(0, 1, RINGS)[1:], near), MARGIN) * radius
    r, angle = np.meshgrid(rings, angles, indexing="ij")

    def height(rr: NDArray[np.float64], aa: NDArray[np.float64]) -> NDArray[np.float64]:
        inside = np.minimum(rr, radius)
        climb = meniscus * np.exp((inside - radius) / CAPILLARY)
        return np.asarray(1e3 * wave.height(inside * 1e-3, aa) + climb)

    z = height(r, angle)
    step = 0.05
    slope_r = (height(r + step, angle) - height(r - step, angle)) / (2 * step)
    slope_a = (height(r, angle + 1e-3) - height(r, angle - 1e-3)) / 2e-3 / r
    normal = np.stack(
        [
            -slope_r * np.cos(angle) + slope_a * np.sin(angle),
            -slope_r * np.sin(angle) - slope_a * np.cos(angle),
            np.ones_like(r),
        ],
        axis=-1,
    ).reshape(-1, 3)
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1).reshape(-1, 3)
    middle = float(height(np.array(0.0), np.array(0.0)))
    tilt = normal[:SECTORS].mean(axis=0)
    lid = points[-SECTORS:].copy()
    lid[:, 2] = top
    vertices = np.vstack([points, [[0, 0, middle]], lid, [[0, 0, top]]])
    outward = lid * [1, 1, 0]
    normals = np.vstack([normal, [tilt], outward, [[0, 0, 1]]])
    faces = _faces(len(points))
    return (
        "mesh2 {\nvertex_vectors {" + _vectors(vertices) + "}\n"
        "normal_vectors {" + _vectors(normals) + "}\n"
        f"face_indices {{{len(faces)}," + ",".join(f"<{a},{b},{c}>" for a, b, c in faces) + "}\n"
        "inside_vector <0,0,1>\n}\n"
    )


def _faces(count: int) -> list[tuple[int, int, int]]:
    ring = [(i, (i + 1) % SECTORS) for i in range(SECTORS)]
    centre, lid, apex = count, count + 1, count + 1 + SECTORS
    faces = [(centre, a, b) for a, b in ring]
    starts = [*range(0, count, SECTORS), lid]
    for low, high in zip(starts[:-1], [*starts[1:-1], lid], strict=True):
        for a, b in ring:
            faces += [(low + a, high + a, high + b), (low + a, high + b, low + b)]
    return faces + [(apex, lid + a, lid + b) for a, b in ring]


def _vectors(rows: NDArray[np.float64]) -> str:
    return f"{len(rows)}," + ",".join(f"<{x:.5f},{y:.5f},{z:.5f}>" for x, y, z in rows)


def axes(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns rotation cup to camera (rows are OpenCV's axes), and the camera's centre [mm]."""
    az, pitch, roll = (math.radians(v) for v in (camera.azimuth, camera.pitch, camera.roll))
    forward = np.array(
        [
            -math.cos(az) * math.cos(pitch),
            -math.sin(az) * math.cos(pitch),
            -math.sin(pitch),
        ]
    )
    right = np.array([-math.sin(az), math.cos(az), 0.0])
    down = np.cross(forward, right)
    turned = math.cos(roll) * right + math.sin(roll) * down
    down = np.cross(forward, turned)
    centre = np.array(
        [camera.distance * math.cos(az), camera.distance * math.sin(az), camera.height]
    )
    return np.stack([turned, down, forward]), centre


def _vec(values: Colour | NDArray[np.float64]) -> str:
    return "<" + ",".join(f"{float(v):.8g}" for v in values) + ">"


def _camera(camera: Camera, size: tuple[int, int]) -> str:
    """Returns a camera of `size` pixels with the principal point in the middle, as text."""
    rotation, centre = axes(camera)
    right, down, forward = rotation
    return (
        f"camera {{ perspective location {_vec(centre)} direction {_vec(forward)} "
        f"right {_vec(right * size[0] / camera.focal)} "
        f"up {_vec(-down * size[1] / camera.focal)} }}\n"
    )


def _cup(scene: Scene, glass: str, liquid: str, liquid_top: str, drops: str) -> str:
    cup = scene.cup
    bore, body, filled = _solids(cup)
    hollow = f"intersection {{ {bore} object {{ Above }} }}"
    if drops:
        hollow = f"difference {{ {hollow} {drops} }}"
    return (
        f"difference {{ {body} {hollow} {glass} }}\n"
        f"difference {{ {filled % liquid} "
        f"object {{ Above translate <0,0,{-FILM}> {liquid_top} }} {_interior(scene)} }}\n"
    )


def _solids(cup: Cup) -> tuple[str, str, str]:
    """Returns texts of three solids: the inside, the whole cup, and the textured inside."""
    floor, high, depth = -cup.fill, cup.rim + 5, cup.rim + 1
    if not cup.profile:
        at = "{:.4f},{:.4f}".format(*cup.eccentricity)
        outer = cup.radius + cup.wall
        return (
            f"cylinder {{ <0,0,{floor}>, <0,0,{high}>, {cup.radius} }}",
            f"cylinder {{ <{at},{floor - cup.base}>, <{at},{cup.rim}>, {outer} }}",
            f"cylinder {{ <0,0,{floor}>, <0,0,{depth}>, {cup.radius} %s }}",
        )
    inner = np.array(cup.profile) + np.array([0.0, floor])
    top = inner[-1, 0]
    return (
        _lathe(np.vstack([inner, [top, high], [0.0, high]])),
        _lathe(outer_profile(inner, cup.wall, cup.base)),
        _lathe(np.vstack([inner, [top, depth], [0.0, depth]]), "%s"),
    )


def outer_profile(inner: NDArray[np.float64], wall: float, base: float) -> NDArray[np.float64]:
    """Returns the outside of an inner profile (N, 2): the wall moved outwards, with a foot."""
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(inner, axis=0).T)))
    fine = np.linspace(0.0, lengths[-1], 160)
    inner = np.column_stack([np.interp(fine, lengths, column) for column in inner.T])
    way = np.gradient(inner, axis=0)
    normal = np.column_stack([way[:, 1], -way[:, 0]])
    moved = inner + wall * normal / np.linalg.norm(normal, axis=1)[:, None]
    upright = moved[way[:, 1] > 0.2 * np.abs(way[:, 0])]
    bottom = inner[:, 1].min() - base
    foot = [[0.0, bottom], [upright[0, 0], bottom]]
    upright[-1, 1] = inner[-1, 1]
    return np.vstack([foot, upright, [[0.0, inner[-1, 1]]]])


def _lathe(points: NDArray[np.float64], texture: str = "") -> str:
    """Returns a solid of revolution with a given profile as POV-Ray text."""
    closed = np.vstack([points, points[:1]])
    rows = ",".join(f"<{max(r, 0.0):.5f},{z:.5f}>" for r, z in closed)
    return f"lathe {{ linear_spline {len(closed)}, {rows} rotate <90,0,0> {texture} }}"


def _interior(scene: Scene) -> str:
    absorption = _vec(1e-3 * np.array(scene.liquid.absorption))
    return f"interior {{ ior 1.33 media {{ absorption rgb {absorption} }} }} hollow"


def _drops(scene: Scene) -> str:
    """Returns droplets on the inner wall above the still level as POV-Ray text."""
    rng = np.random.default_rng(100 + scene.room.seed)
    parts = []
    for _ in range(scene.droplets):
        az = math.radians(scene.camera.azimuth + rng.uniform(-80, 80))
        z = rng.uniform(6, scene.cup.rim - 6)
        size = float(np.exp(rng.normal(math.log(1.3), 0.45)))
        parts.append(
            f"sphere {{ 0, 1 scale <{0.45 * size:.3f},{size:.3f},{1.25 * size:.3f}> "
            f"translate <{scene.cup.radius},0,0> rotate <0,0,{math.degrees(az):.3f}> "
            f"translate <0,0,{z:.3f}> }}"
        )
    return " ".join(parts)


def _dirt(scene: Scene) -> str:
    """Returns half-transparent smudges on the outer wall as POV-Ray text."""
    rng = np.random.default_rng(200 + scene.room.seed)
    outer = scene.cup.radius + scene.cup.wall + 0.3
    parts = []
    for _ in range(scene.dirt):
        az = scene.camera.azimuth + rng.uniform(-85, 85)
        z = rng.uniform(-scene.cup.fill, scene.cup.rim)
        wide, high = np.exp(rng.normal(math.log(1.5), 0.6, 2))
        tone, clear = rng.uniform(0.1, 0.8), rng.uniform(0.35, 0.8)
        parts.append(
            f"sphere {{ 0, 1 scale <0.02,{wide:.3f},{high:.3f}> rotate <{rng.uniform(0, 90):.1f},"
            f"0,0> translate <{outer},0,0> rotate <0,0,{az:.3f}> translate <0,0,{z:.3f}> "
            f"pigment {{ rgb {tone:.3f} transmit {clear:.3f} }} "
            "finish { ambient 0 diffuse 0.4 emission 0.5 } no_shadow }\n"
        )
    return "".join(parts)


def _glass_behind(scene: Scene, glass: str) -> str:
    """Returns a second glass with liquid behind the cup as POV-Ray text."""
    if scene.room.glass_behind is None:
        return ""
    bottom, turn = -scene.cup.fill - scene.cup.base, scene.camera.azimuth + 90
    right, back = scene.room.glass_behind
    high, level = 110.0, 55.0
    return (
        f"union {{ difference {{ cylinder {{ 0, <0,0,{high}>, 36 }} "
        f"cylinder {{ <0,0,4>, <0,0,{high + 1}>, 34 }} {glass} }} "
        f"cylinder {{ <0,0,4.1>, <0,0,{level}>, 33.9 "
        "pigment { rgb <0.25,0.08,0.06> transmit 0.5 } "
        "finish { ambient 0 diffuse 0.5 emission 0.4 } } "
        f"translate <{right},{back},{bottom}> rotate <0,0,{turn}> }}\n"
    )


def _label(scene: Scene, folder: Path) -> str:
    label = scene.label
    if label is None:
        return ""
    paint_label(folder / "label.png", label.width / label.height)
    radius = scene.cup.radius + scene.cup.wall + 0.05
    half = 0.5 * label.width / radius
    count = 24
    angles = math.radians(label.azimuth) + np.linspace(-half, half, count)
    bottom, top = label.z - label.height / 2, label.z + label.height / 2
    rows = np.array(
        [[radius * math.cos(a), radius * math.sin(a), z] for a in angles for z in (bottom, top)]
    )
    texture = ",".join(f"<{i / (count - 1):.5f},{v}>" for i in range(count) for v in (0, 1))
    faces = ",".join(
        f"<{2 * i},{2 * i + 1},{2 * i + 2}>,<{2 * i + 1},{2 * i + 3},{2 * i + 2}>"
        for i in range(count - 1)
    )
    return (
        f"mesh2 {{ vertex_vectors {{{_vectors(rows)}}} uv_vectors {{{2 * count},{texture}}} "
        f"face_indices {{{2 * (count - 1)},{faces}}} uv_mapping "
        'texture { pigment { image_map { png "label.png" interpolate 2 } } '
        "finish { ambient 0 diffuse 0.6 emission 0.35 } } }\n"
    )


def paint_label(path: Path, aspect: float) -> None:
    """Writes an image of a cream paper label with a few printed lines."""
    high = 300
    image = np.full((high, max(8, round(high * aspect)), 3), (215, 232, 238), np.uint8)
    wide = image.shape[1]
    cv2.rectangle(image, (8, 8), (wide - 9, high - 9), (150, 90, 60), 4)
    for row, text in enumerate(("No 7", "pH 7.0", "250 ml", "A / 3")):
        cv2.putText(image, text, (20, 70 + 58 * row), 0, 1.3, (60, 50, 40), 3, cv2.LINE_AA)
    cv2.imwrite(str(path), image)


def to_srgb(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Converts linear light in [0, 1] to 8-bit sRGB values."""
    clipped = np.clip(linear, 0, 1)
    encoded = np.where(
        clipped <= 0.0031308, 12.92 * clipped, 1.055 * np.power(clipped, 1 / 2.4) - 0.055
    )
    return np.asarray(np.round(255 * encoded), np.uint8)


def paint_board(scene: Scene, path: Path) -> None:
    """Writes an image of the board behind the cup, with blurred objects and uneven light."""
    room = scene.room
    rng = np.random.default_rng(room.seed)
    high, wide = 425, 650
    image = np.ones((high, wide, 3)) * np.array(room.wall)
    for _ in range(room.things):
        left, width = rng.uniform(0.18, 0.8) * wide, rng.uniform(0.015, 0.09) * wide
        top, bottom = rng.uniform(-0.1, 0.5) * high, rng.uniform(0.55, 1.1) * high
        tone = np.array(room.wall) * (
            1 - room.contrast * rng.uniform(0.3, 1.0) * rng.uniform(0.8, 1.0, 3)
        )
        image[max(0, int(top)) : int(bottom), int(left) : int(left + width)] = tone
    shelf = int(rng.uniform(0.25, 0.4) * high)
    image[shelf : shelf + 6] *= 1 - 0.5 * room.contrast
    image = cv2.GaussianBlur(image, (0, 0), 3.0)
    _hang_posters(scene, image)
    if room.texture:
        image *= 1 + room.texture * _pattern(rng, (high, wide))[..., None]
    # The gradient lies in the third of the board that the cameras see.
    image *= np.interp(np.linspace(0, 1, wide), (0.35, 0.65), room.slope)[None, :, None]
    image *= np.linspace(1.08, 0.85, high)[:, None, None]
    cv2.imwrite(str(path), to_srgb(image)[..., ::-1])


def _hang_posters(scene: Scene, image: NDArray[np.float64]) -> None:
    """Draws sheets on the visible part of the board's image (H, W, 3), in place."""
    room = scene.room
    rng = np.random.default_rng(300 + room.seed)
    high, wide = image.shape[:2]
    for _ in range(room.posters):
        left, top = int(rng.uniform(0.36, 0.6) * wide), int(rng.uniform(0.3, 0.65) * high)
        right = left + int(rng.uniform(0.05, 0.2) * wide)
        bottom = top + int(rng.uniform(0.03, 0.2) * high)
        tone = np.array(room.wall) * (1 + room.contrast * rng.uniform(-1.0, 0.6, 3))
        image[top:bottom, left:right] = tone


def _pattern(rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Returns noise with spots of 1 to 8 pixels and unit standard deviation."""
    layers = [cv2.GaussianBlur(rng.standard_normal(shape), (0, 0), s) for s in (1.0, 3.0, 8.0)]
    noise = sum(layer / layer.std() for layer in layers)
    return np.asarray(noise / np.std(noise))


def paint_surroundings(scene: Scene, path: Path) -> None:
    """Writes a spherical image of what the cup reflects: walls, ceiling, window, lamp."""
    room = scene.room
    high, wide = 200, 400
    tone = np.linspace(1.15, 0.5, high)[:, None, None] * np.ones((1, wide, 1))
    image = tone * room.behind * np.array([0.9, 0.9, 0.88])
    rng = np.random.default_rng(room.seed + 50)
    for low, size in ((int(rng.uniform(10, 150)), 34), (int(rng.uniform(200, 340)), 22)):
        image[62:100, low : low + size] = 1.0
        image[62:100, low + size // 2 - 1 : low + size // 2 + 1] = 0.3
    image[5:16] = 0.95
    image = cv2.GaussianBlur(image, (0, 0), 2.0)
    cv2.imwrite(str(path), to_srgb(image)[..., ::-1])


def _surroundings(scene: Scene, shift: float) -> str:
    """Returns board, table, surroundings and lamps as POV-Ray text."""
    room, cup = scene.room, scene.cup
    top = -cup.fill - cup.base - 0.2
    turn = scene.camera.azimuth + 90
    lamp = math.radians(room.lamp_azimuth)
    wide, high = BOARD
    return (
        "#declare Flat = finish { ambient 0 diffuse 0 emission 1 }\n"
        'sphere { 0, 4000 hollow pigment { image_map { png "around.png" map_type 1 interpolate 2 }'
        " rotate <90,0,0> } finish { Flat } no_shadow }\n"
        'polygon { 5, <0,0>,<1,0>,<1,1>,<0,1>,<0,0> pigment { image_map { png "board.png" once '
        f"interpolate 2 }} }} finish {{ Flat }} translate <-0.5,-0.5,0> scale <{wide},{high},1> "
        f"rotate <90,0,0> translate <{shift},700,{high / 2 - 750}> rotate <0,0,{turn}> "
        "no_shadow }\n"
        f"box {{ <-420,-330,{top - 40}>, <420,330,{top}> pigment {{ bozo scale 25 color_map {{ "
        f"[0 rgb {_vec(room.table)}] [1 rgb {_vec(room.table)}*1.12] }} }} "
        f"finish {{ ambient 0 diffuse 0.75 emission 0.4 }} rotate <0,0,{turn}> }}\n"
        f"light_source {{ <{1500 * math.cos(lamp):.1f},{1500 * math.sin(lamp):.1f},1800> "
        f"rgb {room.sun} }}\n"
        f"light_source {{ <{-900 * math.cos(lamp):.1f},{900 * math.sin(lamp):.1f},1500> "
        f"rgb {0.5 * room.sun} shadowless }}\n"
    )


def photo_text(
    scene: Scene, wave: Surface, size: tuple[int, int], shift: float, folder: Path
) -> str:
    """Returns the POV-Ray text of a scene as a camera photographs it."""
    liquid = scene.liquid
    look = (
        f"texture {{ pigment {{ rgb {_vec(liquid.colour)} transmit {1 - liquid.opacity} }} "
        f"finish {{ ambient 0 diffuse {1 - liquid.glow} emission {liquid.glow} "
        "reflection { 0, 1 fresnel on } conserve_energy } }"
    )
    glass = (
        "texture { pigment { rgbt <1,1,1,1> } finish { ambient 0 diffuse 0 specular 0.3 "
        "roughness 0.002 reflection { 0, 1 fresnel on } conserve_energy } } "
        f"interior {{ ior {scene.cup.index} }} hollow"
    )
    drops = _drops(scene) if scene.droplets else ""
    return (
        "#version 3.7;\nglobal_settings { assumed_gamma 1 max_trace_level 9 adc_bailout 0.012 }\n"
        + _camera(scene.camera, size)
        + "#declare Above = "
        + surface_mesh(wave, scene.cup.rim + 10, scene.cup.meniscus)
        + _cup(scene, glass, look, look, drops)
        + _dirt(scene)
        + _glass_behind(scene, glass)
        + _label(scene, folder)
        + _surroundings(scene, shift)
    )


def mask_text(scene: Scene, wave: Surface, size: tuple[int, int]) -> str:
    """Returns the POV-Ray text for a mask: red liquid, green free surface, blue floor."""
    flat = "finish { ambient 0 diffuse 0 emission 1 }"
    floor = -scene.cup.fill + 0.02
    side = (
        "texture { pigment { gradient z color_map { [0 rgb <0,0,1>] [0.5 rgb <0,0,1>] "
        f"[0.5 rgb <1,0,0>] [1 rgb <1,0,0>] }} scale 400 translate <0,0,{floor - 200}> }} "
        f"{flat} }}"
    )
    free = f"texture {{ pigment {{ rgb <0,1,0> }} {flat} }}"
    glass = (
        "texture { pigment { rgbt <1,1,1,1> } finish { ambient 0 diffuse 0 } } "
        f"interior {{ ior {scene.cup.index} }} hollow"
    )
    return (
        "#version 3.7;\nglobal_settings { assumed_gamma 1 max_trace_level 12 }\n"
        + _camera(scene.camera, size)
        + "#declare Above = "
        + surface_mesh(wave, scene.cup.rim + 10)
        + _cup(scene, glass, side, free, "")
    )


def run(
    text: str, size: tuple[int, int], folder: Path, smooth: bool,
    rows: tuple[int, int] | None = None,
) -> Image:  # fmt: skip
    """Renders POV-Ray text in `folder`; returns linear RGB in [0, 1], (H, W, 3).

    Args:
        text: the scene.
        size: width and height of the picture.
        folder: where POV-Ray works.
        smooth: whether edges are sampled finer.
        rows: first row, and the row after the last one, to draw; None: all. The rest is black.

    Raises:
        RenderError: POV-Ray failed; the message has its last lines.
    """
    (folder / "scene.pov").write_text(text)
    out = folder / "scene.png"
    out.unlink(missing_ok=True)
    command = [
        *("povray", "+Iscene.pov", "+Oscene.png", "+WT1", "-D", "-V"),
        *(f"+W{size[0]}", f"+H{size[1]}", "+FN16", "File_Gamma=1.0"),
        *(("+A0.08", "+AM2", "+R2") if smooth else ("-A",)),
        *((f"+SR{rows[0] + 1}", f"+ER{rows[1]}") if rows else ()),
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode or not out.exists():
        tail = " | ".join(done.stderr.strip().splitlines()[-8:])
        raise RenderError(f"povray failed in {folder}: {tail}")
    image = cv2.imread(str(out), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise RenderError(f"{out}: is no image")
    return np.asarray(image[..., :3][..., ::-1] / 65535.0, np.float32)

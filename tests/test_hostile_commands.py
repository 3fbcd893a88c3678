"""Tests that commands refuse impossible options and damaged files in one line, exit code 2."""

import gzip
import random
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.path import path_through

MODEL = """version: 1
container: {shape: cylinder, radius: 0.04, fill_height: 0.06, rim_height: 0.11}
liquid: {density: 998.2, kinematic_viscosity: 1.0e-06}
"""
ROWS = "".join(f"{0.01 * k},{k % 3},0,0\n" for k in range(60))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Makes a folder with a model, a motion and a folder of runs the current one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").write_text(MODEL)
    (tmp_path / "motion.csv").write_text("t,ax,ay,az\n" + ROWS)
    (tmp_path / "runs").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("plan model.yaml --straight 1e300 --limit 0.02 -o p.csv", "must be at most 10 m"),
        ("plan model.yaml --straight 400000mm --limit 1e9m -o p.csv", "must be at most 100 m"),
        ("plan model.yaml --straight 300 --limit 0.02 -o p.csv", "did you mean 300 mm, 0.3?"),
        ("plan model.yaml --straight 0.1 --velocity-scaling 0.5 --limit 0.02 -o p.csv",
         "--velocity-scaling: needs the robot"),
        ("plan model.yaml --straight 0.1 --acceleration-scaling 0.5 --limit 0.02 -o p.csv",
         "--acceleration-scaling: needs the robot"),
        ("predict model.yaml motion.csv --limit 1e300", "must be at most 1 m"),
        ("predict model.yaml motion.csv --epsilon=-1", "must be 0 to 1"),
        ("mounting bag --sensor-to-origin 1e300 0 0", "must be at most 5 m"),
        ("mounting bag --sensor-rotation 1e300 0 0", "must be -6.3 to 6.3 rad"),
        ("motion quintic --speed 60 --stroke 0 -o m.csv", "must be at least 0.001 mm"),
        ("motion quintic --speed 60 --stroke 1e-300 -o m.csv", "must be at least 0.001 mm"),
        ("modes model.yaml -o motion.csv", "motion.csv: a model must end in .yaml or .yml"),
        ("predict model.yaml motion.csv --page model.yml", "model.yml: a page must end in .html"),
        ("predict model.yaml motion.csv -o model.yml", "model.yml: a table must end in .csv"),
        ("query --page model.yaml", "model.yaml: a page must end in .html"),
        ("replay bag --junit model.yaml", "model.yaml: the checks' results must end in .xml"),
        ("calibrate still.png --fov 30 -o motion.csv", "a camera's file must end in .yaml"),
        ("intrinsics still.png --board 9x6 --square 0.02 -o motion.csv", "must end in .yaml"),
        ("new n --diameter 0.08 --fill-height 0.06 --wall 1e-300", "must be 1e-05 to 0.05 m"),
        ("export bag --list --urdf none.urdf", "--urdf: is not used with --list"),
        ("store runs --quota nan", "nan bytes is no size"),
        ("store runs --quota inf", "inf bytes is no size"),
        ("store runs --quota 20", "did you mean 20GB?"),
    ],
)  # fmt: skip
def test_an_impossible_option_is_refused_in_one_line(folder, capsys, line, told):
    try:
        code = main(line.split())
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("line", ["store runs --quota 0", "store runs --quota 20GB"])
def test_a_possible_quota_is_taken(folder, line):
    assert main(line.split()) == 0


@pytest.mark.parametrize("value", [1e300, -1e7, float("inf"), float("nan")])
def test_a_waypoint_that_is_nowhere_is_named(value):
    with pytest.raises(
        SloshPlanError, match=r"waypoint 1 has y = .*it must be finite and at most"
    ):
        path_through([[0.0, 0.0, 0.0], [0.1, value, 0.0]])


# --- damaged files ------------------------------------------------------------------------------

ROBOT = (Path(__file__).resolve().parent.parent / "examples/robot.urdf").read_bytes()
BAG = (Path(__file__).resolve().parent.parent / "bags/l/l_0.mcap").read_bytes()
PATH = b"t,rail,shoulder,elbow,wrist\n0,0,0,0,0\n1,0.1,0.2,0.1,0\n2,0,0,0,0\n"
CONTOUR = b"r,z\n0,0\n0.03,0\n0.04,0.1\n"
PROFILE = "container: {shape: revolution, profile: file.csv, fill_height: 0.05}\n"
PICTURE = cv2.imencode(".png", np.tile(np.arange(200, dtype=np.uint8), (150, 1)))[1].tobytes()
FILES = {
    "modes file.yaml": ("file.yaml", MODEL.encode()),
    "predict file.yaml motion.csv --limit 0.02": ("file.yaml", MODEL.encode()),
    "migrate file.yaml": ("file.yaml", MODEL.encode()),
    "modes profile.yaml --count 1": ("file.csv", CONTOUR),
    "simulate model.yaml file.csv -o o.csv": ("file.csv", ("t,ax,ay,az\n" + ROWS).encode()),
    "import table file.csv -o o": ("file.csv", ("t,ax,ay,az\n" + ROWS).encode()),
    "predict model.yaml path.csv --urdf file.urdf --tool-frame cup": ("file.urdf", ROBOT),
    "predict model.yaml file.csv --urdf robot.urdf --tool-frame cup": ("file.csv", PATH),
    "calibrate file.png --model model.yaml --fov 30 -o o.yaml": ("file.png", PICTURE),
    "export file.mcap --list": ("file.mcap", BAG),
    "recover file.mcap -o o": ("file.mcap", BAG),
}
NUMBER = re.compile(rb"(?<![A-Za-z_.\d])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
VALUES = (
    b"0", b"-1", b"nan", b".nan", b"inf", b"1e300", b"1e-300", b"5e-324", b"9" * 22, b"", b"abc",
    b"1,5", b"true", b"null", b"[1,2]", b"60:00", b"1e400", "\u00bd".encode(),
)  # fmt: skip


def damaged(content: bytes, draw: random.Random) -> bytes:
    """Returns a file's content after one mishap."""
    at, end = sorted(draw.randrange(len(content) + 1) for _ in range(2))
    numbers = list(NUMBER.finditer(content)) if len(content) < 10_000 else []
    kind = draw.choice(["number"] * 6 + ["cut", "hole", "twice", "bit", "zeros", "code", "other"])
    if kind == "number" and numbers:
        found = draw.choice(numbers)
        return content[: found.start()] + draw.choice(VALUES) + content[found.end() :]
    if kind in ("cut", "number"):
        return content[:at]
    if kind == "hole":
        return content[:at] + content[end:]
    if kind == "twice":
        return content[:end] + content[at:]
    if kind == "zeros":
        return content[:at] + bytes(min(end - at, 512)) + content[min(end, at + 512) :]
    if kind == "other":
        return draw.choice([b"", b"\n", b"%PDF-1.7\n", PICTURE, CONTOUR, gzip.compress(content)])
    if kind == "code" and content.isascii():
        return content.decode().encode(draw.choice(["utf-16", "utf-16-le", "utf-32", "utf-8-sig"]))
    bits = bytearray(content)
    bits[min(at, len(bits) - 1)] ^= 1 << draw.randrange(8)
    return bytes(bits)


@pytest.mark.parametrize("line", FILES)
def test_a_damaged_file_is_read_or_named_in_one_line(folder, capfd, line):
    name, content = FILES[line]
    (folder / "profile.yaml").write_text(PROFILE)
    (folder / "robot.urdf").write_bytes(ROBOT)
    (folder / "path.csv").write_bytes(PATH)
    for seed in range(12):
        (folder / name).write_bytes(damaged(content, random.Random(f"{line} {seed}")))
        words = [f"o{seed}{word[1:]}" if word in ("o", "o.csv") else word for word in line.split()]
        code = main(words)
        told = capfd.readouterr().err.strip().splitlines()
        assert code in (0, 1, 2), seed
        assert "Traceback" not in "".join(told), seed
        if code == 2:
            remarks = ("note:", "warning:", "%")
            faults = [text for text in told if not any(one in text for one in remarks)]
            assert len(faults) == 1, (seed, told)


def test_a_prism_whose_modes_take_long_says_so_once(folder, capfd, monkeypatch):
    monkeypatch.setattr("slosh_shapes.solver.read", lambda key: None)
    corners = "[[0.04, 0.031], [-0.04, 0.031], [-0.04, -0.031], [0.04, -0.031]]"
    shape = f"{{shape: prism, outline: {corners}, fill_height: 0.05}}"
    (folder / "tray.yaml").write_text(f"container: {shape}\n")
    for told in ("slosh modes: note: computing the modes of a prism once: up to a minute\n", ""):
        assert main(["modes", "tray.yaml", "--count", "1"]) == 0
        assert capfd.readouterr().err == told

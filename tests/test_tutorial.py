"""Tests the first-steps pages by typing their commands; the stated output appears."""

import json
import math
import re

import cv2
import numpy as np
import pytest
import tutorial
from pages.commands import Block, Command, blocks_of, not_said
from pages.shell import Shell
from stand_in import CAMERA, view_of

from slosh_camera.calibrate.camera_file import read_calibration
from slosh_model.model_text import read_model

pytestmark = pytest.mark.timeout(600)
LONGEST = 300.0


@pytest.fixture(scope="module")
def terminal(tmp_path_factory):
    """Yields a shell with an empty home, and the folder in which the pages are followed."""
    home = tmp_path_factory.mktemp("home")
    with Shell(tutorial.ROOT, tutorial.environment(home), LONGEST) as shell:
        yield shell, home / "sloshing"


@pytest.fixture(scope="module")
def cup(terminal):
    """Returns the folder after the commands of the first page."""
    list(tutorial.type_page(terminal[0], "cup"))
    return terminal[1]


@pytest.fixture(scope="module")
def camera(terminal, cup):
    """Returns the folder after the commands of the second page."""
    list(tutorial.type_page(terminal[0], "camera"))
    return cup


@pytest.fixture(scope="module")
def robot(terminal, camera):
    """Returns the folder after the commands of the third page."""
    list(tutorial.type_page(terminal[0], "robot"))
    return camera


def test_my_cup_tells_how_high_the_liquid_rises(cup):
    assert read_model(cup / "cup" / "model.yaml").container.size == 0.04
    heights = np.genfromtxt(cup / "heights.csv", delimiter=",", names=True)
    assert 0.003 < heights["msh"].max() < 0.02
    assert cv2.imread(str(cup / "heights.png")) is not None


@pytest.mark.long
def test_my_camera_is_calibrated_as_it_is(camera):
    """Against the stand-in camera: what its pose and lens make of heights, and the lens itself."""
    assert (camera / "board.pdf").read_bytes().startswith(b"%PDF")
    found = read_calibration(camera / "cup" / "camera.yaml").view
    truth = view_of(read_model(camera / "cup" / "model.yaml"))
    assert (found.camera.fx, found.camera.fy) == pytest.approx(CAMERA.focal, rel=0.01)
    azimuths = truth.camera_azimuth + np.linspace(-1.0, 1.0, 9)
    for level in (-0.01, 0.0, 0.01):
        seen, true = (view.project_wall(azimuths, level) for view in (found, truth))
        assert np.abs(seen - true).max() < 1.0  # px, of 3 in a millimetre
    table = np.genfromtxt(camera / "footage.csv", delimiter=",", names=True, usecols=(0, 2))
    crest = 0.15 * 0.04
    swing = crest * np.exp(-0.4 * table["t"]) * np.abs(np.cos(6.0 * math.pi * table["t"]))
    assert np.abs(table["msh"] - swing).max() < 5e-4
    for picture in ("pose.png", "footage.png"):
        assert cv2.imread(str(camera / picture)) is not None


@pytest.mark.long
def test_my_robot_ends_with_a_report_of_measured_against_estimated(robot):
    latest = robot / "out" / "cell" / "latest"
    result = json.loads((latest / "result.json").read_text())
    # A busy machine drops images, and says so among the problems.
    assert result["nothing_because"] == []
    assert f"{robot}/cup/camera.yaml" in result["in_force"]["calibration"]
    sigma = {one["name"]: one["sigma"] for one in result["agreements"]}
    assert sigma["3D-NL / camera"] < 5e-4
    report = (latest / "report.html").read_text(encoding="utf-8")
    assert re.search(
        r"measured 5\.\d+ mm at 0\.\d+ s; 3D-L \d\.\d+ mm .*; 3D-NL 5\.\d+ mm", report
    )
    assert (robot / "again" / "bag.html").is_file()


def test_the_pages_state_how_long_they_take_and_what_stands_in():
    for page in tutorial.PAGES:
        text = (tutorial.ROOT / tutorial.path_of(page)).read_text(encoding="utf-8")
        assert re.search(r"commands(?:\s+take)?\s+\d+ s on two cores", text), page
        stands_in = any("stand_in.py" in command.text for command in commands_of(page))
        assert stands_in == bool(re.search("Without a (camera|robot),", text)), page


def commands_of(page):
    path = tutorial.ROOT / tutorial.path_of(page)
    return [command for block in blocks_of(path) for command in block.commands]


def test_a_page_is_read_as_people_read_it(tmp_path):
    (tmp_path / "page.md").write_text(
        'Type\n\n```sh\n# a remark\none \\\n    more\n\ntwo  # Ctrl-C after "the end"\n```\n\n'
        "```\nanswer 1.0 mm\n```\n\n```yaml\nnot: typed\n```\n"
    )
    assert blocks_of(tmp_path / "page.md") == [
        Block((Command("one more", 5), Command("two", 8, "the end")), ("answer 1.0 mm",))
    ]


@pytest.mark.parametrize(
    ("said", "holds"),
    [
        ("peak 6.5 mm, out/a/b", True),
        ("peak  6.5 mm, out/c", True),
        ("peak 9.0 mm, out/a/b", False),
        ("peak 6.5 cm, out/a/b", False),
        ("", False),
    ],
)
def test_a_shown_answer_is_compared_with_what_is_printed(said, holds):
    assert (not_said(("peak 6.0 mm, out/…",), f"before\n{said}\n") == []) == holds


@pytest.mark.long
def test_a_shell_keeps_folder_and_variables_and_can_be_interrupted(tmp_path):
    with Shell(tmp_path, tutorial.environment(tmp_path), LONGEST) as shell:
        assert shell.type("mkdir a && cd a && export A=1").code == 0
        assert shell.type("echo $A $PWD").said == f"1 {tmp_path}/a\n"
        waits = "python3 -c 'import time; print(\"up\", flush=True); time.sleep(99)'"
        assert shell.type(waits, ctrl_c_after="up").code == 130
        assert shell.type("echo still here").said == "still here\n"

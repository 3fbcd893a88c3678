"""Tests a live cell and its page with file names that try to inject text."""

import json
import shutil
import signal
import urllib.request
from pathlib import Path

import pytest
import yaml

from slosh_bringup.processes import config_folder
from slosh_testing.live_processes import LiveProcess, free_port, live_process, recorded, robot
from slosh_testing.reports import CONTROL, EVIL, Page, has_forged_line

BAG = Path(__file__).resolve().parents[1] / "bags" / "l"
pytestmark = pytest.mark.timeout(200)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Creates a folder with an injecting name, and a cell in it."""
    made = tmp_path / EVIL
    made.mkdir()
    cell = {"model": f"{EVIL}-model.yaml", "calibration": f"{EVIL}-camera.yaml"}
    for kind, name in cell.items():
        source = "model.yaml" if kind == "model" else "camera.yaml"
        shutil.copy(config_folder() / source, made / name)
    shutil.copy(config_folder() / "still.png", made / "still.png")
    (made / f"{EVIL}-own.yaml").write_text("/**/monitor: {ros__parameters: {warn_share: 0.7}}")
    cell["parameters"] = f"{EVIL}-own.yaml"
    (made / f"{EVIL}-cell.yaml").write_text(yaml.safe_dump(cell))
    return made


@pytest.mark.long
def test_a_cell_of_hostile_names_runs_and_says_so_plainly(
    domain: int, tmp_path: Path, folder: Path
) -> None:
    port = free_port()
    words = ["--config", str(folder / f"{EVIL}-cell.yaml"), "-o", str(folder / f"{EVIL}-out")]
    output = tmp_path / "words"
    moves = robot(domain, motion="l", repeat="20")
    with moves, live_process("cell", *words, "--watch", str(port), output=output) as cell:
        run = folder / f"{EVIL}-out" / "latest"
        cell.wait_until_ready()
        cell.wait_for_recording(run / "bag", recorded(run / "bag") + 2_000_000)
        assert_plain(served(port))
        cell.process.send_signal(signal.SIGTERM)
        assert cell.end() == 0, cell.said
        assert_says_nothing_forged(cell)
    for log in (run / "logs").iterdir():
        assert not has_forged_line(log.read_text())
    assert_plain((run / "report.html").read_text())
    kept = yaml.safe_load((run / "settings.yaml").read_text())
    assert kept["monitor"]["parameters"]["warn_share"] == 0.7
    assert not json.loads((run / "result.json").read_text())["nothing_because"]


def test_a_recording_of_a_hostile_name_is_watched_and_said_plainly(
    tmp_path: Path, folder: Path
) -> None:
    shutil.copytree(BAG, folder / f"{EVIL}-bag")
    port = free_port()
    words = ("watch", str(folder / f"{EVIL}-bag"), "--port", str(port))
    with live_process(*words, output=tmp_path / "words") as page:
        page.wait_for(lambda: "Ctrl-C to stop" in page.said, "the page")
        assert_plain(served(port))
        page.process.send_signal(signal.SIGINT)
        assert page.end() == 0
        assert_says_nothing_forged(page)


def served(port: int) -> str:
    """Returns the HTML page that the cell serves."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=30) as answer:
        return str(answer.read().decode())


def assert_plain(page: str) -> None:
    """Asserts that no element of a page comes from a file name."""
    read = Page()
    read.feed(page)
    assert not read.hacked


def assert_says_nothing_forged(running: LiveProcess) -> None:
    assert not has_forged_line(running.said)
    assert not CONTROL & set(running.said)

"""Two clicks on the page of `slosh calibrate --page` make the command that writes camera.yaml."""

import shlex

import cv2
import numpy as np
import pytest
from live_browser import LiveBrowser

from slosh_bringup.cli.main import main
from slosh_camera.calibrate.camera_file import read_any_calibration

MODEL = "container: {shape: cylinder, radius: 0.06, fill_height: 0.07}\n"
CLICK = """(([u, v]) => {
  const still = document.getElementById("still"), box = still.getBoundingClientRect();
  const scale = box.width / still.naturalWidth;
  still.dispatchEvent(new MouseEvent("click", {
    bubbles: true, clientX: box.left + (u + 0.5) * scale, clientY: box.top + (v + 0.5) * scale}));
  return document.getElementById("command").textContent;
})"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").write_text(MODEL)
    cv2.imwrite(str(tmp_path / "my still.png"), np.full((380, 440), 200, np.uint8))
    return tmp_path


def test_two_clicks_make_the_command(folder, capsys):
    words = ["--page", "clicks.html", "--model", "model.yaml", "-o", "camera.yaml"]
    assert main(["calibrate", "my still.png", *words]) == 0
    assert "clicks.html: open it" in capsys.readouterr().out
    with LiveBrowser() as browser:
        page = browser.open((folder / "clicks.html").as_uri(), 900, 1200)
        page.wait_until("still.complete && still.naturalWidth === 440")
        page.value(f"{CLICK}([340.0, 200.0])")  # the right end first
        command = page.value(f"{CLICK}([90.0, 200.0])")
        assert command.startswith("slosh calibrate 'my still.png' --scale ")
        clicked = [float(word) for word in shlex.split(command)[4:8]]
        assert clicked == pytest.approx([90.0, 200.0, 340.0, 200.0], abs=0.7)  # a screen's pixel
        command = page.value(f"{CLICK}([100.0, 200.0])")  # moves the nearer end
        assert page.complaints == []
    assert main(shlex.split(command)[1:]) == 0
    scale = float(capsys.readouterr().out.split()[1])
    assert scale == pytest.approx(0.5, abs=0.003)
    assert read_any_calibration(folder / "camera.yaml").view.box.fill_height == 0.07

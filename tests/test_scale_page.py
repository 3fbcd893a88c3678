"""Tests that clicks on the pages of `slosh calibrate` and `slosh new` make commands."""

import shlex

import cv2
import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_camera.calibrate.camera_file import read_any_calibration
from slosh_model.model_text import read_model

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


def test_two_clicks_make_the_command(browser, folder, capsys):
    words = ["--page", "clicks.html", "--model", "model.yaml", "-o", "camera.yaml"]
    assert main(["calibrate", "my still.png", *words]) == 0
    assert "clicks.html: open it" in capsys.readouterr().out
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


PLACE = """(([u, v]) => {
  const still = document.getElementById("still"), box = still.getBoundingClientRect();
  const scale = box.width / still.naturalWidth;
  return [box.left + (u + 0.5) * scale, box.top + (v + 0.5) * scale];
})"""
OUTER = ((0.032, 0.0), (0.035, 0.03), (0.04, 0.07), (0.044, 0.1))
"""A cup's outside (r, z) from the floor up [m], in a picture of 0.1 mm per pixel."""


def press(page, key):
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key=key)


def click(page, pixel):
    """Moves a real mouse pointer to a pixel of the image, and clicks."""
    x, y = page.value(f"{PLACE}({list(pixel)})")
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    for kind in ("mousePressed", "mouseReleased"):
        page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)


def test_a_mouse_draws_the_outline_of_a_new_container(browser, folder, capsys):
    pixels = [(800.0 + 1e4 * r, 1100.0 - 1e4 * z) for r, z in OUTER]
    rim = pixels[-1]
    photograph = np.full((1200, 1600, 3), 190, np.uint8)
    sides = [*pixels, *((1600.0 - u, v) for u, v in pixels[::-1])]
    cv2.fillPoly(photograph, [np.rint(sides).astype(np.int32)], (70, 60, 50))
    cv2.imwrite("photo.png", photograph)
    words = ["new", "cup", "--outline", "photo.png", "--across", "0.088", "--fill-height", "0.05"]
    assert main([*words, "--page", "clicks.html"]) == 0
    page = browser.open((folder / "clicks.html").as_uri(), 900, 1200)
    page.wait_until("still.complete && still.naturalWidth === 1600")
    click(page, rim)  # the right end first
    click(page, (1600.0 - rim[0], rim[1]))
    assert page.value("command.textContent") == "2 more to click"
    click(page, (1000.0, 300.0))  # a slip, taken back
    press(page, "Backspace")
    for pixel in pixels[-2::-1]:
        click(page, pixel)
    before = page.value("command.textContent")
    press(page, "ArrowLeft")
    command = page.value("command.textContent")
    assert page.complaints == []
    numbers = [[float(word) for word in shlex.split(text)[10:]] for text in (before, command)]
    clicked = np.reshape(numbers[0], (-1, 2))
    expected = [(1600.0 - rim[0], rim[1]), rim, *pixels[-2::-1]]
    np.testing.assert_allclose(clicked, expected, atol=2.0)  # a screen's pixel
    assert numbers[1][-2] == pytest.approx(numbers[0][-2] - 0.1, abs=0.06)
    capsys.readouterr()
    assert main(shlex.split(command)[1:]) == 0
    container = read_model(folder / "cup" / "model.yaml").container
    assert container.size == pytest.approx(0.0375, abs=3e-4)
    assert container.rim_height == pytest.approx(0.1, abs=3e-4)

"""Renders an HTML page with a real browser, without a screen and without a network.

    tools/run python tools/headless_browser.py PAGE.html -o PAGE.png [--width 390] [--dark]
    tools/run python tools/headless_browser.py PAGE.html -o PAGE.pdf

A page is looked at in a frame of a page around it: so one start of the browser sees it at several
widths, narrower than the browser's own narrowest window, and in both colour schemes.
"""

from __future__ import annotations

import argparse
import html
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-dev-shm-usage",
    "--disable-extensions",
    "--disable-sync",
    "--no-default-browser-check",
    "--no-first-run",
    "--hide-scrollbars",
    "--enable-logging=stderr",
)
TIMEOUT = 90.0
"""A loaded machine takes its time to start a browser [s]."""
AROUND = """<!DOCTYPE html><html><head><meta charset="utf-8"><link rel="icon" href="data:,">
<style>body {{ margin: 0 }} iframe {{ display: block; border: 0 }}</style></head><body>{frames}
<script>
const look = (document, window) => {{ {script} }};
const seen = [];
addEventListener("load", () => {{
  for (const frame of document.querySelectorAll("iframe"))
    seen.push(look(frame.contentDocument, frame.contentWindow));
  const text = document.createElement("pre");
  text.id = "seen";
  text.textContent = JSON.stringify(seen);
  document.body.append(text);
}});
</script></body></html>"""


@dataclass(frozen=True, slots=True)
class View:
    """An HTML page with the frame size and colour mode in which it is displayed.

    Attributes:
        page: its HTML text.
        width, height: of the frame [CSS px].
        dark: whether the reader prefers dark colours.
    """

    page: str
    width: int = 1280
    height: int = 900
    dark: bool = False


@dataclass(frozen=True, slots=True)
class Seen:
    """What scripts returned and what pages logged in the browser.

    Attributes:
        values: what the script returned for each view.
        console: errors and warnings that the pages left in the console.
    """

    values: list[Any]
    console: list[str]


def find_browser() -> str | None:
    """Returns the path of an installed browser, or None if there is none."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def look(views: Sequence[View], script: str) -> Seen:
    """Loads HTML pages in one browser and runs a script in each of them.

    Args:
        views: at least one.
        script: body of a JavaScript function of `document` and `window`; returns what JSON holds.

    Raises:
        RuntimeError: no browser, or it gave no answer.
    """
    with tempfile.TemporaryDirectory() as name:
        around = _around(Path(name), views, script)
        process = _run(["--dump-dom", around.as_uri()], Path(name))
    found = re.search(r'<pre id="seen">(.*?)</pre>', process.stdout, flags=re.DOTALL)
    if found is None:
        raise RuntimeError(f"the browser gave no answer: {process.stderr[-500:]}")
    return Seen(json.loads(html.unescape(found.group(1))), console(process.stderr))


def screenshot(view: View, target: Path) -> None:
    """Renders an HTML page in a given view as a PNG image."""
    with tempfile.TemporaryDirectory() as name:
        around = _around(Path(name), [view], "return null;")
        size = f"--window-size={view.width},{view.height}"
        _run([size, f"--screenshot={target.absolute()}", around.as_uri()], Path(name))


def print_pdf(page: str, target: Path) -> None:
    """Prints an HTML page to a PDF file."""
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "page.html"
        file.write_text(page, encoding="utf-8")
        arguments = ["--no-pdf-header-footer", f"--print-to-pdf={target.absolute()}"]
        _run([*arguments, file.as_uri()], Path(name))


def console(log: str) -> list[str]:
    """Extracts the pages' console messages from the browser's log."""
    return re.findall(r":(?:INFO|WARNING|ERROR):CONSOLE[^\]]*\] (.*)", log)


def _around(folder: Path, views: Sequence[View], script: str) -> Path:
    frames = "".join(
        f'<iframe srcdoc="{html.escape(view.page)}" style="width: {view.width}px;'
        f' height: {view.height}px; color-scheme: {"dark" if view.dark else "light"}"></iframe>'
        for view in views
    )
    file = folder / "around.html"
    file.write_text(AROUND.format(frames=frames, script=script), encoding="utf-8")
    return file


def _run(arguments: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
    browser = find_browser()
    if browser is None:
        raise RuntimeError(f"no browser found; one of {', '.join(BROWSERS)} is needed")
    command = [browser, *FLAGS, f"--user-data-dir={folder / 'profile'}", *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, encoding="utf-8", timeout=TIMEOUT, check=True
    )


def main() -> int:
    """Renders an HTML page as PNG or prints it as PDF."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("page", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, help="PNG or PDF file")
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=4000)
    parser.add_argument("--dark", action="store_true")
    arguments = parser.parse_args()
    page = arguments.page.read_text(encoding="utf-8")
    if arguments.output.suffix == ".pdf":
        print_pdf(page, arguments.output)
    else:
        view = View(page, arguments.width, arguments.height, arguments.dark)
        screenshot(view, arguments.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())

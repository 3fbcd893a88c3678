"""Controls a real browser without a screen, to view pages that a server provides.

    tools/run python tools/live_browser.py URL -o PAGE.png [--width 390] [--dark] [--wait JS]

The browser is asked over its debugging protocol: what a page's script gives, when something has
come true, and what it looks like.
"""

from __future__ import annotations

import argparse
import base64
import json
import subprocess
import sys
import tempfile
import time
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from headless_browser import FLAGS, find_browser
from websockets.sync.client import ClientConnection, connect

PATIENCE = 60.0
"""A loaded machine takes its time [s]."""


class LiveBrowser:
    """A running browser with its tabs, used as a context manager."""

    def __enter__(self) -> LiveBrowser:
        browser = find_browser()
        if browser is None:
            raise RuntimeError("no browser found")
        self._tabs = ExitStack()
        self._room = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        profile = Path(self._room.name) / "profile"
        own = (f"--user-data-dir={profile}", "--remote-debugging-port=0", "about:blank")
        self._process = subprocess.Popen(
            [browser, *FLAGS, *own],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        told = profile / "DevToolsActivePort"
        deadline = time.monotonic() + PATIENCE
        while not (told.is_file() and told.read_text().count("\n")):
            if time.monotonic() > deadline or self._process.poll() is not None:
                raise RuntimeError("the browser did not start")
            time.sleep(0.05)
        self._port = int(told.read_text().split("\n", 1)[0])
        return self

    def __exit__(self, *_: object) -> None:
        self._tabs.close()
        self._process.kill()
        self._process.wait()
        self._room.cleanup()

    def open(self, url: str, width: int = 1400, height: int = 1000, *, dark: bool = True) -> Page:
        """Opens a web page in a new tab."""
        asked = urllib.request.Request(
            f"http://127.0.0.1:{self._port}/json/new?about:blank", method="PUT"
        )
        with urllib.request.urlopen(asked, timeout=PATIENCE) as answer:
            target = json.load(answer)
        tab = connect(target["webSocketDebuggerUrl"], max_size=None)
        page = Page(self._tabs.enter_context(tab))
        page.call("Page.enable")
        page.call("Runtime.enable")
        page.call("Log.enable")
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        page.call("Emulation.setDeviceMetricsOverride", **metrics)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        page.call("Emulation.setEmulatedMedia", features=[scheme])
        page.call("Page.navigate", url=url)
        page.wait_until("location.href !== 'about:blank' && document.readyState === 'complete'")
        return page


class Page:
    """A browser tab with a web page.

    Attributes:
        complaints: errors that its console has shown.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._number = 0
        self.complaints: list[str] = []

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Sends a command of the debugging protocol to the tab; returns the result."""
        self._number += 1
        asked = {"id": self._number, "method": method, "params": parameters}
        self._connection.send(json.dumps(asked))
        while True:
            answer = json.loads(self._connection.recv(timeout=PATIENCE))
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                result: dict[str, Any] = answer["result"]
                return result
            self._note(answer)

    def value(self, script: str) -> Any:
        """Evaluates a JavaScript expression in the tab; waits for a promise's result."""
        answer = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{script}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def wait_until(self, script: str, patience: float = PATIENCE) -> Any:
        """Waits until a JavaScript expression is true in the tab; returns its value."""
        deadline = time.monotonic() + patience
        while not (found := self.value(script)):
            if time.monotonic() > deadline:
                raise RuntimeError(f"waited in vain for {script}")
            time.sleep(0.02)
        return found

    def screenshot(self, target: Path) -> None:
        """Saves the tab's content as a PNG image."""
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        target.write_bytes(base64.b64decode(shot["data"]))

    def _note(self, event: dict[str, Any]) -> None:
        about = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            self.complaints.append(str(about["exceptionDetails"]))
        entry = about.get("entry", {})
        if event.get("method") == "Log.entryAdded" and entry.get("level") == "error":
            self.complaints.append(f"{entry.get('text')} {entry.get('url', '')}")


def main() -> int:
    """Opens a web page and saves it as a PNG image."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("url")
    parser.add_argument("-o", "--output", type=Path, required=True, help="PNG file")
    parser.add_argument("--width", type=int, default=1400)
    parser.add_argument("--height", type=int, default=1000)
    parser.add_argument("--dark", action="store_true")
    parser.add_argument("--run", default="", help="JavaScript to run in the page first")
    parser.add_argument("--wait", default="true", help="JavaScript to wait for until true")
    given = parser.parse_args()
    with LiveBrowser() as browser:
        page = browser.open(given.url, given.width, given.height, dark=given.dark)
        if given.run:
            page.value(given.run)
        page.wait_until(given.wait)
        page.screenshot(given.output)
        print("\n".join(page.complaints))
    return 0


if __name__ == "__main__":
    sys.exit(main())

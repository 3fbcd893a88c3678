"""Tests several cells on one host: each page lists all cells, with links to the others."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from live_browser import LiveBrowser
from rclpy.node import Node

from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_msgs.msg import NodeSettings, SloshComparison
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_time
from slosh_testing.live_processes import free_port

pytestmark = pytest.mark.timeout(200)
CELLS = {"/left": (0.004, 0), "/right": (0.018, 1)}
"""Height [m] and state of each cell."""


class Monitors(threading.Thread):
    """Simulates the monitors of both cells."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.node = Node("voices")
        self.silent: set[str] = set()
        self._ended = threading.Event()
        self._out = {
            name: self.node.create_publisher(
                SloshComparison, f"{name}/{topics.COMPARISON}", qos.STREAM_OUT
            )
            for name in CELLS
        }
        for name in CELLS:
            parameters = {"measured_limit": 0.02, "estimated_limit": 0.02}
            document = yaml.safe_dump({"parameters": parameters, "files": {}, "topics": {}})
            settings = self.node.create_publisher(
                NodeSettings, f"{name}/{topics.SETTINGS}", qos.EVENT
            )
            settings.publish(
                NodeSettings(node="monitor", code="c", arithmetic="a", document=document)
            )

    def run(self) -> None:
        while not self._ended.wait(0.05):
            for name, (height, state) in CELLS.items():
                if name in self.silent:
                    continue
                message = SloshComparison(
                    measured=height, estimated_nonlinear=0.5 * height, state=state
                )
                message.header.stamp = to_time(time.time_ns())
                self._out[name].publish(message)

    def end(self) -> None:
        self._ended.set()
        self.join()
        self.node.destroy_node()


@pytest.fixture(scope="module")
def monitors(domain: int) -> Iterator[Monitors]:
    rclpy.init(args=[])
    found = Monitors()
    found.start()
    yield found
    found.end()
    rclpy.try_shutdown()


@pytest.fixture(scope="module")
def ports(
    domain: int, monitors: Monitors, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, int]]:
    """Returns the TCP ports of the web pages, by cell."""
    found = {name: free_port() for name in CELLS}
    groups = []
    try:
        for name, port in found.items():
            folder = tmp_path_factory.mktemp("logs")
            group = NodeGroup(name, folder, node_environment(domain))
            groups.append(group)
            group.__enter__()
            group.start(NodeProcess("watch", parameters={"port": str(port)}))
        yield found
    finally:
        for group in groups:
            group.__exit__(None, None, None)


ROWS = (
    "[...document.querySelectorAll('#cells tr')].map((r) => [...r.cells].map((c) => c.innerText))"
)
LINK = "document.querySelector('#cells a')"


def opened(browser: LiveBrowser, port: int) -> Any:
    deadline = time.monotonic() + 60.0
    while True:
        page = browser.open(f"http://127.0.0.1:{port}/")
        if page.value("document.getElementById('verdict') !== null"):
            return page
        assert time.monotonic() < deadline, "the page is not served"
        time.sleep(0.1)


def test_each_page_lists_all_cells_and_leads_to_the_others(
    browser: LiveBrowser, ports: dict[str, int], monitors: Monitors, tmp_path: Path
) -> None:
    page = opened(browser, ports["/left"])
    page.wait_until(f"{LINK} !== null")
    page.wait_until(f"{ROWS}.every((row) => row[3] === '20.0')")
    left, right = page.value(ROWS)
    assert left[:4] == ["/left", "safe", "4.0", "20.0"]
    assert right[:4] == ["/right", "near limit", "18.0", "20.0"]
    assert left[4].startswith("this page")
    assert page.value(f"{LINK}.textContent") == "/right"
    assert page.value(f"{LINK}.href") == f"http://127.0.0.1:{ports['/right']}/"
    page.value(f"{LINK}.click()")
    page.wait_until(f"location.port === '{ports['/right']}'")
    page.wait_until(f"typeof CLASSES !== 'undefined' && {LINK} !== null")
    assert page.value(f"{LINK}.textContent") == "/left"
    assert page.value("document.getElementById('measured').textContent") == "18.0"


def test_a_cell_that_falls_silent_is_blind_in_the_list(
    browser: LiveBrowser, ports: dict[str, int], monitors: Monitors
) -> None:
    page = opened(browser, ports["/left"])
    page.wait_until(f"{LINK} !== null")
    monitors.silent.add("/right")
    page.wait_until(f"{ROWS}[1][1] === 'blind'")
    assert page.value("document.getElementById('verdict').textContent") == "safe"
    monitors.silent.clear()
    page.wait_until(f"{ROWS}[1][1] === 'near limit'")

"""Tests who can reach a running cell, read its files, and what untrusted texts do."""

import json
import re
import signal
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from slosh_base.files.plain_text import LONGEST
from slosh_bringup.processes import config_folder
from slosh_msgs.msg import NodeSettings
from slosh_msgs_py import qos, topics
from slosh_replay.replay import replay_bag
from slosh_testing.live_processes import LiveProcess, alive, free_port, live_process, robot
from slosh_testing.loopback import Socket, descendants, sockets, waiting_bytes

NODES = ("recorder", "estimator", "camera", "monitor", "watch")
FORGED = "\x1b[31mall is well\nslosh: all is well\x1b]0;title\x07" + "x" * 100_000
DOCUMENTS = (
    "- no settings",
    'parameters: {"\\ud800": 1}\nfiles: {model: "\\ud800"}',
    "parameters: {measured_limit: .nan\nfiles",
)
pytestmark = [pytest.mark.timeout(300), pytest.mark.long]


class Cell(NamedTuple):
    """A running cell: its process, the folder of its runs, and its cell file."""

    process: LiveProcess
    output: Path
    file: Path

    @property
    def run(self) -> Path:
        """Folder of the run's results."""
        first = next(line for line in self.process.said.splitlines() if "this run is in" in line)
        return Path(first.partition("this run is in ")[2])


@pytest.fixture(scope="module")
def cell(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    """Runs a cell with the operator's page and a simulated robot."""
    folder, config = tmp_path_factory.mktemp("cell"), config_folder()
    file = folder / "cell.yaml"
    document = {"model": config / "model.yaml", "calibration": config / "camera.yaml"}
    file.write_text(yaml.safe_dump({key: str(path) for key, path in document.items()}))
    words = ("cell", "--config", str(file), "-o", str(folder / "runs"))
    words += ("--watch", str(free_port()))
    with ExitStack() as stack:
        stack.enter_context(robot(domain, motion="l", repeat="50", fps="15.0"))
        running = stack.enter_context(live_process(*words, output=folder / "words"))
        running.wait_for_nodes(len(NODES))
        running.wait_for_recording(folder / "runs" / "latest" / "bag")
        yield Cell(running, folder / "runs", file)


def test_every_socket_of_a_cell_is_on_this_machine_alone(cell: Cell) -> None:
    """What is not is one that Fast DDS sends from: nobody reads what comes there."""
    held = {(pid, one) for pid in descendants([cell.process.process.pid]) for one in sockets(pid)}
    assert len({pid for pid, _ in held}) == 1 + len(NODES)
    assert any(one.table == "tcp" for _, one in held), "the page"
    strange = {(pid, one) for pid, one in held if not one.is_loopback}
    assert {one.table for _, one in strange} <= {"udp"}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for _, one in strange:
            address = "127.0.0.1" if one.address.is_unspecified else str(one.address)
            stranger.sendto(b"RTPS", (address, one.port))
    time.sleep(0.3)
    assert all(is_unread(pid, one) for pid, one in strange), strange


def is_unread(pid: int, one: Socket) -> bool:
    """Returns whether received bytes still wait at a socket of a process."""
    return waiting_bytes(pid, one.table, one.port) > 0


def test_others_cannot_read_the_recorded_images(cell: Cell) -> None:
    files = list((cell.run / "bag").glob("*.mcap"))
    assert files
    assert not any(file.stat().st_mode & stat.S_IRWXO for file in files)


def test_a_strangers_words_are_one_plain_line_and_end_nothing(cell: Cell) -> None:
    pids = dict(cell.process.nodes())
    rclpy.init()
    try:
        node = rclpy.create_node("stranger", namespace="/slosh")
        health = node.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS)
        settings = node.create_publisher(NodeSettings, topics.SETTINGS, qos.EVENT)
        pairs = [
            KeyValue(key=f"{what} [Hz]", value="\x1b[2J") for what in ("output", "measurement")
        ]
        forged = [
            DiagnosticStatus(level=b"\2", name=f"/slosh/{name}", message=FORGED, values=pairs)
            for name in NODES
        ]

        def told() -> bool:
            # Two in a row agree, between those of the nodes themselves.
            for _ in range(2):
                health.publish(DiagnosticArray(status=forged))
            for name in ("monitor", "camera", "\x1b[31m"):
                for document in DOCUMENTS:
                    settings.publish(NodeSettings(node=name, document=document))
            time.sleep(0.2)
            return "all is well" in cell.process.said

        cell.process.wait_for(told, "the stranger's words")
        node.destroy_node()
    finally:
        rclpy.shutdown()
    time.sleep(0.5)
    assert cell.process.process.poll() is None, cell.process.said
    assert cell.process.nodes() == pids
    assert all(alive(pid) for pid in pids.values())
    said = cell.process.said
    assert "\\x1b[31mall is well\\nslosh: all is well\\x1b]0;title\\x07" in said
    assert max(map(len, said.splitlines())) < 2 * LONGEST
    logs = "".join(file.read_text() for file in (cell.run / "logs").iterdir())
    for text in (said, logs):
        assert not {"\x1b", "\x07"} & set(text)
    assert yaml.safe_load((cell.run / "settings.yaml").read_text()).keys() <= set(NODES)


def test_a_second_cell_is_told_and_has_a_folder_of_its_own(cell: Cell, tmp_path: Path) -> None:
    words = ("cell", "--config", str(cell.file), "-o", str(cell.output))
    with live_process(*words, output=tmp_path / "words") as second:
        line = "run in /slosh, too: their messages are mixed"
        for one in (second, cell.process):
            one.wait_for(lambda one=one: line in one.said, line)
        second.wait_until_ready()
        mixed = re.compile("several publishers on [^:]*/slosh/estimate[,:]")
        cell.process.wait_for(lambda: mixed.search(cell.process.said), "mixed estimates")
        second.process.send_signal(signal.SIGINT)
        second.end()
        assert Cell(second, cell.output, cell.file).run != cell.run
    assert cell.process.process.poll() is None


def test_the_recording_of_all_that_has_its_report_and_replays(cell: Cell) -> None:
    """Is the last one: it ends the cell. In the bag is what the second cell published, too."""
    cell.process.process.send_signal(signal.SIGINT)
    assert cell.process.end() == 1
    (mixed,) = [line for line in cell.process.said.splitlines() if "were mixed on" in line]
    assert "/slosh/estimate (of " in mixed
    result = json.loads((cell.run / "result.json").read_text())
    assert not result.get("nothing_because"), cell.process.said
    assert replay_bag(cell.run / "bag").verification.identical > 0
    page = (cell.run / "report.html").read_text()
    assert "\x1b" not in page

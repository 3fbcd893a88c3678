"""Tests the operator's page in a real browser: it shows the topics' values, to nobody else."""

import math
import os
import signal
import socket
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from websockets.sync.client import connect

from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_msgs.msg import FreeSurface, GovernedMotion, LimitEvent, NodeSettings, SloshComparison
from slosh_msgs_py import qos, topics
from slosh_msgs_py.images import image_message
from slosh_msgs_py.stamps import to_time
from slosh_testing.live_processes import free_port, live_process

BAG = Path(__file__).resolve().parents[1] / "bags" / "l3"
NASTY = "<script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">"
pytestmark = pytest.mark.timeout(200)


class Voices(threading.Thread):
    """Publishes messages of a cell's camera and monitor 50 times a second, for the page.

    Attributes:
        measured: what they say [m].
        speaks: whether they say anything.
        share: of a command that a governor follows; None: there is none.
        images: publishes what the camera sees, not compressed.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.node = Node("voices", namespace="/slosh")
        self.measured, self.state, self.speaks = 0.0123, 0, True
        self.share: float | None = None
        self._ended = threading.Event()
        kinds = (
            (FreeSurface, topics.FREE_SURFACE, qos.STREAM_OUT),
            (SloshComparison, topics.COMPARISON, qos.STREAM_OUT),
            (LimitEvent, topics.LIMIT_EVENT, qos.EVENT),
            (NodeSettings, topics.SETTINGS, qos.EVENT),
            (GovernedMotion, topics.GOVERNED_MOTION, qos.STREAM_OUT),
            (DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS),
        )
        self._out = {
            kind: self.node.create_publisher(*entry) for entry in kinds if (kind := entry[0])
        }
        self.images = self.node.create_publisher(*_image_topic())
        calibration = config_folder() / "camera.yaml"
        self._tell("monitor", {"measured_limit": 0.02, "disagreement_limit": 0.01}, {})
        self._tell(
            "camera", {"calibration": str(calibration)}, {"calibration": calibration.read_text()}
        )

    def run(self) -> None:
        """Publishes until it is stopped."""
        while not self._ended.wait(0.02):
            if self.speaks:
                self._speak()

    def end(self) -> None:
        """Stops publishing."""
        self._ended.set()
        self.join()
        self.node.destroy_node()

    def event(self, kind: int, text: str) -> None:
        """Publishes the start or end of a limit violation."""
        message = LimitEvent(id=1, kind=kind, limit=0.02, peak=0.03, description=text)
        message.header.stamp = to_time(time.time_ns())
        self._out[LimitEvent].publish(message)

    def _tell(self, node: str, parameters: dict, files: dict) -> None:
        document = yaml.safe_dump({"parameters": parameters, "files": files, "topics": {}})
        message = NodeSettings(node=node, code="c", arithmetic="a", document=document)
        self._out[NodeSettings].publish(message)

    def _speak(self) -> None:
        stamp = to_time(time.time_ns())
        nan = math.nan
        compared = SloshComparison(
            measured=self.measured, measured_stddev=1e-4, estimated_linear=nan,
            estimated_nonlinear=self.measured - 0.0011, residual_linear=nan,
            residual_nonlinear=0.0011, sigma_linear=nan, sigma_nonlinear=0.00042,
            epsilon_linear=nan, epsilon_nonlinear=-0.0314, state=self.state,
        )  # fmt: skip
        azimuths = np.linspace(-math.pi, math.pi, 90, dtype=np.float32)
        surface = FreeSurface(
            msh=self.measured, azimuth=0.5, profile_azimuth=azimuths,
            profile_height=(self.measured * np.cos(azimuths - 0.5)).astype(np.float32),
        )  # fmt: skip
        status = DiagnosticStatus(level=b"\x00", name="/slosh/camera", message=NASTY)
        status.values = [
            KeyValue(key="image [Hz]", value="59.9"),
            KeyValue(key=NASTY, value=NASTY),
        ]
        governed = GovernedMotion(share=self.share or 0.0, state=GovernedMotion.LIMITED, safe=True)
        told = (compared, surface, *([] if self.share is None else [governed]))
        for message in told:
            message.header.stamp = stamp
            self._out[type(message)].publish(message)
        self._out[DiagnosticArray].publish(DiagnosticArray(status=[status]))
        picture = image_message(
            np.full((480, 640), 128, np.uint8), "mono8", time.time_ns(), "camera"
        )
        picture.header.stamp = stamp
        self.images.publish(picture)


def _image_topic():
    from sensor_msgs.msg import Image

    return Image, topics.IMAGE, qos.IMAGE_OUT


@pytest.fixture(scope="module")
def voices(domain):
    rclpy.init(args=[])
    found = Voices()
    found.start()
    yield found
    found.end()
    rclpy.try_shutdown()


@pytest.fixture(scope="module")
def cell(domain, voices, tmp_path_factory):
    """Runs the watch node; yields its process group and the port of its page."""
    port = free_port()
    with NodeGroup("/slosh", tmp_path_factory.mktemp("logs"), node_environment(domain)) as group:
        start(group, port)
        yield group, port


def start(group, port):
    group.start(NodeProcess("watch", parameters={"port": str(port)}))
    deadline = time.monotonic() + 60.0
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
            return
        except OSError:
            assert time.monotonic() < deadline, "the page is not served"
            assert not group.ended(), "the node has ended"
            time.sleep(0.05)


def text(page, part):
    return page.value(f"document.getElementById({part!r}).textContent")


class TestLive:
    def test_its_figures_are_the_topics(self, browser, cell, voices):
        page = browser.open(f"http://127.0.0.1:{cell[1]}/")
        page.wait_until("document.getElementById('verdict').textContent === 'safe'")
        assert text(page, "measured") == "12.3"
        assert text(page, "estimated") == "11.2"
        assert text(page, "residual") == "1.1"
        assert text(page, "sigma") == "0.42"
        assert text(page, "epsilon") == "-3.1"
        assert "20.0 mm" in page.wait_until(
            "document.getElementById('measured-limit').textContent"
        )
        page.wait_until("heights.rows[0].length > 20")
        assert page.value("heights.rows[1].every((v) => v === 12.3)")
        # The image, with the line that was found in it.
        page.wait_until("document.getElementById('camera').width === 640")
        voices.measured = 0.0187
        page.wait_until("document.getElementById('measured').textContent === '18.7'")
        voices.measured = 0.0123
        assert page.complaints == []

    def test_an_add_ons_figure_comes_goes_and_is_shown_once(self, browser, cell, voices):
        page = browser.open(f"http://127.0.0.1:{cell[1]}/")
        page.wait_until("document.getElementById('verdict').textContent === 'safe'")
        assert page.value("document.querySelectorAll('.further').length") == 0
        shown = "document.querySelector('.further')?.textContent"
        voices.share = 0.37
        page.wait_until(f"{shown} === 'command followed37 %limited'")
        voices.share = 0.52
        page.wait_until(f"{shown} === 'command followed52 %limited'")
        assert page.value("document.querySelectorAll('.further').length") == 1
        voices.share = None
        page.wait_until("document.querySelectorAll('.further').length === 0")
        assert page.complaints == []

    def test_names_and_sentences_are_text_whatever_they_hold(self, browser, cell, voices):
        page = browser.open(f"http://127.0.0.1:{cell[1]}/")
        voices.event(0, NASTY)
        page.wait_until("document.getElementById('events').children.length > 0")
        page.wait_until("document.getElementById('nodes').children.length > 1")
        assert NASTY in text(page, "events")
        assert NASTY in text(page, "nodes")
        assert page.value("document.querySelectorAll('main script, main img').length") == 0
        assert "owned" not in page.value("document.title")
        assert text(page, "verdict") == "limit exceeded"
        voices.event(1, "back")
        page.wait_until("document.getElementById('verdict').textContent === 'safe'")

    @pytest.mark.parametrize(
        ("state", "word"), [(1, "near limit"), (2, "limit exceeded"), (4, "blind")]
    )
    def test_the_monitors_state_is_read_across_the_room(self, browser, cell, voices, state, word):
        page = browser.open(f"http://127.0.0.1:{cell[1]}/", 390, 800)
        voices.state = state
        page.wait_until(f"document.getElementById('verdict').textContent === {word!r}")
        size = page.value(
            "parseFloat(getComputedStyle(document.getElementById('verdict')).fontSize)"
        )
        assert size >= 27
        assert page.value("document.documentElement.scrollWidth") <= 390
        voices.state = 0

    def test_a_silent_monitor_is_no_safe_cell(self, browser, cell, voices):
        page = browser.open(f"http://127.0.0.1:{cell[1]}/")
        page.wait_until("document.getElementById('verdict').textContent === 'safe'")
        voices.speaks = False
        page.wait_until("document.getElementById('verdict').textContent === 'blind'")
        assert "no message" in text(page, "reason")
        voices.speaks = True
        page.wait_until("document.getElementById('verdict').textContent === 'safe'")

    def test_a_page_says_that_it_has_lost_the_cell_and_comes_back_by_itself(self, browser, cell):
        group, port = cell
        page = browser.open(f"http://127.0.0.1:{port}/")
        page.wait_until("document.getElementById('verdict').textContent === 'safe'")
        os.kill(group.pid("watch"), signal.SIGSTOP)
        page.wait_until("document.getElementById('verdict').textContent === 'no connection'")
        assert page.value("performance.now() - state.heard") < 3000.0
        os.kill(group.pid("watch"), signal.SIGCONT)
        page.wait_until("document.getElementById('verdict').textContent === 'safe'")
        os.kill(group.pid("watch"), signal.SIGKILL)
        page.wait_until("document.getElementById('verdict').textContent === 'no connection'")
        while "watch" not in group.ended():
            time.sleep(0.02)
        group.forget("watch")
        start(group, port)
        page.wait_until("document.getElementById('verdict').textContent === 'safe'")

    def test_a_viewer_that_reads_nothing_holds_nobody_up(self, browser, cell):
        port = cell[1]
        with socket.create_connection(("127.0.0.1", port)) as deaf:
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.sendall(
                f"GET /frames HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
                "Connection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
                "Sec-WebSocket-Version: 13\r\n\r\n".encode()
            )
            page = browser.open(f"http://127.0.0.1:{port}/")
            page.wait_until("heights.rows[0].length > 50")
            assert text(page, "verdict") == "safe"

    @pytest.mark.parametrize(
        "path", ["/files/../state.py", "/files/%2e%2e/state.py", "/files/..%2fstate.py"]
    )
    def test_no_other_file_is_served(self, cell, path):
        with socket.create_connection(("127.0.0.1", cell[1])) as raw:
            raw.sendall(f"GET {path} HTTP/1.0\r\nHost: 127.0.0.1:{cell[1]}\r\n\r\n".encode())
            assert b" 404 " in raw.makefile("rb").readline()

    def test_nothing_can_be_written(self, cell):
        for method in ("POST", "PUT", "DELETE", "PATCH"):
            asked = urllib.request.Request(f"http://127.0.0.1:{cell[1]}/", b"x", method=method)
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(asked, timeout=20.0)
            assert refused.value.code == 405

    def test_what_a_viewer_says_is_not_heard(self, cell):
        with connect(f"ws://127.0.0.1:{cell[1]}/frames") as viewer:
            viewer.send("load_model")
            assert viewer.recv(timeout=20.0)


def test_a_port_that_is_taken_is_told_in_a_line(domain, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        with live_process("watch", "--port", port, output=tmp_path / "words") as running:
            assert running.end() == 2
    # Beside other processes the middleware reports a port file that one of them holds.
    (line,) = (one for one in running.said.splitlines() if "RTPS_TRANSPORT_SHM" not in one)
    assert f"port {port}: Address already in use; choose another port" in line


def test_a_run_whose_page_has_no_port_does_not_begin(domain, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        words = ("demo", "-o", str(tmp_path / "out"), "--watch", port)
        with live_process(*words, output=tmp_path / "words") as running:
            assert running.end() == 2
    (line,) = running.said.strip().splitlines()
    assert line.endswith(f"port {port}: Address already in use; choose another port")
    assert not (tmp_path / "out").exists()


@pytest.mark.long
class TestRecording:
    @pytest.fixture(scope="class")
    @classmethod
    def port(cls, tmp_path_factory):
        port = free_port()
        words = tmp_path_factory.mktemp("watch") / "words"
        with live_process("watch", str(BAG), "--port", str(port), output=words) as running:
            running.wait_for(lambda: "Ctrl-C to stop" in running.said, "the page")
            yield port
            running.process.send_signal(signal.SIGINT)
            assert running.end() == 0, running.said

    def test_it_is_played_and_sought(self, browser, port):
        page = browser.open(f"http://127.0.0.1:{port}/")
        page.wait_until("!document.getElementById('slider').hidden")
        last = page.value("source.about.frames - 1")
        assert last > 50
        # It plays by itself, from shortly before something happens.
        start = page.value("source.about.start")
        assert 0 < start < last
        page.wait_until(f"source.at > {start + 3}")
        page.value("document.getElementById('play').click()")
        assert text(page, "play") == "play"
        page.value(f"source.seek({last})")
        page.wait_until("Math.max(...heights.rows[1]) > 22")
        assert page.value("Math.max(...heights.rows[1])") == pytest.approx(22.3, abs=0.1)
        page.wait_until("document.getElementById('events').textContent.includes('22.3 mm')")
        page.value("source.seek(0)")
        page.wait_until("heights.rows[0].length < 10")
        page.value("document.getElementById('play').click()")
        page.wait_until("source.at > 3")
        assert page.complaints == []

    def test_a_bag_without_a_cell_is_refused_in_a_line(self, tmp_path):
        with live_process("watch", str(tmp_path), output=tmp_path / "words") as running:
            assert running.end() == 2
        assert len(running.said.strip().splitlines()) == 1

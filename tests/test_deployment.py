"""The service's unit and the image's file: what their own linters and this repository know."""

import json
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from slosh_bringup.cli.main import build_parser
from slosh_bringup.live.service_manager import PERIOD
from slosh_bringup.processes import EXIT_WRONG_INPUT
from slosh_msgs_py.node.network import TRANSPORTS, WITHOUT_SHARED_MEMORY

ROOT = Path(__file__).resolve().parent.parent
UNIT = ROOT / "deploy" / "slosh-cell@.service"
IMAGE = ROOT / "deploy" / "Containerfile"
PLACE = "/opt/slosh"
"""Where both have the checkout."""
EXPOSURE = 15
"""Of the hundredths that `systemd-analyze security` may give: it is far below what is usual."""
systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed (systemd)"
)


def analyze(*words):
    return subprocess.run(["systemd-analyze", *words], capture_output=True, text=True)


def values(key):
    """Returns the values of a key in the systemd unit."""
    return re.findall(rf"^{key}=(.*)$", UNIT.read_text(), re.MULTILINE)


@systemd
def test_systemd_takes_the_unit(tmp_path):
    """Every key is known and every program is there, as in a checkout at PLACE."""
    unit = tmp_path / UNIT.name
    unit.write_text(UNIT.read_text().replace(f"ExecStart={PLACE}", f"ExecStart={ROOT}"))
    done = analyze("verify", "--man=no", str(unit))
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
    unit.write_text(unit.read_text().replace("ProtectClock", "ProtectClocks"))
    assert "ProtectClocks" in analyze("verify", "--man=no", str(unit)).stderr


@systemd
def test_the_service_may_do_little():
    if "--offline" not in analyze("--help").stdout:
        pytest.skip("this systemd-analyze rates running services only (before version 250)")
    words = ("security", "--offline=true", "--no-pager", str(UNIT))
    done = analyze(*words, f"--threshold={EXPOSURE}")
    assert done.returncode == 0, done.stdout
    assert analyze(*words, "--threshold=1").returncode != 0  # it does look


def test_its_command_is_one_of_ours_and_its_times_fit():
    (line,) = values("ExecStart")
    run, program, *words = shlex.split(line.replace("%i", "line_1"))
    assert (run, program) == (f"{PLACE}/tools/run", "slosh")
    parsed = build_parser(words[0]).parse_args(words)
    assert parsed.config == Path("/etc/slosh/line_1/cell.yaml")
    assert f"/var/lib/{values('StateDirectory')[0].replace('%i', 'line_1')}" == str(parsed.output)
    assert int(values("WatchdogSec")[0].removesuffix("s")) >= 10 * PERIOD
    assert values("RestartPreventExitStatus") == [str(EXIT_WRONG_INPUT)]


def test_the_image_has_what_the_command_needs():
    text = IMAGE.read_text()
    for source in re.findall(r"^COPY --chown=slosh (\S+) ", text, re.MULTILINE):
        assert (ROOT / source).exists(), source
    assert text.count(f"{PLACE} {PLACE}") == 1
    words = re.search(r"^CMD (\[.*\])$", text, re.MULTILINE)[1]
    build_parser("cell").parse_args(json.loads(words))


def test_the_images_file_is_clean():
    linter = shutil.which("hadolint") or shutil.which("hadolint", path=Path(sys.executable).parent)
    if linter is None:
        pytest.skip("hadolint is not installed (requirements/deployment.txt)")
    done = subprocess.run([linter, str(IMAGE)], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.long
def test_the_services_command_tells_that_it_is_ready_alive_and_stopping(tmp_path):
    """As the unit starts it: by its line, with its variables, a socket and an end by SIGTERM."""
    assert subprocess.run(
        [ROOT / "tools" / "run", "slosh", "new", tmp_path / "cup", "--radius", "0.05",
         "--fill-height", "0.07", "--no-camera", "--namespace", "/served"],
        capture_output=True,
    ).returncode == 0  # fmt: skip
    (line,) = values("ExecStart")
    line = line.replace("%i", "cup").replace(PLACE, str(ROOT))
    line = line.replace("/etc/slosh", str(tmp_path)).replace("/var/lib/slosh", str(tmp_path))
    own = dict(one.split("=", 1) for row in values("Environment") for one in row.split())
    environment = {**os.environ, TRANSPORTS: own[TRANSPORTS]}
    environment["NOTIFY_SOCKET"] = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(environment["NOTIFY_SOCKET"])
        manager.settimeout(300.0)
        process = subprocess.Popen(
            shlex.split(line), env=environment, cwd=tmp_path, start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=(tmp_path / "words").open("w"),
        )  # fmt: skip
        try:
            heard_until(manager, "READY=1")
            assert "WATCHDOG=1" in heard_until(manager, "WATCHDOG=1")
            os.kill(process.pid, signal.SIGTERM)  # KillMode=mixed: the command alone
            heard_until(manager, "STOPPING=1")
            process.wait(120.0)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 1  # no input came, so nothing was estimated
    assert (tmp_path / "cup" / "latest" / "bag").is_dir()


def test_service_and_image_do_without_shared_memory():
    (line,) = re.findall(rf"^ENV {TRANSPORTS}=(.*)$", IMAGE.read_text(), re.MULTILINE)
    assert line == WITHOUT_SHARED_MEMORY
    assert f"{TRANSPORTS}={WITHOUT_SHARED_MEMORY}" in values("Environment")


def heard_until(manager, word):
    """Reads messages sent to systemd's socket until one contains a word."""
    while word not in (lines := manager.recv(2000).decode().splitlines()):
        pass
    return lines

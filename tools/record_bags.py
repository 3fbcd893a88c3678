"""Records the example bags in bags/ with the simulated cell and all its nodes, live.

Each run is real: DDS, camera, estimator, monitor and recorder as on a robot. State anew in the
manifest what they must give with `slosh replay bags --write-manifest`, and look at the difference.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from slosh_bringup.live.cell_setup import default_setup
from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_msgs_py.node.domain import own_domain

BAGS = Path(__file__).resolve().parents[1] / "bags"
# What a replay needs and gives, and the truth; no images.
EXCLUDED = r"^/(rosout|parameter_events|diagnostics)$|/_|/camera/|/imu$|/summary$"
POLL = 0.02


@dataclass(frozen=True, slots=True)
class Recording:
    """Settings for recording one bag: the motion, node parameters and a fault during it.

    Attributes:
        motion: that the cell plays.
        parameters: of nodes, by node and name, beside those of the package's cell.yaml.
        during: what happens while the cell runs; it gets the running nodes and the bag's folder.
        finished: whether the recorder is there at the end.
    """

    motion: str
    parameters: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    during: Callable[[NodeGroup, Path], None] | None = None
    finished: bool = True


def silence_camera(nodes: NodeGroup, bag: Path) -> None:
    """Stops the camera node for one second in the middle of the motion."""
    wait_for_bytes(bag, 250_000)
    os.kill(nodes.pid("camera"), signal.SIGSTOP)
    time.sleep(1.0)
    os.kill(nodes.pid("camera"), signal.SIGCONT)


def kill_recorder(nodes: NodeGroup, bag: Path) -> None:
    """Kills the recorder and truncates the bag file, to make a damaged bag."""
    wait_for_bytes(bag, 500_000)
    os.kill(nodes.pid("recorder"), signal.SIGKILL)
    (file,) = bag.glob("*.mcap")
    os.truncate(file, file.stat().st_size - 2_000)


def wait_for_bytes(bag: Path, size: int) -> None:
    """Waits until a bag has a given size [bytes]."""
    while sum(file.stat().st_size for file in bag.glob("*.mcap")) < size:
        time.sleep(POLL)


RECORDINGS = {
    **{motion: Recording(motion) for motion in ("l", "e", "c", "l3", "e3", "c3")},
    "limit": Recording("e3", {"monitor": {"measured_limit": "0.012", "estimated_limit": "0.012"}}),
    "camera_gap": Recording("c", during=silence_camera),
    "cut": Recording("c3", during=kill_recorder, finished=False),
}


def record(name: str, recording: Recording, folder: Path) -> None:
    """Records one bag; replaces an existing one."""
    shutil.rmtree(folder / name, ignore_errors=True)
    setup = default_setup()
    processes = setup.processes(folder / name)
    cell = NodeProcess(
        "cell",
        [setup.parameters],
        {
            "motion": recording.motion,
            "rate": "500.0",
            "model": str(config_folder() / "truth.yaml"),
            "calibration": str(setup.calibration),
            "wait_for": ",".join(process.name for process in processes),
            "readers": "1",  # images are not recorded
        },
    )
    given = {"recorder": {"exclude": EXCLUDED}, **recording.parameters}
    with (
        tempfile.TemporaryDirectory() as logs,
        own_domain() as domain,
        NodeGroup(setup.namespace, Path(logs), node_environment(domain)) as nodes,
    ):
        for process in (*processes, cell):
            own = {**process.parameters, **given.get(process.name, {})}
            nodes.start(replace(process, parameters=own))
        if recording.during is not None:
            recording.during(nodes, folder / name)
        while "cell" not in nodes.ended():
            if recording.finished:
                nodes.check()
            time.sleep(POLL)
    (folder / name / ".reserve").unlink(missing_ok=True)  # of a recorder that was killed


def main() -> int:
    """Records the bags named on the command line, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "names", nargs="*", choices=[[], *RECORDINGS], help="bags to record (default: all)"
    )
    parser.add_argument("-o", "--output", type=Path, default=BAGS)
    arguments = parser.parse_args()
    for name in arguments.names or RECORDINGS:
        print(name, flush=True)
        record(name, RECORDINGS[name], arguments.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())

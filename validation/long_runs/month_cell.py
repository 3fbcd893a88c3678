"""Processes of the simulated month: nodes, robot, PLC node and broker, with a shifted clock.

`shifted_clock.c` shows them the day that the month has reached; steady clocks and the kernel's
times of files are as they are. When a run has ended, its files get the time of its day.
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from slosh_bag.store.stored_bags import RUN
from slosh_base.files import write_text
from slosh_bringup.processes import NodeProcess, config_folder, node_environment
from slosh_testing.live_processes import LiveProcess, alive
from slosh_testing.plc import free_port
from validation.long_runs.long_cell import resident
from validation.long_runs.month_clients import GROUP
from validation.long_runs.month_days import Day

DAY: Final = 86400.0
SOURCE = Path(__file__).with_name("shifted_clock.c")
NODES: Final = ("recorder", "estimator", "monitor")
LOW, HIGH = 0.003, 0.03
"""Limit of the heights [m] on days that record events, where motions exceed it, and on others."""


class Clock:
    """The shifted clock of the simulated month, a number of days behind the real one.

    Args:
        folder: for its library and the file that tells all processes which day it is.

    Raises:
        OSError: there is no C compiler.
        CalledProcessError: it does not compile.
    """

    def __init__(self, folder: Path) -> None:
        self._library, self._file = folder / "shifted_clock.so", folder / "shift"
        words = ["cc", "-shared", "-fPIC", "-O2", "-o", self._library, SOURCE, "-ldl"]
        subprocess.run(words, check=True)
        self._file.write_bytes(bytes(8))
        self.set(0)

    def set(self, ago: int) -> None:
        """Sets by how many days the clock is behind; running processes see it at once."""
        self.ago = ago
        with self._file.open("r+b") as mapped:
            mapped.write(struct.pack("=q", -round(DAY) * ago))

    def now(self) -> float:
        """Returns the shifted time that the cell's processes see [s since 1970]."""
        return time.time() - DAY * self.ago

    def environment(self) -> dict[str, str]:
        """Returns the environment variables with which a process uses the shifted clock."""
        return {"LD_PRELOAD": str(self._library), "SHIFTED_CLOCK": str(self._file)}

    def date_files(self, run: Path) -> None:
        """Sets the file times of a finished run to the simulated day."""
        for path in [*run.rglob("*"), run]:
            if not path.is_symlink():
                state = path.stat()
                if state.st_mtime > self.now() + DAY / 2:
                    os.utime(path, (state.st_atime, state.st_mtime - DAY * self.ago))


class Site:
    """Folders, TCP ports and files of the simulated month's cell.

    Args:
        folder: of the month.
        runs: of the cell's runs, on the small disk.
        domain: of DDS.
        quota: largest size of the bags [bytes].
        keep: days for which complete bags and event bags are kept.
    """

    def __init__(
        self, folder: Path, runs: Path, domain: int, quota: int, keep: tuple[float, float]
    ) -> None:
        self.folder, self.runs = folder, runs
        self.store = folder / "motions"
        self.clock = Clock(folder)
        self.opc_ua, self.modbus, self.mqtt = free_port(), free_port(), free_port()
        self.limits = {
            "store_quota": quota, "store_days": keep[0], "store_event_days": keep[1],
        }  # fmt: skip
        self._own = node_environment(domain) | {"ROS_DOMAIN_ID": str(domain)}
        self._count = 0
        for kind, limit in (("complete", HIGH), ("events", LOW)):
            self._write_config(kind, limit)
        write_text(
            folder / "plc.yaml",
            f"/**: {{plc: {{ros__parameters: {{opc_ua_port: {self.opc_ua}, "
            f'modbus_port: {self.modbus}, mqtt_broker: "127.0.0.1:{self.mqtt}", '
            f"sparkplug_group: {GROUP}}}}}}}\n",
        )

    def _write_config(self, kind: str, limit: float) -> None:
        recorder = "".join(f"      {name}: {value}\n" for name, value in self.limits.items())
        write_text(
            self.folder / f"{kind}_parameters.yaml",
            f"/**:\n  monitor:\n    ros__parameters:\n      estimated_limit: {limit}\n"
            f"  recorder:\n    ros__parameters:\n{recorder}",
        )
        write_text(
            self.folder / f"{kind}.yaml",
            f"model: {config_folder() / 'model.yaml'}\ncamera: none\nrecord: {kind}\n"
            f"parameters: {kind}_parameters.yaml\nstore_motions: {self.store}\n",
        )

    def environment(self) -> dict[str, str]:
        """Returns the environment variables of the cell's processes."""
        return self._own | self.clock.environment()

    def words(self, name: str) -> Path:
        """Returns the path of a new file for a process's output."""
        self._count += 1
        return self.folder / "words" / f"{self._count:03d}_{name}"

    def slosh(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Runs a `slosh` command on the simulated day; returns exit code and output."""
        return subprocess.run(
            [sys.executable, "-m", "slosh_bringup.cli", *words],
            env=self.environment(), capture_output=True, text=True, check=False,
        )  # fmt: skip

    def start_cell(self, day: Day) -> LiveProcess:
        """Starts `slosh cell` without waiting; see `wait_for`."""
        config = self.folder / ("events.yaml" if day.events else "complete.yaml")
        words = ("cell", "--config", str(config), "-o", str(self.runs))
        return LiveProcess(words, self.words(f"cell_{day.number}"), self.environment())

    @staticmethod
    def wait_for(cell: LiveProcess) -> None:
        """Waits until a started cell reports that all nodes are ready."""
        cell.wait_until_ready()
        cell.wait_for_nodes(len(NODES))

    def start_plc(self) -> LiveProcess:
        """Starts `slosh plc`, which runs through the whole month."""
        words = ("plc", "--parameters", str(self.folder / "plc.yaml"))
        plc = LiveProcess(words, self.words("plc"), self.environment())
        plc.wait_for_nodes(1)
        return plc

    def start_robot(self, table: Path) -> subprocess.Popen[bytes]:
        """Starts the simulated robot, which plays a motion table once."""
        given = {
            "motion": str(table), "model": str(config_folder() / "truth.yaml"),
            "camera": "false", "rate": "200.0", "imu_every": "0", "acceleration_noise": "0.003",
            "wait_for": ",".join(NODES),
        }  # fmt: skip
        command = NodeProcess("cell", parameters=given).command("/slosh")
        with self.words("robot").open("wb") as said:
            return subprocess.Popen(
                command, env=self.environment(), stdout=said, stderr=subprocess.STDOUT
            )

    def run_folders(self) -> list[Path]:
        """Returns the folders of all runs on the disk."""
        return sorted(path for path in self.runs.iterdir() if RUN.fullmatch(path.name))


def memory(processes: Mapping[str, int]) -> dict[str, float]:
    """Returns the private memory of the running processes [MB], by name."""
    return {name: resident(pid, own=True) for name, pid in processes.items() if alive(pid)}

"""Runs a cell with the simulated robot for minutes and samples its nodes' memory."""

from __future__ import annotations

import contextlib
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from slosh_bringup.processes import NodeProcess, config_folder
from slosh_testing.live_processes import nodes_of


@dataclass(slots=True)
class LongCell:
    """A running `slosh cell` process and its exit code.

    Attributes:
        process: of the command.
        code: its exit code, when it has ended.
    """

    process: subprocess.Popen[bytes]
    code: int = 0


@contextlib.contextmanager
def long_cell(
    output: Path, robot: Mapping[str, str], patience: float, options: Sequence[str] = ()
) -> Iterator[LongCell]:
    """Runs `slosh cell` and a simulated robot inside a `with` block; ends both afterwards.

    Args:
        output: folder of the runs, made where it is missing; `words` in it gets what they say.
        robot: parameters of the simulated cell, beside its model.
        patience: how long all of it may take to be replayed in the end [s].
        options: of `slosh cell`.
    """
    output.mkdir(parents=True, exist_ok=True)
    config = config_folder()
    (output / "cell.yaml").write_text(
        f"model: {config / 'model.yaml'}\ncalibration: {config / 'camera.yaml'}\n"
    )
    command = [sys.executable, "-m", "slosh_bringup.cli", "cell", *options]
    command += ["--config", str(output / "cell.yaml"), "-o", str(output)]
    played = NodeProcess("cell", parameters={"model": str(config / "truth.yaml"), **robot})
    with (output / "words").open("w") as said:
        cell = LongCell(subprocess.Popen(command, stdout=said, stderr=said))
        source = subprocess.Popen(played.command("/slosh"), stdout=said, stderr=said)
    try:
        yield cell
    finally:
        cell.process.send_signal(signal.SIGTERM)
        cell.code = cell.process.wait(patience)
        source.kill()
        source.wait()


def resident(pid: int, *, own: bool = False) -> float:
    """Returns the resident memory of a process [MB].

    Args:
        pid: its process id.
        own: without what it shares with others: the middleware's segments, of which each node
            comes to see more and more up to their size, and code.

    Raises:
        OSError: there is no such process.
    """
    size, shared = Path(f"/proc/{pid}/statm").read_text().split()[1:3]
    return (int(size) - own * int(shared)) * resource.getpagesize() / 1e6


def sizes(parent: int, *, own: bool = False) -> dict[tuple[str, int], float]:
    """Returns the resident memory of a process's nodes [MB], by name and process id.

    Args:
        parent: its process id.
        own: as of `resident`.
    """
    found = {}
    for name, pid in nodes_of(parent).items():
        with contextlib.suppress(OSError):
            found[name, pid] = resident(pid, own=own)
    return found

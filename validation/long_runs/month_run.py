"""Runs the days of the simulated month one after the other, with their failures."""

from __future__ import annotations

import contextlib
import signal
import time
from pathlib import Path

from slosh_bag.store.retention import BagKind, StoredBag
from slosh_bag.store.stored_bags import stored_bags
from slosh_testing.live_processes import LiveProcess, alive
from slosh_testing.plc import Broker
from validation.long_runs import month_audit as audit
from validation.long_runs.month_audit import Outage, Shift
from validation.long_runs.month_cell import Site, memory
from validation.long_runs.month_clients import Clients
from validation.long_runs.month_days import PERIOD, Day, Trouble, write_motions

PATIENCE = 60.0
MOVING = 0.0015
"""Estimated height from which the first motion is seen [m]."""
FULL = 3.0  # s


class Month:
    """State and results of the simulated month so far.

    Attributes:
        shifts: the days so far.
        outages: times without a cell.
        deaf: times without a broker.
        problems: what was not as it should be.
        kept: largest size of the bags that are not running, at the start of a day [bytes].
        gone: bags that retention has deleted.
        left: bags that are there in the end.
    """

    def __init__(self, site: Site, clients: Clients, broker: Broker) -> None:
        self.site, self.clients, self._broker = site, clients, broker
        self.shifts: list[Shift] = []
        self.outages: list[Outage] = []
        self.deaf: list[Outage] = []
        self.problems: list[str] = []
        self.kept = 0
        self.gone: list[StoredBag] = []
        self._ended: float | None = None
        self._known: list[StoredBag] = []
        self.left: list[StoredBag] = []
        self.plc = site.start_plc()
        self._plc_pids = dict(self.plc.nodes())

    def run(self, day: Day) -> None:
        """Runs one day of the month, with its failures."""
        self.site.clock.set(day.ago)
        shift = Shift(day)
        self.shifts.append(shift)
        before = set(self.site.run_folders())
        table = self.site.folder / f"motions_{day.motions}.csv"
        if not table.exists():
            write_motions(table, day.motions)
        cell = self._start(shift)
        robot = self.site.start_robot(table)  # it waits for the cell
        ballast: Path | None = None
        try:
            self.site.wait_for(cell)
            self._look_at_store()
            shift.began = self._first_motion()
            for trouble in day.troubles:
                self._sleep_until(shift.began + day.moment(trouble))
                cell, ballast = self._act(trouble, shift, cell)
            shift.played = robot.wait(PATIENCE + PERIOD * day.motions) == 0
            shift.memory = memory(cell.nodes() | self._plc_pids)
            self._stop(shift, cell)
        finally:
            robot.kill()
            robot.wait()
            if ballast is not None:
                ballast.unlink(missing_ok=True)
            cell.clean_up()
        self._file(shift, before)

    def _start(self, shift: Shift) -> LiveProcess:
        if self._ended is not None:
            self.outages.append(Outage(self._ended, time.time()))
            self._ended = None
        return self.site.start_cell(shift.day)

    def _again(self, shift: Shift) -> LiveProcess:
        cell = self._start(shift)
        self.site.wait_for(cell)
        return cell

    def _stop(self, shift: Shift, cell: LiveProcess) -> None:
        nodes = cell.nodes()
        cell.process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + PATIENCE
        while alive(nodes["monitor"]) and time.monotonic() < deadline:
            time.sleep(0.02)
        self._ended = time.time()
        shift.codes.append(cell.process.wait(PATIENCE))
        shift.words += cell.said

    def _act(
        self, trouble: Trouble, shift: Shift, cell: LiveProcess
    ) -> tuple[LiveProcess, Path | None]:
        """Causes a failure; returns the cell that runs then, and the file that fills the disk."""
        if trouble is Trouble.BROKER_LOST:
            self._broker.__exit__()
            self.deaf.append(Outage(time.time(), float("inf")))
        elif trouble is Trouble.BROKER_BACK:
            self._broker.__enter__()
            self.deaf[-1] = Outage(self.deaf[-1].begin, time.time() + 5.0)
        elif trouble is Trouble.RESTART:
            self._stop(shift, cell)
            return self._again(shift), None
        elif trouble is Trouble.KILL:
            for process in (cell, self.plc):
                process.nodes()
                process.clean_up()
            self._ended = time.time()
            shift.words += cell.said
            self.plc = self.site.start_plc()
            self._plc_pids = dict(self.plc.nodes())
            return self._again(shift), None
        else:
            ballast = fill(self.site.runs / "ballast")
            if trouble is Trouble.FULL_TO_END:
                return cell, ballast
            time.sleep(FULL)
            ballast.unlink()
        return cell, None

    def _first_motion(self) -> float:
        """Waits until a client sees the first motion's height; returns the time [s since 1970]."""
        deadline = time.monotonic() + PATIENCE
        while not self.clients.height > MOVING:
            if time.monotonic() > deadline:
                self.problems.append(f"day {self.shifts[-1].day.number}: no motion was seen")
                break
            time.sleep(0.02)
        return time.time()

    @staticmethod
    def _sleep_until(moment: float) -> None:
        time.sleep(max(moment - time.time(), 0.0))

    def _file(self, shift: Shift, before: set[Path]) -> None:
        """Sets the day's file times, reads its messages, ingests the bags of a killed cell."""
        runs = [path for path in self.site.run_folders() if path not in before]
        for run in runs:
            self.site.clock.date_files(run)
            for log in sorted(run.glob("logs/*.log")):
                shift.words += log.read_text(errors="replace")
        found = stored_bags(self.site.runs, self.site.clock.now() + 3600.0)
        shift.bags = [bag.folder for bag in found if any(r in bag.folder.parents for r in runs)]
        shift.told = audit.told_in(shift.bags)
        self._known = found
        if Trouble.KILL in shift.day.troubles:  # its recorder had no end at which to store motions
            words = ("ingest", *map(str, shift.bags), "--store", str(self.site.store))
            done = self.site.slosh(*words)
            shift.words += done.stdout + done.stderr

    def _look_at_store(self) -> None:
        """Records the bags that retention deleted at a day's start, and the remaining size."""
        now = self.site.clock.now()
        deadline = time.monotonic() + PATIENCE
        while True:
            found = stored_bags(self.site.runs, now)
            size = sum(bag.size for bag in found if bag.kind is not BagKind.RUNNING)
            if size <= self.site.limits["store_quota"] or time.monotonic() > deadline:
                break
            time.sleep(0.1)
        kept = {bag.folder for bag in found}
        self.gone += [bag for bag in self._known if bag.folder not in kept]
        self.kept = max(self.kept, size)

    def finish(self) -> None:
        """Stops the PLC node at the end of the month."""
        self.plc.process.send_signal(signal.SIGTERM)
        code = self.plc.process.wait(PATIENCE)
        if code or any(map(alive, self._plc_pids.values())):
            self.problems.append(f"slosh plc: exit code {code} after SIGTERM, or its node runs on")


def fill(path: Path) -> Path:
    """Fills the disk of a file completely, and returns the file."""
    with path.open("wb", buffering=0) as ballast, contextlib.suppress(OSError):
        while True:
            ballast.write(bytes(65536))
    with path.open("ab", buffering=0) as ballast, contextlib.suppress(OSError):
        while True:
            ballast.write(bytes(512))
    return path

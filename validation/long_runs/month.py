"""Runs a cell for a month of short days, with failures, and audits what is left.

    tools/run python -m validation.long_runs.month [--days 30] [-o out/month] [--table FILE.csv]

Each day is a shift: `slosh cell` starts, a robot makes motions, the cell stops, its bags are
ingested. The nodes' clock shows the day (shifted_clock.c); of its eight hours a dozen seconds are
played, so that stamps, names of runs, ages of bags and the store's rows are those of a month, and
the number of motions is not. On the way: the MQTT broker is killed and returns days later, the
cell is restarted twice, once by killing all of it in the middle of a motion, and the disk is full
twice. The PLC node runs through the month; clients over OPC UA, Modbus and MQTT watch it.

Exit code 0 if each motion is in the store or its loss was told, and all else in the table holds.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import re
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from tqdm import tqdm

from slosh_bag.store.retention import BagKind, StoredBag
from slosh_bag.store.stored_bags import stored_bags
from slosh_base.files import check_free, write_text
from slosh_msgs_py.node.domain import own_domain
from slosh_replay.fleet.store import FleetStore
from slosh_testing.live_processes import LiveProcess, alive
from slosh_testing.plc import WHY, Broker, find_mosquitto
from slosh_testing.small_disk import small_disk
from validation.long_runs import month_audit as audit
from validation.long_runs.month_audit import Counted, Fate, Outage, Row, Shift
from validation.long_runs.month_cell import Site, memory
from validation.long_runs.month_clients import Clients
from validation.long_runs.month_days import PERIOD, Day, Trouble, days_of, write_motions

QUOTA = 6_000_000
DISK = 60_000_000
"""Size of the file system of the runs [bytes]."""
PATIENCE = 60.0
MOVING = 0.0015
"""Estimated height from which the first motion is seen [m]."""
FULL = 3.0  # s
HARMLESS = frozenset({Trouble.BROKER_LOST, Trouble.BROKER_BACK, Trouble.FULL_DISK})
"""Troubles that must cost no motion."""


class Month:
    """The month as it goes on.

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
        self._ingest: threading.Thread | None = None
        self.plc = site.start_plc()
        self._plc_pids = dict(self.plc.nodes())

    def run(self, day: Day) -> None:
        """Runs a day."""
        self.site.clock.set(day.ago)
        shift = Shift(day)
        self.shifts.append(shift)
        before = set(self.site.run_folders())
        table = self.site.folder / f"motions_{day.motions}.csv"
        if not table.exists():
            write_motions(table, day.motions)
        cell = self._start(shift)
        self._look_at_store()
        robot = self.site.start_robot(table)
        ballast: Path | None = None
        try:
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
        """Makes a trouble; returns the cell that runs then, and what fills the disk."""
        if trouble is Trouble.BROKER_LOST:
            self._broker.__exit__()
            self.deaf.append(Outage(time.time(), float("inf")))
        elif trouble is Trouble.BROKER_BACK:
            self._broker.__enter__()
            self.deaf[-1] = Outage(self.deaf[-1].begin, time.time() + 5.0)
        elif trouble is Trouble.RESTART:
            self._stop(shift, cell)
            return self._start(shift), None
        elif trouble is Trouble.KILL:
            for process in (cell, self.plc):
                process.nodes()
                process.clean_up()
            self._ended = time.time()
            shift.words += cell.said
            self.plc = self.site.start_plc()
            self._plc_pids = dict(self.plc.nodes())
            return self._start(shift), None
        else:
            ballast = fill(self.site.runs / "ballast")
            if trouble is Trouble.FULL_TO_END:
                return cell, ballast
            time.sleep(FULL)
            ballast.unlink()
        return cell, None

    def _first_motion(self) -> float:
        """Waits for the robot's first motion; returns when its height was seen."""
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
        """Dates the day's files, reads what they tell, and ingests the bags."""
        runs = [path for path in self.site.run_folders() if path not in before]
        for run in runs:
            self.site.clock.date_files(run)
            for log in sorted(run.glob("logs/*.log")):
                shift.words += log.read_text(errors="replace")
        found = stored_bags(self.site.runs, self.site.clock.now() + 3600.0)
        shift.bags = [bag.folder for bag in found if any(r in bag.folder.parents for r in runs)]
        shift.told = audit.told_in(shift.bags)
        self._known = found
        self._wait_for_ingest()
        words = ("ingest", *map(str, shift.bags), "--store", str(self.site.store))
        self._ingest = threading.Thread(target=lambda: self._run_ingest(shift, words))
        self._ingest.start()

    def _run_ingest(self, shift: Shift, words: tuple[str, ...]) -> None:
        done = self.site.slosh(*words)
        shift.words += done.stdout + done.stderr

    def _wait_for_ingest(self) -> None:
        if self._ingest is not None:
            self._ingest.join()

    def _look_at_store(self) -> None:
        """Notes what retention has deleted at a day's start, and the size of the rest."""
        self._wait_for_ingest()
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
        """Waits for the last ingest and stops the PLC node."""
        self._wait_for_ingest()
        self.plc.process.send_signal(signal.SIGTERM)
        code = self.plc.process.wait(PATIENCE)
        if code or any(map(alive, self._plc_pids.values())):
            self.problems.append(f"slosh plc: exit code {code} after SIGTERM, or its node runs on")


def fill(path: Path) -> Path:
    """Leaves no room on the disk of a file."""
    with path.open("wb", buffering=0) as ballast, contextlib.suppress(OSError):
        while True:
            ballast.write(bytes(65536))
    with path.open("ab", buffering=0) as ballast, contextlib.suppress(OSError):
        while True:
            ballast.write(bytes(512))
    return path


def main() -> int:
    """Runs the month; returns 1 if something is not as it should be."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/month"))
    parser.add_argument("--table", type=Path, help="CSV file of the audit")
    given = parser.parse_args()
    if find_mosquitto() is None:
        parser.error(WHY)
    begun = time.monotonic()
    folder = given.output.absolute()
    check_free(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with own_domain() as domain:
        month = run_month(folder, domain, given.days)
        lines = report(month)
    lines.append(("wall time [min]", f"{(time.monotonic() - begun) / 60:.1f}", True))
    for what, value, holds in lines:
        print(f"{'    ' if holds else 'NOT '} {what:<58} {value}")
    for problem in month.problems:
        print(f"NOT  {problem}")
    if given.table is not None:
        rows = [f'"{what}","{value}"' for what, value, _ in lines]
        write_text(given.table, "\n".join(["what,result", *rows]) + "\n")
    return int(bool(month.problems) or not all(holds for *_, holds in lines))


def run_month(folder: Path, domain: int, count: int) -> Month:
    """Runs all days and returns the month."""
    runs = folder / "runs"
    for path in (runs, folder / "words"):
        path.mkdir()
    keep = max(count / 3.0, 0.7), max(2.0 * count / 3.0, 1.4)
    with small_disk(runs, f"size={DISK}"), contextlib.ExitStack() as stack:
        site = Site(folder, runs, domain, QUOTA, keep)
        broker = Broker(folder, site.mqtt)
        broker.__enter__()
        stack.callback(broker.__exit__)
        clients = stack.enter_context(Clients("slosh", site.opc_ua, site.modbus, site.mqtt))
        month = Month(site, clients, broker)
        stack.callback(month.plc.clean_up)
        for day in tqdm(days_of(count), unit="day"):
            month.run(day)
        month.finish()
        month.left = stored_bags(site.runs, site.clock.now() + 3600.0)
        again(month)
    return month


def again(month: Month) -> None:
    """Ingests all bags that are left once more: nothing new may come of it."""
    bags = [str(bag.folder) for bag in month.left]
    done = month.site.slosh("ingest", *bags, "--store", str(month.site.store))
    if re_stored := done.stdout.count(" motions, stored\n"):
        month.problems.append(f"{re_stored} bags were stored a second time")


def rows_of(month: Month) -> Iterator[tuple[int, Row]]:
    """Yields the stored motions with the number of days before today."""
    sql = "SELECT begin_ns, duration, digest FROM motions ORDER BY begin_ns"
    done = month.site.slosh("query", sql, "--json", "--store", str(month.site.store))
    if done.returncode:
        month.problems.append(f"slosh query: {done.stderr.strip()}")
        return
    for row in json.loads(done.stdout):
        ago = (time.time() - 1e-9 * row["begin_ns"]) / 86400.0
        yield int(ago + 0.02), Row(row["begin_ns"], row["duration"], row["digest"])


def report(month: Month) -> list[tuple[str, str, bool]]:
    """Returns the lines of the audit: what, the value, and whether it is as it should be."""
    by_day: dict[int, list[Row]] = {}
    for ago, row in rows_of(month):
        by_day.setdefault(ago, []).append(row)
    counted = [
        audit.count_motions(
            shift, by_day.get(shift.day.ago, []), month.clients, audit.moments_of(shift)
        )
        for shift in month.shifts
    ]
    return [*_motions(month, counted), *_retention(month), *_rest(month)]


def _motions(month: Month, counted: list[Counted]) -> Iterator[tuple[str, str, bool]]:
    fates = [fate for one in counted for fate in one.fates]
    reasons = sorted(set().union(*(one.reasons for one in counted)))
    yield "days", str(len(month.shifts)), all(shift.played for shift in month.shifts)
    yield "motions of the robot", str(len(fates)), bool(fates)
    for fate in Fate:
        number = fates.count(fate)
        yield f"motions {fate.value}", str(number), fate is not Fate.UNTOLD or number == 0
    yield "a loss was told by", "; ".join(reasons), True
    for shift, one in zip(month.shifts, counted, strict=True):
        troubles = ", ".join(trouble.text for trouble in shift.day.troubles)
        if troubles:
            kept, count = one.fates.count(Fate.STORED), len(one.fates)
            holds = kept == count or not HARMLESS.issuperset(shift.day.troubles)
            yield f"stored when {troubles}", f"{kept} of {count}", holds
        elif one.fates.count(Fate.STORED) < len(one.fates):
            month.problems.append(f"day {shift.day.number}: without trouble, and not all stored")
        if Fate.UNTOLD in one.fates:
            month.problems.append(f"day {shift.day.number}: {[f.name for f in one.fates]}")
    strange = sum(one.strange for one in counted)
    yield "rows twice, or of no motion", str(strange), strange == 0


def _retention(month: Month) -> Iterator[tuple[str, str, bool]]:
    limits, now = month.site.limits, month.site.clock.now()
    kinds = {BagKind.COMPLETE: "complete bags", BagKind.EVENT: "event bags"}
    size = 1e-6 * month.kept
    text = f"{size:.1f} of {1e-6 * limits['store_quota']:.1f} MB"
    yield "largest size of the bags at a day's start", text, 1e6 * size <= limits["store_quota"]
    for kind, name in kinds.items():
        left = [bag for bag in month.left if bag.kind is kind]
        gone = [bag for bag in month.gone if bag.kind is kind]
        oldest = max(((now - bag.written) / 86400.0 for bag in left), default=0.0)
        limit = limits["store_days" if kind is BagKind.COMPLETE else "store_event_days"]
        text = f"{len(left)} kept, the oldest for {oldest:.1f} of {limit:.1f} days; "
        text += f"{len(gone)} deleted"
        yield name, text, oldest <= limit + 0.5
    said = "".join(shift.words for shift in month.shifts)
    told = sum(bool(re.search(rf"deleted the old (event )?bag {bag.folder},", said))
               for bag in month.gone)  # fmt: skip
    yield (
        "deleted bags that the recorder told",
        f"{told} of {len(month.gone)}",
        told == len(month.gone),
    )


def _rest(month: Month) -> Iterator[tuple[str, str, bool]]:
    late = audit.late_losses(month.clients, month.outages, month.deaf)
    month.problems += late
    yield "times without a cell", str(len(month.outages)), bool(month.outages)
    yield (
        "of these, seen as bad within 1 s by all three clients",
        str(len(month.outages) - len(late)),
        not late,
    )
    told = set().union(*(shift.told for shift in month.shifts))
    lost = sum("MQTT broker" in text and "is not connected" in text for text in told)
    yield "diagnostics of the lost broker", str(lost), lost > 0
    full = sum("No space left" in text or "nothing" in text for text in told)
    said = sum("No space left" in shift.words for shift in month.shifts)
    yield "diagnostics of the full disk; days whose log has it", f"{full}; {said}", full + said > 0
    files = [path for path in month.site.store.rglob("*") if path.is_file()]
    half = [path for path in files if path.suffix != ".parquet"]
    rows = FleetStore(str(month.site.store)).dataset().to_table(columns=["digest"])
    unique = len(set(rows["digest"].to_pylist()))
    yield "files of the store; half ones", f"{len(files)}; {len(half)}", not half
    yield (
        "rows of the store; different ones",
        f"{rows.num_rows}; {unique}",
        rows.num_rows == unique,
    )
    memories: dict[str, list[float]] = {}
    for shift in month.shifts:
        for name, size in shift.memory.items():
            memories.setdefault(name, []).append(size)
    grown = audit.grown(memories)
    text = "; ".join(f"{name} {sizes[0]:.0f}, {sizes[-1]:.0f}" for name, sizes in memories.items())
    yield "private memory on the first and the last day [MB]", text, not grown


if __name__ == "__main__":
    sys.exit(main())

"""Runs a cell for a simulated month of short days with failures, and checks its records.

    tools/run python -m validation.long_runs.month [--days 30] [-o out/month] [--table FILE.csv]

Each day is a shift: `slosh cell` starts, a robot makes motions, the cell stops and adds them to
the store. The nodes' clock shows the day (shifted_clock.c); of its eight hours a dozen seconds are
played, so that stamps, names of runs, ages of bags and the store's rows are those of a month, and
the number of motions is not. On the way: the MQTT broker is killed and returns days later, the
cell is restarted twice, once by killing all of it in the middle of a motion, and the disk is full
twice. The PLC node runs through the month; clients over OPC UA, Modbus, MQTT and Sparkplug watch
it.

Exit code 0 if each motion is in the store or its loss was told, and all else in the table holds.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from pyarrow.parquet import ParquetFile
from tqdm import tqdm

from slosh_bag.store.retention import BagKind
from slosh_bag.store.stored_bags import stored_bags
from slosh_base.files import check_free, is_unfinished, write_text
from slosh_msgs_py.node.domain import own_domain
from slosh_testing.plc import WHY, Broker, find_mosquitto
from slosh_testing.small_disk import small_disk
from validation.long_runs import month_audit as audit
from validation.long_runs.month_audit import Counted, Fate, Row
from validation.long_runs.month_cell import Site
from validation.long_runs.month_clients import Clients
from validation.long_runs.month_days import Trouble, days_of
from validation.long_runs.month_run import Month

QUOTA = 12_000_000
DISK = 60_000_000
"""Size of the file system of the runs [bytes]."""
HARMLESS = frozenset({Trouble.BROKER_LOST, Trouble.BROKER_BACK, Trouble.FULL_DISK})
"""Troubles that must cost no motion."""


def main() -> int:
    """Runs the simulated month; returns 1 if a check of its records fails."""
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
    """Runs all days of the simulated month and returns the result."""
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
    """Ingests all remaining bags again, and reports a bag whose motions are stored twice."""
    bags = [str(bag.folder) for bag in month.left]
    done = month.site.slosh("ingest", *bags, "--store", str(month.site.store))
    if re_stored := done.stdout.count(" motions, stored\n"):
        month.problems.append(f"{re_stored} bags were stored a second time")


def rows_of(month: Month) -> Iterator[tuple[int, Row]]:
    """Yields each stored motion with the number of days between the motion and today."""
    sql = "SELECT begin_ns, duration, digest FROM motions ORDER BY begin_ns"
    done = month.site.slosh("query", sql, "--json", "--store", str(month.site.store))
    if done.returncode:
        month.problems.append(f"slosh query: {done.stderr.strip()}")
        return
    for row in json.loads(done.stdout):
        ago = (time.time() - 1e-9 * row["begin_ns"]) / 86400.0
        yield int(ago + 0.02), Row(row["begin_ns"], row["duration"], row["digest"])


def report(month: Month) -> list[tuple[str, str, bool]]:
    """Returns the checks of the month as lines: name, value, and whether the value is right."""
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
        longer = (
            kind is BagKind.COMPLETE or len(month.shifts) < 20 or oldest > limits["store_days"]
        )
        yield name, text, oldest <= limit + 0.5 and longer
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
        "of these, seen as bad within 1 s by all four clients",
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
    half = [path for path in files if is_unfinished(path) or not path.stat().st_size]
    parts = sorted(path for path in files if path.suffix == ".parquet")
    digests = [one for path in parts for one in column_of(path, "digest")]
    yield "files of the store; half ones", f"{len(files)}; {len(half)}", not half
    text = f"{len(digests)}; {len(set(digests))}"
    yield "rows of the store; different ones", text, len(digests) == len(set(digests))
    memories: dict[str, list[float]] = {}
    for shift in month.shifts:
        for name, size in shift.memory.items():
            memories.setdefault(name, []).append(size)
    grown = audit.grown(memories)
    text = "; ".join(f"{name} {sizes[0]:.0f}, {sizes[-1]:.0f}" for name, sizes in memories.items())
    yield "private memory on the first and the last day [MB]", text, not grown


def column_of(path: Path, name: str) -> list[str]:
    """Reads a column of a Parquet file; raises an error if the file is incomplete."""
    return list(ParquetFile(path).read([name])[name].to_pylist())


if __name__ == "__main__":
    sys.exit(main())

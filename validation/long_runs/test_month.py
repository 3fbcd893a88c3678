"""Tests the audit of the month and its shifted clock, and runs two days of the month."""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from slosh_motion.signals.motion_spans import MotionFinder
from slosh_motion.tables.motion_table import read_motion_table
from validation.long_runs import month_audit as audit
from validation.long_runs.month_audit import Fate, Outage, Row, Shift
from validation.long_runs.month_clients import BAD, GONE, GOOD, Clients, Seen
from validation.long_runs.month_days import PERIOD, Day, Trouble, days_of, write_motions

SECOND = 10**9
BEGAN = 1e9
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc)")


def watched(*bad: tuple[float, float]) -> Clients:
    """Returns clients that saw bad values only in given time spans [s since BEGAN]."""
    clients = Clients("slosh", 0, 0, 0)
    for protocol in clients.seen:
        for k in range(600):
            t = 0.1 * k
            lost = any(begin <= t < end for begin, end in bad)
            clients.seen[protocol].append(Seen(BEGAN + t, BAD if lost else GOOD))
    return clients


def rows(*numbers: float, length: float = 0.8) -> list[Row]:
    """Returns rows of stored motions at given positions in a day's sequence."""
    return [Row(round((5.0 + PERIOD * n) * SECOND), length, str(n)) for n in numbers]


def counted(stored: list[Row], clients: Clients, **given: object) -> audit.Counted:
    shift = Shift(Day(1, 0), BEGAN, **given)
    return audit.count_motions(shift, stored, clients, audit.moments_of(shift))


def test_a_motion_that_is_missing_without_a_word_is_found() -> None:
    assert counted(rows(0, 1, 2, 3), watched()).fates == [Fate.STORED] * 4
    fates = counted(rows(0, 1, 3), watched()).fates
    assert fates == [Fate.STORED, Fate.STORED, Fate.UNTOLD, Fate.STORED]


def test_a_loss_is_told_by_bad_quality_or_by_the_recorder() -> None:
    during = watched((2 * PERIOD - 0.5, 2 * PERIOD + 0.5))
    found = counted(rows(0, 1, 3), during)
    assert (found.fates[2], found.reasons) == (Fate.LOST, {"over OPC UA: bad"})
    found = counted(rows(0, 1, 3), watched((0.0, 1.0)))  # at another time
    assert found.fates[2] is Fate.UNTOLD
    found = counted(rows(0, 1, 3), watched(), words="17 messages are lost (noted in the bag)")
    assert found.fates[2] is Fate.LOST
    assert counted(rows(0, 1, 3), watched(), words="0 messages are lost").fates[2] is Fate.UNTOLD


def test_half_a_motion_is_no_whole_one_and_two_are_not_one() -> None:
    stored = rows(0, 1, 3) + rows(2, length=0.3)
    assert counted(stored, watched()).fates[2] is Fate.UNTOLD
    assert counted(stored, watched((4.5, 5.0))).fates[2] is Fate.CUT
    assert counted(rows(0, 1, 2, 2, 3), watched()).strange == 1
    assert counted(rows(0, 1, 2, 3, 9), watched()).strange == 1


def test_an_outage_must_be_seen_within_a_second() -> None:
    outage = [Outage(BEGAN + 10.0, BEGAN + 20.0)]
    assert audit.late_losses(watched((10.5, 20.5)), outage, []) == []
    assert len(audit.late_losses(watched((11.5, 20.5)), outage, [])) == 4
    assert len(audit.late_losses(watched(), outage, outage)) == 2  # nobody hears without a broker
    gone = watched((10.5, 20.5))
    gone.seen["Modbus"] = [Seen(one.at, GONE if one.what == BAD else GOOD)
                           for one in gone.seen["Modbus"]]  # fmt: skip
    assert audit.late_losses(gone, outage, []) == []


def test_memory_that_grows_is_named() -> None:
    assert audit.grown({"a": [50.0] * 9, "b": [50.0, 51.0, 52.0]}) == {}
    assert list(audit.grown({"a": [50.0] * 6 + [60.0] * 3})) == ["a"]


@pytest.mark.parametrize("count", [1, 2, 30])
def test_every_trouble_comes_once(count: int) -> None:
    days = days_of(count)
    assert sorted(t.name for day in days for t in day.troubles) == sorted(t.name for t in Trouble)
    assert [day.ago for day in days] == list(range(count))[::-1]
    assert not any(day.events and day.troubles for day in days)


def test_the_motions_are_found_one_by_one(tmp_path: Path) -> None:
    write_motions(tmp_path / "motions.csv", 7)
    table = read_motion_table(tmp_path / "motions.csv")
    finder = MotionFinder()
    finder.add(np.round(table.t * SECOND).astype(np.int64), table.acceleration)
    finder.finish()
    starts = np.array([span.start_ns for span in finder.spans]) / SECOND
    assert np.allclose(np.diff(starts), PERIOD, atol=0.06)
    assert len(starts) == 7
    lengths = [(span.end_ns - span.start_ns) / SECOND for span in finder.spans]
    assert min(lengths) >= audit.WHOLE * 0.8


WAIT = """import threading, time
t, steady = time.time(), time.monotonic()
print(t)
lock = threading.Condition()
with lock:
    lock.wait(0.05)
print(time.monotonic() - steady)
"""


@needs_compiler
def test_the_clock_shows_another_day_and_waits_as_long(tmp_path: Path) -> None:
    from validation.long_runs.month_cell import DAY, Clock

    clock = Clock(tmp_path)
    clock.set(12)
    words = [sys.executable, "-c", WAIT]
    environment = os.environ | clock.environment()
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    shown, waited = map(float, done.stdout.split())
    assert shown == pytest.approx(clock.now(), abs=60.0)
    assert abs(shown - clock.now()) < DAY / 2
    assert 0.05 <= waited < 30.0


@pytest.mark.long
@needs_compiler
@pytest.mark.usefixtures("new_broker")
@pytest.mark.skipif(os.geteuid() != 0, reason="a small file system needs root")
def test_two_days_lose_nothing_without_a_word(tmp_path: Path) -> None:
    pytest.importorskip("duckdb", reason="not installed (requirements/fleet.txt)")
    pytest.importorskip("asyncua", reason="not installed (requirements/plc.txt)")
    words = [sys.executable, "-m", "validation.long_runs.month", "--days", "2"]
    words += ["-o", str(tmp_path / "month"), "--table", str(tmp_path / "table.csv")]
    root = Path(__file__).parents[2]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode == 0, done.stdout + done.stderr
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as file:
        found = dict(list(csv.reader(file))[1:])
    assert found["motions lost or cut, not told"] == "0"
    assert int(found["motions stored"]) > 0

"""Tests the parallel processing of many files, with an outcome for each item."""

import importlib
import logging
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from slosh_bringup import many_files
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.many_files import IN_FLIGHT, KILLED, ItemOutcome, map_files

PATIENCE = 60.0
WORK = """
import os

from slosh_bag.errors import SloshBagError


def square(number):
    if number == 17:
        raise SloshBagError("bag17: damaged:\\nbad CRC")
    if number == 23:
        return 1 / 0
    if number == 31:
        os._exit(3)
    if number == 37:
        raise SystemExit("enough")
    return number * number


def dawdle(path):
    open(path, "w").close()
    while True:
        sum(range(1000))
"""


@pytest.fixture
def work(tmp_path, monkeypatch):
    """Functions in a module that worker processes can import."""
    (tmp_path / "many_files_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(tmp_path))
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    monkeypatch.setenv("PYTHONPATH", path.rstrip(os.pathsep))
    yield importlib.import_module("many_files_work")
    del sys.modules["many_files_work"]


def expected(number):
    errors = {
        17: "bag17: damaged: bad CRC",
        23: "ZeroDivisionError: division by zero (many_files_work.py:11)",
        31: KILLED,
        37: "SystemExit: enough (many_files_work.py:15)",
    }
    value = None if number in errors else number * number
    return ItemOutcome(number, number, value, errors.get(number, ""))


def listening():
    """Returns the addresses at which this process and its children accept connections."""
    us = psutil.Process()
    return {
        connection.laddr
        for process in [us, *us.children(recursive=True)]
        for connection in process.net_connections()
        if connection.status == psutil.CONN_LISTEN
    }


def workers_of(process):
    """Returns the worker processes that a process has started."""
    children = process.children(recursive=True)
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def holds_back(process, number):
    """Returns whether a process blocks a signal."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    mask = next(line.split()[1] for line in status.splitlines() if line.startswith("SigBlk"))
    return bool(int(mask, 16) >> (number - 1) & 1)


def test_sixty_items_have_sixty_outcomes_though_some_fail_and_one_kills_its_worker(
    work, capfd, recwarn
):
    taken, before, addresses = [], listening(), set()

    def items():
        for number in range(60):
            taken.append(number)
            yield number

    # Another cluster's dashboard is no reason to complain.
    taken_port = socket.socket()
    with suppress(OSError):
        taken_port.bind(("127.0.0.1", 8787))
        taken_port.listen()
    outcomes = []
    for outcome in map_files(work.square, items(), jobs=2):
        outcomes.append(outcome)
        if len(outcomes) < 5:  # later ones come and go with the worker that ends
            addresses |= listening() - before
        # Of all that is there, no more is under way than keeps two workers busy.
        assert len(taken) - len(outcomes) <= 2 * IN_FLIGHT
    assert sorted(outcomes, key=lambda o: o.index) == [expected(n) for n in range(60)]
    assert addresses
    assert {address.ip for address in addresses} == {"127.0.0.1"}
    taken_port.close()
    assert capfd.readouterr() == ("", "")
    assert not recwarn.list
    assert not workers_of(psutil.Process())


@pytest.mark.long
def test_a_killed_worker_costs_one_item_of_a_task_of_several(work):
    outcomes = map_files(work.square, range(60), jobs=2, sizes=[1.0] * 60)
    assert sorted(outcomes, key=lambda o: o.index) == [expected(n) for n in range(60)]


def running_cluster(**options):
    """Runs a Dask cluster that is independent of the tested code."""
    from distributed import LocalCluster

    return LocalCluster(
        host="127.0.0.1",
        protocol="tcp",
        dashboard_address=None,
        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
        silence_logs=logging.CRITICAL,
        **options,
    )


@pytest.mark.parametrize(("items", "jobs"), [([5], None), (list(range(17, 31)), 1)])
def test_one_item_or_one_job_is_worked_on_here_in_order(work, items, jobs):
    outcomes = list(map_files(work.square, items, jobs=jobs))
    assert outcomes == [
        ItemOutcome(index, number, expected(number).value, expected(number).error)
        for index, number in enumerate(items)
    ]
    assert list(map_files(os.path.basename, [])) == []


@pytest.mark.parametrize("sizes", [None, [1.0] * 39])
def test_a_running_cluster_does_the_same(work, sizes, monkeypatch):
    tasks, submit = [], many_files._Farm._submit
    monkeypatch.setattr(
        many_files._Farm, "_submit", lambda farm, batch: tasks.append(batch) or submit(farm, batch)
    )
    with running_cluster(n_workers=1, threads_per_worker=1, processes=False) as cluster:
        numbers = [n for n in range(40) if n != 31]
        given = {"scheduler": cluster.scheduler_address, "sizes": sizes}
        outcomes = list(map_files(work.square, numbers, **given))
    assert len(tasks) == 39 if sizes is None else len(tasks) < 20
    assert {o.item: (o.value, o.error) for o in outcomes} == {
        n: (expected(n).value, expected(n).error) for n in numbers
    }
    assert len(outcomes) == len(numbers)


def test_a_cluster_without_workers_is_told(work):
    with (
        running_cluster(n_workers=0, processes=False) as cluster,
        pytest.raises(SloshBringupError, match=r"scheduler tcp://127.0.0.1:\d+: has no workers"),
    ):
        list(map_files(work.square, range(3), scheduler=cluster.scheduler_address))


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("tcp://127.0.0.1:1", "no answer within"),
        ("nobody", "missing port number"),
        ("tcp://no.such.host.invalid:8786", "cannot be reached"),
    ],
)
def test_an_address_where_no_scheduler_is_gives_one_line(address, said, monkeypatch):
    monkeypatch.setattr(many_files, "CONNECT_TIMEOUT", 1.0)
    with pytest.raises(SloshBringupError, match=said) as caught:
        list(map_files(len, ["a"], scheduler=address))
    assert str(caught.value).startswith(f"scheduler {address}: cannot be reached: ")
    assert "\n" not in str(caught.value)


def test_where_dask_is_missing_it_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SloshBringupError, match="install it, or use one job"):
        list(map_files(len, ["a", "b"], jobs=2))


def test_options_that_do_not_fit_are_told_before_any_work():
    with pytest.raises(SloshBringupError, match="jobs = 0: must be at least 1"):
        map_files(len, ["a"], jobs=0)
    with pytest.raises(SloshBringupError, match="has its own workers"):
        map_files(len, ["a"], jobs=2, scheduler="tcp://127.0.0.1:1")


@pytest.mark.long
@pytest.mark.parametrize("moment", ["starting", "working"])
def test_an_interrupt_ends_all_of_it_without_a_word(work, tmp_path, moment):
    program = (
        "import many_files_work\n"
        "from slosh_bringup.many_files import map_files\n"
        "if __name__ == '__main__':\n"
        "    try:\n"
        "        for outcome in map_files(many_files_work.dawdle, 'abcd', jobs=2): pass\n"
        "    except KeyboardInterrupt:\n"
        "        print('stopped')\n"
    )
    script = tmp_path / "script.py"
    script.write_text(program)
    process = subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        cwd=tmp_path,
    )
    try:
        ours = psutil.Process(process.pid)
        deadline = time.monotonic() + PATIENCE
        while not (
            workers_of(ours) if moment == "starting" else len(list(tmp_path.glob("[abcd]"))) == 2
        ):
            assert time.monotonic() < deadline, "the workers did not start to work"
            time.sleep(0.02)
        children = ours.children(recursive=True)
        # It reaches the whole group, as a terminal's does, but the first process alone acts on it.
        assert all(holds_back(worker, signal.SIGINT) for worker in workers_of(ours))
        os.killpg(process.pid, signal.SIGINT)
        said, _ = process.communicate(timeout=PATIENCE)
        assert said == "stopped\n"
        _, alive = psutil.wait_procs(children, timeout=PATIENCE)
        assert not alive
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)

"""Tests which bags are deleted: oldest first, event bags later, a running one never."""

import os
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_bag.bag_writer import Qos
from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import HeldFolder, is_held
from slosh_bag.nodes.store_thread import DAYS, EVENT_DAYS, QUOTA, StoreThread
from slosh_bag.recorder import Recorder
from slosh_bag.store.retention import DAY, BagKind, Retention, StoredBag, surplus
from slosh_bag.store.stored_bags import delete, runs_folder, stored_bags

NOW = 2_000_000_000.0
COMPLETE, EVENT, RUNNING = BagKind


def bag(age, size=10, kind=COMPLETE):
    """Returns a bag that was written a given number of days ago."""
    return StoredBag(f"{kind.value}_{age}", NOW - age * DAY, size, kind)


def ages(found):
    return [(one.kind, round((NOW - one.written) / DAY)) for one in found.bags]


def test_what_is_too_old_goes_and_events_stay_longer():
    bags = [bag(age, kind=kind) for age in (5, 20, 50, 90) for kind in (COMPLETE, EVENT)]
    found = surplus(bags, Retention(days=30, event_days=60), NOW)
    assert ages(found) == [(COMPLETE, 90), (COMPLETE, 50), (EVENT, 90)]
    assert surplus(bags, Retention(), NOW).bags == ()


def test_a_quota_takes_the_oldest_complete_bags_first_and_events_last():
    bags = [bag(age, kind=kind) for age in (1, 2, 3) for kind in (COMPLETE, EVENT)]
    assert ages(surplus(bags, Retention(quota=45), NOW)) == [(COMPLETE, 3), (COMPLETE, 2)]
    found = surplus(bags, Retention(quota=25), NOW)
    assert ages(found) == [(COMPLETE, 3), (COMPLETE, 2), (COMPLETE, 1), (EVENT, 3)]


def test_a_running_bag_counts_and_is_never_selected():
    bags = [bag(0, 100, RUNNING), bag(400, 5, RUNNING), bag(3), bag(1, kind=EVENT)]
    found = surplus(bags, Retention(quota=50, days=1, event_days=2), NOW)
    assert ages(found) == [(COMPLETE, 3), (EVENT, 1)]
    assert found.excess == 55


@given(
    st.lists(
        st.builds(bag, st.integers(0, 400), st.integers(0, 50), st.sampled_from(BagKind)),
        unique_by=lambda one: (one.written, one.kind),
    ),
    st.integers(1, 300),
    st.integers(1, 200),
)
def test_the_rest_fits_and_nothing_newer_of_its_kind_goes_before(bags, quota, days):
    found = surplus(bags, Retention(quota, days, 2 * days), NOW)
    kept = [one for one in bags if one not in found.bags]
    assert sum(one.size for one in kept) == min(
        sum(one.size for one in kept), quota + found.excess
    )
    assert all(one.kind is not RUNNING for one in found.bags)
    for kind in (COMPLETE, EVENT):
        gone = [one.written for one in found.bags if one.kind is kind]
        stays = [one.written for one in kept if one.kind is kind]
        assert max(gone, default=0.0) <= min(stays, default=NOW)
    if any(one.kind is not RUNNING for one in kept):
        assert found.excess == 0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"quota": -1}, "quota"), ({"days": float("nan")}, "days"),
        ({"days": 30, "event_days": 10}, "event bags are kept longer"),
        ({"event_days": 10}, "event bags are kept longer"),
    ],
)  # fmt: skip
def test_limits_that_do_not_fit_are_refused(given, told):
    with pytest.raises(SloshBagError, match=told):
        Retention(**given)


def make(folder, age, size=1000):
    """Writes the files of a bag as a recorder leaves them, with a given age [day]."""
    folder.mkdir(parents=True)
    for name in (f"{folder.name}_0.mcap", "metadata.yaml"):
        (folder / name).write_bytes(bytes(size))
        os.utime(folder / name, (NOW - age * DAY,) * 2)


@pytest.fixture
def runs(tmp_path):
    """Writes the folder of a cell's runs, and files beside them that must be left alone."""
    root = tmp_path / "cell"
    make(root / "2026-01-01T10-00-00" / "bag", 40)
    (root / "2026-01-01T10-00-00" / "report.html").write_text("report")
    make(root / "2026-01-02T10-00-00-2" / "bag" / "0001_limit", 30)
    make(root / "2026-01-02T10-00-00-2" / "bag" / "mine", 30)
    make(root / "2026-01-03T10-00-00" / "bag", 10)
    make(root / "2026-01-03T10-00-00" / "bag_2", 9)
    make(root / "my_bags" / "bag", 500)
    make(tmp_path / "elsewhere", 500)
    (root / "2026-01-03T10-00-00" / "link").symlink_to(tmp_path / "elsewhere")
    make(tmp_path / "another" / "bag", 500)
    (root / "2026-01-05T10-00-00").symlink_to(tmp_path / "another")
    (root / "latest").symlink_to("2026-01-03T10-00-00")
    return root


def names(runs, bags):
    return [(str(one.folder.relative_to(runs)), one.kind) for one in bags]


def test_only_the_bags_of_runs_are_found(runs):
    assert names(runs, stored_bags(runs, NOW)) == [
        ("2026-01-01T10-00-00/bag", COMPLETE),
        ("2026-01-02T10-00-00-2/bag/0001_limit", EVENT),
        ("2026-01-03T10-00-00/bag", COMPLETE),
        ("2026-01-03T10-00-00/bag_2", COMPLETE),
    ]
    with pytest.raises(SloshBagError, match="absent: No such file"):
        stored_bags(runs / "absent", NOW)


def test_a_bag_goes_and_what_is_beside_it_stays(runs):
    first, event, *_ = stored_bags(runs, NOW)
    delete(first)
    assert not first.folder.exists()
    assert (first.folder.parent / "report.html").read_text() == "report"
    (event.folder / "notes.txt").write_text("mine")
    delete(event)
    assert [path.name for path in event.folder.iterdir()] == ["notes.txt"]
    assert len(stored_bags(runs, NOW)) == 2


def test_a_folder_that_a_recorder_writes_to_is_never_deleted(runs, tmp_path):
    folder = runs / "2026-01-04T10-00-00" / "bag"
    recorder = Recorder(folder)
    try:
        recorder.add_topic("/a", "std_msgs/msg/Header", Qos())
        far = NOW + 10 * DAY
        (found,) = (one for one in stored_bags(runs, far) if one.folder == folder)
        assert found.kind is RUNNING
        with pytest.raises(SloshBagError, match="is being recorded"):
            delete(found)
    finally:
        recorder.close()
    assert not is_held(folder)


def test_the_mark_ends_with_its_process(tmp_path):
    program = (
        "import sys, pathlib\nfrom slosh_bag.held_folder import HeldFolder\n"
        "held = HeldFolder(pathlib.Path(sys.argv[1]))\nprint('held', flush=True)\nsys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE,
        stdin=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout.readline() == "held\n"
        assert is_held(tmp_path)
        process.kill()
        process.wait()
        assert not is_held(tmp_path)


def test_what_was_written_a_moment_ago_counts_as_running(runs):
    (found,) = (
        one
        for one in stored_bags(runs, NOW - 10 * DAY + 30.0)
        if one.folder.parent.name.startswith("2026-01-03") and one.folder.name == "bag"
    )
    assert found.kind is RUNNING


def thread(bag, told, **values):
    limits = {QUOTA: 0, DAYS: 0.0, EVENT_DAYS: 0.0} | values
    return StoreThread(bag, limits, told.append)


def test_the_recorder_deletes_and_tells(runs):
    told = []
    own = runs / "2026-01-04T10-00-00" / "bag"
    make(own, 0)
    held = HeldFolder(own)
    store = thread(own, told, **{QUOTA: 10_000})
    store.close()  # its own look would come at any time
    store.look(NOW)
    assert (told, store.complaint) == ([], "")
    store._retention = Retention(quota=2500)
    store.look(NOW)
    assert [line.split("/")[-2] for line in told] == [
        "2026-01-01T10-00-00",
        "2026-01-03T10-00-00",
        "2026-01-03T10-00-00",
    ]
    assert store.facts() == {"stored bags": 2, "stored [MB]": 0, "deleted bags": 3}
    store._retention = Retention(quota=500)
    store.look(NOW)
    assert own.exists()
    assert "the running recording alone exceeds store_quota" in store.complaint
    held.release()


def test_without_limits_there_is_nothing_to_do(runs, tmp_path):
    told = []
    assert thread(tmp_path / "bag", told).facts() == {}
    with pytest.raises(SloshBagError, match="is in no folder of runs"):
        thread(tmp_path / "bag", told, **{DAYS: 1.0})
    assert runs_folder(runs / "2026-01-04T10-00-00" / "bag_2") == runs


@pytest.mark.skipif(os.geteuid() == 0, reason="root deletes anything")
def test_what_cannot_be_deleted_is_told(runs):
    first, *_ = stored_bags(runs, NOW)
    first.folder.chmod(0o500)
    store = thread(runs / "2026-01-04T10-00-00" / "bag", [], **{DAYS: 1.0})
    store.look(NOW)
    assert "old bags are not deleted" in store.complaint

"""Tests folders of event bags: number, contents, full disks and earlier recorders."""

import errno
import subprocess
import sys
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_bag.bag_writer import Qos
from slosh_bag.black_box.black_box import EVENTS, Cause, Happening, Windows
from slosh_bag.black_box.event_bags import EventRecorder, KeptBag, noted_events, superfluous
from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import is_held
from slosh_bag.mcap_files.mcap_file import McapFile
from slosh_bag.reader import BagReader
from slosh_bag.recorder import Recorder

SECOND = 1_000_000_000
HEADER = "std_msgs/msg/Header"
DATA = bytes.fromhex("000100000000000000000000020000006100")
WINDOWS = Windows(2 * SECOND, SECOND, 10**8, 10**8)
BAGS = st.lists(
    st.builds(
        KeptBag,
        st.just(None),
        st.frozensets(st.sampled_from([cause.value for cause in Cause]), min_size=1, max_size=2),
        st.integers(0, 50),
    ),
    max_size=30,
)


def recorder_of(folder, per_cause=1000, quota=10**9):
    recorder = EventRecorder(folder, WINDOWS, per_cause, quota)
    recorder.add_topic("/h", HEADER, Qos())
    return recorder


def hear(recorder, begin, end, data=DATA):
    """Adds ten messages per second in the time range [begin, end) [s]."""
    for k in range(10 * begin, 10 * end):
        recorder.add("/h", data, k * SECOND // 10)


def happen(recorder, cause=Cause.LIMIT, text="it happened"):
    recorder.happen(Happening(cause, 7 * SECOND, text))


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


@given(bags=BAGS, per_cause=st.integers(1, 5), quota=st.integers(0, 300))
def test_the_newest_of_each_cause_are_kept_as_far_as_the_quota_goes(bags, per_cause, quota):
    given_up = superfluous(bags, per_cause, quota)
    gone = {id(bag) for bag in given_up}
    kept = [bag for bag in bags if id(bag) not in gone]
    assert [bag for bag in bags if id(bag) in gone] == given_up
    assert sum(bag.size for bag in kept) <= quota
    if sum(bag.size for bag in bags) > quota:
        return
    for cause in Cause:
        last = [bag for bag in bags if cause.value in bag.causes][-per_cause:]
        assert all(id(bag) not in gone for bag in last)
    for bag in given_up:  # so many newer ones of each of its causes are there
        newer = kept[sum(1 for one in kept if bags.index(one) < bags.index(bag)) :]
        assert newer


def test_a_bag_is_complete_and_tells_its_events(tmp_path):
    recorder = recorder_of(tmp_path / "events")
    hear(recorder, 0, 5)
    happen(recorder)
    hear(recorder, 5, 6)
    happen(recorder, Cause.BLIND, "nothing, ist zu sehen: ✓")
    hear(recorder, 6, 9)
    recorder.close()
    (name,) = names(tmp_path / "events")
    assert name == "0001_limit"
    reader = BagReader(tmp_path / "events" / name)
    times = [message.log_ns for message in reader.messages()]
    assert times == [k * SECOND // 10 for k in range(29, 70)]
    told = noted_events(reader.metadata()[EVENTS])
    assert [event.cause for event in told] == ["limit", "blind"]
    assert told[1].text == "nothing, ist zu sehen: ✓"
    assert (recorder.status().lost, recorder.status().failure) == (0, "")


@pytest.mark.parametrize("text", ["", "{", "null", "[1]", '[{"cause": 1}]', "[[]]"])
def test_a_damaged_note_tells_no_events(text):
    assert noted_events(text) == []


def test_bags_of_an_earlier_recorder_count_and_a_renamed_one_is_left_alone(tmp_path):
    for _ in range(3):
        recorder = recorder_of(tmp_path, per_cause=2)
        hear(recorder, 0, 1)
        happen(recorder)
        recorder.close()
    assert names(tmp_path) == ["0002_limit", "0003_limit"]
    (tmp_path / "0002_limit").rename(tmp_path / "keep this")
    (tmp_path / "0009_blind").mkdir()  # of a recorder that was killed at once
    recorder = recorder_of(tmp_path, per_cause=1)
    happen(recorder)
    recorder.close()
    assert names(tmp_path) == ["0009_blind", "0010_limit", "keep this"]


def test_a_bag_of_two_causes_is_kept_while_one_of_them_needs_it(tmp_path):
    recorder = recorder_of(tmp_path, per_cause=1)
    hear(recorder, 0, 1)
    happen(recorder)
    happen(recorder, Cause.BLIND)
    for begin in (1, 10, 20):
        hear(recorder, begin, begin + 5)
        happen(recorder)
    recorder.close()
    assert names(tmp_path) == ["0001_limit", "0004_limit"]
    again = recorder_of(tmp_path, per_cause=1)  # as its facts tell it
    happen(again)
    again.close()
    assert names(tmp_path) == ["0001_limit", "0005_limit"]


def test_a_folder_with_a_recording_is_refused(tmp_path):
    (tmp_path / "bag_0.mcap").write_bytes(b"")
    with pytest.raises(SloshBagError, match="holds a recording"):
        recorder_of(tmp_path)
    with pytest.raises(SloshBagError):
        recorder_of(tmp_path / "bag_0.mcap" / "below")


def test_a_full_disk_costs_no_event_that_is_still_in_memory(tmp_path, monkeypatch):
    recorder = recorder_of(tmp_path)
    hear(recorder, 0, 5)
    begin = McapFile.__init__

    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(McapFile, "__init__", full)
    happen(recorder)
    hear(recorder, 5, 6)
    status = recorder.status()
    assert "No space left on device" in status.failure
    monkeypatch.setattr(McapFile, "__init__", begin)
    hear(recorder, 6, 10)
    recorder.close()
    (bag,) = [name for name in names(tmp_path) if any((tmp_path / name).glob("*.mcap"))]
    times = [message.log_ns for message in BagReader(tmp_path / bag).messages()]
    assert 49 * SECOND // 10 in times
    assert (recorder.box.missed, recorder.status().failure) == (0, "")


@pytest.mark.long
def test_a_hundred_events_are_a_hundred_bags_and_memory_stays_flat(tmp_path):
    """Simulates an hour with an event every 36 s."""
    recorder = recorder_of(tmp_path)
    sizes = []
    tracemalloc.start()
    try:
        for number in range(100):
            hear(recorder, 36 * number + 32, 36 * number + 34)
            happen(recorder, list(Cause)[number % len(Cause)], f"event {number}")
            hear(recorder, 36 * number + 34, 36 * number + 36)
            recorder.status()
            sizes.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    recorder.close()
    found = names(tmp_path)
    assert len(found) == recorder.box.bags == recorder.box.events == 100
    told = [noted_events(BagReader(tmp_path / name).metadata()[EVENTS]) for name in found]
    assert [event.text for events in told for event in events] == [
        f"event {number}" for number in range(100)
    ]
    # A bag's name and causes, and no message of it.
    assert max(sizes[50:]) - min(sizes[20:50]) < 400_000


def test_all_bags_together_keep_to_the_quota(tmp_path):
    recorder = recorder_of(tmp_path, quota=10_000_000)
    noise = [DATA + bytes((k * 7919 * (i + 1) >> 3) % 251 for i in range(2000)) for k in range(40)]
    for number in range(12):
        for k, data in enumerate(noise):
            recorder.add("/h", data * 40, (10 * number) * SECOND + k * SECOND // 100)
        happen(recorder)
        recorder.look((10 * number + 9) * SECOND)
    recorder.close()
    sizes = [sum(f.stat().st_size for f in bag.iterdir()) for bag in tmp_path.iterdir()]
    assert sum(sizes) <= 10_000_000
    assert names(tmp_path)[-1] == "0012_limit"


def test_a_bag_without_messages_displaces_no_other(tmp_path, monkeypatch):
    recorder = recorder_of(tmp_path, per_cause=2)
    close = Recorder.close

    def emptied(self):
        close(self)
        for file in self.path.parent.glob("*.mcap"):
            file.unlink()

    for begin in (0, 10, 20):
        hear(recorder, begin, begin + 5)
        happen(recorder)
        if begin == 20:  # as on a disk that is full to the last byte
            monkeypatch.setattr(Recorder, "close", emptied)
        hear(recorder, begin + 5, begin + 9)
    recorder.close()
    monkeypatch.undo()
    assert names(tmp_path) == ["0001_limit", "0002_limit"]
    assert recorder.box.missed == 1
    # One that a killed recorder left behind is none, and its number is not used again.
    (tmp_path / "0007_limit").mkdir()
    recorder = recorder_of(tmp_path, per_cause=2)
    hear(recorder, 0, 5)
    happen(recorder)
    hear(recorder, 5, 9)
    recorder.close()
    assert names(tmp_path) == ["0002_limit", "0007_limit", "0008_limit"]


def test_a_quota_that_is_too_small_for_an_event_is_told(tmp_path):
    recorder = recorder_of(tmp_path, quota=10_000)
    hear(recorder, 0, 5)
    assert recorder.shortage == ""
    happen(recorder)
    for k in range(50, 58):
        hear(recorder, 5, 6, DATA + bytes(1000))
        recorder.add("/h", DATA + bytes(1000), k * SECOND // 10)
    assert "larger than half of event_quota" in recorder.shortage
    recorder.close()
    roomy = recorder_of(tmp_path / "roomy")
    hear(roomy, 0, 5)
    happen(roomy)
    hear(roomy, 5, 9)
    roomy.close()
    assert roomy.shortage == ""


@pytest.mark.parametrize("kind", ["events", "complete"])
def test_a_second_recorder_in_one_folder_is_refused_and_changes_nothing(tmp_path, kind):
    first = recorder_of(tmp_path, per_cause=1)
    with pytest.raises(SloshBagError, match="another recorder writes in it; choose another"):
        Recorder(tmp_path) if kind == "complete" else recorder_of(tmp_path, per_cause=1)
    assert names(tmp_path) == []
    hear(first, 0, 10)
    happen(first)
    with pytest.raises(SloshBagError, match=f"{tmp_path}: "):
        Recorder(tmp_path) if kind == "complete" else recorder_of(tmp_path, per_cause=1)
    hear(first, 10, 20)
    first.close()
    assert names(tmp_path) == ["0001_limit"]
    assert len(list(BagReader(tmp_path / "0001_limit").messages())) > 20


HOLD = """
import sys, time
from pathlib import Path
from slosh_bag.black_box.event_bags import EventRecorder
from slosh_bag.black_box.black_box import Windows
recorder = EventRecorder(Path(sys.argv[1]), Windows(1, 1, 10**8, 10**8), 9, 10**9)
print("held", flush=True)
time.sleep(600)
"""


def test_a_lock_goes_with_its_process_even_if_that_is_killed(tmp_path):
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert other.stdout.readline() == "held\n"
    assert is_held(tmp_path)
    with pytest.raises(SloshBagError, match="another recorder writes in it"):
        recorder_of(tmp_path)
    other.kill()
    other.wait()
    other.stdout.close()
    assert not is_held(tmp_path)
    recorder_of(tmp_path).close()

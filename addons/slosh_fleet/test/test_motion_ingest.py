"""The recorder's end: motions go to the store, and a failure is told and costs no message."""

import math
import os
import re
import sys
from pathlib import Path

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray

from slosh_bag.nodes.recorder_node import RecorderNode
from slosh_bag.reader import BagReader
from slosh_bag.store.motion_ingest import MotionIngest
from slosh_bringup.cli.main import main
from slosh_fleet.motions.store import FleetStore
from slosh_msgs.msg import ModelEstimate, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import WARN
from slosh_msgs_py.stamps import to_time
from slosh_testing.hearing_robot import Graph

BEGIN_NS = 1_790_000_000 * 10**9


def bag(folder):
    folder.mkdir(parents=True)
    (folder / "bag_0.mcap").write_bytes(b"")
    return folder


def ended(tmp_path, program, *, longest=60.0):
    """Runs another program in place of `slosh ingest` and returns what is reported of its end."""
    told = []
    command = (sys.executable, "-c", program)
    ingest = MotionIngest("STORE", bag(tmp_path / "bag"), command)
    ingest.run(lambda: told.append((ingest.facts()["motions"], ingest.complaint)), longest)
    return told[-1]


def test_what_the_command_says_is_told(tmp_path):
    program = "import sys; print(len(sys.argv), sys.argv[-1])"
    assert ended(tmp_path, program) == ("4 STORE", "")


@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("import sys; print('slosh ingest: a: wrong', file=sys.stderr); print('0'); exit(2)",
         "slosh ingest: a: wrong"),
        ("raise KeyError('x')", "KeyError: 'x'"),
        ("import os; os.kill(os.getpid(), 9)", "exit code -9"),
    ],
)  # fmt: skip
def test_a_failure_is_one_line_with_the_remedy(tmp_path, program, why):
    state, complaint = ended(tmp_path, program)
    assert state == "not added to STORE"
    folder = tmp_path / "bag"
    assert complaint == (
        f"the recording is kept, but its motions are not in STORE: {why}; "
        f"`slosh ingest {folder} --store STORE` adds them"
    )


def test_a_command_that_takes_long_goes_on_by_itself(tmp_path):
    mark = tmp_path / "mark"
    os.mkfifo(mark)
    program = f"open({str(mark)!r}).read(); open({str(tmp_path / 'done')!r}, 'x')"
    state, complaint = ended(tmp_path, program, longest=0.01)
    assert complaint == ""
    process = int(re.fullmatch(r"still being added to STORE by process (\d+)", state)[1])
    assert os.getsid(process) == process  # what ends this session leaves it alone
    mark.write_text("on")
    os.waitpid(process, 0)
    assert (tmp_path / "done").exists()


def test_without_a_program_a_store_or_a_bag_nothing_runs(tmp_path):
    ingest = MotionIngest("STORE", bag(tmp_path / "bag"), ["/absent/program"])
    ingest.run(lambda: None)
    assert "/absent/program: No such file or directory; `slosh ingest" in ingest.complaint
    for store, folder in (("", tmp_path / "bag"), ("STORE", tmp_path / "empty")):
        ingest = MotionIngest(store, folder, ["/absent/program"])
        ingest.run(lambda: pytest.fail("nothing is told"))
        assert ingest.complaint == ""


@pytest.fixture
def cell(tmp_path):
    rclpy.init()
    graph = Graph("talker")
    yield graph
    graph.close()
    rclpy.shutdown()


def record_a_motion(cell, folder, store):
    """Records a push of 1 s and returns the recorder, which is not closed."""
    recorder = cell.with_parameters(
        RecorderNode, output=str(folder), topics="^/line/", store_motions=str(store)
    )
    publisher = cell.publisher(SloshEstimate, "/line/estimate", qos.STREAM_OUT)
    cell.until(lambda: publisher.get_subscription_count() == 1)
    still = ModelEstimate(modal_position=[0.0, 0.0], modal_velocity=[0.0, 0.0])
    for number in range(300):
        push = 3.0 * math.sin(math.pi * number / 100.0) if 100 <= number < 200 else 0.0
        message = SloshEstimate(acceleration=[push, 0.0, 0.0], linear=still, nonlinear=still)
        message.header.stamp = to_time(BEGIN_NS + 10_000_000 * number)
        publisher.publish(message)
        if number % 50 == 0:
            cell.until(lambda n=number: written(recorder) > n)
    cell.until(lambda: written(recorder) == 300)
    return recorder


def written(recorder):
    return recorder._core.status().written.get("/line/estimate", 0)


def test_the_motions_of_a_recording_are_stored_at_its_end(cell, tmp_path, capsys):
    folder, store = tmp_path / "bag", tmp_path / "store"
    recorder = record_a_motion(cell, folder, store)
    assert not store.exists()
    recorder.close()
    assert recorder.failure == ""
    found = FleetStore(str(store)).dataset().to_table().to_pylist()
    assert [(row["cell"], row["bag"]) for row in found] == [("line", str(folder))]
    assert recorder._facts()["motions"] == f"1 motions of 1 bags in {store}"
    before = sorted(store.rglob("*"))
    assert main(["ingest", str(folder), "--store", str(store)]) == 0
    assert "1 motions, stored before" in capsys.readouterr().out
    assert sorted(store.rglob("*")) == before


def test_a_store_that_cannot_be_written_is_told_and_the_recording_is_whole(cell, tmp_path):
    folder, store = tmp_path / "bag", tmp_path / "file"
    store.write_text("no folder")
    told = cell.listen(DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS)
    recorder = record_a_motion(cell, folder, store)
    recorder.close()
    assert re.search(r"its motions are not in .*/file: .*Not a directory", recorder.failure)
    assert len([m for m in BagReader(folder).messages() if m.topic == "/line/estimate"]) == 300

    def complaints():
        states = [one for array in told for one in array.status if one.name == "/recorder"]
        return [one for one in states if "the recording is kept, but" in one.message]

    cell.until(complaints, "the complaint")
    assert complaints()[-1].level == WARN
    assert store.read_text() == "no folder"
    assert Path(folder).is_dir()

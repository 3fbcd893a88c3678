"""Tests recordings of two cells in one namespace: reported, without a traceback."""

import dataclasses
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_bag.recorder import PUBLISHERS, SEVERAL
from slosh_bag.recover import NotedDefinitions
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_replay.replay import replay_bag
from slosh_replay.replay.one_estimator import OneEstimator

MODEL = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
BAGS = Path(__file__).resolve().parents[3] / "bags"
# Not the comparisons: those of the shipped bags are shorter than the writer's definition.
ENDS = ("/accel", "/estimate", "/estimator_state", "/settings", "/free_surface")
_STAMP = struct.Struct("<iI")


def shifted(message, by_ns):
    """Returns the message with a later header stamp and log time."""
    if message.topic.endswith("/settings"):
        return message._replace(log_ns=message.log_ns + by_ns)
    sec, nanosec = _STAMP.unpack_from(message.data, 4)
    stamp = sec * 10**9 + nanosec + by_ns
    data = message.data[:4] + _STAMP.pack(*divmod(stamp, 10**9)) + message.data[12:]
    return message._replace(log_ns=message.log_ns + by_ns, data=data)


def part(name, ends=ENDS):
    found = [m for m in BagReader(BAGS / name).messages() if m.topic.endswith(tuple(ends))]
    return found, found[0].log_ns


def mix(folder, lead_ns, ends=ENDS, facts=(), left_out="nothing"):
    """Writes a bag that mixes two recordings as if of two cells."""
    first, begin = part("c", ends)
    second, other = part("e", [end for end in ends if end != left_out])
    both = first + [shifted(message, begin - other + lead_ns) for message in second]
    reader = BagReader(BAGS / "c")
    list(reader.messages())  # makes its types known
    with BagWriter(folder, NotedDefinitions(reader.types)) as writer:
        for name, value in facts:
            writer.note(name, value)
        for message in sorted(both, key=lambda message: message.log_ns):
            writer.add_topic(message.topic, message.message_type)
            writer.write(message.topic, message.data, message.log_ns, message.publish_ns)
    return folder


@pytest.mark.long
@pytest.mark.parametrize(
    "lead",
    [
        0.0,
        0.35,
        1.0,
        pytest.param(2.6, marks=pytest.mark.long),
        -0.4,
        pytest.param(-1.5, marks=pytest.mark.long),
    ],
)
def test_two_cells_without_a_note_are_recognised_by_their_estimates(tmp_path, lead):
    bag = mix(tmp_path / "bag", round(lead * 1e9) + 333_000)
    for number in (1, 2):
        found = replay_bag(bag, estimator=number)
        assert found.verification.recorded == found.verification.identical
        assert any("mixed on /slosh/accel, /slosh/estimate" in line for line in found.warnings)


def test_two_cells_of_which_only_one_tells_its_settings_are_refused(tmp_path):
    bag = mix(tmp_path / "bag", 32_500_333_000, left_out="/settings")
    with pytest.raises(SloshBagError, match=r"go back \d+ times, .* several publishers"):
        replay_bag(bag)


@pytest.mark.parametrize("ends", [("/accel", "/settings"), ("/accel", "/free_surface")])
def test_inputs_of_two_cells_without_estimates_are_told(tmp_path, ends):
    found = replay_bag(mix(tmp_path / "bag", 333_000, ends), MODEL)
    assert any("several publishers are mixed on its topic" in line for line in found.warnings)


NOTED = ["/slosh/accel", "/slosh/estimate"]


def noted(topics):
    nodes = '{"/slosh/estimate": ["/slosh/estimator", "/slosh/estimator"]}'
    return [(SEVERAL, ",".join(topics)), (PUBLISHERS, nodes)]


def check(found, count):
    assert found.verification.recorded == found.verification.identical == count
    assert found.verification.missing <= 1
    named = r"mixed on .*/slosh/estimate \(of 2 x /slosh/estimator\)"
    assert any(re.search(named, line) for line in found.warnings)


@pytest.mark.first(1)
@pytest.mark.parametrize("lead", [0.0, 1.0, 2.6])
def test_of_two_cells_the_estimator_that_came_first_is_replayed_by_itself(tmp_path, lead):
    bag = mix(tmp_path / "bag", round(lead * 1e9) + 333_000, facts=noted(NOTED))
    found = replay_bag(bag)
    first = "e" if lead < 1.3 else "c"  # the one whose first estimate was recorded earlier
    recorded = BagReader(BAGS / first).topics()["/slosh/estimate"].count
    check(found, pytest.approx(recorded, abs=1))
    # The other one, too.
    other = "ce".replace(first, "")
    recorded = BagReader(BAGS / other).topics()["/slosh/estimate"].count
    found = replay_bag(bag, estimator=2)
    check(found, pytest.approx(recorded, abs=1))
    assert any("of 2 estimators on /slosh/estimate the replayed one is 2" in line
               for line in found.warnings)  # fmt: skip
    with pytest.raises(SloshBagError, match="estimator 3 of 2: there is no such one"):
        replay_bag(bag, estimator=3)


def test_of_two_estimators_on_one_input_the_first_is_replayed(tmp_path):
    reader = BagReader(BAGS / "c")
    messages = [m for m in reader.messages() if m.topic.endswith(ENDS)]
    estimates = [m for m in messages if m.topic == "/slosh/estimate"]
    for message in estimates:
        estimate = reader.decode(message)
        other = dataclasses.replace(estimate, samples_used=estimate.samples_used + 1000)
        other.nonlinear.msh += 1e-3
        data = reader.typestore.serialize_cdr(other, message.message_type)
        messages.append(message._replace(log_ns=message.log_ns + 200_000, data=bytes(data)))
    with BagWriter(tmp_path / "bag", NotedDefinitions(reader.types)) as writer:
        for name, value in noted(NOTED[1:]):
            writer.note(name, value)
        for message in sorted(messages, key=lambda message: message.log_ns):
            writer.add_topic(message.topic, message.message_type)
            writer.write(message.topic, message.data, message.log_ns, message.publish_ns)
    check(replay_bag(tmp_path / "bag"), len(estimates))


MS = 1_000_000


@pytest.mark.parametrize("other", [1, 40, 500_000])
def test_estimators_are_told_apart_by_their_counts_and_stamps(other):
    """Tests that estimators are separated by their counters and stamps."""
    rows = [(2 * MS * k, 40 + k, True) for k in range(60) if k not in (7, 8, 9)]
    rows += [(2 * MS * k + MS // 3, other + k, False) for k in range(60)]
    stamps, used, own = (np.array(column) for column in zip(*sorted(rows), strict=True))
    assert OneEstimator().mask(stamps, used).tolist() == own.tolist()

"""Tests recordings of two cells in one namespace: reported, without a traceback."""

import re
import struct
from pathlib import Path

import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.reader import BagReader
from slosh_bag.recorder import PUBLISHERS, SEVERAL
from slosh_bag.recover import NotedDefinitions
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_replay.replay import replay_bag

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


def test_two_cells_of_which_only_one_tells_its_settings_are_told(tmp_path):
    first, begin = part("c")
    moving = next(message.log_ns for message in first if message.topic.endswith("/accel"))
    lead = moving - begin + 333_000
    found = replay_bag(mix(tmp_path / "bag", lead, left_out="/settings"))
    assert not found.verification.exact
    assert any("several publishers are mixed on its topic" in line for line in found.warnings)


@pytest.mark.parametrize("ends", [("/accel", "/settings"), ("/accel", "/free_surface")])
def test_inputs_of_two_cells_without_estimates_are_told(tmp_path, ends):
    found = replay_bag(mix(tmp_path / "bag", 333_000, ends), MODEL)
    assert any("several publishers are mixed on its topic" in line for line in found.warnings)


def test_two_cells_in_one_namespace_are_named_with_the_remedy(tmp_path):
    nodes = '{"/slosh/estimate": ["/slosh/estimator", "/slosh/estimator"]}'
    facts = [(SEVERAL, "/slosh/accel,/slosh/estimate"), (PUBLISHERS, nodes)]
    found = replay_bag(mix(tmp_path / "bag", 333_000, facts=facts))
    assert not found.verification.exact
    named = r"mixed on .*/slosh/estimate \(of 2 x /slosh/estimator\).* another namespace"
    assert any(re.search(named, line) for line in found.warnings)

"""Writes small bags of a robot cell with an estimator: one push of the container, then rest."""

import math
from datetime import UTC, datetime

from rclpy.serialization import serialize_message

from slosh_bag.bag_writer import BagWriter
from slosh_msgs.msg import ModelEstimate, NodeSettings, SloshEstimate
from slosh_msgs_py.stamps import to_time

MODEL = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}"
BEGIN_NS = int(datetime(2026, 1, 30, 12, tzinfo=UTC).timestamp()) * 10**9


def observed(folder, others):
    """Writes a bag with estimates of one push of 1 s, then rest, and the given other messages.

    Args:
        folder: of the bag.
        others: name of the topic, message and time [s] of each.
    """
    messages = []
    still = ModelEstimate(modal_position=[0.0, 0.0], modal_velocity=[0.0, 0.0])
    for number in range(600):
        push = 3.0 * math.sin(math.pi * number / 100.0) if 100 <= number < 200 else 0.0
        estimate = SloshEstimate(acceleration=[push, 0.0, 0.0], linear=still, nonlinear=still)
        messages.append(("estimate", estimate, 0.01 * number))
    document = f"parameters: {{}}\nfiles: {{model: {MODEL!r}}}\n"
    messages.append(("settings", NodeSettings(node="estimator", document=document), 0.0))
    with BagWriter(folder) as writer:
        for name, message, seconds in [*messages, *others]:
            stamp_ns = BEGIN_NS + round(1e9 * seconds)
            message.header.stamp = to_time(stamp_ns)
            writer.add_topic(f"/slosh/{name}", _type_name(message))
            writer.write(f"/slosh/{name}", serialize_message(message), stamp_ns)


def _type_name(message):
    package = type(message).__module__.partition(".")[0]
    return f"{package}/msg/{type(message).__name__}"

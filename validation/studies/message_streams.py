"""Draws motions of a robot as messages, and gives them to the real readers of the inputs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from random import Random
from typing import Any, NamedTuple

import numpy as np

from slosh_model.model import Model
from slosh_motion.checks.stamp_checks import stamp_doubts
from slosh_motion.inputs.frames import Transform
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.sampling import modes_of
from slosh_motion.inputs.velocity_input import Twist

BEGIN = 1_700_000_000_000_000_000
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
NOWHERE = (0.0, 0.0, 0.0)
RATES = (50.0, 100.0, 125.0, 250.0, 500.0)
LONGEST = 4000
"""Messages of a stream."""
MODEL = Model.from_cup(diameter=0.08, fill_height=0.06).nonlinear()
ARM = """<robot name="arm"><link name="world"/><link name="upper"/><link name="container"/>
<joint name="shoulder" type="continuous"><parent link="world"/><child link="upper"/>
<axis xyz="0 0 1"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="container"/>
<origin xyz="0.4 0 0"/><axis xyz="0 0 1"/></joint></robot>"""
JOINTS = ("shoulder", "elbow")
Place = tuple[float, float, float]


class Row(NamedTuple):
    """A message: stamp and arrival [s], values, and who publishes it."""

    stamp: float
    arrived: float
    values: Any
    publisher: str = ""


class Stroke(NamedTuple):
    """A stroke there and back: its vector [m], how long it takes [s]."""

    vector: Place
    lasts: float

    @classmethod
    def drawn(cls, draw: Random) -> Stroke:
        """Returns a random stroke of 0.1 to 0.8 m in 0.5 to 1.5 s."""
        vector = [draw.gauss(0.0, 1.0) for _ in range(3)]
        scale = draw.uniform(0.1, 0.8) / math.hypot(*vector)
        return cls(
            (scale * vector[0], scale * vector[1], scale * vector[2]), draw.uniform(0.5, 1.5)
        )

    def at(self, t: float) -> Place:
        """Returns the place at a time [s]."""
        share = 0.0
        for start, sign in ((1.0, 1.0), (3.5, -1.0)):
            s = min(max((t - start) / self.lasts, 0.0), 1.0)
            share += sign * s**3 * (10 - 15 * s + 6 * s * s)
        x, y, z = self.vector
        return share * x, share * y, share * z

    def velocity(self, t: float) -> Place:
        """Returns the velocity at a time [m/s]."""
        before, after = self.at(t - 1e-4), self.at(t + 1e-4)
        x, y, z = ((b - a) / 2e-4 for a, b in zip(before, after, strict=True))
        return x, y, z

    def acceleration(self, t: float) -> Place:
        """Returns the acceleration at a time [m/s²]."""
        before, after = self.velocity(t - 1e-3), self.velocity(t + 1e-3)
        x, y, z = ((b - a) / 2e-3 for a, b in zip(before, after, strict=True))
        return x, y, z


def times(rate: float, begin: float = 0.0) -> Iterator[float]:
    """Yields the times [s] of a motion at a rate [Hz]."""
    return (begin + k / rate for k in range(int(6.0 * rate)))


def take(kind: str, reader: Any, source: Any, row: Row) -> list[Any]:
    """Gives a message to the reader of its kind; returns the samples that are complete."""
    stamp, at = (BEGIN + round(1e9 * t) for t in row[:2])
    if kind == "accel":
        return [reader.update(stamp, "world", *row.values)]
    if kind == "imu":
        return [reader.update(stamp, *row.values)]
    if kind == "pose":
        return list(reader.update(stamp, *row.values))
    if kind in ("odometry", "twist"):
        return list(reader.update_twist(Twist(stamp, *row.values)))
    if kind == "joints":
        names, positions = row.values
        found = source.take(stamp, names, positions, (), at)
    else:
        parent, child, place, turn = row.values
        found = source.take([Transform(parent, child, stamp, place, turn)], at_ns=at)
    return [sample for pose in found for sample in reader.update(*pose)]


def heard(kind: str, rows: Iterable[Row]) -> tuple[str, list[Any]]:
    """Returns what is told of messages in the order of their arrival, and the input samples."""
    settings = InputSettings(
        kind, modes=modes_of(MODEL), urdf=ARM, frames=("world", "container"), any_world=True
    )
    reader, source = settings.reader(kind), settings.poses(kind)
    clocks: dict[str, list[tuple[float, float]]] = {}
    samples: list[Any] = []
    for row in sorted(rows, key=lambda one: one.arrived)[:LONGEST]:
        samples += take(kind, reader, source, row)
        clocks.setdefault(row.publisher, []).append(row[:2])
    found = [reader.doubt, reader.began, *reader.message_doubts()]
    found += [source.clock_doubt()] if source is not None else []
    texts = [one.text for one in found if one is not None]
    for each in clocks.values():
        stamps, logs = (
            BEGIN + np.rint(1e9 * column).astype(np.int64) for column in np.array(each).T
        )
        texts += [str(doubt) for doubt in stamp_doubts(stamps, logs, "messages")]
    return " ".join(texts), [one for one in samples if one is not None]


def told(kind: str, rows: Iterable[Row]) -> str:
    """Returns what is told of messages."""
    return heard(kind, rows)[0]


def sent(draw: Random, rows: Iterable[tuple[float, Any]], publisher: str = "") -> list[Row]:
    """Returns messages that arrive up to some milliseconds after their stamps."""
    delay, scatter = draw.uniform(0.0, 0.008), draw.choice((0.0, 5e-4, 2e-3))
    found, newest = [], -math.inf
    for stamp, values in rows:  # one publisher's do not overtake each other
        newest = max(newest, stamp + delay + draw.expovariate(1.0) * scatter)
        found.append(Row(stamp, newest, values, publisher))
    return found


def upright(rows: Iterable[tuple[float, Place]]) -> Iterator[tuple[float, Any]]:
    """Yields places as the values of poses."""
    return ((t, (place, UPRIGHT)) for t, place in rows)


def sum_of(one: Place, other: Iterable[float]) -> Place:
    """Returns the sum of two vectors."""
    x, y, z = (a + b for a, b in zip(one, other, strict=True))
    return x, y, z


def chain(draw: Random, stroke: Stroke) -> tuple[list[Row], list[Row]]:
    """Returns moving transforms of two publishers: of the rail, and of the container on it."""
    rail = ((t, ("world", "rail", stroke.at(t), UPRIGHT)) for t in times(draw.choice(RATES)))
    angle = draw.uniform(0.3, 2.0)
    wrist = []
    for t in times(draw.choice(RATES)):
        half = 0.5 * angle * math.sin(0.8 * t) ** 2
        turn = (0.0, 0.0, math.sin(half), math.cos(half))
        wrist.append((t, ("rail", "container", (0.2, 0.0, 0.1), turn)))
    return sent(draw, rail, "rail"), sent(draw, wrist, "container")


def joints(draw: Random, stroke: Stroke, *, apart: bool) -> tuple[list[Row], list[Row]]:
    """Returns joint states of two publishers, or of one that sends both joints."""
    quantum = draw.choice((0.0, 0.0, 1e-5, math.radians(0.01)))
    size = draw.uniform(1.0, 3.0)

    def angles(t: float) -> tuple[float, float]:
        x, y, z = stroke.at(t)
        found = (0.3 + size * (x + z), -0.9 + size * (y - z))
        return found if not quantum else (
            round(found[0] / quantum) * quantum, round(found[1] / quantum) * quantum
        )  # fmt: skip

    if not apart:
        rows = [(t, (JOINTS, angles(t))) for t in times(draw.choice(RATES))]
        return sent(draw, rows), []
    one, other = (
        sent(draw, [(t, ((name,), (angles(t)[k],))) for t in times(draw.choice(RATES))], name)
        for k, name in enumerate(JOINTS)
    )
    return one, other

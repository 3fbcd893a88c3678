"""Measures how often contradicting messages are found, and honest ones are blamed.

    tools/run python validation/studies/message_checks.py 200 docs/results/tables

Each seed draws a motion of a robot and one fault of each kind. Odd seeds are reported; even ones
are for whoever tunes the checks. Of honest kinds four times as many seeds are drawn.
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

from honest_inputs import honest_input

from slosh_estimator.gate import GateSettings
from slosh_estimator.pose_input import PoseInput
from slosh_estimator.velocity_input import Twist, VelocityInput

BEGIN = 1_700_000_000_000_000_000
GATE = GateSettings(max_jump=math.inf, confirms=False)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
RATES = (50.0, 100.0, 125.0, 250.0, 500.0)
LAGS = (0.005, 0.02, 0.05, 0.15)
Place = tuple[float, float, float]
Row = tuple[float, Place]


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


def times(rate: float) -> Iterator[float]:
    """Yields the times [s] of a motion at a rate [Hz]."""
    return (k / rate for k in range(int(6.0 * rate)))


def told(rows: list[Row]) -> str:
    """Returns what a reader of poses says of rows in order of arrival."""
    reader = PoseInput(GATE, 0.0, checks=True)
    for t, place in rows:
        reader.update(BEGIN + round(1e9 * t), place, UPRIGHT)
    return " ".join(doubt.text for doubt in reader.message_doubts())


def zeros(draw: Random, stroke: Stroke) -> str:
    """Three single poses are zero."""
    rate, base = draw.choice(RATES), [draw.uniform(-0.4, 0.4) for _ in range(3)]
    rows = [(t, sum_of(stroke.at(t), base)) for t in times(rate)]
    for _ in range(3):
        k = draw.randrange(5, len(rows) - 5)
        rows[k] = rows[k][0], (0.0, 0.0, 0.0)
    return told(rows)


def stairs(draw: Random, stroke: Stroke) -> str:
    """Poses are renewed at 10 to 50 Hz and sent at least twice as often."""
    renewed = draw.choice((10.0, 20.0, 25.0, 30.0, 40.0, 50.0))
    rate = draw.choice([rate for rate in RATES if rate >= 2.0 * renewed])
    return told([(t, stroke.at(math.floor(t * renewed + 1e-9) / renewed)) for t in times(rate)])


def two(lag: float) -> Callable[[Random, Stroke], str]:
    """Returns the kind: two publishers, one of them late by a time [s]."""

    def kind(draw: Random, stroke: Stroke) -> str:
        rate, other = draw.choice(RATES), draw.choice(RATES)
        shift = draw.uniform(0.1, 0.9) / rate
        rows = [(t, stroke.at(t)) for t in times(rate)]
        rows += [(t + shift, stroke.at(t + shift - lag)) for t in times(other)]
        return told(sorted(rows))

    return kind


def sum_of(one: Place, other: list[float]) -> Place:
    """Returns the sum of two vectors."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def rounded_poses(draw: Random, stroke: Stroke) -> str:
    """Honest: rounded or noisy poses, with uneven stamps."""
    rate, noise = draw.choice((20.0, *RATES, 1000.0)), draw.choice((0.0, 1e-5, 1e-4, 1e-3))
    quantum, jitter = draw.choice((0.0, 1e-4, 1e-3)), draw.choice((0.0, 0.2, 0.9)) / rate
    rows: list[Row] = []
    for t in times(rate):
        place = [value + draw.gauss(0.0, noise) for value in stroke.at(t)]
        if quantum:
            place = [round(value / quantum) * quantum for value in place]
        rows.append((t + draw.uniform(0.0, jitter), (place[0], place[1], place[2])))
    return told(rows)


def shaken_poses(draw: Random, stroke: Stroke) -> str:
    """Honest: oscillations at up to 8 Hz beside a stroke."""
    rate = draw.choice((20.0, *RATES))
    frequency, size = draw.uniform(0.3, min(8.0, rate / 8.0)), draw.uniform(0.005, 0.3)
    return told([
        (t, sum_of(stroke.at(t), [size * math.sin(math.tau * frequency * t), 0.0, 0.0]))
        for t in times(rate)
    ])  # fmt: skip


def robot_poses(draw: Random, _: Stroke) -> str:
    """Honest: fast moves, circles and drives of another generator, with noise."""
    motion = honest_input(draw.randrange(10**9))
    noise = draw.choice((0.0, 1e-5, 1e-4))
    rows: list[Row] = []
    for stamp, (x, y, z) in zip(motion.stamps, motion.position.tolist(), strict=True):
        place = [draw.gauss(0.0, noise) for _ in range(3)]
        rows.append(((int(stamp) - BEGIN) * 1e-9, sum_of((x, y, z), place)))
    return told(rows)


def odometry(how: str) -> Callable[[Random, Stroke], str]:
    """Returns the kind: odometry on a straight and a curve, its twist wrong in one way."""

    def kind(draw: Random, _: Stroke) -> str:
        reader = VelocityInput(GATE, checks=True)
        rate, heading = draw.choice((10.0, 20.0, *RATES[:-2])), draw.uniform(0.4, 2.7)
        top, turning = draw.uniform(0.2, 1.5), draw.uniform(-1.5, 1.5)
        x = y = 0.0
        for t in times(rate):
            speed, spin = top * min(t, 1.0, max(5.0 - t, 0.0)), turning * (1.5 < t < 3.5)
            vx, vy = speed * math.cos(heading), speed * math.sin(heading)
            slip = draw.gauss(1.0, 0.03)
            sent = {"empty": (0.0, 0.0, 0.0), "parent": (vx, vy, 0.0)}.get(
                how, (slip * speed, 0.0, 0.0)
            )
            turn = (0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading))
            stamp, rates = BEGIN + round(1e9 * t), (0.0, 0.0, 0.0 if how == "empty" else spin)
            reader.update_twist(Twist(stamp, sent, rates, turn, "base", (x, y, 0.0)))
            heading += 0.5 * spin / rate
            x += speed * math.cos(heading) / rate
            y += speed * math.sin(heading) / rate
            heading += 0.5 * spin / rate
        return " ".join(doubt.text for doubt in reader.message_doubts())

    return kind


WRONG: dict[str, tuple[Callable[[Random, Stroke], str], str]] = {
    "zeros now and then": (zeros, "leap"),
    "stairs of 10 to 50 Hz": (stairs, "renewed at"),
    **{f"two publishers, {1e3 * lag:g} ms apart": (two(lag), "publishers") for lag in LAGS},
    "odometry: twist never filled": (odometry("empty"), "stays zero"),
    "odometry: twist in the parent's axes": (odometry("parent"), "axes of header.frame_id"),
}
HONEST: dict[str, Callable[[Random, Stroke], str]] = {
    "honest: rounded, noisy, uneven": rounded_poses,
    "honest: shaken": shaken_poses,
    "honest: moves, circles, drives": robot_poses,
    "honest: odometry with slip": odometry("right"),
}


def main(seeds: int, folder: Path) -> None:
    """Writes the table of all kinds over the odd seeds below a number."""
    rows: list[tuple[str, int, int, int]] = []
    odd = range(1, seeds, 2)
    for name, (kind, word) in WRONG.items():
        texts = [kind(draw, Stroke.drawn(draw)) for draw in map(Random, odd)]
        named = sum(word in text for text in texts)
        rows.append((name, len(texts), named, sum(bool(text) for text in texts) - named))
    for name, honest in HONEST.items():
        many = range(1, 4 * seeds, 2)
        texts = [honest(draw, Stroke.drawn(draw)) for draw in map(Random, many)]
        rows.append((name, len(texts), 0, sum(bool(text) for text in texts)))
    with (folder / "input_checks_messages.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([("messages", "motions", "named", "called something else"), *rows])


if __name__ == "__main__":
    main(int(sys.argv[1]), Path(sys.argv[2]))

"""Measures how often faulty messages are named, and honest ones are blamed.

    tools/run python validation/studies/message_checks.py 300 docs/results/tables

Each seed draws a motion of a robot and one fault of each kind. All messages go through the real
readers, with the times of their arrival. Odd seeds are reported; even ones (a third argument 0)
are for whoever tunes the checks. Of faults a third as many seeds are drawn as of honest messages.
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from honest_inputs import HonestInput, honest_input
from message_streams import (
    BEGIN,
    LONGEST,
    MODEL,
    NOWHERE,
    RATES,
    UPRIGHT,
    Place,
    Row,
    Stroke,
    chain,
    heard,
    joints,
    sent,
    sum_of,
    times,
    told,
    upright,
)

from slosh_model.simulate import Inputs, simulate

LAGS = (0.005, 0.02, 0.05, 0.15)
Kind = Callable[[Random, Stroke], str]


# --- faults --------------------------------------------------------------------------------------


def zeros(draw: Random, stroke: Stroke) -> str:
    """Three single poses are zero."""
    rate, base = draw.choice(RATES), [draw.uniform(-0.4, 0.4) for _ in range(3)]
    rows = [(t, sum_of(stroke.at(t), base)) for t in times(rate)]
    for _ in range(3):
        k = draw.randrange(5, len(rows) - 5)
        rows[k] = rows[k][0], NOWHERE
    return told("pose", sent(draw, upright(rows)))


def stairs(draw: Random, stroke: Stroke) -> str:
    """Poses are renewed at 10 to 50 Hz and sent at least twice as often."""
    renewed = draw.choice((10.0, 20.0, 25.0, 30.0, 40.0, 50.0))
    rate = draw.choice([rate for rate in RATES if rate >= 2.0 * renewed])
    rows = [(t, stroke.at(math.floor(t * renewed + 1e-9) / renewed)) for t in times(rate)]
    return told("pose", sent(draw, upright(rows)))


def two(kind: str, lag: float) -> Kind:
    """Returns the fault: two publishers, one of them late by a time [s]."""

    def fault(draw: Random, stroke: Stroke) -> str:
        rate, other = draw.choice(RATES), draw.choice(RATES)
        shift = draw.uniform(0.1, 0.9) / rate

        def values(t: float) -> Any:
            return (stroke.at(t), UPRIGHT) if kind == "pose" else (stroke.velocity(t), NOWHERE)

        rows = [Row(t, t, values(t)) for t in times(rate)]
        rows += [Row(t + shift, t + shift, values(t + shift - lag)) for t in times(other)]
        return told(kind, rows)

    return fault


def odometry(how: str) -> Kind:
    """Returns odometry on a straight and a curve, its twist wrong in one way."""

    def fault(draw: Random, _: Stroke) -> str:
        rate, heading = draw.choice((10.0, 20.0, *RATES[:-2])), draw.uniform(0.4, 2.7)
        top, turning = draw.uniform(0.2, 1.5), draw.uniform(-1.5, 1.5)
        x = y = 0.0
        rows = []
        for t in times(rate):
            speed, spin = top * min(t, 1.0, max(5.0 - t, 0.0)), turning * (1.5 < t < 3.5)
            vx, vy = speed * math.cos(heading), speed * math.sin(heading)
            slip = draw.gauss(1.0, 0.03)
            sends = {"empty": NOWHERE, "parent": (vx, vy, 0.0)}.get(how, (slip * speed, 0.0, 0.0))
            turn = (0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading))
            rates = (0.0, 0.0, 0.0 if how == "empty" else spin)
            rows.append((t, (sends, rates, turn, "base", (x, y, 0.0))))
            heading += 0.5 * spin / rate
            x += speed * math.cos(heading) / rate
            y += speed * math.sin(heading) / rate
            heading += 0.5 * spin / rate
        return told("odometry", sent(draw, rows))

    return fault


def dropouts(draw: Random, stroke: Stroke) -> str:
    """One to three velocities in the middle of the stroke are zero."""
    rate = draw.choice(RATES)
    rows = [(t, (stroke.velocity(t), NOWHERE)) for t in times(rate)]
    begin = int((1.0 + draw.uniform(0.3, 0.7) * stroke.lasts) * rate)
    for k in range(begin, begin + draw.randint(1, 3)):
        rows[k] = rows[k][0], (NOWHERE, NOWHERE)
    return told("twist", sent(draw, rows))


def begun(kind: str) -> Kind:
    """Returns the fault: the first messages move already."""

    def fault(draw: Random, stroke: Stroke) -> str:
        rate, begin = draw.choice(RATES), 1.0 + draw.uniform(0.15, 0.85) * stroke.lasts
        if kind == "accel":  # below 1 m/s² along the floor nothing is told
            while math.hypot(*stroke.acceleration(begin)[:2]) < 1.2:
                stroke = Stroke.drawn(draw)
                begin = 1.0 + draw.uniform(0.05, 0.4) * stroke.lasts
        values: dict[str, Callable[[float], Any]] = {
            "pose": lambda t: (stroke.at(t), UPRIGHT),
            "twist": lambda t: (stroke.velocity(t), NOWHERE),
            "accel": stroke.acceleration,
        }
        return told(kind, sent(draw, ((t, values[kind](t)) for t in times(rate, begin))))

    return fault


def height(t: list[float], accelerations: list[Place]) -> float:
    """Returns the greatest height of the liquid [mm]."""
    motion = Inputs(np.array(t) - t[0], np.array(accelerations))
    return 1e3 * float(np.max(simulate(MODEL, motion)[0].msh))


def late(draw: Random, stroke: Stroke) -> str:
    """Poses are stamped as they are sent, 1 to 8 ms late; those that are read rightly count."""
    rate, scatter = draw.choice(RATES[:-1]), draw.uniform(0.001, 0.008)
    rows: list[Row] = []
    for t in times(rate):
        stamp = t + abs(draw.gauss(0.0, scatter))
        arrived = max(stamp, rows[-1].arrived if rows else stamp)
        rows.append(Row(stamp, arrived + 1e-6, (stroke.at(t), UPRIGHT)))
    text, samples = heard("pose", rows)
    found = height([1e-9 * (s.stamp_ns - BEGIN) for s in samples], [s[1:4] for s in samples])
    right = height(list(times(1000.0)), [stroke.acceleration(t) for t in times(1000.0)])
    return text if text or abs(found - right) > max(1.0, 0.1 * right) else "scatter: read rightly"


def unit(draw: Random, stroke: Stroke) -> str:
    """The stamps' fraction holds ms or µs, or nothing."""
    rate, size = draw.choice(RATES), draw.choice((0.0, 1e-6, 1e-3))
    rows = [Row(math.floor(t) + size * (t % 1.0), t, (stroke.at(t), UPRIGHT)) for t in times(rate)]
    return told("pose", rows)


def counted(draw: Random, stroke: Stroke) -> str:
    """The stamps are counted at a rate that is up to 20 % wrong."""
    factor, rate = 1.0 + draw.choice((-1.0, 1.0)) * draw.uniform(0.02, 0.2), draw.choice(RATES)
    rows = sent(draw, upright((t, stroke.at(t)) for t in times(rate)))
    return told("pose", [row._replace(stamp=factor * row.stamp) for row in rows])


def was_set(draw: Random, stroke: Stroke) -> str:
    """The clock that stamps is set by 20 to 200 ms during the motion."""
    at, rate = draw.uniform(1.0, 4.5), draw.choice(RATES)
    step = draw.uniform(max(0.02, 1.5 / rate), 0.2)
    rows = sent(draw, upright((t, stroke.at(t)) for t in times(rate)))
    return told("pose", [row._replace(stamp=row.stamp + step * (row.stamp > at)) for row in rows])


def ahead(kind: str) -> Kind:
    """Returns the fault: the clock of one of two publishers is 20 to 300 ms ahead."""

    def fault(draw: Random, stroke: Stroke) -> str:
        while math.hypot(*stroke.vector) < 0.25:
            stroke = Stroke.drawn(draw)
        one, other = chain(draw, stroke) if kind == "tf" else joints(draw, stroke, apart=True)
        off = draw.uniform(0.02, 0.3)
        return told(kind, [*(row._replace(stamp=row.stamp + off) for row in one), *other])

    return fault


# --- honest streams ------------------------------------------------------------------------------


def rounded_poses(draw: Random, stroke: Stroke) -> str:
    """Rounded or noisy poses, measured at uneven times or stamped up to a fifth tick late."""
    rate, noise = draw.choice((20.0, *RATES, 1000.0)), draw.choice((0.0, 1e-5, 1e-4, 1e-3))
    quantum, uneven = draw.choice((0.0, 1e-4, 1e-3)), draw.choice((0.0, 0.9)) / rate
    late = draw.choice((0.0, 0.2)) / rate if not uneven else 0.0
    rows: list[tuple[float, Place]] = []
    for tick in times(rate):
        t = tick + draw.uniform(0.0, uneven)
        place = [value + draw.gauss(0.0, noise) for value in stroke.at(t)]
        if quantum:
            place = [round(value / quantum) * quantum for value in place]
        rows.append((t + draw.uniform(0.0, late), (place[0], place[1], place[2])))
    return told("pose", sent(draw, upright(rows)))


def shaken_poses(draw: Random, stroke: Stroke) -> str:
    """Oscillations at up to 8 Hz and 20 m/s², growing from rest, beside a stroke."""
    rate = draw.choice((20.0, *RATES))
    frequency, size = draw.uniform(0.3, min(8.0, rate / 8.0)), draw.uniform(0.005, 0.3)
    size = min(size, 20.0 / (math.tau * frequency) ** 2)
    rows = []
    for t in times(rate):
        grown = min(t, 1.0) ** 2 * (3.0 - 2.0 * min(t, 1.0))
        aside = grown * size * math.sin(math.tau * frequency * t)
        rows.append((t, sum_of(stroke.at(t), (aside, 0.0, 0.0))))
    return told("pose", sent(draw, upright(rows)))


def resting_first(draw: Random) -> HonestInput:
    """Returns the motion and sensors of another generator, one that begins at rest."""
    while True:
        motion = honest_input(draw.randrange(10**9))
        if np.abs(motion.true[:5]).max() < 0.1:
            return motion


def robot(kind: str) -> Kind:
    """Returns moves, circles, drives, pouring and spinning of another generator."""

    def honest(draw: Random, _: Stroke) -> str:
        motion = resting_first(draw)
        stamps = 1e-9 * (motion.stamps - BEGIN)[:LONGEST]
        count, steps = len(stamps), np.diff(stamps, prepend=stamps[:1])
        noise = draw.choice((0.0, 1e-5, 1e-4))
        place = motion.position[:count] + np.random.default_rng(draw.randrange(10**9)).normal(
            0.0, noise, (count, 3)
        )
        velocity = np.gradient(
            motion.position[:count], np.arange(count) * np.median(steps), axis=0
        )
        turned = motion.attitude[:count]
        quaternions, rates = turned.as_quat(), motion.rate[:count]
        own, spins = turned.inv().apply(velocity), turned.apply(rates)
        rows: dict[str, Callable[[int], Any]] = {
            "accel": lambda k: tuple(motion.acceleration[k].tolist()),
            "imu": lambda k: (tuple(motion.force[k].tolist()), tuple(rates[k].tolist())),
            "pose": lambda k: (tuple(place[k].tolist()), tuple(quaternions[k].tolist())),
            "twist": lambda k: (
                tuple(velocity[k].tolist()), tuple(spins[k].tolist()), None,
                "world",
            ),
            "odometry": lambda k: (
                tuple((draw.gauss(1.0, 0.02) * own[k]).tolist()), tuple(rates[k].tolist()),
                tuple(quaternions[k].tolist()), "base", tuple(place[k].tolist()),
            ),
        }  # fmt: skip
        return told(kind, sent(draw, ((float(t), rows[kind](k)) for k, t in enumerate(stamps))))

    return honest


def honest_joints(draw: Random, stroke: Stroke) -> str:
    """Joint states of one or two publishers."""
    one, other = joints(draw, stroke, apart=draw.random() < 0.5)
    return told("joints", [*one, *other])


def honest_transforms(draw: Random, stroke: Stroke) -> str:
    """Transforms of two publishers at rates of their own."""
    one, other = chain(draw, stroke)
    return told("tf", [*one, *other])


WRONG: dict[str, tuple[Kind, str]] = {
    "zeros now and then": (zeros, "leap"),
    "stairs of 10 to 50 Hz": (stairs, "renewed at"),
    **{
        f"two publishers, {1e3 * lag:g} ms apart": (two("pose", lag), "publishers")
        for lag in LAGS
    },
    "two publishers of velocities, 50 ms apart": (two("twist", 0.05), "publishers"),
    "velocities zero now and then": (dropouts, "zero between"),
    "odometry: twist never filled": (odometry("empty"), "stays zero"),
    "odometry: twist in the parent's axes": (odometry("parent"), "axes of header.frame_id"),
    "poses begin in motion": (begun("pose"), "begins in motion"),
    "velocities begin in motion": (begun("twist"), "begins in motion"),
    "accelerations begin in motion": (begun("accel"), "begins in motion"),
    "stamped 1 to 8 ms late: named, or read rightly": (late, "scatter"),
    "nanosec 0, in ms or in µs": (unit, "nanosec"),
    "stamps counted at a wrong rate": (counted, "counted at"),
    "clock set during the motion": (was_set, "step"),
    "transforms: one clock 20 to 300 ms ahead": (ahead("tf"), "ahead of their arrival"),
    "joints: one clock 20 to 300 ms ahead": (ahead("joints"), "ahead of their arrival"),
}  # fmt: skip
HONEST: dict[str, Kind] = {
    "honest poses: rounded, noisy, uneven": rounded_poses,
    "honest poses: shaken": shaken_poses,
    **{f"honest {kind}": robot(kind) for kind in ("accel", "imu", "pose", "odometry", "twist")},
    "honest odometry with slip": odometry("right"),
    "honest joints": honest_joints,
    "honest tf": honest_transforms,
}


def main(seeds: int, folder: Path, parity: int = 1) -> None:
    """Writes the table of all kinds over the odd (or even) seeds below a number."""
    rows: list[tuple[str, int, int | str, int]] = []
    kinds = [(name, seeds // 3, *how) for name, how in WRONG.items()]
    kinds += [(name, seeds, kind, "") for name, kind in HONEST.items()]
    for name, end, kind, word in kinds:
        draws = {seed: Random(seed) for seed in range(parity, end, 2)}
        texts = {seed: kind(draw, Stroke.drawn(draw)) for seed, draw in draws.items()}
        others = {s: text for s, text in texts.items() if text and not (word and word in text)}
        named = sum(map(bool, texts.values())) - len(others)
        rows.append((name, len(texts), named if word else "", len(others)))
        print(*rows[-1], *(f"\n  {s}: {text[:200]}" for s, text in others.items()), flush=True)
    with (folder / "input_checks_messages.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([("messages", "motions", "named", "called something else"), *rows])


if __name__ == "__main__":
    main(int(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:]))

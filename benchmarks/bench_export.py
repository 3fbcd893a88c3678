"""Compares the export of a bag's topics with a short script that uses mcap_ros2 and csv.

The script reads with mcap, decodes with mcap_ros2 and writes rows with the csv module: the same
columns of the same topics, AccelStamped and SloshEstimate at 1 kHz each. Both take turns in one
process. A second part exports a bag of --seconds and one 20 times as long, each in a process of
its own, and compares the greatest memory of the two.

    tools/run python benchmarks/bench_export.py [--seconds 60] [--turns 3]
"""

from __future__ import annotations

import argparse
import csv
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from measuring import greatest_memory, header_of, message_of, parsed, peak_memory

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.interchange.export import export_targets, export_topics
from slosh_bag.reader import BagReader

RATE = 1000
GOAL = 1.0
"""Least speed, as a multiple of the script's."""
MEMORY_GOAL = 1.1
"""Greatest memory of the export of the long bag, as a multiple of the short one's."""
LONGER = 20
DIFFERENT = 1000
"""Messages of a topic before the same values come again, under new times."""
ACCEL, ESTIMATE = "/slosh/accel", "/slosh/estimate"
ACCEL_TYPE, ESTIMATE_TYPE = "geometry_msgs/msg/AccelStamped", "slosh_msgs/msg/SloshEstimate"


def write_bag(folder: Path, seconds: float) -> Path:
    """Writes a bag with accelerations and estimates at 1 kHz; returns its folder."""
    definitions = Definitions()
    for kind in (ACCEL_TYPE, ESTIMATE_TYPE):
        definitions.hash(kind)
    messages = [serialised(definitions, k) for k in range(DIFFERENT)]
    with BagWriter(folder, definitions) as writer:
        writer.add_topic(ACCEL, ACCEL_TYPE)
        writer.add_topic(ESTIMATE, ESTIMATE_TYPE)
        for k in range(round(seconds * RATE)):
            accel, estimate = messages[k % DIFFERENT]
            writer.write(ACCEL, accel, 10**18 + k * (10**9 // RATE))
            writer.write(ESTIMATE, estimate, 10**18 + k * (10**9 // RATE))
    return folder


def serialised(definitions: Definitions, k: int) -> tuple[bytes, bytes]:
    """Returns an AccelStamped and a SloshEstimate with random numbers, as CDR bytes."""
    store = definitions.typestore
    header = header_of(store, 10**18 + k * (10**9 // RATE), "world")
    normal = np.random.default_rng(k).normal
    accel = message_of(store, ACCEL_TYPE, normal, header=header)
    estimate = message_of(store, ESTIMATE_TYPE, normal, header=header, samples_used=k)
    serialise = store.serialize_cdr
    return bytes(serialise(accel, ACCEL_TYPE)), bytes(serialise(estimate, ESTIMATE_TYPE))


def export(bag: Path, folder: Path, form: str) -> None:
    """Exports the bag's topics as `slosh export` does."""
    reader = BagReader(bag)
    targets = export_targets(bag, reader, [ACCEL, ESTIMATE], folder, form)  # type: ignore[arg-type]
    export_topics(reader, targets, overwrite=True)


def script(bag: Path, folder: Path) -> None:
    """Writes the same tables with mcap, mcap_ros2 and csv, for comparison."""
    folder.mkdir(exist_ok=True)
    with (
        next(bag.glob("*.mcap")).open("rb") as stream,
        (folder / "accel.csv").open("w", newline="") as accel_file,
        (folder / "estimate.csv").open("w", newline="") as estimate_file,
    ):
        accel, estimate = csv.writer(accel_file), csv.writer(estimate_file)
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, record, m in reader.iter_decoded_messages(topics=[ACCEL, ESTIMATE]):
            stamp = m.header.stamp
            start = [
                record.log_time, record.publish_time, stamp.sec * 10**9 + stamp.nanosec,
                stamp.sec, stamp.nanosec, m.header.frame_id,
            ]  # fmt: skip
            if channel.topic == ACCEL:
                a, b = m.accel.linear, m.accel.angular
                accel.writerow([*start, a.x, a.y, a.z, b.x, b.y, b.z])
            else:
                row = start
                for part in (m.linear, m.nonlinear):
                    row += [
                        part.model, part.msh, part.azimuth, part.sh_x, part.sh_y,
                        json.dumps(list(part.modal_position)),
                        json.dumps(list(part.modal_velocity)),
                    ]  # fmt: skip
                estimate.writerow(
                    [*row, *m.acceleration, m.jerk, m.yaw, m.surface_height, m.height_along_wall,
                     m.contact_radius, m.distance_to_rim, m.distance_along_wall, m.flags,
                     m.samples_used, m.samples_dropped]
                )  # fmt: skip


def check_columns(folder: Path) -> None:
    """Ends the benchmark if the script's tables do not have as many columns as the export's."""
    for name in ("accel.csv", "estimate.csv"):
        columns = []
        for place in (folder / "script", folder / "csv"):
            with next(place.rglob(f"*{name}")).open(newline="") as file:
                columns.append(len(next(csv.reader(file))))
        if columns[0] != columns[1]:
            raise SystemExit(f"{name}: {columns[0]} columns of the script, {columns[1]} exported")


def compare(seconds: float, turns: int) -> dict[str, Any]:
    """Measures the speeds of export and script in turns, and the export's memory."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bag = write_bag(folder / "bag", seconds)
        runs: dict[str, Callable[[], None]] = {
            "script": lambda: script(bag, folder / "script"),
            "csv": lambda: export(bag, folder / "csv", "csv"),
            "parquet": lambda: export(bag, folder / "parquet", "parquet"),
        }
        for run in runs.values():
            run()  # compiles the decoders, and warms the disk's cache
        check_columns(folder)
        times: dict[str, list[float]] = {label: [] for label in runs}
        for _ in range(turns):
            for label, run in runs.items():
                begin = time.process_time()
                run()
                times[label].append(time.process_time() - begin)
        memory = [
            greatest_memory(__file__, write_bag(folder / f"long{factor}", seconds * factor))
            for factor in (1, LONGER)
        ]
    count = 2 * round(seconds * RATE)
    middle = {label: statistics.median(values) for label, values in times.items()}
    return {
        **{f"{label}_messages_per_s": round(count / spent) for label, spent in middle.items()},
        "csv_ratio": round(middle["script"] / middle["csv"], 2),
        "parquet_ratio": round(middle["script"] / middle["parquet"], 2),
        "memory_mib": [round(value) for value in memory],
        "memory_ratio": round(memory[1] / memory[0], 3),
        "goal": GOAL,
        "memory_goal": MEMORY_GOAL,
    }


def main() -> int:
    """Prints the result as JSON; returns 1 if a required speed or memory is not reached."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--measure", type=Path, help=argparse.SUPPRESS)
    given = parsed(parser, seconds=0.2, turns=1)
    if given.measure:
        for form in ("csv", "parquet"):
            export(given.measure, given.measure.with_name("out"), form)
        print(peak_memory())
        return 0
    result = compare(given.seconds, given.turns)
    print(json.dumps(result))
    good = result["csv_ratio"] >= GOAL and result["memory_ratio"] <= MEMORY_GOAL
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

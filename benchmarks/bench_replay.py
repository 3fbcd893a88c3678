"""Measures speed and memory of `slosh replay`, against only decoding with mcap_ros2.

    tools/run python benchmarks/bench_replay.py [--seconds 600] [--turns 3]

The bag is that of a cell without images: accelerations and estimates at 1 kHz, measured heights
and comparisons at 60 Hz, settings. Its motion is simulated, its estimates are the estimator's, so
that the replay finds them again bit for bit. Measured are

- `speed`: processor time of a replay, and of reading and decoding the same messages by
  mcap.reader and mcap_ros2, in turns in one process; the goals are 100 times real time and half
  the messages per second of mcap_ros2;
- `command`: `slosh replay BAG` from its start to its end, at 100 times real time;
- `memory`: greatest memory of a process that replays a bag of a twentieth of the length and one of
  the whole, and of one that replays the short one once and 20 copies of it; neither may need more
  than a tenth more.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from measuring import greatest_memory, header_of, message_of, parsed, peak_memory

from slosh_bag.bag_writer import BagWriter
from slosh_bag.columns.cdr_columns import write_messages
from slosh_bag.columns.cdr_layout import layout_of
from slosh_bag.definitions import Definitions
from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compile_cache import sources_digest
from slosh_estimator import SOURCES
from slosh_estimator.estimator import Estimates, Estimator
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.sampling import Samples
from slosh_replay.recording.heights import Measurements
from slosh_replay.replay import ReplayResult, replay_bag
from slosh_replay.replay.monitor_feed import MonitoredHeights, MonitorFeed
from slosh_replay.replay.verification import COMPARED, estimate_columns

REAL_TIME_GOAL = 100.0
DECODE_GOAL = 0.5
MEMORY_GOAL = 1.1
LONGER = 20
RATE, IMAGES = 1000, 60
START = 1_700_000_000_000_000_000
MODEL = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
TYPES = {
    "/slosh/accel": "geometry_msgs/msg/AccelStamped",
    "/slosh/estimate": "slosh_msgs/msg/SloshEstimate",
    "/slosh/free_surface": "slosh_msgs/msg/FreeSurface",
    "/slosh/comparison": "slosh_msgs/msg/SloshComparison",
    "/slosh/settings": "slosh_msgs/msg/NodeSettings",
}
PARAMETERS = {
    "estimator": {
        "input": "accel", "world_frame": "world", "container_frame": "container",
        "max_gap": 0.05, "max_age": 0.5, "sensor_rotation": [0.0, 0.0, 0.0],
        "sensor_to_origin": [0.0, 0.0, 0.0], "pose_window": 21,
    },
    "monitor": {
        "measured_limit": 0.02, "estimated_limit": 0.02, "disagreement_limit": 0.01,
        "warn_share": 0.8, "release": 0.9, "hold": 0.1, "timeout": 0.3, "buffer": 2.0,
    },
}  # fmt: skip
Columns = dict[str, Any]


def motion(seconds: float) -> Samples:
    """Returns samples with noise of repeated motions of 6 s in all directions and rests of 4 s."""
    t = np.arange(round(seconds * RATE)) / RATE
    phase = t % 10.0
    swell = np.where(phase < 6.0, np.sin(np.pi * phase / 6.0) ** 2, 0.0)
    waves = (3.0 * np.sin(13.0 * t), 2.5 * np.cos(11.0 * t), 2.0 * np.sin(9.0 * t))
    a = swell[:, None] * np.column_stack(waves)
    a += 0.02 * np.random.default_rng(0).standard_normal(a.shape)
    stamps = START + np.rint(t * 1e9).astype(np.int64)
    restarted = np.zeros(len(t), dtype=bool)
    restarted[0] = True
    return Samples(stamps, a, np.zeros(len(t)), restarted)


def write_bag(folder: Path, seconds: float) -> Path:
    """Writes a bag of a simulated robot cell; returns its folder."""
    samples = motion(seconds)
    estimates = Estimator(MODEL).update_many(samples)
    images = np.unique(np.arange(0, len(samples.stamps), RATE / IMAGES).astype(int))
    definitions = Definitions()
    packer = Packer(definitions)
    order = [
        *packer.settings(),
        *packer.pack("/slosh/accel", samples.stamps, 0, accelerations(samples)),
        *packer.pack("/slosh/estimate", samples.stamps, 1, estimated(estimates)),
        *packer.pack(
            "/slosh/free_surface", samples.stamps[images], 9, measured(estimates, images)
        ),
        *packer.pack("/slosh/comparison", samples.stamps[images], 10, compared(estimates, images)),
    ]
    order.sort(key=lambda entry: entry[0])
    with BagWriter(folder, definitions) as writer:
        for topic, kind in TYPES.items():
            writer.add_topic(topic, kind)
        for log_ns, topic, data in order:
            writer.write(topic, data, log_ns)
    return folder


def accelerations(samples: Samples) -> Columns:
    """Returns the columns of AccelStamped messages."""
    return {f"accel.linear.{axis}": samples.accelerations[:, i] for i, axis in enumerate("xyz")}


def estimated(estimates: Estimates) -> Columns:
    """Returns the columns of SloshEstimate messages."""
    counts = np.arange(1, len(estimates.stamps) + 1)
    return {**estimate_columns(estimates), "samples_used": counts}


def measured(estimates: Estimates, images: Any) -> Columns:
    """Returns FreeSurface columns: the nonlinear model's heights with 2 % error and noise."""
    height = estimates.heights[images, 1, 0]
    noise = 2e-4 * np.random.default_rng(1).standard_normal(len(images))
    return {"msh": 1.02 * height + noise, "azimuth": estimates.heights[images, 1, 1]}


def compared(estimates: Estimates, images: Any) -> Columns:
    """Returns the columns of SloshComparison messages."""
    feed = MonitorFeed(MonitorSettings())
    heights = MonitoredHeights(
        estimates.stamps, estimates.heights[:, 0, 0], estimates.heights[:, 1, 0], estimates.flags
    )
    values = measured(estimates, images)
    unknown = np.full(len(images), np.nan)
    rows = feed.add(
        heights,
        Measurements(
            estimates.stamps[images], values["msh"], np.zeros(len(images), int), unknown, unknown
        ),
    )
    return {name: np.array([getattr(row, name) for row in rows]) for name in COMPARED}


class Packer:
    """Serialises columns of values to messages."""

    def __init__(self, definitions: Definitions) -> None:
        for kind in TYPES.values():
            definitions.hash(kind)  # makes the type known
        self._store: Any = definitions.typestore

    def settings(self) -> list[tuple[int, str, bytes]]:
        """Returns the serialised settings messages of estimator and monitor."""
        kind = TYPES["/slosh/settings"]
        found = []
        for node, parameters in PARAMETERS.items():
            files = {"model": format_model(MODEL)} if node == "estimator" else {}
            message = self._store.types[kind](
                header=header_of(self._store, 0, "world"), node=node,
                arithmetic=arithmetic_fingerprint(), code=sources_digest(*SOURCES),
                document=yaml.safe_dump({"parameters": parameters, "files": files}),
            )  # fmt: skip
            data = bytes(self._store.serialize_cdr(message, kind))
            found.append((START - 1, "/slosh/settings", data))
        return found

    def pack(
        self, topic: str, stamps: Any, late_ms: int, columns: Columns
    ) -> list[tuple[int, str, bytes]]:
        """Returns log time [ns], topic and bytes of each message."""
        kind = TYPES[topic]
        template = bytes(self._store.serialize_cdr(self._blank(kind), kind))
        layout = layout_of(self._store, kind, template)
        seconds, nanoseconds = np.divmod(stamps, 10**9)
        header = {"header.stamp.sec": seconds, "header.stamp.nanosec": nanoseconds}
        packed = write_messages(layout, template, {**header, **columns})
        logged = (stamps + late_ms * 1_000_000).tolist()
        return [(at, topic, row.tobytes()) for at, row in zip(logged, packed, strict=True)]

    def _blank(self, kind: str) -> Any:
        """Returns a message with zero numbers and the usual strings."""
        empty: dict[str, Any] = {
            name: np.empty(0, np.float32)
            for name, _ in self._store.fielddefs[kind][1]
            if "profile" in name
        }
        return message_of(self._store, kind, header=header_of(self._store, 0, "world"), **empty)


def decode(bag: Path) -> int:
    """Reads and decodes all messages with mcap and mcap_ros2; returns their number."""
    count = 0
    with next(bag.glob("*.mcap")).open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _ in reader.iter_decoded_messages():
            count += 1
    return count


def replay(bag: Path) -> ReplayResult:
    """Replays a bag; ends the program if the estimates are not reproduced exactly."""
    result = replay_bag(bag)
    if result.verification is None or not result.verification.exact:
        raise SystemExit(f"{bag}: did not come out again bit for bit")
    return result


def processor_time(run: Callable[[], Any]) -> float:
    """Returns the processor time of a function call [s]."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def speed(bag: Path, short: Path, seconds: float, turns: int) -> dict[str, Any]:
    """Compares the times of replay and decoding, and of the whole command."""
    replay(short)  # compiles, and fills the caches
    count = decode(bag)
    replays, decodes = [], []
    for _ in range(turns):
        replays.append(processor_time(lambda: replay(bag)))
        decodes.append(processor_time(lambda: decode(bag)))
    begin = time.monotonic()
    subprocess.run(
        [sys.executable, "-m", "slosh_bringup.cli", "replay", str(bag), "--check"],
        check=True, capture_output=True,
    )  # fmt: skip
    command = time.monotonic() - begin
    own, theirs = statistics.median(replays), statistics.median(decodes)
    return {
        "messages": count,
        "replay_messages_per_s": round(count / own),
        "mcap_ros2_messages_per_s": round(count / theirs),
        "decode_ratio": round(theirs / own, 2),
        "real_time_factor": round(seconds / own),
        "command_real_time_factor": round(seconds / command),
    }


def memory(bag: Path, short: Path) -> dict[str, Any]:
    """Returns the peak memory of processes that replay more and more data [MiB]."""
    copies = []
    for number in range(LONGER):
        copies.append(short.with_name(f"copy{number}"))
        shutil.copytree(short, copies[-1])
    figures = {
        "short": greatest_memory(__file__, short),
        "long": greatest_memory(__file__, bag),
        "many": greatest_memory(__file__, *copies),
    }
    return {
        "memory_mib": {name: round(value) for name, value in figures.items()},
        "length_ratio": round(figures["long"] / figures["short"], 3),
        "number_ratio": round(figures["many"] / figures["short"], 3),
    }


def measure(bags: list[Path]) -> int:
    """Replays bags in this process and prints its peak memory [MiB]."""
    from slosh_bringup.cli.main import main as slosh

    code = slosh(["replay", *map(str, bags), "--check", "--jobs", "1", "--json"])
    print(peak_memory())
    return code


def main() -> int:
    """Prints the result as JSON; returns 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--measure", type=Path, nargs="+", help=argparse.SUPPRESS)
    given = parsed(parser, seconds=2.0, turns=1)
    if given.measure:
        return measure(given.measure)
    with tempfile.TemporaryDirectory() as name:
        bag = write_bag(Path(name) / "long", given.seconds)
        short = write_bag(Path(name) / "short", given.seconds / LONGER)
        result = {**speed(bag, short, given.seconds, given.turns), **memory(bag, short)}
    goals = {
        "real_time_factor": result["real_time_factor"] >= REAL_TIME_GOAL,
        "command_real_time_factor": result["command_real_time_factor"] >= REAL_TIME_GOAL,
        "decode_ratio": result["decode_ratio"] >= DECODE_GOAL,
        "length_ratio": result["length_ratio"] <= MEMORY_GOAL,
        "number_ratio": result["number_ratio"] <= MEMORY_GOAL,
    }
    print(json.dumps({**result, "passed": goals}))
    return 0 if all(goals.values()) else 1


if __name__ == "__main__":
    sys.exit(main())

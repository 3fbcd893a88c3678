"""Topics of a bag as flat tables: one CSV or Parquet file per topic.

Every table starts with `log_ns` and `publish_ns`, when the message was received and sent, and
`stamp_ns` where it has a header; all whole nanoseconds. Rows come in the order of the log times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.export_fields import STAMP, Leaf, leaves, row_getter
from slosh_bag.export_sinks import Sink, load_pyarrow, make_sink
from slosh_bag.reader import BagMessage, BagReader
from slosh_bag.topic_choice import find_topic

Form = Literal["csv", "parquet"]
SUFFIXES: Final = (".csv", ".csv.gz", ".parquet")
BATCH_ROWS: Final = 4096
BATCH_BYTES: Final = 4 << 20
"""A batch of a topic is written when it has so many rows or bytes of messages."""
SECOND: Final = 1_000_000_000


class ExportTarget(NamedTuple):
    """Where a topic goes: its type, its number of messages and the file."""

    message_type: str
    messages: int
    path: Path


class ExportResult(NamedTuple):
    """What was exported.

    Attributes:
        rows: rows by file.
        notes: what is not in the files, one line each.
    """

    rows: dict[Path, int]
    notes: tuple[str, ...]


def is_table(path: Path) -> bool:
    """Whether a path names a table and not a folder of tables."""
    return path.name.endswith(SUFFIXES)


def export_targets(
    bag: Path,
    reader: BagReader,
    topics: Sequence[str],
    output: Path,
    form: Form = "parquet",
) -> dict[str, ExportTarget]:
    """The file for each topic.

    Args:
        bag: the bag; for what is said of it.
        reader: of the bag.
        topics: as typed; empty: all.
        output: a file for one topic, or a folder.
        form: of the files in a folder.

    Raises:
        SloshBagError: there is no such topic, or one file for several topics.
    """
    known = reader.topics()
    wanted = sorted({find_topic(bag, known, name) for name in topics} or known)
    if not wanted:
        raise SloshBagError(f"{bag}: holds no topics")
    if is_table(output):
        if len(wanted) > 1:
            raise SloshBagError(
                f"{output}: is one file for {len(wanted)} topics; name a folder, or one of "
                f"{', '.join(wanted)}"
            )
        paths = [output]
    else:
        # No topic has a dot in its name: no two of them share a file.
        paths = [output / f"{name.strip('/').replace('/', '.')}.{form}" for name in wanted]
    return {
        name: ExportTarget(known[name].message_type, known[name].count or 0, path)
        for name, path in zip(wanted, paths, strict=True)
    }


def export_topics(
    reader: BagReader,
    targets: dict[str, ExportTarget],
    *,
    overwrite: bool = False,
    progress: Callable[[int], object] = lambda count: None,
) -> ExportResult:
    """Writes topics as tables.

    Args:
        reader: of the bag.
        targets: the file for each topic.
        overwrite: whether existing files are replaced.
        progress: is told how many messages were read since it was told last.

    Raises:
        SloshBagError: a file exists or cannot be written, pyarrow is missing, or the bag is
            damaged; no file is left then.
    """
    check_targets([target.path for target in targets.values()], overwrite=overwrite)
    facts = reader.metadata()
    tables = {
        topic: _Table(reader, target.path, {**facts, "topic": topic, "type": target.message_type})
        for topic, target in targets.items()
    }
    try:
        for message in reader.messages(list(targets)):
            tables[message.topic].add(message)
            progress(1)
        for table in tables.values():
            table.close()
    except OSError as error:
        _discard(tables)
        raise SloshBagError(
            f"{error.filename or ''}: cannot be written: {error.strerror}"
        ) from None
    except BaseException:
        _discard(tables)
        raise
    notes = [note for table in tables.values() for note in table.notes]
    rows = {targets[topic].path: table.rows for topic, table in tables.items()}
    # An unfinished file says so each time it is read through.
    return ExportResult(rows, tuple(dict.fromkeys([*reader.warnings, *notes])))


def check_targets(paths: Any, *, overwrite: bool) -> None:
    """Refuses files that exist, and kinds that cannot be written here.

    Raises:
        SloshBagError: a file exists, is a folder, or needs what is not installed.
    """
    for path in paths:
        if path.is_dir():
            raise SloshBagError(f"{path}: is a folder")
        if path.exists() and not overwrite:
            raise SloshBagError(f"{path}: exists already; choose another name or --overwrite")
        if path.suffix == ".parquet":
            load_pyarrow()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SloshBagError(f"{path.parent}: {error.strerror}") from None


def _discard(tables: dict[str, _Table]) -> None:
    for table in tables.values():
        table.discard()


class _Table:
    """The table of a topic, and the batch that waits to be written to it."""

    def __init__(self, reader: BagReader, path: Path, facts: dict[str, str]) -> None:
        self.rows = 0
        self.notes: list[str] = []
        self._reader = reader
        self._path = path
        self._facts = facts
        self._type = facts["type"]
        self._sink: Sink | None = None
        self._stamped = False
        self._get: Callable[[Any], tuple[Any, ...]] = lambda message: ()
        self._times: list[tuple[int, ...]] = []
        self._values: list[tuple[Any, ...]] = []
        self._size = 0

    def add(self, message: BagMessage) -> None:
        """Takes a message."""
        if message.message_type != self._type:
            raise SloshBagError(
                f"{self._reader.path}: {message.topic} has messages of two types: {self._type} "
                f"and {message.message_type}; cut the bag in two"
            )
        decoded = self._reader.decode(message)
        if self._sink is None:
            self._open(leaves(self._reader.typestore, self._type))
        log, publish = message.log_ns, message.publish_ns
        if self._stamped:
            stamp = decoded.header.stamp
            self._times.append((log, publish, stamp.sec * SECOND + stamp.nanosec))
        else:
            self._times.append((log, publish))
        self._values.append(self._get(decoded))
        self._size += len(message.data)
        if len(self._values) >= BATCH_ROWS or self._size >= BATCH_BYTES:
            self._flush()

    def close(self) -> None:
        """Finishes the file; a topic without messages gets its heading alone."""
        if self._sink is None:
            definitions = Definitions()
            try:
                definitions.hash(self._type)
            except SloshBagError as error:
                self.notes.append(f"{self._path}: not written: no messages, and {error}")
                return
            self._open(leaves(definitions.typestore, self._type))
        self._flush()
        if self._sink is not None:
            self._sink.close()
            self.notes += self._sink.notes

    def discard(self) -> None:
        """Removes what was written."""
        if self._sink is not None:
            self._sink.discard()

    def _open(self, fields: Sequence[Leaf]) -> None:
        names = {leaf.name for leaf in fields}
        self._stamped = names.issuperset(STAMP)
        self._get = row_getter(fields)
        times = ["log_ns", "publish_ns", *(["stamp_ns"] if self._stamped else [])]
        # A message's own field of that name keeps it.
        times = [name if name not in names else f"{name}_" for name in times]
        self._sink = make_sink(self._path, times, fields, self._facts)

    def _flush(self) -> None:
        if self._sink is not None and self._values:
            self._sink.write(
                list(zip(*self._times, strict=True)), list(zip(*self._values, strict=True))
            )
            self.rows += len(self._values)
        self._times, self._values, self._size = [], [], 0

"""Exports topics of a bag as flat tables, one CSV or Parquet file per topic.

Every table starts with `log_ns` and `publish_ns`, when the message was received and sent, and
`stamp_ns` where it has a header; all whole nanoseconds. Rows come in the order of the log times.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.export_rows import RowReader
from slosh_bag.interchange.export_sinks import Sink, load_pyarrow, make_sink
from slosh_bag.interchange.topic_choice import find_topic
from slosh_bag.mcap_files.bag_folder import files_of
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.mcap_files.mcap_walk import is_in_order
from slosh_bag.reader import BagMessage, BagReader
from slosh_base.files import check_apart

Form = Literal["csv", "parquet"]
SUFFIXES: Final = (".csv", ".csv.gz", ".parquet")
_NO_TOPIC = re.compile(r"[^\w/-]", re.ASCII)
BATCH_ROWS: Final = 4096
BATCH_BYTES: Final = 4 << 20
"""Messages of a topic are written when there are so many, or so many bytes of them."""


class ExportTarget(NamedTuple):
    """A topic to export: its type, its number of messages and the output file."""

    message_type: str
    messages: int
    path: Path


class ExportResult(NamedTuple):
    """Files that an export wrote, with their row counts.

    Attributes:
        rows: rows by file.
        notes: what is not in the files, one line each.
    """

    rows: dict[Path, int]
    notes: tuple[str, ...]


def is_table(path: Path) -> bool:
    """Whether a path names a single table file rather than a folder of tables."""
    return path.name.endswith(SUFFIXES)


def export_targets(
    bag: Path,
    reader: BagReader,
    topics: Sequence[str],
    output: Path,
    form: Form = "parquet",
) -> dict[str, ExportTarget]:
    """Chooses the output file of each topic.

    Args:
        bag: the bag; for what is said of it.
        reader: of the bag.
        topics: as typed; empty: all.
        output: a file for one topic, or a folder.
        form: of the files in a folder.

    Raises:
        SloshBagError: there is no such topic, one file for several topics, or a folder that is
            named as a file of another format.
    """
    known = reader.topics()
    wanted = sorted({find_topic(bag, known, name) for name in topics} or known)
    if not wanted:
        raise SloshBagError(f"{bag}: holds no topics")
    if is_table(output):
        if len(wanted) > 1:
            raise SloshBagError(
                f"{output}: one file cannot hold {len(wanted)} topics; give a folder, or one "
                f"of {', '.join(wanted)}"
            )
        paths = [output]
    else:
        _check_folder_name(output)
        paths = [output / f"{_file_stem(name)}.{form}" for name in wanted]
        if len(set(paths)) < len(paths):
            raise SloshBagError(f"{bag}: topics whose names differ by a slash; export one by one")
    return {
        name: ExportTarget(known[name].message_type, known[name].count or 0, path)
        for name, path in zip(wanted, paths, strict=True)
    }


def _file_stem(topic: str) -> str:
    """Converts a topic name to a file name: slash to dot, other special characters to `%2e`."""
    inner = _NO_TOPIC.sub(lambda found: f"%{ord(found[0]):02x}", topic.strip("/"))
    return inner.replace("/", ".")


def _check_folder_name(output: Path) -> None:
    """Raises an error for a new folder whose name looks like a file name, such as `out.xls`."""
    if output.suffix[1:].isalpha() and not output.is_dir():
        raise SloshBagError(
            f"{output}: a table must end in {', '.join(SUFFIXES)}; create the folder first if "
            "you mean a folder"
        )


def export_topics(
    reader: BagReader,
    targets: dict[str, ExportTarget],
    *,
    overwrite: bool = False,
    progress: Callable[[int], object] = lambda count: None,
) -> ExportResult:
    """Writes topics of a bag to tables, one file per topic.

    Args:
        reader: of the bag.
        targets: the file for each topic.
        overwrite: whether existing files are replaced.
        progress: is told how many messages were read since it was told last.

    Raises:
        SloshBagError: a file exists, pyarrow is missing, or the bag is damaged.
        SloshFileError: a file is one of the bag's.
        OSError: a file cannot be written.
            After any of these all files are as they were.
    """
    paths = [target.path for target in targets.values()]
    check_apart(paths, files_of(reader.path))
    check_targets(paths, overwrite=overwrite)
    facts = reader.metadata()
    tables: dict[str, _Table] = {}
    try:
        for topic, target in targets.items():
            about = {**facts, "topic": topic, "type": target.message_type}
            tables[topic] = _Table(reader, target.path, about)
        if all(is_in_order(file) for file in reader.files):
            for block in reader.blocks(list(targets)):
                tables[block.topic].add_block(block)
                progress(len(block))
        else:
            for message in reader.messages(list(targets)):
                tables[message.topic].add(message)
                progress(1)
        for table in tables.values():
            table.close()
        for table in tables.values():
            table.keep()
    except BaseException:
        for table in tables.values():
            table.discard()
        raise
    notes = [note for table in tables.values() for note in table.notes]
    rows = {targets[topic].path: table.rows for topic, table in tables.items()}
    return ExportResult(rows, (*reader.warnings, *notes))


def check_targets(paths: Any, *, overwrite: bool) -> None:
    """Raises an error for files that exist already or have an unsupported format.

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


class _Table:
    """The exported table of a topic while it is being written."""

    def __init__(self, reader: BagReader, path: Path, facts: dict[str, str]) -> None:
        self.rows = 0
        self._path = path
        self._type = facts["type"]
        self._reader = RowReader(reader, self._type)
        self._sink: Sink = make_sink(path, self._reader.time_names, self._reader.fields, facts)
        self._waiting: list[BagMessage] = []
        self._size = 0

    @property
    def notes(self) -> list[str]:
        """Notes about values that the exported file does not contain."""
        return self._sink.notes

    def add_block(self, block: MessageBlock) -> None:
        """Adds a row to the table for each message of a block."""
        self._check(block.topic, block.message_type)
        # Slices: the rows of a chunk of small messages would take many times their bytes.
        for start in range(0, len(block), BATCH_ROWS):
            part = block.take(slice(start, start + BATCH_ROWS))
            self._sink.write(*self._reader.block(part))
        self.rows += len(block)

    def add(self, message: BagMessage) -> None:
        """Adds a row to the table for one message."""
        self._check(message.topic, message.message_type)
        self._waiting.append(message)
        self._size += len(message.data)
        if len(self._waiting) >= BATCH_ROWS or self._size >= BATCH_BYTES:
            self._flush()

    def close(self) -> None:
        """Writes the remaining rows; a topic without messages gets its header row only."""
        self._flush()
        self._sink.close()

    def keep(self) -> None:
        """Renames the temporary file to its final name, when the export is complete."""
        self._sink.keep()

    def discard(self) -> None:
        """Deletes the unfinished temporary file."""
        self._sink.discard()

    def _check(self, topic: str, message_type: str) -> None:
        if message_type != self._type:
            raise SloshBagError(
                f"{self._path}: {topic} has messages of two types, {self._type} and "
                f"{message_type}; split the bag"
            )

    def _flush(self) -> None:
        if self._waiting:
            self._sink.write(*self._reader.messages(self._waiting))
            self.rows += len(self._waiting)
        self._waiting, self._size = [], 0

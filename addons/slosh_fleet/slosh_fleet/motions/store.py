"""Fleet store: Parquet files of motions by cell and month, on any file system of fsspec.

STORE/cell=line_1/month=2026-11/<begin>-<end>-<digest>.parquet holds motions of one bag. The name
has the first and last begin of its motions [ns] and the digest of its rows: the same bag gives the
same file, and is stored once. A file appears as a whole. The file of a bag that was cut off gives
way to that of the whole one.
STORE/_ingested/<digest> holds the number of motions of a bag that needs no second reading. Readers
such as pandas pass over names that begin so.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import quote

from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.export_sinks import load_pyarrow
from slosh_bag.mcap_files.remote_path import telling
from slosh_base.files import write_bytes
from slosh_fleet.motions.motion_row import COLUMNS, Column, MotionRow

SUFFIX: Final = ".parquet"
_SPAN: Final = re.compile(r"(\d+)-(\d+)-")
NOTES: Final = "_ingested"
"""Folder of the notes on ingested bags."""
_OLD_NOTES: Final = "ingested"
ADDED: Final = (
    Column("month", "str", "1", "month of the begin, UTC"),
    Column("begin", "timestamp", "UTC", "begin of the motion"),
)
"""Columns that the store adds to those of MotionRow."""
_STORED: Final = tuple(column for column in COLUMNS if column.name != "cell")
"""Columns in the files; the cell and the month are in their folders' names."""


_IDENTITY: Final = ("opening", "digest", "duration", "images")
"""Columns that tell of two rows whether they are one motion, and which is the more complete."""


class Added(NamedTuple):
    """Counts after storing one bag: its motions, the new files, and files that already existed."""

    motions: int
    new: int
    known: int


class Parted(NamedTuple):
    """The stored motions as two datasets: those stored only once, those possibly stored twice.

    Attributes:
        once: each motion in it is in one file only.
        doubtful: a motion in it may be in several files.
    """

    once: Any
    doubtful: Any


class FleetStore:
    """Parquet files of the motions of many recordings, in a folder or remote storage.

    Args:
        url: folder, or what fsspec knows, such as s3://bucket/motions.

    Attributes:
        url: as given.
        is_disk: whether it is a folder on a disk of this machine.
        warnings: files that are damaged and left out, one line each.

    Raises:
        SloshBagError: the place's protocol is not known or its library is not installed.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self.warnings: list[str] = []
        self._damaged: set[str] = set()
        with self._naming():
            core = importlib.import_module("fsspec.core")
            self._files, self._root = core.url_to_fs(url)
            self.is_disk = "file" in _protocols(self._files)

    def add(self, rows: Sequence[MotionRow]) -> Added:
        """Stores the motions of one bag; skips motions that are already stored.

        Raises:
            SloshBagError: the place cannot be written.
        """
        groups: dict[tuple[str, str], list[MotionRow]] = {}
        for row in rows:
            groups.setdefault((row.cell, row.month), []).append(row)
        new = 0
        for (cell, month), group in sorted(groups.items()):
            digest = hashlib.sha256("".join(sorted(row.digest for row in group)).encode())
            begins = sorted(row.begin_ns for row in group)
            name = f"{begins[0]}-{begins[-1]}-{digest.hexdigest()[:32]}{SUFFIX}"
            # As readers of such folders decode it: a cell may be named as no ROS name is.
            folder = f"{self._root}/cell={quote(cell, safe='')}/month={month}"
            path = f"{folder}/{name}"
            with self._naming():
                if self._files.exists(path):
                    continue
                own = _identities((getattr(row, name) for name in _IDENTITY) for row in group)
                beside = self._beside(folder, begins[0], begins[-1])
                if any(_holds(other, own) for other in beside.values()):
                    continue
                self._put(path, _packed(group))
                new += 1
                for part in (part for part, other in beside.items() if _holds(own, other)):
                    self._files.rm_file(part)
        return Added(len(rows), new, len(groups) - new)

    def _beside(self, folder: str, first_ns: int, last_ns: int) -> dict[str, _Motions]:
        """Returns the motions of files in a folder whose begins [ns] overlap, by path."""
        found: dict[str, _Motions] = {}
        for path in self._files.glob(f"{folder}/[0-9a-f]*{SUFFIX}"):
            span = _SPAN.match(path.rpartition("/")[2])
            if span is None or int(span[1]) > last_ns or int(span[2]) < first_ns:
                continue
            try:
                table = self._dataset([path]).to_table(columns=list(_IDENTITY))
            except (OSError, ValueError):  # a damaged one is named when it is queried
                continue
            found[path] = _identities(row.values() for row in table.to_pylist())
        return found

    def noted(self, state: str) -> int | None:
        """Returns the number of stored motions that is noted for a bag; None if nothing is noted.

        Args:
            state: digest of the bag's state, as given to `note`.

        Raises:
            SloshBagError: the place cannot be read.
        """
        with self._naming():
            try:
                return int(self._files.cat_file(self._note(state)))
            except (FileNotFoundError, ValueError):  # a machine without power may empty a note
                return None

    def note(self, state: str, motions: int) -> None:
        """Notes that all motions of a bag are stored, so that the bag is not read again.

        Args:
            state: digest that changes with the bag.
            motions: their number.

        Raises:
            SloshBagError: the place cannot be written.
        """
        with self._naming():
            self._put(self._note(state), str(motions).encode())
            old = f"{self._root}/{_OLD_NOTES}"
            if self._files.exists(old):  # of earlier versions, which pandas takes for data
                self._files.rm(old, recursive=True)

    def _note(self, state: str) -> str:
        return f"{self._root}/{NOTES}/{state[:32]}"

    @contextlib.contextmanager
    def _naming(self) -> Iterator[None]:
        """Converts file system errors in a `with` block to one-line errors with the URL."""
        try:
            with telling(self.url):
                yield
        except OSError as error:
            raise SloshBagError(f"{self.url}: {error.strerror}") from None

    def dataset(self) -> Any:
        """Returns all stored motions as a pyarrow dataset, which may contain a motion twice.

        Raises:
            SloshBagError: there are none, or the place cannot be read.
        """
        return self._dataset(self._paths())

    def parted(self) -> Parted:
        """Returns all stored motions; those possibly stored twice are in a separate dataset.

        Raises:
            SloshBagError: there are none, or the place cannot be read.
        """
        paths = self._paths()
        twice = _overlapping(paths)
        parts = ([path for path in paths if path not in twice], sorted(twice))
        return Parted(*(self._dataset(part) if part else None for part in parts))

    def _paths(self) -> list[str]:
        """Returns the paths of all Parquet files of the store, sorted.

        Raises:
            SloshBagError: there are none, or the place cannot be read.
        """
        with self._naming():
            # Beside files that are being written, which have other names.
            found = self._files.glob(f"{self._root}/cell=*/month=*/[0-9a-f]*{SUFFIX}")
        if not found:
            raise SloshBagError(
                f"{self.url}: no motions are stored here; `slosh ingest BAG --store "
                f"{self.url}` adds some"
            )
        whole = sorted(set(found) - self._damaged)
        if not whole:
            raise SloshBagError(
                f"{self.url}: all {len(found)} files of motions are damaged; delete them and "
                "ingest their bags again"
            )
        return whole

    def leave_out_damaged(self) -> bool:
        """Reads all files, and leaves out from now on those that cannot be read.

        Returns:
            whether another one was found; it is named in `warnings`.

        Raises:
            SloshBagError: the place cannot be read.
        """
        before = len(self._damaged)
        for path in self._paths():
            try:
                self._dataset([path]).to_table()
            except (OSError, ValueError) as error:  # Arrow's errors are also these
                reason = (str(error).splitlines() or [type(error).__name__])[0]
                self._damaged.add(path)
                self.warnings.append(
                    f"{path}: damaged, left out: {reason}; delete the file and the folder "
                    f"{NOTES}, and ingest the bags again"
                )
        return len(self._damaged) > before

    def _dataset(self, paths: Sequence[str]) -> Any:
        arrow, _ = load_pyarrow()
        dataset = importlib.import_module("pyarrow.dataset")
        folders = arrow.schema([("cell", arrow.string()), ("month", arrow.string())])
        # Arrow reads a disk by itself: through fsspec it would wait for Python at each piece.
        files = None if self.is_disk else self._files
        with self._naming():
            return dataset.dataset(
                paths, filesystem=files,
                format=dataset.ParquetFileFormat(page_checksum_verification=True),
                schema=arrow.schema([*_schema(arrow), *folders]),
                partitioning=dataset.partitioning(folders, flavor="hive"),
            )  # fmt: skip

    def _put(self, path: str, data: bytes) -> None:
        """Writes a file completely or not at all: by renaming on a disk, else by one request."""
        if self.is_disk:
            _write(Path(path), data)
        else:
            self._files.makedirs(path.rpartition("/")[0], exist_ok=True)
            self._files.pipe_file(path, data)


_Motions = dict[str, tuple[float, int]]
"""Duration [s] and number of images of motions, by what is the same in a bag that was cut off."""


def _identities(rows: Iterable[Iterable[Any]]) -> _Motions:
    return {
        str(opening or digest): (float(duration or 0.0), int(images or 0))
        for opening, digest, duration, images in rows
    }


def _holds(whole: _Motions, part: _Motions) -> bool:
    """Returns whether each motion of a part is in the whole, at least as complete."""
    return all(key in whole and whole[key] >= one for key, one in part.items())


def _overlapping(paths: Sequence[str]) -> set[str]:
    """Returns files of one cell whose time spans overlap, so that they may share motions."""
    found: set[str] = set()
    spans: dict[str, list[tuple[int, int, str]]] = {}
    for path in paths:
        folder, _, name = path.rpartition("/")
        span = _SPAN.match(name)
        if span is None:
            return set(paths)
        cell = folder.rpartition("/")[0]
        spans.setdefault(cell, []).append((int(span[1]), int(span[2]), path))
    for own in spans.values():
        last, holder = -1, ""
        for begin, end, path in sorted(own):
            if begin <= last:
                found |= {holder, path}
            if end > last:
                last, holder = end, path
    return found


def _write(path: Path, data: bytes) -> None:
    """Writes a file to disk; removes the folders created for the file if writing fails."""
    made = [folder for folder in path.parents if not folder.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, data)
    except BaseException:
        for folder in made:
            with contextlib.suppress(OSError):  # another ingest has written there
                folder.rmdir()
        raise


def _protocols(files: Any) -> Iterable[str]:
    named = files.protocol
    return (named,) if isinstance(named, str) else named


def _schema(arrow: Any) -> Any:
    """Returns the schema of the Parquet files, with the unit and meaning of each column."""
    types = {"str": arrow.string(), "int": arrow.int64(), "float": arrow.float64()}
    own = [
        arrow.field(
            column.name,
            types[column.type],
            metadata={"unit": column.unit, "about": column.meaning},
        )
        for column in _STORED
    ]
    return arrow.schema([*own, arrow.field("begin", arrow.timestamp("us", tz="UTC"))])


def _packed(rows: Sequence[MotionRow]) -> bytes:
    """Returns rows as a Parquet file; NaN becomes null, which SQL aggregates ignore."""
    arrow, parquet = load_pyarrow()
    schema = _schema(arrow)
    columns = [
        arrow.array([_known(getattr(row, name)) for row in rows], type=schema.field(name).type)
        for name in schema.names
    ]
    stream = io.BytesIO()
    parquet.write_table(
        arrow.table(columns, schema=schema), stream, compression="zstd", write_page_checksum=True
    )
    return stream.getvalue()


def _known(value: Any) -> Any:
    return None if value != value else value

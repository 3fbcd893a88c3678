"""Reads one MCAP file from start to end and reports damage and losses.

Chunks carry a checksum each. Around them lie bytes that none of these covers: the lengths and
kinds of the records, the definitions outside chunks. They are held against what else there is:
lengths against each other and the file's end, definitions and numbers of messages against the
summary, all of it against the checksum of the data section where the writer made one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.appended import (
    LONGEST_NAMES,
    attachment_index,
    check_appended,
    check_message_index,
    check_no_chunk,
)
from slosh_bag.mcap_files.chunk_scan import MOST_DEFINITIONS, MOST_MESSAGES, find_chunk
from slosh_bag.mcap_files.chunks import (
    CHUNK_START,
    RECORD_HEADER,
    Chunk,
    ChunkHeader,
    DamageError,
    TooLargeError,
    chunk_header,
    damaged,
    parse,
    read_loose,
    whole_chunk,
)
from slosh_bag.mcap_files.found import MOST_DEFINED, Found, UnreadBytes
from slosh_bag.mcap_files.mcap_summary import MAGIC, FileSummary, read_summary
from slosh_bag.mcap_files.record_stream import CutOffError, RecordStream

UNPACKED = 500_000_000
"""What any file may be unpacked [bytes]."""
UNPACKED_PER_BYTE = 4000
"""And for each byte of it: black images in small chunks are packed 3000 to 1."""


class ReadingBound:
    """Counts the decompressed bytes of a file and rejects excessive amounts.

    Args:
        path: the file.
        size: its size [bytes].
    """

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._size = path, size
        self._unpacked = self._messages = 0

    def unpack(self, content: bytes) -> None:
        """Counts a chunk's decompressed size before the chunk is decompressed.

        Raises:
            SloshBagError: with it, it is too much.
        """
        try:
            self._unpacked += chunk_header(content[:CHUNK_START], len(content)).size
        except DamageError:
            return
        if self._unpacked > UNPACKED + UNPACKED_PER_BYTE * self._size:
            raise self._error(f"{self._unpacked // 1_000_000} MB")

    def take(self, messages: int) -> None:
        """Counts messages and rejects more messages than the file can contain.

        Raises:
            SloshBagError: with them, there are too many.
        """
        self._messages += messages
        if self._messages > MOST_MESSAGES + self._size:
            raise self._error(f"{self._messages} messages")

    def _error(self, what: str) -> SloshBagError:
        return SloshBagError(
            f"{self._path}: a file of {1e-6 * self._size:.1f} MB that unpacks to more than "
            f"{what}: no recording compresses so well; copy it again from the recorder"
        )


_LOOSE = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
_WINDOW = 1 << 20


class McapWalk:
    """Reads a file from start to end, and collects its definitions, counts and damage.

    Args:
        path: the file.
        lenient: pass over what is damaged, and note it in `found.gaps`, instead of raising.

    Attributes:
        found: what was found so far; complete when `chunks` has ended.
        warnings: what a reader should know; complete when `chunks` has ended.
        summary: what the file's end says; None: it has no end, or `chunks` has not begun.
        size: of the file [bytes].
    """

    def __init__(self, path: Path, *, lenient: bool = False) -> None:
        self.path = path
        self.found = Found()
        self.warnings: list[str] = []
        self.summary: FileSummary | None = None
        self._lenient = lenient
        self.size = path.stat().st_size
        self._bound_on_work = ReadingBound(path, self.size)
        self._cut: ChunkHeader | None = None
        self._stream: RecordStream

    def chunks(self) -> Iterator[Chunk]:
        """Yields the chunks of messages in file order.

        Raises:
            SloshBagError: the file is damaged, other than by missing its end.
        """
        with self.path.open("rb") as stream:
            self.summary = read_summary(stream, self.size)
            if self.summary:
                self.found.schemas.update(self.summary.schemas)
                self.found.channels.update(self.summary.channels)
            self._stream = RecordStream(stream, self.size, checked=not self._lenient)
            ended = False
            while not ended:
                position = self._stream.position
                try:
                    chunk, ended = self._step()
                    if chunk is not None:
                        chunk = self._admit(chunk)
                except DamageError as error:
                    chunk, ended = None, self._damaged(position, error)
                if chunk is not None:
                    yield chunk

    def _step(self) -> tuple[Chunk | None, bool]:
        """Reads one record, or successive messages outside chunks; detects the last record."""
        if not self._stream.position and self._stream.take(len(MAGIC)) != MAGIC:
            raise DamageError("not an MCAP file")
        first = self._stream.position == len(MAGIC)
        opcode, length = self._stream.begin()
        if first != (opcode == Opcode.HEADER):
            raise DamageError("a record that does not belong there")
        if length > self._stream.left:
            self._beyond(opcode, length)
        if opcode == Opcode.CHUNK:
            return self._chunk(length), False
        if opcode <= Opcode.DATA_END and opcode != Opcode.MESSAGE:
            self._check_no_chunk(length)
        if opcode in _LOOSE:
            return self._loose(opcode, length), False
        if opcode == Opcode.DATA_END:
            self._end(length)
            return None, not self._lenient or not self._goes_on()
        self._other(opcode, length)
        return None, False

    def _beyond(self, opcode: int, length: int) -> None:
        """Raises the error for a record that extends beyond the file's end."""
        start = self._stream.peek(CHUNK_START)
        if opcode == Opcode.CHUNK and len(start) == CHUNK_START:
            # Where the header is there it has to fit: else the length is wrong, not the end.
            self._cut = chunk_header(start, length)
        raise CutOffError("a record is cut off")

    def _chunk(self, length: int) -> Chunk:
        position = self._stream.position - RECORD_HEADER
        content = self._stream.take(length)
        self._bound_on_work.unpack(content)
        chunk = whole_chunk(position, content, agreeing=not self._lenient)
        header = chunk_header(content[:CHUNK_START], length)
        check_appended(content[header.content + header.stored :])
        self.found.chunks += 1
        return chunk

    def _check_no_chunk(self, length: int) -> None:
        """Raises an error for a chunk whose record type is damaged."""
        try:
            chunk_header(self._stream.peek(CHUNK_START), length)
        except DamageError:
            return
        content = self._stream.peek(length)
        self._bound_on_work.unpack(content)
        check_no_chunk(content)

    def _loose(self, opcode: int, length: int) -> Chunk:
        self._stream.back()
        # A definition comes alone: a file may hold many, and a window for each is much to read.
        more = _WINDOW if opcode == Opcode.MESSAGE else 0
        window = self._stream.peek(max(more, RECORD_HEADER + length))
        chunk = read_loose(self._stream.position, window)
        self._stream.take(chunk.stored)
        self.found.loose += len(chunk)
        self._bound(*chunk.schemas, *chunk.channels, kept=False)
        return chunk

    def _other(self, opcode: int, length: int) -> None:
        """Checks and skips a record that contains no messages."""
        if opcode == Opcode.HEADER:
            parse(Header, self._stream.take(length))
        elif opcode == Opcode.METADATA:
            self.found.metadata.append(parse(Metadata, self._stream.take(length)))
        elif opcode == Opcode.MESSAGE_INDEX:
            check_message_index(self._stream.take(length))
        elif opcode == Opcode.ATTACHMENT:
            self._pass_attachment(length)
        elif opcode <= Opcode.DATA_END:
            raise DamageError("a record that does not belong there")
        else:
            self.found.unknown += 1
            self._stream.skip(length)

    def _pass_attachment(self, length: int) -> None:
        """Skips an attachment after verifying its checksum."""
        content = self._stream.position
        index = attachment_index(self._stream.peek(min(length, LONGEST_NAMES)), length)
        actual = self._stream.skip(index.length, checked=True)
        noted = int.from_bytes(self._stream.take(4), "little")
        self._stream.skip(length - index.length - 4)
        if noted not in (0, actual):
            raise DamageError(f"a damaged attachment, {index.name!r}")
        self.found.attachments.append(replace(index, offset=content))

    def _admit(self, chunk: Chunk) -> Chunk:
        """Registers a chunk's schemas and channels, and checks that its messages are defined."""
        if self.found.chunks and self.found.loose and not self._is_counted():
            raise DamageError("messages both inside and outside chunks")
        for schema in chunk.schemas:
            self._define(self.found.schemas, schema)
        for channel in chunk.channels:
            self._define(self.found.channels, channel)
        self.found.unchecked |= not chunk.checked and not self._is_in_summary(chunk)
        lost = [c for c in np.unique(chunk.channel).tolist() if not self.found.is_defined(c)]
        if lost and not self._lenient:
            raise DamageError(f"messages of channel {lost[0]}, which is not defined")
        if lost:
            known = ~np.isin(chunk.channel, lost)
            self.found.orphans += int(np.count_nonzero(~known))
            chunk = chunk.take(known)
        self.found.add(chunk)
        self._bound_on_work.take(len(chunk))
        return chunk

    def _is_in_summary(self, chunk: Chunk) -> bool:
        """Whether the summary, which has a checksum, contains a chunk's schemas and channels."""
        schemas = self.summary.schemas if self.summary else {}
        channels = self.summary.channels if self.summary else {}
        return all(schema.id in schemas for schema in chunk.schemas) and all(
            channel.id in channels for channel in chunk.channels
        )

    def _bound(self, *definitions: Schema | Channel, kept: bool) -> None:
        """Raises an error for a file with too many schemas or channels."""
        if not self.found.has_room(definitions, kept=kept):
            raise SloshBagError(
                f"{self.path}: more than {MOST_DEFINITIONS} schemas and channels, or "
                f"{MOST_DEFINED // 1_000_000} MB of them; a usual recording has a few hundred: "
                "filter it or record it again"
            )

    def _define(self, known: dict[int, Any], record: Schema | Channel) -> None:
        if record.id not in known:
            self._bound(record, kept=True)
        if known.setdefault(record.id, record) != record and not self._lenient:
            kind = type(record).__name__.lower()
            raise DamageError(f"{kind} {record.id} is defined twice, differently")

    def _is_counted(self) -> bool:
        """Whether the summary has message counts, by which missing messages are noticed."""
        return self.summary is not None and self.summary.counts is not None

    def _end(self, length: int) -> None:
        """Compares the contents with the file's checksums at the end of the data."""
        if length < 4:
            raise DamageError("a damaged end of the data")
        actual, crc = self._stream.crc, int.from_bytes(self._stream.take(4), "little")
        self._stream.skip(length - 4)
        if self._lenient:
            return
        if length > 4:
            self._check_last()
        wrong = bool(crc) and crc != actual
        self._check_counts()
        if wrong and (self.found.unchecked or (self.summary and not self._is_counted())):
            raise DamageError("the checksum (CRC) of all data is wrong")
        if wrong:
            self._warn("bytes between its chunks are damaged; the chunks are whole")
        if self.found.unknown and not self._is_counted() and (wrong or not crc):
            self._warn(f"{self.found.unknown} records of an unknown kind were skipped")
        if self.found.unchecked and not crc:
            self._warn("written without checksums: damage would not be noticed")
        if self.summary is None:
            self._warn("its end is cut off or damaged; all messages before it were read")
        elif self.summary.damaged:
            self._warn("its summary is damaged and was not used")

    def _check_last(self) -> None:
        """Raises an error if another chunk follows the end of the data."""
        position = self._stream.position
        if self._next_chunk(position) is not None:
            raise DamageError("a damaged end of the data")
        self._stream.jump(position)

    def _goes_on(self) -> bool:
        """Moves to the chunk that follows after a damaged record, which seemed to end the data."""
        after = self._next_chunk(self._stream.position)
        if after is not None:
            self._stream.jump(after)
        return after is not None

    def _check_counts(self) -> None:
        if self.summary is None or not self.summary.trusted:
            return
        position = self._stream.position
        if position != self.summary.start:
            raise DamageError(f"the data end at byte {position}, not {self.summary.start}")
        noted = self.summary.counts
        if noted is None or noted == self.found.counts:
            return
        for channel in sorted(noted | self.found.counts):
            there, said = self.found.counts.get(channel, 0), noted.get(channel, 0)
            if there != said:
                known = self.found.channels.get(channel)
                topic = known.topic if known else f"channel {channel}"
                raise DamageError(f"{there} messages of {topic}, but the summary counts {said}")

    def _damaged(self, position: int, error: DamageError) -> bool:
        """Handles unreadable bytes; returns whether the rest of the file is unreadable, too."""
        if self._lenient:
            return self._leave_out(position, error)
        if isinstance(error, TooLargeError):
            raise SloshBagError(f"{self.path}: at byte {position}: {error}")
        if self.summary is not None or self._next_chunk(position + 1) is not None:
            raise damaged(self.path, position, error)
        self._warn(self._lost_end(position, error))
        if self.found.unchecked:
            self._warn("written without checksums: damage would not be noticed")
        return True

    def _lost_end(self, position: int, error: DamageError) -> str:
        """Describes in one line which messages an unfinished file has lost."""
        cut = isinstance(error, CutOffError)
        text = f"unfinished ({'cut off' if cut else error}); "
        first, last = self.found.first_ns, self.found.last_ns
        if first is None or last is None:
            text += "no message could be read"
        else:
            text += f"read up to {last * 1e-9:.3f} s, {(last - first) * 1e-9:.3f} s of data"
        unused = self.size - position
        text += f"; the last {unused} bytes could not be used" if unused else ""
        if self._cut is not None:
            span = self._cut.start_ns * 1e-9, self._cut.end_ns * 1e-9
            text += f": messages from {span[0]:.3f} s to {span[1]:.3f} s"
        if self.found.unknown:
            text += f"; {self.found.unknown} records of an unknown kind were skipped"
        return text

    def _leave_out(self, position: int, error: DamageError) -> bool:
        """Skips damaged bytes up to the next readable record or chunk."""
        after = self._after_record(position)
        if after is None:
            after = self._next_chunk(position + 1)
        gap = UnreadBytes(
            position, self.size if after is None else after, str(error), self._span(position)
        )
        self.found.gaps.append(gap)
        if after is not None:
            self._stream.jump(after)
        return after is None

    def _span(self, position: int) -> tuple[int, int] | None:
        self._stream.jump(position)
        try:
            opcode, length = self._stream.begin()
            header = chunk_header(self._stream.peek(CHUNK_START), length)
        except DamageError:
            return None
        return (header.start_ns, header.end_ns) if opcode == Opcode.CHUNK else None

    def _after_record(self, position: int) -> int | None:
        """Returns the end of a record, or None if no other record begins there."""
        self._stream.jump(position)
        try:
            _, length = self._stream.begin()
            self._stream.skip(length)
            after = self._stream.position
            opcode, length = self._stream.begin()
        except CutOffError:
            return None
        fits = 0 < opcode <= Opcode.DATA_END and length <= self._stream.left
        return after if fits else None

    def _next_chunk(self, start: int) -> int | None:
        """Returns the position of the next intact chunk, or None if there is none."""
        while start < self.size:
            self._stream.jump(start)
            window = self._stream.peek(_WINDOW)
            at = find_chunk(np.frombuffer(window, np.uint8), 0)
            if at < 0:
                # A header that the window's end cuts is found in the next window.
                start += max(1, len(window) - CHUNK_START)
                continue
            if self._is_chunk(start + at):
                return int(start + at)
            start += at + 1
        return None

    def _is_chunk(self, position: int) -> bool:
        self._stream.jump(position)
        try:
            _, length = self._stream.begin()
            content = self._stream.take(length)
            self._bound_on_work.unpack(content)
            whole_chunk(position, content)
        except DamageError:
            return False
        return True

    def _warn(self, text: str) -> None:
        self.warnings.append(f"{self.path}: {text}")


def is_in_order(path: Path) -> bool:
    """Whether the chunks' time ranges, as their headers give them, are in order.

    Whether they say the truth shows when they are read.
    """
    newest = 0
    with path.open("rb") as file:
        stream = RecordStream(file, path.stat().st_size, checked=False)
        try:
            stream.skip(len(MAGIC))
            while True:
                first, last = _times(stream)
                if first < newest and last:
                    return False
                newest = max(newest, last)
        except DamageError:
            return True  # the end, or damage that the walk will tell


def _times(stream: RecordStream) -> tuple[int, int]:
    """Skips a record; returns first and last log time [ns], or zeros if it has no such times."""
    opcode, length = stream.begin()
    if length > stream.left:
        raise CutOffError("a record is cut off")
    if opcode == Opcode.CHUNK:
        header = chunk_header(stream.peek(CHUNK_START), length)
        stream.skip(length)
        return header.start_ns, header.end_ns
    if opcode == Opcode.MESSAGE:
        stream.back()
        window = stream.peek(max(_WINDOW, RECORD_HEADER + length))
        chunk = read_loose(stream.position, window)
        stream.skip(chunk.stored)
        return (int(chunk.log_ns[0]), int(chunk.log_ns[-1])) if len(chunk) else (0, 0)
    if opcode == Opcode.DATA_END:
        raise CutOffError("the end of the data")
    stream.skip(length)
    return 0, 0

"""Reads images with time stamps from a folder, a file pattern, a video or a bag."""

from __future__ import annotations

import glob
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_folder import bag_folder, files_of, import_hint
from slosh_bag.reader import BagMessage, BagReader, messages_of, stamp_ns
from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.detect.frame import (
    FOLDER_RATE,
    CompressedMessage,
    FrameSource,
    NoImage,
    RawMessage,
    SourceFrame,
    TiffPage,
)
from slosh_bringup.detect.name_times import doubtful_steps, name_times
from slosh_bringup.detect.series import IMAGE_ENDINGS, images_in, longest_series, natural_order
from slosh_bringup.detect.video import video_source
from slosh_bringup.errors import SloshBringupError
from slosh_camera.images.headers import tiff_pages

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
_BEFORE, _AFTER = 100_000_000, 2_000_000_000
"""How long before and after its stamp a recorder may have got an image [ns]."""


def open_source(
    sources: Sequence[str], rate: float | None = None, topic: str | None = None
) -> FrameSource:
    """Opens a folder, a file pattern, a video or a bag as a source of images.

    Args:
        sources: one folder, video, bag, image or pattern such as 'run/img_*.png', or several
            images.
        rate: images per second of files and videos [Hz]; None: as names or a video
            say, or FOLDER_RATE.
        topic: of a bag, whose images are taken; None: the first that holds pictures.

    Raises:
        SloshBringupError: there is nothing there that holds images.
        SloshBagError: a damaged bag, or one without images.
    """
    if len(sources) > 1:
        return file_source(f"{sources[0]} …", _existing(sources), rate)
    (name,) = sources
    path = Path(name)
    if not path.exists():
        return file_source(name, _matching(name), rate)
    if path.suffix == ".mcap" or (path.is_dir() and any(path.glob("*.mcap"))):
        return _bag_source(path, topic)
    if path.is_dir():
        files = images_in(path)
        if not files and any(bag_folder(path).glob("*.mcap")):
            return _bag_source(path, topic)
        if not files:
            raise SloshBringupError(
                f"{path}: no images ({', '.join(IMAGE_ENDINGS)}) in this folder{import_hint(path)}"
            )
        series, note = longest_series(files)
        return file_source(name, series, rate, files, note)
    if path.suffix.lower() in IMAGE_ENDINGS:
        return file_source(name, [path], rate)
    if hint := import_hint(path):
        raise SloshBringupError(f"{path}: not a video{hint}")
    return video_source(path, rate)


def frames_at(reader: BagReader, stamps: Collection[int]) -> dict[int, SourceFrame]:
    """Returns the images with the given stamps [ns] from a bag's first image topic.

    Args:
        reader: of the bag.
        stamps: of those that are wanted [ns]; what is not there is left out.

    Raises:
        SloshBagError: a damaged bag, or one without images.
    """
    topic = _image_topic(reader.path, reader)[0]
    windows = [(stamp - _BEFORE, stamp + _AFTER) for stamp in stamps]
    nearby = chain.from_iterable(map(messages_of, reader.look_up([topic], windows)))
    found = _with_stamps(reader, nearby, stamps)
    if len(found) < len(stamps):
        # The images' clock is not the recorder's, or one of them is not there.
        found = _with_stamps(reader, reader.messages([topic]), stamps)
    return found


def _with_stamps(
    reader: BagReader, records: Iterable[BagMessage], stamps: Collection[int]
) -> dict[int, SourceFrame]:
    frames = (_message_frame(reader, record) for record in records)
    return {frame.stamp_ns: frame for frame in frames if frame.stamp_ns in stamps}


def _existing(sources: Sequence[str]) -> list[Path]:
    paths = [Path(source) for source in sources]
    for path in paths:
        if not path.exists():
            raise SloshBringupError(f"{path}: no such file or folder")
        if path.suffix.lower() not in IMAGE_ENDINGS or path.is_dir():
            raise SloshBringupError(f"{path}: is not an image; several sources must all be images")
    return sorted(paths, key=natural_order)


def _matching(pattern: str) -> list[Path]:
    """Returns the files that match a shell-style pattern."""
    if not glob.has_magic(pattern):
        raise SloshBringupError(f"{pattern}: no such file or folder")
    paths = [Path(match) for match in glob.glob(pattern, recursive=True)]
    files = [path for path in paths if path.suffix.lower() in IMAGE_ENDINGS and path.is_file()]
    if not files:
        raise SloshBringupError(
            f"{pattern}: matches no image ({', '.join(IMAGE_ENDINGS)}); for a video or a bag "
            "give one file"
        )
    return sorted(files, key=natural_order)


def _bag_source(path: Path, topic: str | None) -> FrameSource:
    reader = BagReader(path)
    chosen, others, total = _image_topic(path, reader, topic)
    note = (
        f"measuring topic {chosen}; left out: {', '.join(others)} (choose with --topic)"
        if others
        else ""
    )
    source = FrameSource(str(path), iter(()), total, files=files_of(path), note=note)
    source.frames = _recorded(reader, chosen, source)
    return source


def _image_topic(
    path: Path, reader: BagReader, asked: str | None = None
) -> tuple[str, list[str], int | None]:
    """Returns the image topic to use, the other image topics, and the number of images."""
    topics = {
        topic: info for topic, info in reader.topics().items()
        if info.message_type in (RAW, COMPRESSED) and info.count != 0
    }  # fmt: skip
    if not topics:
        reason = f" ({reader.warnings[0]})" if reader.warnings else ""
        raise SloshBagError(f"{path}: holds no images{reason}")
    if asked is not None and asked not in topics:
        raise SloshBringupError(
            f"--topic {asked}: no images in {path}; topics with images: {', '.join(topics)}"
        )
    most = max(info.count or 0 for info in topics.values())

    def rank(topic: str) -> tuple[bool, bool, bool, bool]:
        # Distances are no picture. Nothing was lost in raw images, but a recorder leaves them
        # when compressed ones come.
        info = topics[topic]
        few = (info.count or most) < 0.5 * most
        return topic != asked, "depth" in topic.lower(), few, info.message_type != RAW

    chosen, *others = sorted(topics, key=rank)
    return chosen, others, topics[chosen].count


def _recorded(reader: BagReader, topic: str, source: FrameSource) -> Iterator[SourceFrame]:
    """Yields the images of a topic; stops with a warning where the bag is damaged."""
    records, unstamped = reader.messages([topic]), 0
    try:
        first = next(records, None)
        for record in chain([] if first is None else [first], _until_damage(records, source)):
            frame = _message_frame(reader, record)
            if not frame.stamp_ns:
                unstamped += 1
                frame = replace(frame, stamp_ns=record.log_ns, name=f"{record.log_ns} ns")
            yield frame
    finally:
        if unstamped:
            source.warnings.append(
                f"{source.name}: {unstamped} images have the stamp 0: their recording time is "
                "used, which is late by the camera's delay; make the driver set the stamps"
            )
        source.warnings.extend(dict.fromkeys(reader.warnings))


def _until_damage(records: Iterable[BagMessage], source: FrameSource) -> Iterator[BagMessage]:
    try:
        yield from records
    except SloshBagError as error:
        source.warnings.append(f"{error}; the images after it are lost")


def _message_frame(reader: BagReader, record: BagMessage) -> SourceFrame:
    try:
        message = reader.decode(record)
    except SloshBagError as error:
        return SourceFrame(record.log_ns, f"{record.log_ns} ns", NoImage(str(error)))
    stamp = stamp_ns(message)
    return SourceFrame(stamp, f"{stamp} ns", _message_content(message, record.message_type))


def _message_content(message: Any, message_type: str) -> RawMessage | CompressedMessage:
    if message_type == RAW:
        return RawMessage(
            message.encoding,
            message.height,
            message.width,
            message.step,
            message.data,
            bool(message.is_bigendian),
        )
    return CompressedMessage(message.format, message.data)


def file_source(
    name: str,
    files: Sequence[Path],
    rate: float | None,
    present: Sequence[Path] = (),
    note: str = "",
) -> FrameSource:
    """Returns image files as a source, every page of a TIFF file as an image.

    Args:
        name: what people call the source.
        files: the images, in natural order.
        rate: images per second [Hz]; None: as the files' names say, or FOLDER_RATE.
        present: all images that are there; empty: these.
        note: what was left out of them, in words.
    """
    pages = [page for file in files for page in _pages(file)]
    notes = [note] if note else []
    if len(pages) != len(files):
        notes.append(f"{len(pages)} images, since TIFF files hold several pages")
    found = None
    if rate is None and len(pages) == len(files):
        found = name_times(files)
        if found is None and (doubt := doubtful_steps(files)):
            notes.append(doubt)
    if found is not None:
        notes.append(f"times are those in the files' names, in {found.unit}; --rate overrides it")
        ordered = sorted(zip(found.stamps_ns, files, strict=True))
        timed = (SourceFrame(stamp, file.name, file) for stamp, file in ordered)
        return FrameSource(name, timed, len(files), None, present or files, "; ".join(notes))
    rate = rate or FOLDER_RATE
    counted = _at_rate(pages, rate)
    return FrameSource(name, counted, len(pages), rate, present or files, "; ".join(notes))


def _pages(file: Path) -> list[Path | TiffPage]:
    """Returns the pictures in a file; a file with one picture is the picture."""
    numbers = tiff_pages(file)
    return [file] if len(numbers) < 2 else [TiffPage(file, number) for number in numbers]


def _at_rate(pages: Sequence[Path | TiffPage], rate: float) -> Iterator[SourceFrame]:
    for index, page in enumerate(pages):
        stamp = round(index * SECOND / rate)
        if isinstance(page, TiffPage):
            yield SourceFrame(stamp, f"{page.path.name} page {page.number + 1}", page)
        else:
            yield SourceFrame(stamp, page.name, page)

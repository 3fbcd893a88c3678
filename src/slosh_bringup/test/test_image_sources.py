"""Tests which images a source has, and their times: videos, TIFF stacks, stamps in names."""

import struct

import cv2
import numpy as np
import pytest

from slosh_bringup.detect.source import open_source
from slosh_bringup.detect.video import edited_duration
from slosh_bringup.errors import SloshBringupError
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.decoding import read_image
from slosh_camera.images.headers import tiff_pages

COUNT, RATE = 30, 30.0
START = 1_700_000_000


def image(number):
    picture = np.full((48, 64), 200, np.uint8)
    picture[8 + number :] = 60
    return picture


def number_of(picture):
    """Returns which of the images this is, by its level."""
    return round(float((picture.reshape(48, -1).mean(axis=1) > 130.0).sum())) - 8


def write_video(path, codec, count=COUNT):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), RATE, (64, 48))
    for number in range(count):
        writer.write(cv2.cvtColor(image(number), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def box(kind, content):
    return struct.pack(">I4s", 8 + len(content), kind) + content


def trimmed(path, begin, shown):
    """Cuts an MP4 file as telephones do: its edit list begins later, all images stay.

    The list must be in front of nothing that has a fixed place: `moov` is at the end here.
    """
    data = path.read_bytes()
    moov = data.index(b"moov") - 4
    assert data.index(b"mdat") < moov
    trak = data.index(b"trak", moov) - 4
    old = data.find(b"edts", trak) - 4
    size = struct.unpack_from(">I", data, old)[0] if old > 0 else 0
    at = old if old > 0 else data.index(b"mdia", trak) - 4
    units = struct.unpack_from(">I", data, data.index(b"mvhd") + 16)[0]
    media = struct.unpack_from(">I", data, data.index(b"mdhd") + 16)[0]
    edit = struct.pack(">BxxxIIiI", 0, 1, round(shown * units), round(begin * media), 1 << 16)
    edts = box(b"edts", box(b"elst", edit))
    data = bytearray(data[:at] + edts + data[at + size :])
    for start in (moov, trak):
        (length,) = struct.unpack_from(">I", data, start)
        struct.pack_into(">I", data, start, length + len(edts) - size)
    path.write_bytes(data)


def with_empty_chunks(path, empty):
    """Writes an MJPEG AVI in which some images are chunks of no length."""
    chunks, index = b"", b""
    for number in range(COUNT):
        data = b"" if number in empty else cv2.imencode(".jpg", image(number))[1].tobytes()
        index += struct.pack("<4sIII", b"00dc", 0x10, 4 + len(chunks), len(data))
        chunks += struct.pack("<4sI", b"00dc", len(data)) + data + b"\0" * (len(data) % 2)

    def chunk(kind, content):
        return struct.pack("<4sI", kind, len(content)) + content

    main = struct.pack("<14I", round(1e6 / RATE), 0, 0, 0x10, COUNT, 0, 1, 0, 64, 48, 0, 0, 0, 0)
    stream = struct.pack(
        "<4s4sIHHIIIIIIII4H", b"vids", b"MJPG", 0, 0, 0, 0, 1, int(RATE), 0, COUNT, 0, 0, 0,
        0, 0, 64, 48,
    )  # fmt: skip
    form = struct.pack("<IiiHH4sIiiII", 40, 64, 48, 1, 24, b"MJPG", 64 * 48 * 3, 0, 0, 0, 0)
    strl = chunk(b"LIST", b"strl" + chunk(b"strh", stream) + chunk(b"strf", form))
    header = chunk(b"LIST", b"hdrl" + chunk(b"avih", main) + strl)
    movi = chunk(b"LIST", b"movi" + chunks)
    path.write_bytes(chunk(b"RIFF", b"AVI " + header + movi + chunk(b"idx1", index)))


def seen(path, **options):
    """Returns the images' numbers, their times from the first one [s], and the source."""
    source = open_source([str(path)], **options)
    frames = list(source.frames)
    times = np.array([frame.stamp_ns - frames[0].stamp_ns for frame in frames]) / 1e9
    return [number_of(frame.image()) for frame in frames], times, source


def test_a_clip_that_was_trimmed_on_the_telephone_has_all_its_images(tmp_path):
    path = write_video(tmp_path / "clip.mp4", "mp4v")
    trimmed(path, begin=0.5, shown=0.5)
    assert edited_duration(path) == pytest.approx(0.5, abs=1e-3)
    numbers, times, source = seen(path)
    assert numbers == list(range(15, 30))
    assert times == pytest.approx(np.arange(15) / RATE, abs=1e-3)
    assert source.warnings == []


def test_images_that_a_camera_lost_are_gaps_in_the_time(tmp_path):
    with_empty_chunks(tmp_path / "lost.avi", empty=(5, 11, 12, 20))
    numbers, times, source = seen(tmp_path / "lost.avi")
    kept = [n for n in range(COUNT) if n not in (5, 11, 12, 20)]
    assert numbers == kept
    assert times == pytest.approx(np.array(kept) / RATE, abs=1e-3)
    assert source.warnings == []


@pytest.mark.parametrize("lost", [1, 2, 3, 12])
def test_images_that_a_camera_lost_at_the_end_cut_nothing_off(tmp_path, lost):
    with_empty_chunks(tmp_path / "lost.avi", empty=range(COUNT - lost, COUNT))
    numbers, times, source = seen(tmp_path / "lost.avi")
    assert numbers == list(range(COUNT - lost))
    assert times == pytest.approx(np.array(numbers) / RATE, abs=1e-3)
    assert source.warnings == []


@pytest.mark.parametrize("empty", [(), (5, 11)], ids=["whole", "images lost"])
def test_a_file_that_is_cut_is_still_told(tmp_path, empty):
    path = tmp_path / "cut.avi"
    with_empty_chunks(path, empty)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    numbers, _, source = seen(path)
    assert 10 < len(numbers) < 20
    assert numbers == [n for n in range(COUNT) if n not in empty][: len(numbers)]
    (warning,) = source.warnings
    assert "should have 30 images" in warning
    assert "is it cut off?" in warning


def test_an_edit_list_that_is_damaged_tells_nothing(tmp_path):
    path = write_video(tmp_path / "clip.mp4", "mp4v")
    trimmed(path, begin=0.5, shown=0.5)
    data = path.read_bytes()
    at = data.index(b"elst")
    for size in range(at, len(data), 7):
        (tmp_path / "part.mp4").write_bytes(data[:size])
        assert edited_duration(tmp_path / "part.mp4") in (None, pytest.approx(0.5, abs=1e-3))
    (tmp_path / "loop.mp4").write_bytes(struct.pack(">I4sQ", 1, b"ftyp", 0) * 9)
    assert edited_duration(tmp_path / "loop.mp4") is None


def test_every_page_of_a_tiff_file_is_an_image(tmp_path):
    stack = tmp_path / "stack.tif"
    assert cv2.imwritemulti(str(stack), [image(n) for n in range(20)])
    numbers, times, source = seen(stack, rate=100.0)
    assert numbers == list(range(20))
    assert times == pytest.approx(np.arange(20) / 100.0)
    assert source.total == 20
    assert "20 images" in source.note
    with pytest.raises(SloshCameraError, match="holds 20 pages"):
        read_image(stack)


def test_a_preview_in_a_tiff_file_is_no_image(tmp_path):
    path = tmp_path / "photo.tif"
    assert cv2.imwritemulti(str(path), [image(3), cv2.resize(image(3), (16, 12))])
    assert tiff_pages(path) == [0]
    numbers, _, source = seen(path)
    assert (numbers, source.note) == ([3], "")
    assert number_of(read_image(path)) == 3


def test_damaged_tiff_files_have_no_further_pages(tmp_path):
    whole = tmp_path / "whole.tif"
    assert cv2.imwritemulti(str(whole), [image(n) for n in range(3)])
    data = whole.read_bytes()
    for size in (0, 1, 3, 7, 9):
        (tmp_path / "cut.tif").write_bytes(data[:size])
        assert tiff_pages(tmp_path / "cut.tif") == []
    # The last page's offset of a next one leads back to the first page: no endless loop.
    (first,) = struct.unpack_from("<I", data, 4)
    at, found = first, []
    while at:
        (tags,) = struct.unpack_from("<H", data, at)
        found.append(at + 2 + 12 * tags)
        (at,) = struct.unpack_from("<I", data, found[-1])
    looped = bytearray(data)
    struct.pack_into("<I", looped, found[-1], first)
    (tmp_path / "loop.tif").write_bytes(looped)
    assert tiff_pages(tmp_path / "loop.tif") == [0, 1, 2]


STEPS = np.array([0, 17, 33, 67, 83, 100, 150, 167]) * 10**6
"""Of a camera at 60 Hz that lost some images [ns]."""


def split(ns):
    return divmod(START * 10**9 + ns, 10**9)


@pytest.mark.parametrize(
    "name",
    [
        lambda ns: f"{START * 10**9 + ns}.png",
        lambda ns: f"cam2_{(START * 10**9 + ns) // 1000}.png",
        lambda ns: f"image-{(START * 10**9 + ns) // 10**6}-left.png",
        lambda ns: f"{split(ns)[0]}.{split(ns)[1]:09d}.png",
        lambda ns: f"{split(ns)[0]}.{split(ns)[1] // 1000:06d}.png",
        lambda ns: f"img_{split(ns)[0]}_{split(ns)[1]:09d}.png",
        lambda ns: f"img_{split(ns + 850_000_000)[0]}_{split(ns + 850_000_000)[1]}.png",
        lambda ns: f"frame{33_000_000 + ns}.png",
        lambda ns: f"frame{(33_000_000 + ns) // 1000:012d}.png",
    ],
    ids=["ns", "us", "ms", "s.ns", "s.us", "s_ns", "s_n", "ns from 0", "us from 0"],
)
def test_stamps_in_names_are_times(tmp_path, name):
    for number, ns in enumerate(STEPS.tolist()):
        cv2.imwrite(str(tmp_path / name(ns)), image(number))
    numbers, times, source = seen(tmp_path)
    assert numbers == list(range(len(STEPS)))
    assert times == pytest.approx(STEPS / 1e9, abs=1e-6)
    assert "times are those in the files' names" in source.note
    assert source.rate is None
    _, times, source = seen(tmp_path, rate=50.0)  # what is asked for counts
    assert times == pytest.approx(np.arange(len(STEPS)) / 50.0)
    assert source.rate == 50.0


@pytest.mark.parametrize(
    "names",
    [
        [f"frame_{n:06d}.png" for n in range(8)],
        [f"frame_{n:06d}.png" for n in range(0, 80_000, 10_000)],
        [f"{n}.png" for n in (1, 2, 4, 5, 9)],
        [f"IMG_20231128_1530{n:02d}.png" for n in range(10, 18)],
        [f"run_1700000000_{n}.png" for n in range(8)],
        [f"2023-11-28_frame{n}.png" for n in range(8)],
        ["1700000000.png"],
        ["a.png", "b.png"],
        [f"{START * 10**9 + n}.png" for n in (0, 10**8)] + ["still.png"],
    ],
)
def test_counters_stay_counters(tmp_path, names):
    paths = [tmp_path / name for name in names]
    for path in paths:
        cv2.imwrite(str(path), image(0))
    source = open_source([str(path) for path in paths])
    stamps = [frame.stamp_ns for frame in source.frames]
    assert stamps == [round(n * 1e9 / 60.0) for n in range(len(names))]
    assert source.note == ""


def test_a_number_that_may_be_milliseconds_is_told(tmp_path):
    for ms in (0, 33, 67, 100, 167):
        cv2.imwrite(str(tmp_path / f"frame_{ms}.png"), image(0))
    source = open_source([str(tmp_path)])
    assert source.rate == 60.0
    assert "grows by 33 to 67" in source.note
    assert "--rate" in source.note


def test_an_empty_video_is_refused(tmp_path):
    (tmp_path / "empty.mp4").touch()
    with pytest.raises(SloshBringupError, match="empty file"):
        open_source([str(tmp_path / "empty.mp4")])

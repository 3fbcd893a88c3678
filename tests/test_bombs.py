"""Tests that small files with huge content are rejected early, with little memory."""

import bz2
import functools
import gzip
import re
import struct
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import cv2
import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, DataEnd, Footer, Header, Schema
from mcap.writer import MCAP0_MAGIC

from slosh_bringup.cli.main import main
from slosh_bringup.processes import config_folder
from slosh_testing.measured_process import Ended, run_slosh

MB = 1_000_000
MOST = 500 * MB
"""What a refused file may cost beyond a command that has nothing to read [bytes]."""
HUGE = 1500 * MB
PROGRESS = re.compile(r"[\w.]+: +\d+%")


POINT, POINT_TEXT = "geometry_msgs/msg/Point", "float64 x\nfloat64 y\nfloat64 z\n"


@pytest.fixture(scope="module")
def idle() -> int:
    """Returns the peak memory of a command that finds nothing to read [bytes]."""
    ended = run_slosh("replay", "/nowhere/at/all")
    assert ended.code == 2
    return ended.peak


def check_refused(ended: Ended, idle: int, *parts: str, code: int = 2) -> None:
    """Checks exit code, a one-line error with given parts, and little memory."""
    check_survived(ended, idle)
    assert ended.code == code, ended.error
    # Where the machine is slow, lines of progress stand before it.
    lines = [line for line in ended.error.splitlines() if not PROGRESS.match(line)]
    assert len(lines) == 1, ended.error
    for part in parts:
        assert part in lines[0]


def check_survived(ended: Ended, idle: int) -> None:
    """Checks that a command ended regularly, with or without a result, and used little memory."""
    print(f"{ended.peak / MB:.0f} MB, {ended.seconds:.1f} s: {ended.error.strip()[:300]}")
    assert ended.code in (0, 1, 2), ended.error
    assert "Traceback" not in ended.error
    assert ended.peak < idle + MOST


# MCAP


def record(content: Any) -> bytes:
    builder = RecordBuilder()
    content.write(builder)
    return bytes(builder.end())


def chunk(compression: str, stored: bytes, size: int, span: tuple[int, int] = (1, 1)) -> bytes:
    name = compression.encode()
    content = struct.pack("<QQQII", *span, size, 0, len(name)) + name
    content += struct.pack("<Q", len(stored)) + stored
    return struct.pack("<BQ", 6, len(content)) + content


def definitions(name: str = POINT, text: str = POINT_TEXT, topic: str = "/p") -> bytes:
    schema = Schema(id=1, name=name, encoding="ros2msg", data=text.encode())
    return record(schema) + record(channel(1, topic))


def channel(number: int, topic: str) -> Channel:
    return Channel(id=number, topic=topic, message_encoding="cdr", schema_id=1, metadata={})


def message(log_ns: int, data: bytes = bytes(28), number: int = 1) -> bytes:
    return struct.pack("<BQHIQQ", 5, 22 + len(data), number, 0, log_ns, log_ns) + data


def write_mcap(path: Path, parts: Iterable[bytes]) -> Path:
    with path.open("wb") as file:
        file.write(MCAP0_MAGIC + record(Header("ros2", "test")))
        for part in parts:
            file.write(part)
        end = record(DataEnd(0)) + record(Footer(0, 0, 0))
        file.write(end + MCAP0_MAGIC)
    return path


def pour(compressor: Any, size: int, filler: bytes = bytes(MB)) -> bytes:
    """Returns the compressed form of a number of filler bytes."""
    parts = [compressor.compress(filler) for _ in range(size // len(filler))]
    return b"".join([*parts, compressor.flush()])


@functools.cache
def lz4_without_size(size: int) -> bytes:
    compressor = lz4.frame.LZ4FrameCompressor()
    return compressor.begin() + pour(compressor, size)


@functools.cache
def zstd_with_size(size: int) -> bytes:
    return pour(zstandard.ZstdCompressor(level=1).compressobj(size=size), size)


@functools.cache
def zstd_without_size(size: int, filler: bytes = bytes(MB)) -> bytes:
    return pour(zstandard.ZstdCompressor(level=1).compressobj(), size, filler)


def zstd_of(content: bytes) -> bytes:
    return zstandard.ZstdCompressor(level=1).compress(content)


def many(part: bytes, size: int) -> tuple[bytes, int]:
    """Returns a part, repeated up to a size and compressed, and the uncompressed length."""
    block = part * (MB // len(part))
    times = size // len(block)
    return zstd_without_size(times * len(block), block), times * len(block)


def overlapping_chunks() -> Iterable[bytes]:
    """Writes an MCAP file whose chunks are small, but all cover the same time."""
    content = definitions() + message(1) + message(10, bytes(100 * MB))
    packed = zstd_of(content)
    return [chunk("zstd", packed, len(content), (1, 10)) for _ in range(8)]


def chunk_of_messages() -> list[bytes]:
    head = chunk("", definitions(), len(definitions()), (0, 0))
    return [head, chunk("zstd", *many(message(1, b""), 190 * MB))]


def chunk_of_schemas() -> list[bytes]:
    schema = record(Schema(id=1, name="a/msg/B", encoding="ros2msg", data=b""))
    return [chunk("zstd", *many(schema, 190 * MB), (0, 0))]


def many_chunks(content: bytes, size: int) -> Iterable[bytes]:
    """Writes an MCAP file of 0.3 MB with extremely well compressed chunks."""
    head = chunk("", definitions(), len(definitions()), (0, 0))
    return [head] + [chunk("zstd", content, size)] * (300_000 // len(content))


def chunks_of_messages() -> Iterable[bytes]:
    content = message(1, b"") * 900_000
    return many_chunks(zstandard.ZstdCompressor(level=19).compress(content), len(content))


MCAPS: dict[str, Callable[[], Iterable[bytes]]] = {
    "lz4 that lies": lambda: [chunk("lz4", lz4_without_size(HUGE), 1000)],
    "lz4 that says 1.5 GB": lambda: [chunk("lz4", lz4_without_size(HUGE), HUGE)],
    "zstd that lies": lambda: [chunk("zstd", zstd_without_size(HUGE), 1000)],
    "zstd that says 1.5 GB": lambda: [chunk("zstd", zstd_with_size(HUGE), HUGE)],
    "zstd of no size that says 1.5 GB": lambda: [chunk("zstd", zstd_without_size(HUGE), HUGE)],
    "eight million messages in a chunk": chunk_of_messages,
    "ten million schemas in a chunk": chunk_of_schemas,
    "chunks at the same time": overlapping_chunks,
    "a hundred million messages": chunks_of_messages,
    "ten gigabytes in chunks": lambda: many_chunks(zstd_of(bytes(190 * MB)), 190 * MB),
    "ten gigabytes of messages": lambda: many_chunks(
        zstd_of(message(1, bytes(190 * MB))), 31 + 190 * MB
    ),
}
QUICK_MCAPS = ("lz4 that lies", "zstd that says 1.5 GB", "a hundred million messages")


def mostly_long(names: Iterable[str], quick: Iterable[str]) -> list[object]:
    return [n if n in quick else pytest.param(n, marks=pytest.mark.long) for n in names]


@pytest.mark.first(1)
@pytest.mark.parametrize("name", mostly_long(MCAPS, QUICK_MCAPS))
@pytest.mark.parametrize("command", ["replay", "export", "recover", "import"])
def test_a_chunk_that_is_huge_when_unpacked(tmp_path, idle, name, command):
    path = write_mcap(tmp_path / "bomb.mcap", MCAPS[name]())
    assert path.stat().st_size < 15 * MB
    ended = run_slosh(*words(command, path, tmp_path))
    check_refused(ended, idle, "bomb.mcap")


def words(command: str, path: Path, folder: Path) -> list[str | Path]:
    return {
        "replay": ["replay", path],
        "export": ["export", path, "-o", folder / "tables"],
        "recover": ["recover", path, "-o", folder / "new"],
        "import": ["import", "rosbag", path, "-o", folder / "new"],
    }[command]


@pytest.mark.parametrize("command", ["export", pytest.param("import", marks=pytest.mark.long)])
def test_chunks_of_the_same_make_are_read(tmp_path, capsys, command):
    whole = definitions() + message(1) + message(2)
    size, plain = len(whole), [definitions(), message(1), message(2)]
    parts = {
        "lz4": [chunk("lz4", lz4.frame.compress(whole, store_size=False), size, (1, 2))],
        "zstd": [chunk("zstd", zstd_of(whole), size, (1, 2))],
        "zstd2": [chunk("zstd", zstd_without_size(size, whole), size, (1, 2))],
        "plain": plain,
    }
    for name, content in parts.items():
        folder = tmp_path / name
        folder.mkdir()
        path = write_mcap(folder / "good.mcap", content)
        assert main(list(map(str, words(command, path, folder)))) == 0
        assert "2" in capsys.readouterr().out


# rosbag2 folders


@pytest.mark.long
def test_a_file_that_is_huge_when_unpacked(tmp_path, idle):
    folder = tmp_path / "bomb"
    folder.mkdir()
    (folder / "bomb.db3.zstd").write_bytes(zstd_without_size(HUGE))
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {compression_mode: FILE, "
        "relative_file_paths: [bomb.db3.zstd]}\n"
    )
    ended = run_slosh("import", "rosbag", folder, "-o", tmp_path / "new")
    check_refused(ended, idle, "bomb.db3.zstd unpacks to more than 1000000000 bytes")


# Message types

DOUBLING = "".join(f"{'=' * 80}\nMSG: a/T{n}\nT{n + 1} left\nT{n + 1} right\n" for n in range(40))
TYPES = {
    "a type within itself": "B inner\n",
    "types within each other": f"C c\n{'=' * 80}\nMSG: a/C\nB b\n",
    "sequences of itself": "B[] inner\n",
    "2⁴⁰ fields": f"T0 first\n{DOUBLING}{'=' * 80}\nMSG: a/T40\nfloat64 x\n",
    "an array of 10¹² fields": f"C[1000000] c\n{'=' * 80}\nMSG: a/C\nD[1000000] d\n"
    f"{'=' * 80}\nMSG: a/D\nuint8 x\n",
    "a definition of 20 MB": "float64 x\n" * 2_000_000,
}


@pytest.mark.first(1)
@pytest.mark.parametrize("name", mostly_long(TYPES, ["a type within itself"]))
@pytest.mark.parametrize("command", ["export", "recover", "import"])
def test_a_message_type_without_an_end(tmp_path, idle, name, command):
    parts = [definitions("a/msg/B", TYPES[name]), message(1)]
    path = write_mcap(tmp_path / "bomb.mcap", parts)
    ended = run_slosh(*words(command, path, tmp_path))
    if command == "recover":
        check_survived(ended, idle)  # it copies the definition, whatever it says
    else:
        check_refused(ended, idle, "a/msg/B")


def numbered_schemas(count: int) -> Iterable[bytes]:
    for number in range(count):
        name = f"a/msg/T{number}"
        yield record(
            Schema(id=number % 65535 + 1, name=name, encoding="ros2msg", data=b"int8 x\n")
        )
        if number % 1000 == 0:
            yield record(channel(1, "/p")) + message(number + 1)


@pytest.mark.long
@pytest.mark.parametrize("command", ["replay", "export", "recover", "import"])
def test_a_million_schemas(tmp_path, idle, command):
    path = write_mcap(tmp_path / "bomb.mcap", numbered_schemas(1_000_000))
    ended = run_slosh(*words(command, path, tmp_path))
    check_refused(ended, idle, "bomb.mcap", "schema")


# ROS 1 bags


def ros1_record(data: bytes, **fields: bytes) -> bytes:
    head = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in fields.items()
    )
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


def u32(value: int) -> bytes:
    return struct.pack("<I", value)


def ros1_chunk(compression: str, packed: bytes, size: int) -> bytes:
    name = compression.encode()
    return ros1_record(packed, op=b"\x05", compression=name, size=u32(size))


def ros1_index(count: int = 1) -> bytes:
    entry = u32(5) + u32(0) + u32(0)
    fields = {"ver": u32(1), "conn": u32(0), "count": u32(count)}
    return ros1_record(entry * count, op=b"\x04", **fields)


def ros1_bag(path: Path, chunk: bytes, indexes: bytes, infos: int = 1) -> Path:
    """Writes a ROS 1 bag with one chunk and one connection."""

    def header(index: int) -> bytes:
        counts = {"conn_count": u32(1), "chunk_count": u32(infos)}
        where = struct.pack("<Q", index)
        return ros1_record(bytes(100), op=b"\x03", index_pos=where, **counts)

    magic = b"#ROSBAG V2.0\n"
    start = len(magic) + len(header(0))
    kind = {"type": POINT.replace("/msg", "").encode(), "md5sum": b"0" * 32}
    inner = ros1_record(b"", **kind, message_definition=POINT_TEXT.encode())
    topic = ros1_record(b"", op=b"\x07", conn=u32(0), topic=b"/p")[:-4]
    connection = topic + struct.pack("<I", len(inner) - 8) + inner[4:-4]
    at = struct.pack("<Q", start)
    fields = {"ver": u32(1), "chunk_pos": at, "start_time": u32(5) * 2, "end_time": u32(5) * 2}
    info = ros1_record(u32(0) + u32(1), op=b"\x06", **fields, count=u32(1))
    end = start + len(chunk) + len(indexes)
    path.write_bytes(magic + header(end) + chunk + indexes + connection + info * infos)
    return path


def ros1_message() -> bytes:
    return ros1_record(bytes(24), op=b"\x02", conn=u32(0), time=u32(5) + u32(0))


def bz2_bomb(path: Path) -> Path:
    packed = bz2.compress(ros1_message() + bytes(10 * MB)) + bz2.compress(bytes(10 * MB)) * 200
    return ros1_bag(path, ros1_chunk("bz2", packed, 1000), ros1_index())


def lz4_bomb(path: Path) -> Path:
    return ros1_bag(path, ros1_chunk("lz4", lz4_without_size(HUGE), 1000), ros1_index())


def index_bomb(path: Path) -> Path:
    whole = ros1_message()
    return ros1_bag(path, ros1_chunk("none", whole, len(whole)), ros1_index(10_000), infos=5000)


ROS1_BAGS = {"bz2": bz2_bomb, "lz4": lz4_bomb, "one index many times": index_bomb}


@pytest.mark.long
@pytest.mark.parametrize("name", mostly_long(ROS1_BAGS, ["bz2"]))
def test_a_ros1_bag_that_is_huge_when_unpacked(tmp_path, idle, name):
    path = ROS1_BAGS[name](tmp_path / "bomb.bag")
    assert path.stat().st_size < 15 * MB
    ended = run_slosh("import", "rosbag", path, "-o", tmp_path / "new")
    check_refused(ended, idle, "bomb.bag")


def test_a_ros1_bag_of_the_same_make_comes_in(tmp_path, capsys):
    whole = ros1_message()
    for name, pack in (("none", bytes), ("bz2", bz2.compress), ("lz4", lz4.frame.compress)):
        data = ros1_chunk(name, pack(whole), len(whole))
        path = ros1_bag(tmp_path / f"{name}.bag", data, ros1_index())
        assert main(["import", "rosbag", str(path), "-o", str(tmp_path / name)]) == 0
        assert "/p: 1" in capsys.readouterr().out


# Tables

TABLE = b"t,ax,ay,az\n"


def sparse(path: Path, head: bytes, size: int) -> None:
    with path.open("wb") as file:
        file.write(head)
        file.truncate(size)


def one_line(path: Path) -> Path:
    path = path.with_suffix(".csv")
    sparse(path, TABLE + b"0,0,0,0\n", 1000 * MB)
    return path


def heading_of_a_gigabyte(path: Path) -> Path:
    path = path.with_suffix(".csv")
    sparse(path, b"t,ax,ay,az", 1000 * MB)
    return path


def gzip_of(filler: bytes, size: int) -> Callable[[Path], Path]:
    def make(path: Path) -> Path:
        path = path.with_suffix(".csv.gz")
        member = gzip.compress(filler * (10 * MB // len(filler)), mtime=0)
        path.write_bytes(gzip.compress(TABLE, mtime=0) + member * (size // (10 * MB)))
        return path

    return make


TABLES = {
    "a line of 1 GB": one_line,
    "a heading of 1 GB": heading_of_a_gigabyte,
    "gzip of one line of 4 GB": gzip_of(bytes(1000), 4000 * MB),
    "gzip of 4 GB of rows": gzip_of(b"1,2,3,4\n", 4000 * MB),
    "gzip of 4 GB of empty lines": gzip_of(b"\n", 4000 * MB),
    "gzip of 4 GB of long rows": gzip_of(b"1" * 60_000 + b"\n", 4000 * MB),
    "gzip of 4 GB of quoted lines": gzip_of(b'"' + b"1" * 1000 + b"\n", 4000 * MB),
}


@pytest.mark.long
@pytest.mark.parametrize("name", mostly_long(TABLES, ["a line of 1 GB"]))
def test_a_table_that_is_huge_when_read(tmp_path, idle, name):
    path = TABLES[name](tmp_path / "bomb")
    model = config_folder() / "model.yaml"
    ended = run_slosh("simulate", model, path, "-o", tmp_path / "heights.csv")
    check_refused(ended, idle, path.name)


# Images


def png_chunk(kind: bytes, content: bytes) -> bytes:
    checked = kind + content
    return struct.pack(">I", len(content)) + checked + struct.pack(">I", zlib.crc32(checked))


@functools.cache
def png(width: int, height: int) -> bytes:
    """Returns a black PNG image with one bit per pixel."""
    row = bytes(1 + (width + 7) // 8)
    packer = zlib.compressobj(1)
    body = b"".join(packer.compress(row) for _ in range(height)) + packer.flush()
    head = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    parts = png_chunk(b"IHDR", head) + png_chunk(b"IDAT", body) + png_chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def jpeg(width: int, height: int) -> bytes:
    """Returns a small JPEG image whose header states another size."""
    data = bytearray(cv2.imencode(".jpg", np.zeros((64, 64, 3), np.uint8))[1].tobytes())
    frame = data.index(b"\xff\xc0")
    data[frame + 5 : frame + 9] = struct.pack(">HH", height, width)
    return bytes(data)


def bmp(width: int, height: int) -> bytes:
    data = bytearray(cv2.imencode(".bmp", np.zeros((4, 4), np.uint8))[1].tobytes())
    data[18:26] = struct.pack("<ii", width, height)
    return bytes(data)


def tiff(width: int, height: int) -> bytes:
    data = cv2.imencode(".tif", np.zeros((40, 50), np.uint8))[1].tobytes()
    for tag, old, new in ((256, 50, width), (257, 40, height), (278, 40, height)):
        for kind, form in ((3, "<HHIHH"), (4, "<HHII")):
            was = struct.pack(form, tag, kind, 1, old, *([0] if kind == 3 else []))
            data = data.replace(was, struct.pack("<HHII", tag, 4, 1, new))
    return data


PICTURES = {".png": png, ".jpg": jpeg, ".bmp": bmp, ".tif": tiff}


@pytest.mark.long
@pytest.mark.parametrize("ending", mostly_long(PICTURES, [".png"]))
@pytest.mark.parametrize("command", ["detect", "calibrate"])
def test_a_picture_of_900_megapixels(tmp_path, idle, ending, command):
    path = tmp_path / f"bomb{ending}"
    path.write_bytes(PICTURES[ending](30_000, 30_000))
    assert path.stat().st_size < MB
    camera = config_folder() / "camera.yaml"
    what = {
        "detect": ["detect", "--camera", camera, path, "-o", tmp_path / "heights.csv"],
        "calibrate": ["calibrate", "--camera", camera, path, "-o", tmp_path / "camera.yaml"],
    }
    ended = run_slosh(*what[command])
    # A series goes on behind an image that cannot be read: it counts as not measured.
    code = 1 if command == "detect" else 2
    check_refused(ended, idle, path.name, "30000 x 30000", code=code)

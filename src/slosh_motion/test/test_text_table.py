"""Tests that one motion, written in many table formats, is read as the same numbers.

Each way has one meaning; what has two, or none, is refused with the option that settles it.
"""

import gzip
import math
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from slosh_base.files.errors import SloshFileError
from slosh_motion.tables.columns import TableOptions, TableWarning
from slosh_motion.tables.motion_table import read_motion_table
from slosh_plan.tables.path_table import read_path_table
from slosh_plan.tables.trajectory_table import read_trajectory

G = 9.80665
N = 24
T = 0.002 * np.arange(N)
A = np.round(np.random.default_rng(3).normal(0.0, 2.0, (N, 3)), 4)
HEIGHT = np.where(np.arange(N) % 3 == 0, np.round(0.01 * np.sin(T), 6), np.nan)
EPOCH_NS = 1_700_000_000_123_456_789
Column = np.ndarray


def text(
    heading: str,
    *columns: Column,
    separator: str = ",",
    number: Callable[[float], str] = repr,
    end: str = "\n",
    unknown: str = "nan",
) -> str:
    """Returns the text of a table with these columns."""
    rows = [
        separator.join(unknown if math.isnan(x) else number(x) for x in row)
        for row in np.column_stack(columns).tolist()
    ]
    return end.join([heading, *rows, ""])


def comma(x: float) -> str:
    return repr(x).replace(".", ",")


def whole(values: np.ndarray) -> list[str]:
    return [str(value) for value in values.tolist()]


def stamped(name: str, stamps: list[str]) -> str:
    rows = [",".join([s, *map(repr, a)]) for s, a in zip(stamps, A.tolist(), strict=True)]
    return "\n".join([f"{name},ax,ay,az", *rows, ""])


def dates(form: str) -> list[str]:
    start = datetime(2025, 3, 1, 12, 0, tzinfo=UTC)
    return [format(start + timedelta(seconds=t), form) for t in T.tolist()]


NS = np.rint(1e9 * T).astype(np.int64)
PLAIN = text("t,ax,ay,az", T, A)
TABLES: dict[str, str | bytes] = {
    "as it is documented": PLAIN,
    "Excel in Europe": text("t;ax;ay;az", T, A, separator=";", number=comma, end="\r\n"),
    "Excel's own first line": "sep=;\r\n" + text("t;ax;ay;az", T, A, separator=";", number=comma),
    "semicolons and points": text("t;ax;ay;az", T, A, separator=";"),
    "tabs": text("t\tax\tay\taz", T, A, separator="\t"),
    "tabs and decimal commas": text("t\tax\tay\taz", T, A, separator="\t", number=comma),
    "Excel's Unicode text": text("t\tax\tay\taz", T, A, separator="\t", end="\r\n").encode(
        "utf-16"),
    "UTF-16 without a mark": PLAIN.encode("utf-16-le"),
    "spaces": text("t ax ay az", T, A, separator=" "),
    "aligned by spaces": text("   t   ax  ay  az ", T, A, separator="   "),
    "spaces and decimal commas": text("t ax ay az", T, A, separator=" ", number=comma),
    "bars": text("t|ax|ay|az", T, A, separator="|"),
    "quoted decimal commas": text('"t","ax","ay","az"', T, A, number=lambda x: f'"{comma(x)}"'),
    "quoted numbers": text('"t","ax","ay","az"', T, A, number=lambda x: f'"{x!r}"'),
    "a byte order mark": PLAIN.encode("utf-8-sig"),
    "blanks around": text(" t , ax , ay , az ", T, A, number=lambda x: f" {x!r} "),
    "carriage returns": text("t,ax,ay,az", T, A, end="\r"),
    "upper case": text("T,AX,AY,AZ", T, A),
    "units in brackets": text("time [s],ax [m/s2],ay [m/s^2],az [m/s²]", T, A),
    "units of a spreadsheet, code page": text("t (s);ax (m/s²);ay (m/s²);az (m/s²)", T, A,
                                              separator=";").encode("cp1252"),
    "units by a slash": text("t / s,a_x / (m/s²),a_y / (m/s²),a_z / (m/s²)", T, A),
    "milliseconds": text("Time (ms),acc_x,acc_y,acc_z", 1e3 * T, A),
    "microseconds": text("t [µs],ax,ay,az", 1e6 * T, A),
    "units after an underscore": text("time_ms,ax_g,ay_g,az_g", 1e3 * T, A / G),
    "g": text("t,ax [g],ay [g],az [g]", T, A / G),
    "mm/s²": text("t,ax [mm/s2],ay [mm/s²],az [mm/s^2]", T, 1e3 * A),
    "a row of units": text("t,ax,ay,az\ns,m/s2,m/s2,m/s2", T, A),
    "a row of other units": text("t,ax,ay,az\n[ms],[g],[g],[g]", 1e3 * T, A / G),
    "other names": text("timestamp,acceleration.x,acceleration.y,acceleration.z", T, A),
    "axis first": text("seconds,x_acc,y_acc,z_acc", T, A),
    "stamps in ns since 1970": stamped("timestamp", whole(EPOCH_NS + NS)),
    "stamps in us since 1970": stamped("timestamp", whole(EPOCH_NS // 1000 + NS // 1000)),
    "stamps in ms since 1970": stamped("timestamp", whole(EPOCH_NS // 10**6 + NS // 10**6)),
    "a clock of ns": stamped("stamp_ns", whole(123_456_789_012 + NS)),
    "dates": stamped("time", dates("%Y-%m-%d %H:%M:%S.%f")),
    "dates of ISO 8601": stamped("time", dates("%Y-%m-%dT%H:%M:%S.%f+00:00")),
    "pandas' index": text(",t,ax,ay,az", np.arange(N), T, A),
    "pandas' index by name": text("Unnamed: 0,t,ax,ay,az", np.arange(N), T, A),
    "R's names of rows": text('"t" "ax" "ay" "az"', np.arange(1.0, N + 1), T, A, separator=" ",
                              number=lambda x: f'"{x:.0f}"' if x == int(x) and x > 0 else repr(x)),
    "comments": "# logger 3\n# 1 kHz\n\n" + PLAIN.replace("\n", "\n# here\n", 3),
    "NumPy's heading": text("# t ax ay az", T, A, separator=" "),
    "NumPy's heading with commas": text("# t,ax,ay,az", T, A),
    "a logger's lines before": "Logger 3\nRate,500 Hz\nStarted: 2025-03-01\n" + PLAIN,
    "a logger's lines, semicolons": "Logger 3\nRate;500\n" + text(
        "t;ax;ay;az", T, A, separator=";", number=comma),
    "ROS 1's %time": text("%time,acc_x,acc_y,acc_z", T, A),
    "a minus sign": PLAIN.replace("-", "\u2212"),
    "a comment in a code page": "# Pr\xfcfstand, 5 \x80\n".encode("latin-1") + PLAIN.encode(),
    "MATLAB's comments": "% made by a script\n" + PLAIN,
    "separators at the end": text("t,ax,ay,az,", T, A).replace("\n", ",\n").replace(",,", ","),
    "separators at the rows' end": PLAIN.replace("\n", ",\n").replace("az,", "az"),
    "blank last lines": PLAIN + "\n\n",
    "empty rows of a spreadsheet": PLAIN + ",,,\n,,,\n",
    "another order": text("az,t,ay,ax", A[:, 2], T, A[:, 1], A[:, 0]),
    "exponents": text("t,ax,ay,az", T, A, number=lambda x: f"{x:.12E}"),
}  # fmt: skip


def read(path: Path, content: str | bytes, **options) -> tuple:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    said: list[str] = []
    return read_motion_table(path, TableOptions(tell=said.append, **options)), said


def assert_same(table) -> None:
    np.testing.assert_allclose(table.t - table.t[0], T, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(table.acceleration, A, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", TABLES)
def test_one_motion_is_read_whatever_it_is_written_like(tmp_path: Path, name: str):
    table, said = read(tmp_path / "a.csv", TABLES[name])
    assert_same(table)
    assert len(said) <= 1
    packed = tmp_path / "a.csv.gz"
    packed.write_bytes(gzip.compress((tmp_path / "a.csv").read_bytes()))
    assert_same(read_motion_table(packed, TableOptions(tell=said.append)))
    # A plan, read by the same reader.
    motion = read_trajectory(tmp_path / "a.csv", TableOptions(tell=said.append))
    np.testing.assert_allclose(motion.acceleration, A, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(motion.t - motion.t[0], T, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("as it is documented", None),
        ("blanks around", None),
        ("a row of units", None),
        ("Excel in Europe", "semicolons between the columns; decimal commas"),
        ("milliseconds", "t from 'Time (ms)' in ms"),
        ("g", "ax from 'ax [g]' in g"),
        ("a row of other units", "t in ms; ax, ay, az in g"),
        ("stamps in ns since 1970", f"counted from {EPOCH_NS}; t from 'timestamp' in ns"),
        ("pandas' index", "not read: the index column"),
    ],
)
def test_what_was_assumed_is_told_once(tmp_path: Path, name: str, words: str | None):
    _, said = read(tmp_path / "a.csv", TABLES[name])
    if words is None:
        assert said == []
    else:
        (line,) = said
        assert line.startswith(f"{tmp_path / 'a.csv'}: read as: ")
        assert words in line


@pytest.mark.parametrize(
    ("content", "options"),
    [
        (text("Zeitpunkt,hin,her,hoch,note", T, A, T),
         {"columns": {"t": "Zeitpunkt", "ax": "hin", "ay": "her", "az": "hoch"}}),
        (text("1.0,2.0,3.0,4.0", T, A).split("\n", 1)[1],
         {"columns": {"t": "1", "ax": "2", "ay": "3", "az": "4"}}),
        (text("t,ax,ay,az", 1e6 * T, A), {"time_unit": "us"}),
        (text("t,ax,ay,az", 1e3 * T, A), {"time_unit": "ms"}),
        (text("t;ax;ay;az", T, A, separator=";", number=lambda x: f"{x:.4f}".replace(".", ",")),
         {"decimal": ","}),
        (text("t ax ay az", T, A, separator=" "), {"separator": " "}),
        (text("when (ms),a1 [g],a2 [g],a3 [g]", 1e3 * T, A / G),
         {"columns": {"t": "when (ms)", "ax": "a1 [g]", "ay": "a2 [g]", "az": "a3 [g]"}}),
    ],
)  # fmt: skip
def test_an_option_settles_it(tmp_path: Path, content: str, options: dict):
    assert_same(read(tmp_path / "a.csv", content, **options)[0])


AMBIGUOUS = text("t;ax;ay;az", 1.0 + np.arange(4.0), A[:4], separator=";",
                 number=lambda x: f"{1.0 + abs(x):.3f}".replace(".", ","))  # fmt: skip
REFUSED: dict[str, tuple[str | bytes, str]] = {
    "decimal commas between commas": (
        text("t,ax,ay,az", T, A, number=comma),
        "line 2: has 8 columns, the heading has 4; decimal commas between commas",
    ),
    "commas of two meanings": (AMBIGUOUS, r"'\d,\d{3}' may be a decimal comma .* --decimal ,"),
    "points and commas": (
        "t;ax;ay;az\n0;1,5;2.5;3\n", "contains decimal points and commas.*--decimal ,"
    ),
    "thousands": ('t,ax,ay,az\n0,"1,234.5",0,0\n', "'1,234.5' is not a number; thousands"),
    "thousands in Europe": ("t;ax;ay;az\n0;1.234,5;0;0\n", "'1.234,5' is not a number; thousands"),
    "us at 1 kHz": (text("t,ax,ay,az", 1e6 * np.arange(N) * 1e-3, A),
                    r"rows are 1000 apart, too far for seconds; probably us \(1000 Hz\): .*"
                    "--time-unit us"),
    "ms at 500 Hz": (text("t,ax,ay,az", 1e3 * T, A), r"probably ms \(500 Hz\).*--time-unit ms"),
    "ns at 1 kHz": (text("t,ax,ay,az", 1e6 * np.arange(N), A),
                    r"probably ns \(1000 Hz\).*--time-unit ns"),
    "an unknown name": (text("t,ax,ay,lift", T, A), "column 'lift' is unknown.*--columns t=…"),
    "an unknown unit": (text("t,ax [furlong],ay,az", T, A), "unit 'furlong' is unknown for ax"),
    "a unit of signs": (text("t,ax [%],ay,az", T, A), "the unit '%' is unknown for ax"),
    "an unknown unit of time": (text("t [min:s],ax,ay,az", T, A), "'min:s'.*--time-unit"),
    "a date of another form": ("t;ax;ay;az\n01.03.2025 12:00;0;0;0\n", "a date is read as 2025"),
    "a pointer": ("version https://git-lfs.github.com/spec/v1\n", "a Git LFS pointer.*lfs pull"),
    "a web page": ("<html>\n<body>", "it is a web page"),
    "a zip file": (b"PK\x03\x04\x14\0\6\0", "it is a zip file"),
    "a unit of another kind": (text("t,ax [mm],ay,az", T, A), "the unit 'mm' is unknown for ax"),
    "no names": (text("0.5,0.0,0.0,0.0", T, A), "line 1: holds numbers .*--columns t=1,ax=2"),
    "two times": (text("t,time,ax,ay,az", T, T, A),
                  "columns 't' and 'time' may all be t; choose one: --columns t=t"),
    "an input that is missing": (PLAIN + "9,,0,0\n", "line 26: column 'ax': '' is not a number"),
    "an input #N/A": (PLAIN + "9,#N/A,0,0\n", "line 26: column 'ax': nan is not allowed"),
    "a column without a name": (text(",t,ax,ay,az", A[:, 0], T, A), "is not a row number"),
    "a short row": (PLAIN + "9,1,1\n", "line 26: has 3 columns, the heading has 4"),
    "a picture": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\xff", "is not a table, it is a picture"),
    "bytes": (bytes(range(1, 256)), "is not a text file"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_meaning_or_two_is_refused_with_the_way_on(tmp_path: Path, name: str):
    content, match = REFUSED[name]
    with pytest.raises(SloshFileError, match=match) as caught:
        read(tmp_path / "a.csv", content)
    assert str(caught.value).startswith(str(tmp_path / "a.csv"))
    assert "\n" not in str(caught.value)


def test_heights_may_be_unknown_in_many_words(tmp_path: Path):
    for unknown in ("", "nan", "NaN", "#N/A", "NA", "null", "None"):
        content = text("t,ax,ay,az,msh [mm]", T, A, 1e3 * HEIGHT, unknown=unknown)
        table, _ = read(tmp_path / "a.csv", content)
        np.testing.assert_allclose(table.msh, HEIGHT, atol=1e-12)


def test_who_calls_from_python_is_warned(tmp_path: Path):
    (tmp_path / "a.csv").write_text("t;ax;ay;az\n0;1;2;3\n1;1;2;3\n")
    with pytest.warns(TableWarning, match="semicolons"):
        read_motion_table(tmp_path / "a.csv")


def test_large_stamps_keep_their_nanoseconds(tmp_path: Path):
    """Tests that stamps of the size 1e18 ns keep their nanoseconds."""
    stamps = EPOCH_NS + 125_000 * np.arange(9)
    table, _ = read(tmp_path / "a.csv", "\n".join(
        ["timestamp,ax,ay,az", *(f"{stamp},0,0,0" for stamp in stamps.tolist())]))  # fmt: skip
    np.testing.assert_allclose(np.diff(table.t), 125e-6, rtol=0.0, atol=1e-15)


def test_paths_and_poses_may_be_in_mm_and_degrees_of_time(tmp_path: Path):
    (tmp_path / "p.csv").write_text(
        "Zeit [ms];X [mm];Y [mm];Z [mm]\n0;0;0;0\n500;1,5;0;0\n900;3;0;0\n"
    )
    options = TableOptions(tell=lambda line: None)
    path = read_path_table(tmp_path / "p.csv", options)
    np.testing.assert_allclose(path.t, [0.0, 0.5, 0.9])
    np.testing.assert_allclose(path.position[:, 0], [0.0, 1.5e-3, 3e-3])
    motion = read_trajectory(tmp_path / "p.csv", options)
    np.testing.assert_allclose(motion.position[-1], [3e-3, 0.0, 0.0])


@pytest.mark.parametrize(
    "options",
    [{"decimal": ":"}, {"time_unit": "h"}, {"separator": "x"}, {"decimal": ",", "separator": ","},
     {"columns": {"ax": "absent"}}],
)  # fmt: skip
def test_wrong_options_are_named(tmp_path: Path, options: dict):
    with pytest.raises(SloshFileError, match="--"):
        read(tmp_path / "a.csv", PLAIN, **options)

"""Tests that motion tables are read as written, and that errors are reported."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slosh_base.files.errors import SloshFileError
from slosh_motion.tables.motion_table import MotionTable, read_motion_table, write_motion_table

FINITE = st.floats(-1e6, 1e6, allow_subnormal=False)


@settings(deadline=None, max_examples=30)
@given(
    acceleration=arrays(np.float64, (5, 3), elements=FINITE),
    msh=arrays(np.float64, (5,), elements=FINITE | st.just(np.nan)),
    suffix=st.sampled_from(["table.csv", "table.csv.gz"]),
)
def test_what_is_written_comes_back_bit_for_bit(tmp_path_factory, acceleration, msh, suffix):
    path = tmp_path_factory.mktemp("table") / suffix
    t = np.cumsum(np.full(5, 0.1))
    azimuth = np.radians([0.0, 90.0, 350.0])
    table = MotionTable(
        t,
        acceleration,
        attitude=np.tile([0.0, 0.0, 0.0, 1.0], (5, 1)),
        angular_velocity=acceleration / 3.0,
        msh=msh,
        eta_azimuth=azimuth,
        eta=np.outer(msh, [1.0, 0.5, 0.25]),
    )
    write_motion_table(path, table)
    back = read_motion_table(path)
    for name in MotionTable.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(back, name), getattr(table, name), err_msg=name)


def test_optional_columns_are_none_where_absent(tmp_path: Path):
    path = tmp_path / "short.csv"
    path.write_text("t,ax,ay,az\n0,1,2,3\n0.1,4,5,6\n")
    table = read_motion_table(path)
    assert (table.attitude, table.msh, table.eta, table.measured) == (None, None, None, None)
    np.testing.assert_array_equal(table.acceleration, [[1, 2, 3], [4, 5, 6]])


def test_measured_height_is_the_maximum_over_the_azimuth(tmp_path: Path):
    path = tmp_path / "eta.csv"
    path.write_text(
        "t,ax,ay,az,eta_180,eta_000\n0,0,0,0,0.01,0.02\n1,0,0,0,nan,-0.03\n2,0,0,0,nan,nan\n"
    )
    table = read_motion_table(path)
    np.testing.assert_array_equal(table.measured, [0.02, -0.03, np.nan])
    np.testing.assert_allclose(table.eta_azimuth, [0.0, np.pi])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "is empty"),
        ("t,ax,ay,az\n", "no rows"),
        ("t,ax,ay\n0,1,2\n", "line 1: column 'az' is missing"),
        ("t,ax,ay,az,qx\n0,1,2,3,0\n", "line 1: column 'qy' is missing"),
        ("t,ax,ay,az,eta_360\n0,1,2,3,0\n", "line 1: column 'eta_360' is unknown"),
        ("t,ax,ay,az,height\n0,1,2,3,0\n", "line 1: column 'height' is unknown"),
        ("t,ax,ay,az,ax\n0,1,2,3,0\n", "line 1: column 'ax' appears twice"),
        ("t,ax,ay,az\n0,1,2,3\n1,1,x,3\n", "line 3: column 'ay': 'x' is not a number"),
        ("t,ax,ay,az\n0,1,2,3\n1,1,2\n", "line 3: has 3 columns"),
        ("t,ax,ay,az\n0,1,2,nan\n", "line 2: column 'az': nan is not allowed"),
        ("t,ax,ay,az,msh\n0,1,2,3,inf\n", "line 2: column 'msh': inf is not allowed"),
        ("t,ax,ay,az\n0,1,2,3\n0,1,2,3\n", "line 3: column 't': 0 s does not come after 0 s"),
    ],
)
def test_a_broken_table_gives_one_line_with_file_line_and_column(tmp_path, text, expected):
    path = tmp_path / "broken.csv"
    path.write_text(text)
    with pytest.raises(SloshFileError) as caught:
        read_motion_table(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert expected in message
    assert "\n" not in message


@pytest.mark.parametrize("keep", [5, 40])
def test_a_cut_off_gzip_file_is_named(tmp_path: Path, keep: int):
    path = tmp_path / "cut.csv.gz"
    path.write_bytes(gzip.compress(b"t,ax,ay,az\n0,1,2,3\n" * 50)[:keep])
    with pytest.raises(SloshFileError, match="cut off or damaged"):
        read_motion_table(path)


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(SloshFileError, match=r"absent\.csv: cannot be read"):
        read_motion_table(tmp_path / "absent.csv")

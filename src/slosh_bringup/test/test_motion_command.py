"""`slosh motion`: the table that it writes, and what it refuses."""

import json

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from slosh_bringup.cli.main import main
from slosh_model.motion_profiles import LAWS
from slosh_tables.motion_table import read_motion_table


def words(output, *more, profile="quintic", speed="30", stroke="0.1"):
    return ["motion", profile, "--speed", speed, "--stroke", stroke, *more, "-o", str(output)]


# Rows a millisecond apart spread the harmonic law's jumps, and with them move the end.
@pytest.mark.parametrize("profile", [law for law in LAWS if law != "harmonic"])
@pytest.mark.parametrize("speed", ["12", "48", "60"])
def test_the_table_moves_the_container_by_the_stroke(tmp_path, capsys, profile, speed):
    output = tmp_path / "motion.csv"
    assert main(words(output, profile=profile, speed=speed)) == 0
    table = read_motion_table(output)
    assert table.t[-1] == pytest.approx(60.0 / float(speed), abs=1.1e-3)
    assert np.diff(table.t) == pytest.approx(np.full(len(table.t) - 1, 1e-3))
    velocity = cumulative_trapezoid(table.acceleration, table.t, axis=0, initial=0)
    position = cumulative_trapezoid(velocity, table.t, axis=0, initial=0)
    assert position[-1] == pytest.approx([0.1, 0.0, 0.0], abs=1e-5)
    assert table.acceleration[table.t > 0.4 * 60.0 / float(speed) + 1e-9, 0] == pytest.approx(
        0.0, abs=1e-9
    )
    assert "rows in" in capsys.readouterr().out


def test_cycles_axis_and_ratio(tmp_path, capsys):
    output = tmp_path / "motion.csv.gz"
    more = ["--cycles", "3", "--axis", "y", "--ratio", "0.5", "--rate", "500", "--json"]
    assert main(words(output, *more, profile="acceleration-pulse")) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["profile"] == "acceleration_pulse"
    assert facts["cycle_time"] == 2.0
    assert facts["motion_time"] == 1.0
    table = read_motion_table(output)
    assert len(table.t) == facts["rows"] == 3001
    a = table.acceleration[:, 1]
    assert not table.acceleration[:, [0, 2]].any()
    assert a[:1000] == pytest.approx(a[1000:2000], abs=1e-12)
    assert np.abs(a).max() == facts["peak_acceleration"]


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (["--rate", "5"], "--rate 5: must be at least 12.5 Hz"),
        (["--rate", "nan"], "--rate nan"),
        (["--cycles", "0"], "--cycles 0: must be at least 1"),
        (["--rate", "1e7"], "rows exceed the maximum of 10000000"),
        (["--ratio", "0"], "ratio = 0.0 must lie in [0.01, 1]"),
        (["--stroke", "-100"], "stroke = -100.0 m must lie in"),
        (["--speed", "0"], "speed = 0.0 1/min"),
    ],
)
def test_refusals_are_one_line(tmp_path, capsys, change, match):
    output = tmp_path / "motion.csv"
    assert main([*words(output), *change]) == 2
    captured = capsys.readouterr()
    assert match in captured.err
    assert captured.err.count("\n") == 1
    assert not output.exists()

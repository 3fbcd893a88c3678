"""Tests `slosh motion-map`: files, exit codes and errors for invalid options."""

import json
import shutil

import pytest

from slosh_bringup.cli.main import main

MODEL = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.1}\n"


@pytest.fixture
def run(tmp_path, capsys):
    """Runs `slosh motion-map`; returns exit code, output, errors and the results folder."""
    (tmp_path / "model.yaml").write_text(MODEL)

    def call(*words, speeds="30:34:2"):
        folder = tmp_path / "out"
        given = ["motion-map", str(tmp_path / "model.yaml"), "--stroke", "100mm", "--speeds"]
        try:
            code = main([*given, speeds, "-o", str(folder), *words])
        except SystemExit as stop:
            code = stop.code
        out, err = capsys.readouterr()
        return code, out, err, folder

    return call


def test_it_writes_table_program_and_page(run):
    code, out, _, folder = run("--limit", "0.015", "--json")
    assert code == 0
    told = json.loads(out)
    assert [row["speed"] for row in told["rows"]] == [30.0, 32.0, 34.0]
    assert max(row["peak"] for row in told["rows"]) < told["height_limit"] == 0.015
    assert sorted(path.name for path in folder.iterdir()) == [
        "map.csv",
        "report.html",
        "stroke.st",
    ]
    page = (folder / "report.html").read_text()
    assert page.count("<svg") == 4


def test_speeds_and_ratio_take_units(run):
    code, out, _, _ = run("--limit", "15mm", "--ratio", "40%", "--json", speeds="0.5Hz:34rpm:2")
    assert code == 0
    rows = json.loads(out)["rows"]
    assert [row["speed"] for row in rows] == [30.0, 32.0, 34.0]
    assert rows[0]["duration"] == pytest.approx(0.4 * 2.0)


def test_a_map_that_ends_early_says_why(run):
    code, out, _, folder = run("--rim-distance", "0.02", speeds="40:50:5")
    assert code == 1
    assert "no safe stroke above 4" in out
    shutil.rmtree(folder)
    code, _, err, _ = run("--limit", "0.001", speeds="60:70")
    assert code == 1
    assert "no stroke keeps the limits at the lowest speed" in err
    assert not folder.exists()


@pytest.mark.parametrize(
    ("words", "speeds", "said"),
    [
        (("--limit", "0.015"), "30", "for one speed give a range that contains it"),
        (("--limit", "0.015"), "30:60:5:1", "is not FROM:TO"),
        (("--limit", "0.015"), "12m/min:20m/min", "unknown unit 'm/min' (/min, 1/min, rpm, Hz)"),
        (("--limit", "0.015", "--stroke", "100"), "30:40", "did you mean 100 mm"),
        (("--limit", "0.015", "--stroke", "0"), "30:40", "--stroke 0: must be 0.0001 m or more"),
        (("--limit", "0.015", "--stroke=-0.1"), "30:40", "the direction does not matter"),
        (("--limit", "0.015", "--stroke", "nan"), "30:40", "--stroke nan: must be"),
        (("--limit", "0.015", "--max-jerk", "74000"), "30:40", "did you mean 74000 mm/s3, 74?"),
        (("--limit", "0.015"), "60:30", "speeds must rise"),
        (("--limit", "0.015"), "nan:60", "speeds must rise"),
        (("--limit", "0.015"), "1:6000", "at most 400"),
        (("--limit", "0.015", "--ratio", "1.5"), "30:40", "did you mean 1.5 %"),
        (("--limit", "0.015", "--ratio", "0.01"), "30:40", "--ratio 0.01: must be 0.05"),
        ((), "30:40", "--limit or --rim-distance is needed"),
    ],
)
def test_a_wrong_word_is_one_line(run, words, speeds, said):
    code, _, err, folder = run(*words, speeds=speeds)
    assert code == 2
    assert said in err.strip()
    assert err.strip().count("\n") == 0
    assert not folder.exists()

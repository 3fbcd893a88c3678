"""Tests `slosh identify`: input files, output and errors for invalid input."""

import json
import math
import re

import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_model.model_text import format_model, read_model
from slosh_model.motion_profiles import Cycle
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs
from slosh_motion.tables.motion_table import MotionTable, read_motion_table, write_motion_table
from slosh_replay.tables.table_bag import import_table
from slosh_testing.commands import complaint

TRUTH = Model(Cylinder(0.03, 0.067), damping_ratio=0.042, natural_frequency=24.0)


def write_run(path, speed, seed, truth=TRUTH):
    cycle = Cycle("acceleration_pulse", speed, 0.1)
    t = np.arange(0.0, cycle.cycle_time, 2e-3)
    acceleration = np.zeros((len(t), 3))
    acceleration[:, 0] = cycle.at(t)[2]
    eta = predicted_heights(truth, Inputs(t, acceleration), t, [0.0, math.pi])
    eta += 2e-4 * np.random.default_rng(seed).normal(size=eta.shape)
    eta[np.arange(len(t)) % 5 != 0] = np.nan
    table = MotionTable(t, acceleration, eta_azimuth=np.array([0.0, math.pi]), eta=eta)
    write_motion_table(path, table)


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """Test data with two repetitions at two speeds, one at a third, and the initial model."""
    folder = tmp_path_factory.mktemp("shop")
    (folder / "runs").mkdir()
    for speed in (36, 48):
        for repeat in range(2):
            write_run(folder / "runs" / f"n{speed}_{repeat}.csv", speed, 10 * speed + repeat)
    write_run(folder / "other.csv", 42, 7)
    (folder / "model.yaml").write_text(format_model(Model(Cylinder(0.03, 0.067))))
    return folder


def words(shop, output, *more):
    return [
        "identify", str(shop / "runs"), "--model", str(shop / "model.yaml"), *map(str, more),
        "-o", str(output),
    ]  # fmt: skip


def test_it_writes_a_model_with_its_covariance_a_document_and_a_page(shop, tmp_path, capsys):
    output = tmp_path / "found"
    assert main(words(shop, output, "--holdout", shop / "other.csv")) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("natural_frequency, damping_ratio from 4 motions, 2 operating")
    assert "36 1/min" in printed
    model = read_model(output / "model.yaml")
    assert model.natural_frequency == pytest.approx(24.0, abs=0.05)
    assert model.damping_ratio == pytest.approx(0.042, abs=0.002)
    assert model.covariance.parameters == ("natural_frequency", "damping_ratio")
    assert 0.0 < model.covariance.standard_errors[0] < 0.05
    document = json.loads((output / "identification.json").read_text())
    assert document["strategy"] == "mosm"
    assert [motion["role"] for motion in document["motions"]].count("holdout") == 1
    assert document["motions"][-1]["seoe"] == pytest.approx(2e-4, rel=0.1)
    for entry in document["overall"]["parameters"]:
        assert entry["lower"] < entry["value"] < entry["upper"]
    assert sorted(path.name for path in output.iterdir()) == [
        "identification.json", "model.yaml", "report.html",
    ]  # fmt: skip
    assert_page_agrees((output / "report.html").read_text(encoding="utf-8"), document)


def assert_page_agrees(page, document):
    """Asserts that each number of the page equals the number in the JSON document."""
    numbers = re.findall(r'<data value="([^"]*)" data-path="([^"]*)">', page)
    assert len(numbers) > 50
    for value, path in numbers:
        found = document
        for key in path.split("/")[1:]:
            found = found[int(key)] if isinstance(found, list) else found[key]
        assert json.loads(value) == found, path
    assert page.count("<svg") >= 10


@pytest.mark.long
def test_one_model_for_each_speed(shop, tmp_path, capsys):
    output = tmp_path / "found"
    assert main(words(shop, output, "--strategy", "sosm", "--json")) == 0
    document = json.loads(capsys.readouterr().out)
    assert [one["file"] for one in document["single"]] == ["model_36.yaml", "model_48.yaml"]
    for one in document["single"]:
        model = read_model(output / one["file"])
        assert model.natural_frequency == one["parameters"][0]["value"]
    assert all(point["sosm"] <= 1.01 * point["mosm"] for point in document["points"])
    page = (output / "report.html").read_text(encoding="utf-8")
    assert "a model for each" in page
    assert_page_agrees(page, document)


@pytest.mark.long
def test_what_the_motions_do_not_tell_is_said_with_the_motion_that_would(tmp_path, capsys):
    # Wall heights on one line tell nothing of the yaw; and a scale nothing that a gain does not.
    run = tmp_path / "run.csv"
    write_run(run, 48, 1)
    model = tmp_path / "model.yaml"
    model.write_text(
        format_model(Model(Cylinder(0.03, 0.067)).with_effect("yaw_coupling", kappa=0.1))
    )
    fit = "natural_frequency,damping_ratio,yaw_coupling.kappa,p,height_scale.gain"
    output = tmp_path / "found"
    assert (
        main(["identify", str(run), "--model", str(model), "--fit", fit, "-o", str(output)]) == 0
    )
    printed = capsys.readouterr().out
    assert "These motions cannot distinguish height_scale.gain from accel_gain.gain" in printed
    assert "These motions do not determine yaw_coupling.kappa" in printed
    document = json.loads((output / "identification.json").read_text())
    helped = next(h for h in document["overall"]["held"] if h["name"] == "yaw_coupling.kappa")
    assert "yaw" in helped["help"]
    assert read_motion_table(output / helped["file"]).attitude is not None


def test_bags_are_read_as_tables_are_with_their_model(shop, tmp_path, capsys):
    bag = tmp_path / "bag"
    import_table(shop / "runs" / "n48_0.csv", bag)
    output = tmp_path / "found"
    arguments = ["identify", str(bag), "--model", str(shop / "model.yaml"), "-o", str(output)]
    assert main(arguments) == 0
    found = read_model(output / "model.yaml")
    assert found.natural_frequency == pytest.approx(24.0, abs=0.1)
    capsys.readouterr()
    line = complaint(capsys, "identify", bag, "--from-bag", "-o", tmp_path / "o")
    assert "contains no model" in line


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (["--fit", "omega"], "--fit 'omega': no such parameter (known: p, fill_height"),
        (["--fit", ""], "no parameter to fit"),
        (["--ratio", "0"], "--ratio 0: must lie in (0, 1]"),
        (["--tolerance", "-1"], "--tolerance -1: must be positive"),
        (["--holdout", "nowhere.csv"], "nowhere.csv: no such file or folder"),
        (["--beside", "nowhere"], "nowhere/identification.json"),
    ],
)
def test_wrong_input_is_refused_in_one_line(shop, tmp_path, capsys, change, match):
    output = tmp_path / "found"
    assert match in complaint(capsys, *words(shop, output, *change))
    assert not output.exists()


def test_without_a_model_it_asks_for_one(shop, tmp_path, capsys):
    line = complaint(capsys, "identify", shop / "runs", "-o", tmp_path / "o")
    assert "no model: give --model" in line


@pytest.mark.parametrize(
    ("columns", "refusal"),
    [
        ("{x:.6f},0,0,0", "all heights are 0"),
        ("1e300,0,0,{x:.6f}", "an acceleration of 1e+300 m/s²"),
    ],
)
def test_a_table_of_no_measurement_gets_one_line(shop, tmp_path, capsys, columns, refusal):
    rows = [
        f"{0.005 * n:.4f}," + columns.format(x=1e-2 * math.sin(0.1 * n)) for n in range(1, 400)
    ]
    table = tmp_path / "run.csv"
    table.write_text("\n".join(("t,ax,ay,az,eta_000", *rows)) + "\n")
    call = ("identify", table, "--model", shop / "model.yaml", "-o", tmp_path / "found")
    assert main([str(word) for word in call]) == 2
    *notes, line = [x for x in capsys.readouterr().err.splitlines() if x.startswith("slosh")]
    assert line.startswith("slosh identify: ")
    assert refusal in line
    assert all(": warning: " in note for note in notes)

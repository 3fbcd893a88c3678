"""Tests `slosh identify --force` with tables and bags: output and errors."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_discovery.discover_data.force_reading import _moving_joints, _renamed
from slosh_discovery.force.document import force_document
from slosh_discovery.force.workflow import identify_force
from slosh_model.model import Model
from slosh_model.model_text import format_model, read_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_report.page.html import html_page
from slosh_testing.cell_bag import CellBag
from slosh_testing.commands import complaint, printed
from slosh_testing.force_sensor import SimulatedSensor

CUP = Model(Cylinder(0.05, 0.07))
TRUTH = SimulatedSensor(CUP, 0.98 * CUP.mode_frequency(1), 0.008, delay=0.02)
WRENCH = "geometry_msgs/msg/WrenchStamped"
START = 10**9


def write_table(path, record, heading, factor=1.0):
    t = record.inputs.t
    force = np.column_stack([np.interp(t, record.t, column) for column in record.force.T])
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(heading)
        writer.writerows(np.column_stack([t, record.inputs.acceleration, force / factor]).tolist())
    return path


@pytest.fixture(scope="module")
def record():
    return TRUTH.record()


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(format_model(CUP))
    return path


def check(document):
    assert document["natural_frequency"]["value"] == pytest.approx(TRUTH.frequency, rel=0.003)
    assert document["damping_ratio"]["value"] == pytest.approx(TRUTH.damping, rel=0.1)
    assert document["sloshing_mass"]["value"] == pytest.approx(TRUTH.mass, rel=0.03)
    assert document["delay"]["value"] == pytest.approx(TRUTH.delay, abs=0.003)
    assert document["directions"][0]["sensor_axis"] == "+fx"


def test_of_a_table_and_writes_the_model(capsys, tmp_path, record, model):
    table = write_table(
        tmp_path / "run.csv",
        record,
        ["t", "ax", "ay", "az", "fx [mN]", "fy [mN]", "fz [mN]"],
        1e-3,
    )
    output = tmp_path / "found"
    words = ["identify", "--force", table, "--model", model, "-o", output]
    check(printed(capsys, *words, "--json"))
    found = read_model(output / "model.yaml")
    assert found.natural_frequency == pytest.approx(TRUTH.frequency, rel=0.003)
    document = json.loads((output / "identification.json").read_text())
    page = (output / "report.html").read_text()
    assert page.count("<svg") == 4  # two charts, each wide and narrow
    assert "force along +fx of the sensor" in page
    # Each number on the page is that of the document.
    for value, path in re.findall(r'<data value="([^"]*)" data-path="([^"]*)">', page):
        part = document
        for key in path.strip("/").split("/"):
            part = part[key]
        assert json.loads(value) == part, path


def test_a_name_on_the_page_is_text(record):
    found = identify_force(replace(record, name="<script>alert(1)</script>"), CUP)
    assert "<script" not in html_page(force_document(found, CUP, CUP))


def write_bag(folder, record, more=()):
    bag = CellBag()
    for t, a in zip(record.inputs.t[::2], record.inputs.acceleration[::2], strict=True):
        bag.accel(START + round(1e9 * t), a)
    for topic in ("/ft/wrench", *more):
        for t, (x, y, z) in zip(record.t[::2], record.force[::2].tolist(), strict=True):
            bag.put(topic, WRENCH, START + round(1e9 * t), "ft",
                    wrench__force__x=x, wrench__force__y=y, wrench__force__z=z)  # fmt: skip
    return bag.write(folder)


def test_of_a_bag_with_a_wrench(capsys, tmp_path, record, model):
    bag = write_bag(tmp_path / "bag", record)
    assert main(["identify", "--force", str(bag), "--model", str(model)]) == 0
    captured = capsys.readouterr()
    assert "force /ft/wrench, motion /slosh/accel" in captured.err
    assert "sloshing mass" in captured.out
    assert "along +fx of the sensor" in captured.out


def test_what_it_refuses(capsys, tmp_path, record, model):
    table = write_table(tmp_path / "run.csv", record, ["t", "ax", "ay", "az", "fx", "fy", "fz"])
    missing = write_table(tmp_path / "no.csv", record, ["t", "ax", "ay", "az", "fx", "fy", "x"])
    words = ["identify", "--force", "--model", model]
    assert "needs the container" in complaint(capsys, "identify", "--force", table)
    assert "'fz' is missing" in complaint(capsys, *words, missing)
    assert "no such file" in complaint(capsys, *words, tmp_path / "none")
    assert "one bag or table" in complaint(capsys, *words, table, table)
    assert "need --force" in complaint(
        capsys, "identify", table, "--model", model, "-o", tmp_path / "o", "--wrench", "w"
    )
    assert "-o DIR" in complaint(capsys, "identify", table, "--model", model)
    several = write_bag(tmp_path / "several", record, ["/other/wrench"])
    assert "several forces" in complaint(capsys, *words, several)
    assert "holds no force" in complaint(capsys, *words, several, "--wrench", "accel")


def test_joints_of_other_names_are_taken_in_their_order():
    urdf = (
        "<?xml version='1.0'?><link name='q1'/><joint name='q1' type='revolute'/>"
        '<joint type="fixed" name="flange"/><joint type="revolute" name="q2"/>'
    )
    assert _moving_joints(urdf) == ["q1", "q2"]
    renamed = _renamed(urdf, {"q1": "arm/a", "q2": "arm/b"})
    assert _moving_joints(renamed) == ["arm/a", "arm/b"]
    assert "<link name='q1'/>" in renamed
    assert 'name="flange"' in renamed

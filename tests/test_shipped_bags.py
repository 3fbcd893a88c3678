"""The bags in bags/ give what their manifest states: physics and code have not drifted."""

import math
import shutil
from pathlib import Path
from xml.etree import ElementTree

import yaml

from slosh_bringup.cli.main import main
from slosh_bringup.processes import config_folder

BAGS = Path(__file__).parents[1] / "bags"


def test_every_shipped_bag_gives_what_its_manifest_states(tmp_path, capsys):
    report = tmp_path / "junit.xml"
    code = main(["replay", str(BAGS), "--check", "--jobs", "1", "--junit", str(report)])
    assert code == 0, capsys.readouterr().err
    suites = ElementTree.parse(report).getroot().findall("testsuite")
    folders = sorted(path.name for path in BAGS.iterdir() if path.is_dir())
    assert sorted(suite.get("name") for suite in suites) == folders
    assert all(int(suite.get("tests")) > 3 for suite in suites)


def test_they_show_what_they_are_there_for():
    stated = yaml.safe_load((BAGS / "manifest.yaml").read_text())["bags"]
    assert {"l", "e", "c", "l3", "e3", "c3", "limit", "camera_gap", "cut"} <= set(stated)
    assert stated["limit"]["events"]
    assert stated["cut"]["warnings"]
    assert stated["camera_gap"]["images"] < stated["c"]["images"] - 40
    assert all(bag["estimates"] == "exact" for bag in stated.values())


def test_the_last_bit_of_the_deployed_model_is_seen_and_named(tmp_path, capsys):
    """The model file that the manifest names has changed since the recording."""
    shutil.copytree(BAGS / "l", tmp_path / "l")
    text = (config_folder() / "model.yaml").read_text()
    (tmp_path / "model.yaml").write_text(
        text.replace("alpha: 0.58", f"alpha: {math.nextafter(0.58, 1.0)!r}")
    )
    stated = {"l": {"shows": "a path", "model": "model.yaml", "estimates": "exact"}}
    (tmp_path / "manifest.yaml").write_text(yaml.safe_dump({"bags": stated}))
    assert main(["replay", str(tmp_path), "--check", "--jobs", "1"]) == 1
    assert "effects.surface_nonlinearity.alpha: recorded 0.58" in capsys.readouterr().err

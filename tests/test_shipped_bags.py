"""Tests that the bags in bags/ replay with the results in their manifest."""

import shutil
from pathlib import Path
from xml.etree import ElementTree

import yaml

from slosh_bringup.cli.main import main

BAGS = Path(__file__).parents[1] / "bags"


def test_a_copy_of_every_shipped_bag_gives_what_its_manifest_states(tmp_path, capsys):
    """What the bags need lies in their folder."""
    report, copy = tmp_path / "junit.xml", tmp_path / "elsewhere" / "bags"
    shutil.copytree(BAGS, copy)
    code = main(["replay", str(copy), "--check", "--jobs", "1", "--junit", str(report)])
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

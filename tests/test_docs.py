"""The documentation tells the truth: links, commands, parameters."""

import importlib.util
import re
from pathlib import Path

import pytest

from slosh_bringup.cli.main import COMMANDS

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_relative_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_named_commands_exist(page):
    for name in re.findall(r"`(?:\.venv/bin/)?slosh ([a-z]+)", page.read_text(encoding="utf-8")):
        assert name in COMMANDS, name


def test_the_parameter_tables_are_those_of_the_nodes():
    path = ROOT / "tools" / "parameter_tables.py"
    spec = importlib.util.spec_from_file_location("parameter_tables", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    text = (ROOT / "docs" / "interfaces.md").read_text(encoding="utf-8")
    assert text.endswith(module.tables()), "run tools/run python tools/parameter_tables.py"

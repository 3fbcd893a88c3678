"""Tests that each effect's page agrees with the registry and shows the models' results."""

import importlib.util
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from slosh_model.effects.registry import EFFECTS

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "effects"
PAGES = sorted(FOLDER.glob("*.md"))
LARGEST = 60_000  # bytes of a picture
ANEW = "run tools/run python tools/effect_pages.py"
SECTIONS = ("What it looks like in data", "When it matters", "Told from others")


@pytest.fixture(scope="module")
def tool():
    path = ROOT / "tools" / "effect_pages.py"
    spec = importlib.util.spec_from_file_location("effect_pages", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_every_effect_has_a_page_and_every_page_an_effect():
    assert {page.stem for page in PAGES} == {*EFFECTS, "index", "adding"}
    assert {file.stem for file in FOLDER.glob("*.svg")} == set(EFFECTS)
    listed = re.search(r"```{toctree}.*?\n\n(.*?)```", (FOLDER / "index.md").read_text(), re.S)
    assert listed[1].split() == [*EFFECTS, "adding"]


@pytest.mark.parametrize("name", EFFECTS)
def test_a_page_has_its_sections_and_the_place_of_what_the_registry_says(name):
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    _, end, prose = text.partition("\n<!-- end generated -->\n")
    assert end
    for section in SECTIONS:
        body = prose.split(f"## {section}\n")[1].split("\n## ")[0]
        assert len(body) > 80
    assert f"`{name}`" in text.splitlines()[0]


@pytest.mark.parametrize("name", EFFECTS)
def test_a_picture_is_small_and_shows_what_its_caption_says(name, tool):
    path = tool.picture(name)
    assert 5_000 < path.stat().st_size < LARGEST
    text = path.read_text(encoding="utf-8")
    ElementTree.fromstring(text)
    assert tool.caption(name) in text.replace("&gt;", ">").replace("&#x27;", "'"), ANEW


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target

"""Tests that the product's packages keep their budgets, and that what exceeds one is refused."""

import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tools"))
import budget  # noqa: E402

MODULE = '"""Of a test."""\n\n\ndef height():\n    """Returns a height."""\n'
HELD = "| `slosh_a` | 10 | 3 | 2 | 0 | the first |"


def test_the_product_keeps_its_budgets():
    assert budget.problems(ROOT) == []


@pytest.fixture
def house(tmp_path):
    package = tmp_path / "src/slosh_a/slosh_a"
    package.mkdir(parents=True)
    (package.parent / "package.xml").touch()
    for name in ("__init__", "one", "two"):
        (package / f"{name}.py").write_text(MODULE if name != "__init__" else "")
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/decisions.md").write_text(f"{HELD}\n")
    (tmp_path / "pyproject.toml").write_text(
        "[tool.slosh.budget]\nslosh_a = { lines = 10, files = 3, names = 2, small = 0 }\n"
    )
    assert budget.problems(tmp_path) == []
    return tmp_path


def plant(house, name, text):
    path = house / "src/slosh_a/slosh_a" / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("two.py", MODULE + "# one more line\n", "11 lines, its budget is 10"),
        ("two.py", MODULE.replace("height()", "height(): pass\ndef b()"), "3 names"),
        ("page.j2", "", "4 files"),
        ("two.py", '"""Of a test."""\n\nfrom slosh_a.one import height\nX = 1\n', "1 small"),
        ("two.py", '"""Of a test."""\n\nfrom slosh_a import one\nX = 1\n', "1 small"),
    ],
)
def test_growth_is_refused(house, name, text, told):
    plant(house, name, text)
    assert any(told in line for line in budget.problems(house)), budget.problems(house)


def test_a_module_that_is_loaded_late_or_has_two_users_may_be_small(house):
    late = 'def use():\n    """Uses it."""\n    from slosh_a.one import height\n'
    plant(house, "two.py", f'"""Of a test."""\n\n\n{late}')
    assert not any("small" in line for line in budget.problems(house))
    for name in ("two", "three"):
        plant(house, f"{name}.py", "from slosh_a.one import height\n")
    assert not any("small" in line for line in budget.problems(house))


def test_a_raised_budget_needs_its_reason(house):
    path = house / "pyproject.toml"
    path.write_text(path.read_text().replace("lines = 10", "lines = 20"))
    assert budget.problems(house) == [
        "slosh_a: docs/decisions.md must say why its budget is (20, 3, 2, 0)"
    ]
    decisions = house / "docs/decisions.md"
    decisions.write_text(f"{HELD}\n| `slosh_a` | 20 | 3 | 2 | 0 | another camera |\n")
    assert budget.problems(house) == []


def test_a_package_needs_a_budget_and_a_budget_its_package(house):
    shutil.copytree(house / "src/slosh_a", house / "src/slosh_b")
    assert "slosh_b: has no budget in pyproject.toml" in budget.problems(house)
    shutil.rmtree(house / "src/slosh_a")
    assert "slosh_a: has a budget, and is no package" in budget.problems(house)


def test_budgets_are_lowered_to_what_is_there(house):
    plant(house, "two.py", '"""Of a test."""\n')
    budget.lower(house)
    assert "lines = 6, files = 3, names = 1" in (house / "pyproject.toml").read_text()
    assert "| `slosh_a` | 6 | 3 | 1 | 0 |" in (house / "docs/decisions.md").read_text()
    assert budget.problems(house) == []

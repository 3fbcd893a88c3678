"""Counts what each package holds and compares it with its budget in pyproject.toml.

A package has a budget of lines, files and public names, and of small modules with one user: of
fewer than 120 lines, imported as it is loaded by a single other module of their package and by
nobody else. What is above its budget fails. Who raises one says why in the table of
docs/decisions.md, whose last row of a package has the same numbers. `--write` lowers budgets to
what is there.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
SMALL = 120
"""Lines of a module from which it may have one user alone."""
_COUNTED = {".py", ".j2", ".js"}
_ROW = re.compile(r"^\| `(?P<name>\w+)` \| (?P<counts>[\d, |]+) \|", re.MULTILINE)


class Counts(NamedTuple):
    """What a package holds.

    Attributes:
        lines: of modules, templates and scripts, tests left out.
        files: with these.
        names: functions, classes and values of modules that do not begin with an underscore.
        small: modules of fewer than SMALL lines with one user, which is of the package.
    """

    lines: int
    files: int
    names: int
    small: int


def counts_of(root: Path) -> dict[str, Counts]:
    """Returns the counts of each package below `src`."""
    folders = sorted(path.parent for path in root.glob("*/slosh*/package.xml"))
    users = _users(root, folders)
    found = {}
    for folder in folders:
        files = [
            path
            for path in sorted((folder / folder.name).rglob("*"))
            if path.suffix in _COUNTED and "__pycache__" not in path.parts
        ]
        lines = {path: path.read_text("utf-8").count("\n") for path in files}
        names = sum(len(list(_public(path))) for path in files if path.suffix == ".py")
        small = sum(
            lines[path] < SMALL and _has_one_user(folder, path, users)
            for path in files
            if path.suffix == ".py" and path.name != "__init__.py"
        )
        found[folder.name] = Counts(sum(lines.values()), len(files), names, small)
    return found


def _public(path: Path) -> Iterator[str]:
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            given = [node.name]
        elif isinstance(node, ast.Assign):
            given = [one.id for one in node.targets if isinstance(one, ast.Name)]
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            given = [node.target.id]
        else:
            given = []
        yield from (name for name in given if not name.startswith("_"))


def _module(folder: Path, path: Path) -> str:
    parts = path.relative_to(folder).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _users(root: Path, folders: list[Path]) -> Mapping[str, set[str]]:
    """Returns for each name that is imported the product's modules that import it.

    What functions import counts for two: it is loaded late, and for that has a file of its own.
    """
    found: dict[str, set[str]] = defaultdict(set)
    for folder in folders:
        for path in (folder / folder.name).rglob("*.py"):
            own = _module(folder, path)
            for name, late in _imports(ast.parse(path.read_text("utf-8")), late=False):
                found[name] |= {own, f"{own} late"} if late else {own}
    return found


def _imports(node: ast.AST, *, late: bool) -> Iterator[tuple[str, bool]]:
    """Yields the names that statements import, each with whether a function does."""
    for inner in ast.iter_child_nodes(node):
        if isinstance(inner, ast.stmt):
            yield from ((name, late) for name in _imported(inner))
            yield from _imports(inner, late=late or isinstance(inner, ast.FunctionDef))
        elif isinstance(inner, ast.excepthandler | ast.match_case):
            yield from _imports(inner, late=late)


def _imported(node: ast.AST) -> list[str]:
    if isinstance(node, ast.ImportFrom) and node.module:
        return [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return [alias.name for alias in node.names] if isinstance(node, ast.Import) else []


def _has_one_user(folder: Path, path: Path, users: Mapping[str, set[str]]) -> bool:
    own = _module(folder, path)
    of = users.get(own, set()) - {own}
    return len(of) == 1 and next(iter(of)).split(".")[0] == folder.name


def problems(root: Path) -> list[str]:
    """Returns what is above its budget, and budgets that decisions.md does not explain."""
    counts = counts_of(root)
    budgets = _budgets(root)
    told = {
        row["name"]: Counts(*(int(one.replace(",", "")) for one in row["counts"].split("|")))
        for row in _ROW.finditer((root / "docs/decisions.md").read_text("utf-8"))
    }
    found = []
    for name, count in counts.items():
        budget = budgets.get(name)
        if budget is None:
            found.append(f"{name}: has no budget in pyproject.toml")
            continue
        for kind, has, may in zip(Counts._fields, count, budget, strict=True):
            if has > may:
                found.append(f"{name}: {has} {kind}, its budget is {may}: remove something first")
        if told.get(name) != budget:
            found.append(f"{name}: docs/decisions.md must say why its budget is {tuple(budget)}")
    found += [f"{name}: has a budget, and is no package" for name in budgets.keys() - counts]
    return found


def _budgets(root: Path) -> dict[str, Counts]:
    with (root / "pyproject.toml").open("rb") as file:
        table = tomllib.load(file)["tool"]["slosh"]["budget"]
    return {name: Counts(**one) for name, one in table.items()}


def lower(root: Path) -> None:
    """Lowers the budgets to what is there, in pyproject.toml and in the last rows of the table."""
    budgets, counts = _budgets(root), counts_of(root)
    for name, budget in budgets.items():
        low = Counts(*map(min, budget, counts.get(name, budget)))
        for path, old, new in (
            (root / "pyproject.toml", _line(name, budget), _line(name, low)),
            (root / "docs/decisions.md", _row(name, budget), _row(name, low)),
        ):
            path.write_text(path.read_text("utf-8").replace(old, new), "utf-8")


def _line(name: str, one: Counts) -> str:
    return f"{name} = {{ {', '.join(f'{k} = {v}' for k, v in one._asdict().items())} }}"


def _row(name: str, one: Counts) -> str:
    return f"| `{name}` | {' | '.join(f'{value:,}' for value in one)} |"


def main() -> int:
    """Prints the counts, or what is above its budget; returns the exit code."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--write", action="store_true", help="lower the budgets to what is there")
    if parser.parse_args().write:
        lower(ROOT)
    found = problems(ROOT)
    print("\n".join(found or (_row(name, one) for name, one in counts_of(ROOT).items())))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

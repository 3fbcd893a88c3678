"""The package's folders import in one direction."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import slosh_camera

PACKAGE = Path(slosh_camera.__file__).parent


def room(parts):
    """The folder of a module by its path below the package; "": the package itself."""
    return parts[0] if (PACKAGE / parts[0]).is_dir() else ""


def imported(path):
    """Rooms of this package that a module imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for package, *rest in (name.split(".") for name in names):
            if package == PACKAGE.name and rest:
                yield room(rest)


def test_no_room_imports_one_that_imports_it():
    rooms = {}
    for path in PACKAGE.rglob("*.py"):
        own = room(path.relative_to(PACKAGE).parts)
        rooms.setdefault(own, set()).update(set(imported(path)) - {own})
    assert rooms["nodes"]
    assert not rooms[""]
    TopologicalSorter(rooms).prepare()  # a circle is an error

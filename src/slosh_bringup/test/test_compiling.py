"""Tests that the set-up compiles all functions, so that no process compiles at its start."""

import ast
import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parents[3]
LISTED = """
import json
from collections import Counter
from slosh_base.compiled.compilation import entry_points
from slosh_bringup.compiling import import_all
import_all()
print(json.dumps(Counter(one.name.partition(".")[0] for one in entry_points())))
"""


def declared(path: Path) -> int:
    """Returns the number of compiled functions in a module that Python code calls."""
    functions = [node for node in ast.walk(ast.parse(path.read_text())) if hasattr(node, "name")]
    decorators = [one for node in functions for one in getattr(node, "decorator_list", ())]
    return sum(ast.unparse(one).startswith("entry_point(") for one in decorators)


def test_every_compiled_function_of_the_product_is_compiled_in_advance():
    done = subprocess.run(
        [sys.executable, "-c", LISTED], capture_output=True, text=True, check=True
    )
    wanted = {
        folder.name: sum(map(declared, folder.rglob("*.py")))
        for folder in ROOT.glob("*/slosh_*/slosh_*")
        if find_spec(folder.name)  # add-ons may be absent
    }
    assert json.loads(done.stdout) == {name: count for name, count in wanted.items() if count}

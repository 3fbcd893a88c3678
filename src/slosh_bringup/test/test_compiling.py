"""Tests that the set-up compiles all functions, so that no process compiles at its start."""

import ast
import subprocess
import sys
from pathlib import Path

SRC = Path(__file__).parents[2]
LISTED = """
from slosh_base.compiled.compilation import entry_points
from slosh_bringup.compiling import import_all
import_all()
print(len(entry_points()))
"""


def declared(path: Path) -> int:
    """Returns the number of compiled functions in a module that Python code calls."""
    functions = [node for node in ast.walk(ast.parse(path.read_text())) if hasattr(node, "name")]
    decorators = [one for node in functions for one in getattr(node, "decorator_list", ())]
    return sum(ast.unparse(one).startswith("entry_point(") for one in decorators)


def test_every_compiled_function_of_the_product_is_compiled_in_advance():
    paths = SRC.glob("slosh_*/slosh_*/**/*.py")
    done = subprocess.run(
        [sys.executable, "-c", LISTED], capture_output=True, text=True, check=True
    )
    assert int(done.stdout) == sum(map(declared, paths))

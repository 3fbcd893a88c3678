"""What a plain scalar of YAML is read as, and therefore what a text must be quoted not to be.

PyYAML follows YAML 1.1, which takes 2e1 for a text, 010 for eight and 1:30 for ninety. Here the
numbers are those of YAML 1.2; everything else is as PyYAML has it.
"""

from __future__ import annotations

import re
from typing import Any, Final

import yaml

INT_TAG: Final = "tag:yaml.org,2002:int"
FLOAT_TAG: Final = "tag:yaml.org,2002:float"
_INT = (INT_TAG, re.compile(r"[-+]?[0-9]+$"), list("-+0123456789"))
_FLOAT = (
    FLOAT_TAG,
    re.compile(
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|[-+]?\.(inf|Inf|INF)$"
        r"|\.(nan|NaN|NAN)$"
    ),
    list("-+.0123456789"),
)


def read_numbers(loader: Any) -> None:
    """Makes a loader's class read numbers so, and in no other way."""
    loader.yaml_implicit_resolvers = {
        first: [pair for pair in pairs if pair[0] not in (INT_TAG, FLOAT_TAG)]
        for first, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    loader.add_implicit_resolver(*_INT)
    loader.add_implicit_resolver(*_FLOAT)


def quote_numbers(dumper: Any) -> None:
    """Makes a dumper's class quote texts that either version would take for a number."""
    dumper.add_implicit_resolver(*_INT)
    dumper.add_implicit_resolver(*_FLOAT)

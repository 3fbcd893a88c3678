"""Tests the controller's program by the grammar and the types of IEC 61131-3."""

import re

import numpy as np
import pytest

from slosh_machines.design import Stroke, StrokeHeights
from slosh_machines.motion_map import MapRow, MotionMap
from slosh_machines.profile import COUNT, Profile
from slosh_machines.structured_text import structured_text
from slosh_plan.planning.limits import PlanLimits

TOKEN = re.compile(
    r"\s+|\(\*.*?\*\)|(?P<real>\d[\d_]*\.\d[\d_]*([eE][+-]?\d+)?(?![\w.]))|(?P<int>\d[\d_]*(?!\w|\.\d))"
    r"|(?P<name>[A-Za-z]\w*)|(?P<sign>:=|\.\.|<=|>=|<>|[-+*/()\[\],;:<>=])",
    re.DOTALL,
)
RESERVED = """
FUNCTION_BLOCK END_FUNCTION_BLOCK VAR VAR_INPUT VAR_OUTPUT CONSTANT END_VAR ARRAY OF IF
THEN ELSE END_IF WHILE DO END_WHILE FOR TO BY END_FOR AND OR NOT XOR MOD TRUE FALSE BOOL
BYTE WORD SINT INT DINT LINT UINT UDINT REAL LREAL TIME DATE TOD DT STRING PROGRAM
FUNCTION TYPE STRUCT CASE REPEAT UNTIL EXIT RETURN AT RETAIN R_EDGE F_EDGE TASK STEP
ACTION TRANSITION ON WITH LIMIT TRUNC DINT_TO_LREAL ABS SQRT MIN MAX SEL MUX MOVE LEN LEFT
RIGHT MID FIND
"""
KEYWORDS = set(RESERVED.split())
FUNCTIONS = {
    "LIMIT": lambda kinds: kinds[0] if len(kinds) == 3 and len(set(kinds)) == 1 else None,
    "TRUNC": lambda kinds: "DINT" if kinds == ["LREAL"] else None,
    "DINT_TO_LREAL": lambda kinds: "LREAL" if kinds == ["DINT"] else None,
}


class WrongTextError(ValueError):
    """Error of a text that is no valid function block, or has wrong types."""


class FunctionBlock:
    """Parser of one function block; names are case-insensitive."""

    def __init__(self, text):
        self._tokens, at = [], 0
        while at < len(text):
            match = TOKEN.match(text, at)
            if match is None:
                raise WrongTextError(f"no token: {text[at : at + 20]!r}")
            at = match.end()
            if match.lastgroup:
                kind = next(k for k in ("real", "int", "name", "sign") if match[k])
                self._tokens.append((kind, match[0].upper()))
        self._kinds, self._fixed = {}, set()
        self._block()

    def _peek(self):
        return self._tokens[0][1] if self._tokens else ""

    def _take(self, *wanted):
        if not self._tokens or (wanted and self._peek() not in wanted):
            raise WrongTextError(f"{self._tokens[:3]}: expected {wanted}")
        return self._tokens.pop(0)

    def _new_name(self):
        kind, name = self._take()
        if kind != "name" or name in KEYWORDS or name in self._kinds:
            raise WrongTextError(f"{name}: no new name")
        return name

    def _block(self):
        self._take("FUNCTION_BLOCK")
        self._new_name()
        while self._peek() in ("VAR", "VAR_INPUT", "VAR_OUTPUT"):
            fixed = self._take()[1] == "VAR_INPUT"
            if self._peek() == "CONSTANT":
                fixed = bool(self._take())
            while self._peek() != "END_VAR":
                self._declaration(fixed)
            self._take("END_VAR")
        self._statements("END_FUNCTION_BLOCK")
        if self._tokens:
            raise WrongTextError(f"{self._peek()}: after the end")

    def _declaration(self, fixed):
        name = self._new_name()
        self._take(":")
        kind, size = self._take("BOOL", "DINT", "LREAL", "ARRAY")[1], 0
        if kind == "ARRAY":
            self._take("[")
            low = int(self._take()[1])
            self._take("..")
            size = int(self._take()[1]) - low + 1
            self._take("]")
            self._take("OF")
            kind = f"ARRAY OF {self._take('LREAL')[1]}"
        if self._peek() == ":=":
            self._take()
            given = [self._expression()] if not size else self._initial(size)
            if set(given) != {kind.removeprefix("ARRAY OF ")}:
                raise WrongTextError(f"{name}: {set(given)} for {kind}")
        self._take(";")
        self._kinds[name] = kind
        if fixed:
            self._fixed.add(name)

    def _initial(self, size):
        found = []
        while not found or self._peek() == ",":
            self._take("[" if not found else ",")
            found.append(self._expression())
        self._take("]")
        if len(found) != size:
            raise WrongTextError(f"{len(found)} values for {size}")
        return found

    def _statements(self, end):
        while self._peek() != end:
            head = self._take()[1]
            if head in ("IF", "WHILE"):
                self._demand("BOOL", self._expression())
                self._take({"IF": "THEN", "WHILE": "DO"}[head])
                self._statements(f"END_{head}")
            elif head == "FOR":
                self._assignment(self._take()[1], "DINT")
                for word in ("TO", "BY"):
                    self._take(word)
                    self._demand("DINT", self._expression())
                self._take("DO")
                self._statements("END_FOR")
            else:
                self._assignment(head)
            self._take(";") if end != "END_FUNCTION_BLOCK" or self._peek() == ";" else None
        self._take(end)

    def _assignment(self, name, kind=None):
        if name not in self._kinds or name in self._fixed:
            raise WrongTextError(f"{name}: cannot be assigned")
        self._take(":=")
        self._demand(kind or self._kinds[name], self._expression())

    @staticmethod
    def _demand(kind, found):
        if kind != found:
            raise WrongTextError(f"{found} for {kind}")

    def _expression(self, level=0):
        levels = (("AND", "OR"), ("<", ">", "<=", ">=", "=", "<>"), ("+", "-"), ("*", "/"))
        if level == len(levels):
            return self._operand()
        kind = self._expression(level + 1)
        while self._peek() in levels[level]:
            self._take()
            self._demand(kind, self._expression(level + 1))
            if (kind == "BOOL") != (level == 0):
                raise WrongTextError(f"{kind} in {levels[level]}")
            kind = "BOOL" if level < 2 else kind
        return kind

    def _operand(self):
        kind, text = self._take()
        if text == "-":
            return self._operand()
        if text == "(":
            found = self._expression()
            self._take(")")
            return found
        if kind in ("real", "int"):
            return {"real": "LREAL", "int": "DINT"}[kind]
        if text in FUNCTIONS:
            kinds = []
            while not kinds or self._peek() == ",":
                self._take("(" if not kinds else ",")
                kinds.append(self._expression())
            self._take(")")
            found = FUNCTIONS[text](kinds)
            if found is None:
                raise WrongTextError(f"{text} of {kinds}")
            return found
        if text not in self._kinds:
            raise WrongTextError(f"{text}: not declared")
        if self._kinds[text].startswith("ARRAY"):
            self._take("[")
            self._demand("DINT", self._expression())
            self._take("]")
            return "LREAL"
        return self._kinds[text]


@pytest.fixture(scope="module")
def text():
    """Returns a program with numbers of all sizes."""
    heights = StrokeHeights(0.01, 0.001, 1.0, 50.0)
    rng = np.random.default_rng(2)
    rows = tuple(
        MapRow(speed, Profile(10.0 ** rng.uniform(-9.0, 3.0, COUNT)), heights)
        for speed in (20.0, 30.5, 1000.0)
    )
    return structured_text(MotionMap(Stroke(1e-4, 0.4), PlanLimits(0.02, 0.01), rows, (), 1e3, ""))


def test_the_program_is_a_function_block_whose_types_fit(text):
    FunctionBlock(text)
    assert "e-" in text


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Elapsed", "Time"),
        ("20.0, 30.5", "2e1, 30.5"),
        ("20.0, 30.5", "20, 30.5"),
        ("20.0, 30.5", "30.5"),
        ("Row := 0;", "Row := 0"),
        ("Row := 0;", "Row := 0.0;"),
        ("Row := 0;", "Lines := 0;"),
        ("Row := 0;", "Speed := 0.0;"),
        ("END_WHILE;", ""),
        ("DINT_TO_LREAL(Segment)", "Segment"),
        ("IF Valid", "IF Row"),
    ],
)
def test_a_wrong_program_is_found(text, old, new):
    assert old in text
    with pytest.raises(WrongTextError):
        FunctionBlock(text.replace(old, new))

"""Generates code that applies all effects to many trajectories at once.

One switch stands before a loop over the lanes, which the compiler turns into vector instructions
where the effect's equation has them. `print(slosh_model.lane_chains.SOURCE)` shows the source.
"""

from __future__ import annotations

from slosh_model.chains import compile_generated, own_memory
from slosh_model.effects.base import Effect
from slosh_model.effects.registry import BY_HOOK, DRIVE_MEMORY, SLOTS
from slosh_model.indices import INPUT_COUNT, MODE_COUNT, POSE_COUNT, STATE_COUNT, TERM_COUNT
from slosh_model.lane_rows import (
    CONSTANTS,
    INPUTS,
    INTERVAL,
    LANES,
    MODE,
    MOMENT,
    NEW_INPUTS,
    PARAMETERS,
    POSE,
    STATE,
    SUMS,
)


def _tuple(first: int, count: int) -> str:
    return "(" + "".join(f"w[{first + row * LANES} + k], " for row in range(count)) + ")"


def _reader(name: str, first: int, count: int) -> list[str]:
    """Generates the source of a function that reads one simulation's values of several rows.

    Every effect calls it, so that Numba infers the types of these lines once.
    """
    return [f"def {name}(w, k):", f"    return {_tuple(first, count)}", ""]


def _writer(name: str, first: int, count: int, sign: str) -> list[str]:
    """Generates the source of a function that sets or increases values of one simulation."""
    rows = [f"    w[{first + row * LANES} + k] {sign} values[{row}]" for row in range(count)]
    return [f"def {name}(w, k, values):", *rows, ""]


def _loop(effect: Effect, line: str) -> list[str]:
    """Generates the source of a loop that applies one effect to each simulation."""
    slot = PARAMETERS + SLOTS[effect.name] * LANES
    return [
        f"    if w[{slot}] != 0.0:",
        "        for k in range(lanes):",
        f"            p = {_tuple(slot + LANES, len(effect.parameters))}",
        f"            {line}",
    ]


def _terms() -> list[str]:
    lines = [
        *_reader("mode_at", MODE, MODE_COUNT),
        *_reader("state_at", STATE, STATE_COUNT),
        *_reader("inputs_at", INPUTS, INPUT_COUNT),
        *_writer("add_sums", SUMS, TERM_COUNT, "+="),
        "def all_lane_terms(lanes, w):",
        "    for k in range(lanes):",
        *(f"        w[{SUMS + row * LANES} + k] = 0.0" for row in range(TERM_COUNT)),
    ]
    around = f"mode_at(w, k), w[{MOMENT} + k], state_at(w, k), inputs_at(w, k)"
    for effect in BY_HOOK["term"]:
        lines += _loop(effect, f"add_sums(w, k, {effect.name}_term({around}, p))")
    return lines


def _modulations() -> list[str]:
    lines = [
        *_reader("constants_at", CONSTANTS, MODE_COUNT),
        *_writer("set_mode", MODE, MODE_COUNT, "="),
        "def all_lane_modulations(lanes, w):",
        "    for k in range(lanes):",
        "        set_mode(w, k, constants_at(w, k))",
    ]
    around = f"mode_at(w, k), w[{MOMENT} + k]"
    for effect in BY_HOOK["modulation"]:
        lines += _loop(effect, f"set_mode(w, k, {effect.name}_modulation({around}, p))")
    return lines


def _drives() -> list[str]:
    lines = [
        *_reader("new_inputs_at", NEW_INPUTS, INPUT_COUNT),
        *_reader("pose_at", POSE, POSE_COUNT),
        *_writer("set_new_inputs", NEW_INPUTS, INPUT_COUNT, "="),
        "def all_lane_drives(lanes, w, memory):",
    ]
    for effect in BY_HOOK["drive"]:
        own = own_memory(effect, "drive", DRIVE_MEMORY, "memory[k, ")
        around = f"w[{INTERVAL} + k], new_inputs_at(w, k), pose_at(w, k), {own}"
        lines += _loop(effect, f"set_new_inputs(w, k, {effect.name}_drive({around}, p))")
    return lines


SOURCE = "\n".join([*_terms(), "", *_modulations(), "", *_drives(), ""])
"""What is compiled; w is the flat array of `lane_rows`."""

_functions = compile_generated(__name__, SOURCE, ("term", "modulation", "drive"))
all_lane_terms = _functions["all_lane_terms"]
all_lane_modulations = _functions["all_lane_modulations"]
all_lane_drives = _functions["all_lane_drives"]

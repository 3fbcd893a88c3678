"""The hooks of all effects for many trajectories at once; see `chains` and `lane_rows`.

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


def _loop(effect: Effect, **values: str) -> list[str]:
    """Where the effect is on: each lane's parameters and values, to be worked with."""
    slot = PARAMETERS + SLOTS[effect.name] * LANES
    values["p"] = _tuple(slot + LANES, len(effect.parameters))
    return [
        f"    if w[{slot}] != 0.0:",
        "        for k in range(lanes):",
        *(f"            {name} = {value}" for name, value in values.items()),
    ]


def _rows(first: int, count: int, sign: str, value: str) -> list[str]:
    return [
        f"            w[{first + row * LANES} + k] {sign} {value}[{row}]" for row in range(count)
    ]


def _terms() -> list[str]:
    lines = [
        "def all_lane_terms(lanes, w):",
        "    for k in range(lanes):",
        *(f"        w[{SUMS + row * LANES} + k] = 0.0" for row in range(TERM_COUNT)),
    ]
    mode, q, inputs = (
        _tuple(MODE, MODE_COUNT),
        _tuple(STATE, STATE_COUNT),
        _tuple(INPUTS, INPUT_COUNT),
    )
    for effect in BY_HOOK["term"]:
        lines += _loop(effect, mode=mode, q=q, inputs=inputs)
        lines += [f"            sums = {effect.name}_term(mode, w[{MOMENT} + k], q, inputs, p)"]
        lines += _rows(SUMS, TERM_COUNT, "+=", "sums")
    return lines


def _modulations() -> list[str]:
    lines = [
        "def all_lane_modulations(lanes, w):",
        "    for k in range(lanes):",
        *(
            f"        w[{MODE + row * LANES} + k] = w[{CONSTANTS + row * LANES} + k]"
            for row in range(MODE_COUNT)
        ),
    ]
    for effect in BY_HOOK["modulation"]:
        lines += _loop(effect, mode=_tuple(MODE, MODE_COUNT))
        lines += [f"            mode = {effect.name}_modulation(mode, w[{MOMENT} + k], p)"]
        lines += _rows(MODE, MODE_COUNT, "=", "mode")
    return lines


def _drives() -> list[str]:
    lines = ["def all_lane_drives(lanes, w, memory):"]
    for effect in BY_HOOK["drive"]:
        own = own_memory(effect, "drive", DRIVE_MEMORY, "memory[k, ")
        lines += _loop(
            effect, inputs=_tuple(NEW_INPUTS, INPUT_COUNT), pose=_tuple(POSE, POSE_COUNT)
        )
        lines += [
            f"            inputs = {effect.name}_drive(w[{INTERVAL} + k], inputs, pose, {own}, p)"
        ]
        lines += _rows(NEW_INPUTS, INPUT_COUNT, "=", "inputs")
    return lines


SOURCE = "\n".join([*_terms(), "", *_modulations(), "", *_drives(), ""])
"""What is compiled; w is the flat array of `lane_rows`."""

_functions = compile_generated(__name__, SOURCE, ("term", "modulation", "drive"))
all_lane_terms = _functions["all_lane_terms"]
all_lane_modulations = _functions["all_lane_modulations"]
all_lane_drives = _functions["all_lane_drives"]

"""Writes a motion map for a controller: a table (CSV) and IEC 61131-3 structured text."""

from __future__ import annotations

import io

import numpy as np

from slosh_base.types import Array
from slosh_machines.design import MINUTE
from slosh_machines.motion_map import MotionMap

POWERS = 8
"""Coefficients of a segment: v⁰ to v⁷."""
PER_LINE = 4
BLOCK = "SloshStroke"


def table_text(found: MotionMap) -> str:
    """Returns the coefficients as CSV: `speed,segment,c0,…,c7`, position in metres.

    In segment k of K the position is Σ cₚ vᵖ with v = K t / duration - k, t the time since the
    stroke's start and the duration 60 · ratio / speed.
    """
    text = io.StringIO()
    text.write(
        f"# position [m] = sum of c_p * v^p, v = {len(_all(found)[0])} * t / duration - segment, "
        f"duration [s] = {MINUTE * found.stroke.ratio:.9g} / speed [1/min]\n"
    )
    text.write("speed,segment," + ",".join(f"c{power}" for power in range(POWERS)) + "\n")
    for row, segments in zip(found.rows, _all(found), strict=True):
        for number, coefficients in enumerate(segments.tolist()):
            text.write(f"{row.speed!r},{number},{','.join(map(repr, coefficients))}\n")
    return text.getvalue()


def structured_text(found: MotionMap) -> str:
    """Returns the IEC 61131-3 function block of the stroke's position, velocity, acceleration."""
    every = _all(found)
    rows, segments, _ = every.shape
    last = rows * segments * POWERS - 1
    speeds = ", ".join(_real(row.speed) for row in found.rows)
    numbers = _lines([_real(value) for value in every.ravel().tolist()])
    ratio = MINUTE * found.stroke.ratio
    height, residual = found.limits.height, found.limits.residual
    low, high = found.rows[0].speed, found.rows[-1].speed
    return f"""\
(* Stroke of {found.stroke.length:g} m during {found.stroke.ratio:g} of the machine's cycle.
   Height of the liquid: {1e3 * height:.4g} mm, in the dwell {1e3 * residual:.4g} mm at most.
   Speeds from {low:g} to {high:g} per minute; at others Valid is FALSE and nothing else is set. *)
FUNCTION_BLOCK {BLOCK}
VAR_INPUT
    Speed : LREAL; (* of the machine [1/min] *)
    Elapsed : LREAL; (* since the start of the cycle [s] *)
END_VAR
VAR_OUTPUT
    Position : LREAL; (* in the stroke [m] *)
    Velocity : LREAL; (* [m/s] *)
    Acceleration : LREAL; (* [m/s2] *)
    Valid : BOOL;
END_VAR
VAR CONSTANT
    LastRow : DINT := {rows - 1};
    Segments : DINT := {segments};
    Count : LREAL := {_real(float(segments))}; (* the same *)
    Next : DINT := {segments * POWERS}; (* from a row to the next one *)
    Speeds : ARRAY[0..{rows - 1}] OF LREAL := [{speeds}];
    Coefficients : ARRAY[0..{last}] OF LREAL := [
{numbers}];
END_VAR
VAR
    Row : DINT;
    Segment : DINT;
    Power : DINT;
    First : DINT;
    Share : LREAL;
    Pace : LREAL;
    Place : LREAL;
    Value : LREAL;
END_VAR
Valid := (Speed >= Speeds[0]) AND (Speed <= Speeds[LastRow]);
IF Valid THEN
    Row := 0;
    WHILE (Row < LastRow - 1) AND (Speed > Speeds[Row + 1]) DO
        Row := Row + 1;
    END_WHILE;
    Share := (Speed - Speeds[Row]) / (Speeds[Row + 1] - Speeds[Row]);
    Pace := Count * Speed / {_real(ratio)};
    Place := LIMIT(0.0, Elapsed * Pace, Count);
    Segment := LIMIT(0, TRUNC(Place), Segments - 1);
    Place := Place - DINT_TO_LREAL(Segment);
    Position := 0.0;
    Velocity := 0.0;
    Acceleration := 0.0;
    FOR Power := {POWERS - 1} TO 0 BY -1 DO
        First := (Row * Segments + Segment) * {POWERS} + Power;
        Value := (1.0 - Share) * Coefficients[First] + Share * Coefficients[First + Next];
        Acceleration := Acceleration * Place + 2.0 * Velocity;
        Velocity := Velocity * Place + Position;
        Position := Position * Place + Value;
    END_FOR;
    Velocity := Velocity * Pace;
    Acceleration := Acceleration * Pace * Pace;
END_IF;
END_FUNCTION_BLOCK
"""


def _all(found: MotionMap) -> Array:
    """Returns the position's coefficients [m] by row of the map, segment and power."""
    return found.stroke.length * np.array([row.profile.coefficients() for row in found.rows])


def _real(value: float) -> str:
    """Formats a real literal of IEC 61131-3, which has a point also before an exponent."""
    digits, mark, exponent = f"{value!r}".partition("e")
    return f"{digits}{'' if '.' in digits else '.0'}{mark}{exponent}"


def _lines(numbers: list[str]) -> str:
    """Formats numbers in text lines of limited length."""
    parts = [numbers[n : n + PER_LINE] for n in range(0, len(numbers), PER_LINE)]
    return ",\n".join("        " + ", ".join(part) for part in parts)

"""Meanings of columns, metrics, units, flags and message fields."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from slosh_base.files.installed import shared_folder

COLUMNS: Mapping[str, str] = {
    # motions and heights
    "t": "time of the sample [s]",
    "time": "time of the sample [s]",
    "x y z": "position of the container's origin in the world [m]",
    "ax ay az": "acceleration of the container's origin in the world, gravity excluded [m/s²]",
    "qx qy qz qw": "attitude of the container in the world, a unit quaternion [1]",
    "wx wy wz": "angular velocity of the container in its own frame [rad/s]",
    "msh": "maximum sloshing height: the liquid's highest place on the wall above the still level "
    "[m]; in a table of slosh simulate as a sensor would read it",
    "msh_stddev": "standard deviation (σ) of msh as the camera claims it [m]",
    "eta": "eta_000 to eta_359: height at the wall above the still level at that azimuth [m, deg]",
    "azimuth": "direction of the highest liquid from the container's +x towards +y, from above "
    "[rad in files, deg on screens]",
    "sh_x sh_y": "signed sloshing height at the container's +x or +y [m]",
    "sh_left sh_right": "height at the left or right end of the visible wall [m]",
    "azimuth_left azimuth_right": "azimuth of the left or right end of the visible wall [rad]",
    "frame": "image or file name of the sample",
    "cell": "namespace of a cell on the operator's page",
    "reason": "cause of a state, in one sentence",
    "peak_u peak_v": "pixel of the highest liquid [px]",
    "peak_side": "wall on which the highest liquid lies: front, rear or unknown",
    "flags": "what limits the validity, by names or as a sum of bits; slosh explain 0x3 splits it",
    "fitted_msh": "maximum height of the surface that was fitted to the visible line [m]",
    "fitted_msh_stddev": "standard deviation (σ) of fitted_msh [m]",
    "fitted_azimuth": "azimuth of the fitted surface's highest place [rad]",
    "slope_angle": "angle of the fitted surface's slope against the still level [rad]",
    # accuracy
    "mae | sigma | mean absolute error": "mean absolute error: mean of |model − measurement| over "
    "all images with both [mm]. It is the index σ of DL22, eq. (33), and the key sigma of "
    "JSON files and messages; σ elsewhere is a standard deviation",
    "ε | epsilon": "relative error of the model's highest height, + above and − below the "
    "measured one (DL22, eq. (32)) [%]",
    "σ | stddev | standard_deviation": "standard deviation: two thirds of the errors are smaller. "
    "The mean absolute error is called MAE",
    "standard_error": "standard deviation of an estimated value",
    "rms": "root of the mean square of the difference between model and measurement [mm]",
    "rms_before rms_after rms_fit rms_residual residual_rms": "rms of model minus measurement, "
    "before or after the change, or for the motions that were fitted [mm]",
    "offset clock clock_offset": "by how much the measured clock is shifted so that model and "
    "measurement fit [s, or ms]",
    "images": "images with a measured height that entered",
    "samples": "samples that entered",
    "measured": "height by the camera [mm]",
    "highest highest_measured highest_estimated": "greatest height of the run or motion [mm]",
    # replays and runs
    "bag run file": "recording, run or file that the row is about",
    "dropped dropped_samples": "input samples that were not used, by reason in the page",
    "events limit_events": "number of times that a limit was exceeded",
    "estimates": "how replayed estimates compare with the recorded ones; bit for bit: equal",
    "verdict": "passed, failed or no expectation, by the manifest; of a discovery its result",
    "latency": "time from an image's exposure to its comparison [ms]",
    "lost lost_messages": "messages that were published and are not in the bag",
    "what quantity": "quantity that the row is about",
    "found": "value of this run, or estimated value",
    "expected": "value in the manifest with its tolerance",
    "model": "model of the row: slosh explain 3D-NL explains its name",
    "topic topic_field field": "recorded topic, and the field of its messages",
    "type": "message type of the topic",
    "messages": "number of messages",
    "per_second rate": "messages per second [Hz]",
    "first_at": "time of the first message that differs [s]",
    "recorded replayed": "value in the recording, and value of the replay",
    "largest_difference": "largest absolute difference, in the field's SI unit",
    "start": "begin of the motion or the excess from the page's zero of time [s]",
    "end": "end of the motion from the page's zero of time [s]",
    "limit": "limit of the height, or the container's rim where it is lower [mm]",
    "peak": "greatest height during the motion or the excess, measured or by the nonlinear model "
    "[mm]",
    "peak_at": "time of the peak [s]",
    "node": "node of the cell",
    "state": "health of the node: OK, WARN, ERROR or STALE (silent)",
    "age": "time since the node last reported [s]",
    "message": "last sentence of the node's report",
    # validation reports
    "criterion": "quantity that is accepted up to a limit; pass, fail or undecided",
    "u": "expanded uncertainty of the value (k = 2): about 95 % of errors are smaller",
    "recording recordings": "recording that the row is about, or number of recordings",
    "gaps": "number of time spans without a measurement",
    "role": "what the file is for, or on whose behalf a person signs",
    "bytes": "size of the file [byte]",
    "sha-256 | SHA-256 of the content": "digest of the file's content; a change gives another",
    "origin": "where the limit comes from",
    "limit_use": "highest measured height by its limit [%]",
    "reproduced": "recorded estimates that the replay gave again",
    "deviation": "standard deviation of a motion's highest heights over the recordings [mm]",
    "mean lowest spread": "mean, least value and highest minus lowest of a motion's highest "
    "heights over the recordings [mm]",
    "name | date | date of issue | signature": "lines to be signed by hand",
    # motions of months
    "month": "month of the motions' begin (UTC)",
    "container": "shape of the container",
    "natural_frequency": "first mode of the liquid, of motions as the observer found it [rad/s]",
    "damping_ratio": "damping of that mode by the critical damping [1]",
    "motions_with_events": "number of motions in which a limit was exceeded",
    "hours": "eight hours of the day, a shift (UTC)",
    "begin": "begin of the motion (UTC)",
    "estimated": "height by the nonlinear model [mm]",
    "change": "slope of a straight line through all motions, times the time from first to last",
    "level [mm]": "median of the still level above the measurement's zero [mm]",
    # predictions and plans
    "motion trajectory": "motion that the row is about",
    "duration": "time from the start to the end of the motion or the excess [s]",
    "linear_peak peak_linear": "greatest height by the linear model (L) [mm, in files m]",
    "peak_nonlinear": "greatest height by the nonlinear model (NL) [m]",
    "peak_lower peak_upper": "ends of the peak's 95 % interval by the model's error [m]",
    "peak_time": "time of the peak [s]",
    "residual residual_nonlinear residual_linear": "greatest height after the end of the motion, "
    "by the nonlinear or the linear model [mm, in files m]; on the operator's page measured "
    "minus estimated",
    "settling settling_time": "time from the motion's end until the liquid stays below the "
    "residual limit, or 1 mm without one [s]",
    "excess residual_excess": "peak or residual minus its limit [m]; negative: below it",
    "safe_from time_scale": "multiple of the duration from which on every slower run keeps the "
    "limits",
    "frequency_tolerance": "largest error of the natural frequency with which a plan keeps its "
    "limits [%, in files 1]",
    "safe_scales": "intervals of time scales that keep the limits",
    "proven": "whether a bound of the linear model shows that all slower runs are safe",
    "kept": "whether all limits are kept",
    "height_limit": "limit of the height that holds [m]",
    "limited_by": "what limits the height: the limit or the distance to the rim (rim limit) that "
    "was set, or the rim",
    "rim_distance": "least vertical distance of the liquid to the rim that is allowed [m]; 0: "
    "the rim itself",
    "distance_to_rim": "vertical distance from the highest liquid up to the rim [m]; negative: "
    "above the rim, it spills",
    "distance_along_wall": "distance from the contact line to the rim along the wall [m]",
    "surface_height": "highest place of the whole surface above the still level [m]: at the wall, "
    "or above msh if the container bulges and the crest is inside",
    "height_along_wall": "length of the wall from the still level to the contact line [m]",
    "contact_radius": "radius of the contact line on the wall [m]",
    "models": "names of the linear and of the nonlinear model",
    "remarks": "excess over a limit, further safe time scales, and validity flags",
    "height": "greatest height during the motion [mm]",
    "after_the_end": "greatest height after the end of the motion [mm]",
    "speed": "greatest speed [m/s]; of a machine its rate [1/min]",
    "acceleration greatest_acceleration": "greatest acceleration of the container [m/s²]",
    "jerk": "greatest change of the acceleration [m/s³]",
    # identification and discovery
    "effect": "named effect of a model: slosh explain NAME explains it",
    "explanation": "set of effects that was fitted",
    "parameter parameters": "parameter of the model or of an effect",
    "unit": "unit of the value",
    "before": "with the given model, before the change [mm or the parameter's unit]",
    "after": "with the found model, after the change [mm or the parameter's unit]",
    "95_% 95_%_interval": "interval that holds the true value with a probability of 95 %",
    "confidence probability": "probability of the explanation among those tried, 0 to 1",
    "similarly_likely_alternatives": "effects that explain the same data about as well",
    "fit gap_fit": "rms difference for the motions that were fitted [mm]",
    "left_out held_out gap_held_out": "rms difference for the motions that were not fitted [mm]",
    "log_evidence": "logarithm of the explanation's evidence (BIC): larger is likelier",
    "term coefficient": "term of the equation that was found, and its factor",
    "gap": "rms difference between model and measurement beyond noise [mm]",
    "closed": "share of the gap that the found effects explain [%]",
    "noise": "rms of the measurement's noise [mm]",
    "share": "share of the squared residual [%]",
    "at": "time of the moment [s]",
    "worst_by": "how the measurements are split, to find where the model is worst",
    "operating_point": "motions of one kind and speed that are fitted together",
    "motions": "number of motions",
    "own own_model": "rms residual of a model fitted to this operating point alone [mm]",
    "all model_of_all": "rms residual of the one model fitted to all operating points [mm]",
    "mean": "mean of the heights over repetitions [mm]",
    "greatest_η_eff": "greatest effective height, TM20's η_eff [mm]",
    "δη_appr": "error of the line approximation of the surface, TM20's Δη_appr [mm]",
    "δη_simul": "error of the simulated heights, TM20's Δη_simul [mm]",
}  # fmt: skip
"""Meaning by names, which are parted by blanks, or by ` | ` where they hold blanks themselves."""

UNITS: Mapping[str, str] = {
    "mm": "millimetre, 0.001 m; on screens and pages",
    "m": "metre; lengths and heights in files and messages",
    "m/s": "metre per second",
    "m/s²": "metre per second squared; 9.81 m/s² is gravity",
    "m/s³": "metre per second cubed: change of an acceleration per second",
    "m³/s²": "surface tension over density",
    "m²/s": "kinematic viscosity; water 1.0e-6 m²/s",
    "mm²/s": "kinematic viscosity, 1e-6 m²/s; also called cSt",
    "kg/m³": "density; water 998 kg/m³",
    "s": "second",
    "ms": "millisecond, 0.001 s",
    "ns": "nanosecond, 1e-9 s; stamps",
    "Hz": "hertz: times per second",
    "1/s": "times per second",
    "1/min": "times per minute; cycles of a machine",
    "rad": "radian, 57.3 deg; angles in files and messages",
    "rad/s": "radian per second; angular frequency or velocity",
    "deg": "degree, 0.01745 rad; angles on the command line",
    "°": "degree, 0.01745 rad; angles on screens and pages",
    "px": "pixel",
    "byte": "8 bits; sizes of files",
    "kB": "1000 bytes",
    "MB": "1,000,000 bytes",
    "GB": "1e9 bytes",
    "TB": "1e12 bytes",
    "%": "hundredth of a whole",
    "% of": "hundredth of a whole",
    "×": "times, a factor",
    "1": "a pure number",
}
_SPLIT = re.compile(r"[\s_,-]+")

OWNERS: Mapping[str, str] = {
    "FreeSurface": "flag of a measurement",
    "SloshEstimate": "flag of an estimate",
    "SloshComparison": "state of the monitor",
}
"""Message -> what its constants are."""
_CONSTANT = re.compile(
    r"^uint\d+ (?:STATE_)?(?P<name>[A-Z_]+)=(?P<value>\d+)(?: +# (?P<meaning>.+?)(?:; see .+)?)?$",
    re.M,
)
_FIELD = re.compile(r"^[\w/]+(?:\[[<=\d]*\])? (?P<name>[a-z]\w*)(?: *# *(?P<meaning>.+))?$")
_NUMBER = re.compile(r"0x[0-9a-f]+|\d+", re.I)


def plain(name: str) -> str:
    """Normalises a column name for look-up, so that `MAE [mm]` and `mae` are equal."""
    bare = re.sub(r"\s*\[[^\]]*\]\s*$", "", name.strip().lower())
    bare = re.sub(r"^eta_?\d{3}$", "eta", bare)
    return _SPLIT.sub("_", bare).strip("_")


@cache
def columns() -> Mapping[str, str]:
    """Returns the meanings of all table columns and metrics by normalised name."""
    found = {}
    for names, meaning in COLUMNS.items():
        for name in names.split(" | ") if " | " in names else names.split():
            found[plain(name)] = meaning
    return found


def column(name: str) -> str:
    """Returns the meaning of a table column or metric; empty if unknown."""
    return columns().get(plain(name), "")


def unit(name: str) -> str:
    """Returns the meaning of a unit; empty if unknown."""
    spelt = re.sub(r"(?<=[a-z])[23]", lambda found: "²³"[int(found[0]) - 2], name)
    return UNITS.get(name) or UNITS.get(spelt, "")


class ExplainedFlag(NamedTuple):
    """A flag or state constant: its name, message, meaning and value."""

    name: str
    message: str
    meaning: str
    value: int

    @property
    def kind(self) -> str:
        """Kind of the constant (flag or state) and the message it belongs to."""
        return f"{OWNERS[self.message]} ({self.message})"

    @property
    def is_state(self) -> bool:
        """Whether the constant is one of several exclusive states rather than a bit."""
        return self.message == "SloshComparison"


@cache
def flags() -> tuple[ExplainedFlag, ...]:
    """Returns all flags by message and value; empty if the message package is not installed."""
    share = shared_folder("slosh_msgs")
    if share is None:
        return ()
    folder = share / "msg"
    return tuple(
        ExplainedFlag(
            found["name"], message, found["meaning"] or "all is well", int(found["value"])
        )
        for message in OWNERS
        for found in _CONSTANT.finditer((folder / f"{message}.msg").read_text(encoding="utf-8"))
        if not found["name"].startswith("PEAK_")
    )


def by_number(text: str) -> list[str]:
    """Explains a flag value such as 3, 0x3 or 0x0003 for each message; empty if not a number.

    Flags are bits: their sum is split.
    """
    if not _NUMBER.fullmatch(text):
        return []
    number = int(text, 16) if text.lower().startswith("0x") else int(text)
    lines = []
    for message, kind in OWNERS.items():
        own = [flag for flag in flags() if flag.message == message]
        met = [one for one in own if (one.value == number if one.is_state else one.value & number)]
        rest = 0 if met and met[0].is_state else number & ~sum(one.value for one in met)
        lines.append(f"{number} (0x{number:x}) as {kind} ({message}):")
        lines += [f"  {one.name} ({one.value}): {one.meaning}" for one in met]
        if rest or not met:
            lines.append("  no flag is set" if not number else f"  0x{rest or number:x}: unknown")
    return lines


@cache
def fields() -> Mapping[str, tuple[str, ...]]:
    """Returns the meanings of all message fields by field name."""
    share = shared_folder("slosh_msgs")
    found: dict[str, tuple[str, ...]] = {}
    for path in sorted(share.glob("msg/*.msg")) if share else ():
        for name, meaning in _fields(path):
            found[name] = (*found.get(name, ()), f"field of {path.stem}: {meaning}")
    return found


def _fields(path: Path) -> Iterator[tuple[str, str]]:
    """Yields field names and meanings from the comments of a message definition file."""
    above: list[str] = []
    used = False
    for line in path.read_text(encoding="utf-8").splitlines():
        field = _FIELD.match(line)
        if line.startswith("#"):
            above = [line[1:].strip()] if used else [*above, line[1:].strip()]
            used = False
        elif field:
            used = True
            yield field["name"], field["meaning"] or " ".join(above) or "see its message"
        elif not line.strip():
            above, used = [], False

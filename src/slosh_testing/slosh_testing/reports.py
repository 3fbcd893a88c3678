"""Example reports: one with every part, and one with malicious texts."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np

from slosh_report.run_report import (
    AzimuthSeries,
    CheckRow,
    DifferenceRow,
    ExcessSpan,
    Fact,
    Frame,
    KeyFigure,
    ModelRow,
    RunMotion,
    RunReport,
    RunVerdict,
    Status,
    TopicRow,
    VerificationRow,
)
from slosh_testing.pages import grey_png

EVIL = "<img src=x onerror=hacked=1>'\"\x1b[31m\nslosh: all is well\u202e\u2028"
FORGED = "slosh: all is well"
CONTROL = set("\x1b\x07\u202e\u2028")

NAN = float("nan")
T = np.arange(0.0, 20.0, 1.0 / 60.0)
NAMES = ("2D-L", "3D-L", "2D-NL", "3D-NL")


def rows(seed):
    """Returns example results of four models, random by seed, with unrounded numbers."""
    noise = np.random.default_rng(seed).random((4, 3)) / 3.0
    return tuple(
        ModelRow(name, 2e-3 * a, b - 0.2, 3e-3 * c, 3.2 + a, 600 + seed)
        for name, (a, b, c) in zip(NAMES, noise.tolist(), strict=True)
    )


def full_report():
    """Returns a report with content in every part of its HTML page."""
    measured = 0.0213 * np.sin(0.7 * T) ** 2
    estimated = AzimuthSeries("3D-NL", T, np.angle(np.exp(0.9j * T)), 0.98 * measured)
    return RunReport(
        title="cup_two_motions",
        subtitle="replay, driven by /slosh/accel",
        t=T,
        measured=np.where((T > 8.0) & (T < 9.0), np.nan, measured),
        linear=1.2 * measured,
        nonlinear=0.98 * measured,
        linear_name="3D-L",
        nonlinear_name="3D-NL",
        limit=0.0181,
        saturated=measured > 0.0212,
        key_figures=(
            KeyFigure("highest measured", 0.0212987, "mm"),
            KeyFigure("ε 3D-NL", -0.0234567, "%", "3D-L: +20.0 %"),
            KeyFigure("model", "3D-NL"),
        ),
        facts=(Fact("bag", "bags/cup_two_motions"),),
        events=(
            ExcessSpan("measured", 1.81, 2.74, 0.0181, 0.0213, "above the limit", 2.2439),
            ExcessSpan("estimated", 19.5, NAN, 0.0181, 0.0191),
        ),
        models=rows(1),
        motions=(
            RunMotion("RD_2D", 0.5, 8.123456, 0.0212987, rows(2)),
            RunMotion("LE_3D", 9.5, 19.0, 0.02, rows(3)),
        ),
        frames=(
            Frame(grey_png(), "highest: 2.24 s", "image/png", 2.24),
            Frame(grey_png(), "first", "image/png"),
        ),
        topics=(
            TopicRow("/slosh/accel", "geometry_msgs/msg/AccelStamped", 20000, 999.73, 0),
            TopicRow("/slosh/free_surface", "slosh_msgs/msg/FreeSurface", 1200, 59.94),
        ),
        model_text="container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n",
        effects={"fill_level": "More or less liquid than the model says."},
        notes=("a note",),
        warnings=("0.4 s are lost at the end",),
        status=Status(RunVerdict.FAILED, ("MAE 3D-NL is too large",)),
        checks=(
            CheckRow("MAE 3D-NL", 0.00060000001, 0.0, 0.0006, "mm"),
            CheckRow("samples dropped", 0, upper=0),
        ),
        verifications=(
            VerificationRow(
                "recorded estimates reproduced bit for bit",
                9216,
                9218,
                (
                    *(
                        DifferenceRow("/slosh/estimate", f"jerk[{i}]", i, NAN, 1e-9)
                        for i in range(6)
                    ),
                    DifferenceRow(
                        "/slosh/estimate", "nonlinear.msh", 2, 3.2141, 1.7e-18,
                        0.012345678901234567, 0.012345678901234569,
                    ),
                ),
            ),
            VerificationRow("limit events reproduced", 4, 4),
        ),
        measured_azimuth=AzimuthSeries("measured", T, estimated.azimuth + 0.05, measured),
        estimated_azimuth=estimated,
        further=(container("near", 0.9 * measured), container("far", np.full_like(T, NAN))),
    )  # fmt: skip


def container(name, measured):
    """Returns the heights of a further container of a tray."""
    return RunReport(
        title=name, t=T, measured=measured, linear=1.1 * measured, nonlinear=1.02 * measured,
        limit=0.0181,
    )  # fmt: skip


def hostile_report():
    """Returns a report whose texts try to become markup, formulas or requests."""
    base = full_report()
    bad_rows = tuple(replace(row, name=evil("model")) for row in base.models[:1])
    return replace(
        base,
        title=evil("title"),
        further=(replace(base.further[0], title=evil("container")),),
        subtitle=evil("subtitle"),
        linear_name=evil("linear"),
        nonlinear_name=evil("nonlinear"),
        key_figures=(KeyFigure(evil("label"), evil("value"), evil("unit"), evil("note")),),
        facts=(Fact(evil("fact"), evil("text")),),
        events=(ExcessSpan(evil("source"), 1.0, 2.0, 0.01, 0.02, evil("description")),),
        models=bad_rows,
        motions=(
            RunMotion(evil("motion"), 0.5, 8.0, 0.02, bad_rows),
            RunMotion(evil("motion"), 9.0, 19.0, 0.02, bad_rows),
        ),
        frames=(Frame(grey_png(), evil("caption"), "image/png", 2.0),),
        topics=(TopicRow(evil("topic"), evil("type"), 1),),
        model_text=evil("text"),
        effects={evil("effect"): evil("meaning")},
        notes=(evil("note"),),
        warnings=(evil("warning"),),
        status=Status(RunVerdict.PASSED, (evil("reason"),)),
        checks=(CheckRow(evil("check"), 1.0),),
        verifications=(
            VerificationRow(evil("verification"), 0, 1, (DifferenceRow(evil("t"), evil("f"), 1),)),
        ),
        measured_azimuth=replace(base.measured_azimuth, name=evil("measured")),
        estimated_azimuth=replace(base.estimated_azimuth, name=evil("estimated")),
    )


class Page(HTMLParser):
    """Parsed page that shows whether injected elements appear, and its text."""

    def __init__(self) -> None:
        super().__init__()
        self.hacked, self.text = False, ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.hacked |= ("src", "x") in attrs or "onerror" in dict(attrs)

    def handle_data(self, data: str) -> None:
        self.text += data


def has_forged_line(text: str) -> bool:
    """Returns whether a name has injected a line into a text."""
    return any(line.lstrip().startswith(FORGED) for line in text.splitlines())


def evil(where: str) -> str:
    """Returns a malicious text: markup, formulas, requests, control characters and a long word."""

    return (
        f'{where}</pre></title></style><script>window.hacked="{where}"</script>'
        f"<img src=http://127.0.0.1:9/{where} onerror=\"window.hacked='{where}'\">"
        f'" onmouseover="window.hacked=1" {{{{7*7}}}} $\\frac{{1}}{{0$ #010101 url(#x)'
        f" \x00\x1b[31m \ud800 \u202e {'W' * 300}"
    )

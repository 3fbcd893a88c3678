"""Tests the JSON and the text of a discovery: they contain the result's numbers."""

import json
from dataclasses import replace

import pytest

from slosh_discovery.discover.finding import (
    Candidate,
    Finding,
    FoundEffect,
    HeightGap,
    Verdict,
)
from slosh_discovery.discovery_report import (
    Command,
    DiscoveryReport,
)
from slosh_discovery.discovery_report.words import (
    headline,
    rivals,
    shown_parameter,
    verdict_sentence,
)
from slosh_testing.example_finding import (
    BASE,
    NOISE,
    example_finding,
    example_report,
    forms_of,
)

NAN = float("nan")


def document_of(verdict=Verdict.NAMED):
    """Returns the parsed JSON document of an example report."""
    return json.loads(forms_of(example_report(verdict))[0], parse_constant=pytest.fail)


def with_finding(**changes):
    return DiscoveryReport(replace(example_finding(), **changes))


def test_the_document_has_the_promised_keys():
    document = document_of()
    assert document["schema"] == 1
    assert document["verdict"] == "named"
    assert document["effects"][0] == {
        "name": "fill_level",
        "parameters": {"delta": -0.0031234},
        "standard_errors": {"delta": 0.0000456},
        "confidence": 0.9612,
        "alternatives": ["height_scale"],
        "refitted": False,
        "units": {"delta": "m"},
        "by_group": {},
    }
    assert document["gap"] == {
        "unit": "m",
        "noise": NOISE,
        "before": {"fit": 1.912e-3, "holdout": 2.012e-3},
        "after": {"fit": 0.31e-3, "holdout": 0.32e-3},
        "closed": 0.99687,
        "fit_closed": 0.99829,
        "holdout_closed": 0.99687,
    }
    assert document["where"][0] == {
        "by": "phase", "label": "motion", "before": 1.234e-3, "after": 0.31e-3,
        "share": 0.71234, "samples": 720,
    }  # fmt: skip
    assert [motion["role"] for motion in document["motions"]] == ["fit", "fit", "holdout"]


@pytest.mark.parametrize("verdict", Verdict)
def test_every_verdict_is_strict_json_and_the_same_each_time(verdict):
    document = document_of(verdict)
    assert document["verdict"] == verdict.value
    assert forms_of(example_report(verdict))[0] == forms_of(example_report(verdict))[0]
    assert (document["proposal"] is not None) == (verdict is Verdict.UNEXPLAINED)
    assert bool(document["separating"]) == (verdict is Verdict.AMBIGUOUS)


def test_what_is_not_known_is_null():
    document = document_of(Verdict.NONE)
    assert document["gap"]["before"]["holdout"] is None
    assert document["gap"]["closed"] is None
    assert document["where"][5]["share"] is None
    bare = DiscoveryReport(
        Finding(
            Verdict.NONE, BASE, BASE, (), NAN, HeightGap(NAN, NAN, NAN, NAN, NAN, NAN, NAN), ()
        )
    )
    assert json.loads(forms_of(bare)[0])["confidence"] is None


@pytest.mark.parametrize(
    ("effect", "name", "value", "error", "text"),
    [
        ("fill_level", "delta", -0.0031234, 0.0000456, "delta = −3.123 ± 0.046 mm"),
        ("static_tilt", "roll", 0.0174533, 0.00174533, "roll = 1.00 ± 0.10 °"),
        ("time_offset", "tau", 0.0123456, NAN, "tau = 0.01235 s"),
        ("damping_mismatch", "factor", 1.23456, 0.0, "factor = 1.235"),
        ("height_scale", "gain", 1.23456, 12.3, "gain = 1 ± 12"),
        ("no such", "x", 1.5, 0.1, "x = 1.50 ± 0.10"),
    ],
)
def test_a_parameter_has_two_digits_of_its_error(effect, name, value, error, text):
    assert shown_parameter(effect, name, value, error).text == text


def test_the_text_begins_with_the_verdict():
    sentences = {
        Verdict.NAMED: "2D-L lacks fill_level and vertical_acceleration (confidence 0.96).",
        Verdict.NONE: "2D-L lacks no effect that these motions show: its residual is noise.",
        Verdict.AMBIGUOUS: "2D-L lacks vertical_acceleration, and either fill_level or "
        "height_scale: these motions cannot distinguish them.",
        Verdict.UNEXPLAINED: "No listed effect closes the gap that 2D-L leaves; "
        "vertical_acceleration comes nearest.",
    }
    for verdict, sentence in sentences.items():
        assert forms_of(example_report(verdict))[1].splitlines()[0] == sentence


def test_the_text_tells_effects_gap_worst_and_what_to_type():
    lines = forms_of(example_report())[1].splitlines()
    assert "fill_level             delta = −3.123 ± 0.046 mm  confidence 0.96" in lines
    assert "held out  2.01 mm  0.32 mm   100 %" in lines
    assert any(
        line.startswith("height") and "5 … 10 mm" in line and "80 %" in line for line in lines
    )
    assert "moment     1.52 s of day_1#2       3.00 mm  0.10 mm  off" in lines
    assert "slosh replay BAG --model model.yaml" in lines
    assert not any("nan" in line for line in lines)


def test_an_ambiguous_finding_names_the_motion_that_separates():
    text = forms_of(example_report(Verdict.AMBIGUOUS))[1]
    assert (
        "separating_1.csv distinguishes fill_level + vertical_acceleration from height_scale"
        in text
    )
    assert "differ by 2.10 mm in it, by 0.04 mm in the present motions" in text


def test_a_wrong_parameter_is_told_from_a_missing_term():
    refitted = FoundEffect("surface_nonlinearity", {"alpha": 0.7}, {}, 0.95, refitted=True)
    missing = FoundEffect("second_mode", {"damping_ratio": 0.01}, {}, 0.95)
    both = replace(example_finding(), effects=(missing, refitted))
    assert verdict_sentence(both) == (
        "2D-L lacks second_mode and has other parameters of surface_nonlinearity"
        " (confidence 0.96)."
    )
    assert headline(both) == "Missing: second mode; other parameters: nonlinear free surface"
    only = replace(both, effects=(refitted,))
    assert headline(only) == "Other parameters: nonlinear free surface"
    assert "lacks" not in verdict_sentence(only)


def test_rivals_of_another_kind_come_from_the_explanations():
    base = example_finding(Verdict.AMBIGUOUS)
    alone = tuple(replace(effect, alternatives=()) for effect in base.effects)
    others = (
        Candidate(("vertical_acceleration", "fill_level"), probability=0.5),
        Candidate(("second_mode", "time_offset", "fill_level"), probability=0.4),
        Candidate(("height_offset",), probability=0.05),
    )
    finding = replace(base, effects=alone, candidates=others)
    assert rivals(finding)[1:] == [("second_mode", "time_offset", "fill_level")]
    assert verdict_sentence(finding) == (
        "2D-L lacks fill_level, and either vertical_acceleration or second_mode + time_offset:"
        " these motions cannot distinguish them."
    )
    lonely = replace(finding, candidates=())
    assert verdict_sentence(lonely) == (
        "Perhaps 2D-L lacks fill_level + vertical_acceleration: these motions are not conclusive."
    )


def test_a_finding_with_nothing_in_it_still_has_a_page_and_a_text():
    gap = HeightGap(NAN, NAN, NAN, NAN, NAN, NAN, NAN)
    for verdict in Verdict:
        report = DiscoveryReport(Finding(verdict, BASE, BASE, (), NAN, gap, ()))
        _, text, page = forms_of(report)
        assert "<h1>" in page
        assert "nan" not in text


def test_commands_are_on_the_page_as_they_are_typed():
    command = Command("run <it>", "slosh replay 'a b' --model \"x\"")
    page = forms_of(replace(with_finding(motions=()), commands=(command,)))[2]
    assert "run &lt;it&gt;" in page
    assert "slosh replay &#39;a b&#39; --model &#34;x&#34;" in page

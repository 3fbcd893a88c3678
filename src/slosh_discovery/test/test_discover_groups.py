"""Tests motions of two campaigns, whose sensor parameters may differ between groups."""

from dataclasses import replace

import numpy as np
import pytest
from example_motions import BASE, measured

from slosh_discovery.discover import MeasuredMotion, Verdict, discover
from slosh_discovery.discover.campaigns import Normal, grouping
from slosh_discovery.discover.finding import Role
from slosh_discovery.discovery_report import (
    DiscoveryReport,
    discovery_document,
)
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.effects.registry import EFFECTS
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_report.page.html import html_page
from slosh_report.text import document_text

REMEMBERED, CORRELATION = 3e-4, 0.9
"""What a camera's noise has in common from image to image [m]."""
LEANS = {"spring": {"e_x": 0.03, "e_y": 0.04}, "autumn": {"e_x": 0.01, "e_y": -0.045}}


def coloured(motion: MeasuredMotion, seed: int) -> MeasuredMotion:
    """Returns the motion with noise that is correlated between images."""
    random = np.random.default_rng(7000 + seed)
    noise = np.empty(len(motion.t))
    noise[0] = random.normal()
    for row in range(1, len(noise)):
        new = np.sqrt(1.0 - CORRELATION**2) * random.normal()
        noise[row] = CORRELATION * noise[row - 1] + new
    assert motion.msh is not None
    return replace(motion, msh=motion.msh + REMEMBERED * noise)


def campaign(group: str, truth: Model, seeds: range) -> list[MeasuredMotion]:
    return [
        replace(coloured(measured(truth, seed, vertical=3.0), seed), group=group) for seed in seeds
    ]


def ungrouped(motions: list[MeasuredMotion]) -> list[MeasuredMotion]:
    return [replace(motion, group=None) for motion in motions]


def leaning(group: str) -> Model:
    truth = BASE.with_effect("vertical_acceleration")
    return truth.with_effect("sensor_tilt", **LEANS[group])


@pytest.fixture(scope="module")
def finding():
    """Returns a discovery from two campaigns with differently tilted sensors."""
    motions = [
        motion
        for start, group in enumerate(LEANS)
        for motion in campaign(group, leaning(group), range(10 * start, 10 * start + 3))
    ]
    held_out = [
        motion
        for start, group in enumerate(LEANS)
        for motion in campaign(group, leaning(group), range(50 + start, 51 + start))
    ]
    return discover(motions, BASE, held_out)


@pytest.mark.long
def test_the_lean_of_each_campaign_is_named_with_its_own_values(finding):
    assert finding.verdict is Verdict.NAMED
    named = {effect.name: effect for effect in finding.effects}
    assert set(named) == {"sensor_tilt", "vertical_acceleration"}
    lean = named["sensor_tilt"]
    assert lean.parameters == {}
    assert set(lean.by_group) == set(LEANS)
    for group, true in LEANS.items():
        fitted = lean.by_group[group]
        for name, value in true.items():
            assert abs(fitted.parameters[name] - value) < 4.0 * fitted.standard_errors[name]
            assert fitted.standard_errors[name] < 0.005
    assert named["vertical_acceleration"].by_group == {}
    assert finding.gap.holdout_closed > 0.9


@pytest.mark.long
def test_text_page_and_document_tell_the_values_of_each_campaign(finding):
    report = DiscoveryReport(finding)
    document = discovery_document(report)
    text, page, document = document_text(document), html_page(document), document.data
    (lean,) = (one for one in document["effects"] if one["name"] == "sensor_tilt")
    assert set(lean["units"]) == {"e_x", "e_y"}
    for group in LEANS:
        assert f"{group}: e_x = " in text
        assert f"Motions of {group}" in page
        value = lean["by_group"][group]["parameters"]["e_x"]
        path = f"/effects/0/by_group/{group}/parameters/e_x"
        assert f'<data value="{value!r}" data-path="{path}">' in page
        told = parse_model(document["group_models"][group]["text"])
        assert set(told.effects) == set(finding.group_models[group].effects)
    assert "sensor_tilt (per group)" in text
    assert {motion["group"] for motion in document["motions"]} == set(LEANS)


@pytest.mark.long
def test_only_what_belongs_to_the_rig_is_fitted_per_group(finding):
    apart = {name for candidate in finding.candidates for name in candidate.per_group}
    assert "sensor_tilt" in apart
    assert all(EFFECTS[name].of_rig for name in apart)
    assert not apart & {"surface_nonlinearity", "damping_mismatch", "second_mode"}


@pytest.mark.long
@pytest.mark.parametrize("given", [True, False])
def test_one_campaign_is_not_split_be_it_given_as_two_or_as_none(given):
    truth = leaning("spring")
    motions = campaign("one", truth, range(3)) + campaign("two", truth, range(10, 13))
    finding = discover(motions if given else ungrouped(motions), BASE)
    assert finding.verdict is Verdict.NAMED
    assert {effect.name for effect in finding.effects} == {"sensor_tilt", "vertical_acceleration"}
    assert all(effect.by_group == {} for effect in finding.effects)
    assert finding.group_models == {}


def test_a_motion_of_whose_group_nothing_is_known_is_one_clear_error():
    (one,), (two,) = (campaign(group, BASE, range(1)) for group in ("one", "two"))
    with pytest.raises(SloshDiscoveryError, match=r"motion 0: no motion of its group two"):
        discover([one], BASE, [two])
    with pytest.raises(SloshDiscoveryError, match=r"motion 0: belongs to no group"):
        discover([one, replace(two, group=None)], BASE)


@pytest.mark.long
def test_campaigns_that_nobody_told_of_are_found_from_the_heights():
    parts = [
        campaign(group, leaning(group), range(10 * start, 10 * start + 4))
        for start, group in enumerate(LEANS)
    ]
    fit = ungrouped([*parts[0][:3], *parts[1][:3]])
    finding = discover(fit, BASE, ungrouped([parts[0][3], parts[1][3]]))
    assert finding.verdict is Verdict.NAMED
    named = {effect.name: effect for effect in finding.effects}
    assert set(named) == {"sensor_tilt", "vertical_acceleration"}
    for found, true in zip(("rig_1", "rig_2"), LEANS.values(), strict=True):
        fitted = named["sensor_tilt"].by_group[found]
        for name, value in true.items():
            assert abs(fitted.parameters[name] - value) < 4.0 * fitted.standard_errors[name]
    placed = [case.motion.group for case in finding.motions]
    assert placed == ["rig_1"] * 3 + ["rig_2"] * 3 + ["rig_1", "rig_2"]
    assert [case.role for case in finding.motions][-2:] == [Role.HOLDOUT] * 2
    assert any("2 set-ups" in remark and "--group" in remark for remark in finding.remarks)
    assert finding.gap.holdout_closed > 0.9


def told(values: list[float], error: float) -> list[Normal]:
    """Returns normal equations of motions that each determine one parameter."""
    information = 1.0 / error**2
    return [
        Normal(np.array([[information]]), np.array([-information * value])) for value in values
    ]


def test_motions_that_tell_the_same_are_one_group_and_others_are_another():
    found = grouping(told([0.5, -0.6, 0.52, -0.57, 0.47], 0.05), "sensor_tilt")
    assert found.members == ((0, 2, 4), (1, 3))
    assert found.gain > 20.0
    assert grouping(told([0.5, 0.45, 0.52, 0.57, 0.47], 0.05), "sensor_tilt").gain == 0.0


def test_a_motion_that_stands_alone_is_no_campaign():
    assert grouping(told([0.5, 0.5, 0.5, -0.6], 0.05), "sensor_tilt").gain == 0.0

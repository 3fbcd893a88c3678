"""A cell's state for controllers: what is good, what is doubtful, what is lost."""

import math
import struct
import sys
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_estimator.comparison import Condition
from slosh_estimator.limits import Kind, Source
from slosh_estimator.observer.calm import CalmReason
from slosh_plc.broker_client import MqttSettings, lost_state
from slosh_plc.cell_state import REGISTERS, SIGNALS, Quality, Reading
from slosh_plc.cell_state import Kind as Type
from slosh_plc.cell_view import CellView
from slosh_plc.errors import SloshPlcError
from slosh_plc.modbus import ModbusServer, ModbusSettings, registers
from slosh_plc.mqtt import MqttPublisher, document
from slosh_plc.opc_ua import OpcUaServer, OpcUaSettings
from slosh_plc.tuning import TUNING
from slosh_testing.plc import ServedCell

GOOD, UNCERTAIN, BAD = Quality
ANY = st.floats(allow_nan=True, allow_infinity=True)


def comparison(**given):
    told = {
        "state": Condition.OK, "measured": 0.004, "estimated_nonlinear": 0.005,
        "measured_flags": 0, "estimate_flags": 0, "measured_stale": False, "estimate_stale": False,
    }  # fmt: skip
    return SimpleNamespace(**(told | given))


def calm(**given):
    told = {"calm": True, "reason": CalmReason.CALM, "time_until_calm": 0.0}
    return SimpleNamespace(**(told | given))


def seen(*, now=10.0, **given):
    """The state just after everything was heard once."""
    view = CellView(0.0)
    view.take_comparison(comparison(**given), now, 0.1)
    view.take_calm(calm(), now, 0.1)
    view.take_fused(SimpleNamespace(msh=0.0045, trusted=True), now, 0.1)
    view.take_parameters("monitor", {"measured_limit": 0.02, "estimated_limit": 0.03})
    return view


def test_a_cell_at_work_has_good_values():
    view = seen()
    view.take_event(SimpleNamespace(kind=Kind.START, source=Source.ESTIMATED))
    view.take_event(SimpleNamespace(kind=Kind.END, source=Source.ESTIMATED))
    state = view.state(10.05)
    assert not state.is_lost
    assert {reading.quality for reading in state.readings().values()} == {GOOD}
    assert {name: reading.value for name, reading in state.readings().items()} == {
        "state": Condition.OK, "blind": False, "measured_height": 0.004,
        "estimated_height": 0.005, "fused_height": 0.0045, "measured_limit": 0.02,
        "estimated_limit": 0.03, "calm": True, "time_until_calm": 0.0, "measured_events": 0,
        "estimated_events": 1, "disagreement_events": 0, "heartbeat": 100,
    }  # fmt: skip


def test_a_lost_cell_is_bad_within_a_second_and_never_ok():
    view = seen()
    late = 10.0 + 1.0 - 2.0 * TUNING.period  # what was heard is taken, and served, a period later
    state = view.state(late)
    assert state.is_lost
    readings = dict(state.readings())
    assert readings.pop("heartbeat").quality is GOOD
    assert {reading.quality for reading in readings.values()} == {BAD}
    assert (state.state.value, state.blind.value, state.calm.value) == (Condition.STALE, 1, 0)
    assert math.isnan(state.estimated_height.value)
    assert state.measured_events.value == 0
    view.take_comparison(comparison(), 12.0, 0.1)
    assert view.state(12.0).state == Reading(Condition.OK, GOOD)


@pytest.mark.parametrize("age", [2.1, 3600.0, 1.7e9, -2.1, math.nan])
def test_what_is_stamped_at_another_time_is_bad_however_it_comes(age):
    view = seen()
    view.take_comparison(comparison(), 10.1, age)
    view.take_calm(calm(), 10.1, age)
    view.take_fused(SimpleNamespace(msh=0.0045, trusted=True), 10.1, age)
    state = view.state(10.1)
    names = ("state", "blind", "measured_height", "estimated_height", "fused_height", "calm",
             "time_until_calm")  # fmt: skip
    assert {state.readings()[name].quality for name in names} == {BAD}
    assert (state.state.value, state.blind.value, state.calm.value) == (Condition.STALE, 1, 0)
    assert math.isnan(state.estimated_height.value)
    view.take_comparison(comparison(), 10.2, 1.9)
    assert view.state(10.2).state == Reading(Condition.OK, GOOD)


def test_a_monitor_without_inputs_says_so_with_good_quality_however_old_they_are():
    view = seen()
    view.take_comparison(comparison(state=Condition.STALE), 10.1, 3600.0)
    state = view.state(10.1)
    assert (state.state, state.blind) == (Reading(Condition.STALE, GOOD), Reading(True, GOOD))
    assert state.estimated_height.quality is BAD


def test_before_the_first_message_a_cell_is_lost():
    assert CellView(0.0).state(0.0).is_lost
    assert lost_state().readings().keys() == CellView(0.0).state(0.0).readings().keys()


@pytest.mark.parametrize(
    ("told", "measured", "estimated"),
    [
        ({"measured_stale": True}, BAD, GOOD),
        ({"estimate_stale": True}, GOOD, BAD),
        ({"measured": math.nan}, BAD, GOOD),
        ({"estimated_nonlinear": math.inf}, GOOD, BAD),
        ({"measured_flags": 8}, UNCERTAIN, GOOD),
        ({"estimate_flags": 2}, GOOD, UNCERTAIN),
        ({"state": Condition.BLIND}, UNCERTAIN, UNCERTAIN),
        ({"state": Condition.ERROR}, GOOD, GOOD),
    ],
)
def test_the_quality_of_a_height_follows_its_source(told, measured, estimated):
    state = seen(**told).state(10.0)
    assert (state.measured_height.quality, state.estimated_height.quality) == (measured, estimated)


@pytest.mark.parametrize(
    ("condition", "blind"),
    [(Condition.OK, False), (Condition.STALE, True), (Condition.BLIND, True)],
)
def test_blind_is_what_the_monitor_says(condition, blind):
    assert seen(state=condition).state(10.0).blind == Reading(blind, GOOD)


def test_a_state_that_the_monitor_does_not_have_is_bad():
    state = seen(state=77).state(10.0)
    assert state.state == Reading(Condition.BLIND, BAD)
    assert state.blind.value


@pytest.mark.parametrize(
    ("told", "flag", "wait"),
    [
        ({"calm": False, "reason": CalmReason.SETTLING, "time_until_calm": 2.5}, GOOD, 2.5),
        ({"calm": False, "reason": CalmReason.UNSURE, "time_until_calm": 0.5}, UNCERTAIN, 0.5),
        ({"calm": True, "reason": CalmReason.STALE}, BAD, None),
        ({"time_until_calm": -3.0}, GOOD, None),
    ],
)
def test_calm_has_the_quality_of_its_reason(told, flag, wait):
    view = seen()
    view.take_calm(calm(**told), 10.0, 0.1)
    state = view.state(10.0)
    assert state.calm == Reading(told.get("calm", True) and flag is not BAD, flag)
    assert (state.time_until_calm.quality is BAD) == (wait is None)
    assert wait is None or state.time_until_calm.value == wait


def test_a_silent_observer_is_bad_though_the_monitor_goes_on():
    view = seen()
    view.take_comparison(comparison(), 12.0, 0.1)
    state = view.state(12.0)
    assert not state.is_lost
    assert {state.fused_height.quality, state.calm.quality} == {BAD}
    assert state.estimated_height.quality is GOOD


def test_a_limit_that_is_not_watched_is_no_number():
    view = seen()
    view.take_parameters("monitor", {"measured_limit": math.nan})
    assert view.state(10.0).measured_limit.quality is BAD
    view.take_parameters("recorder", {"measured_limit": 0.5})
    assert view.state(10.0).measured_limit.quality is BAD


def test_the_heartbeat_advances_with_time_alone():
    view = CellView(5.0)
    beats = [view.state(5.0 + 0.05 + k * TUNING.period).heartbeat.value for k in range(5)]
    assert beats == [0, 1, 2, 3, 4]
    assert view.state(5.0 + 2.0**33 * TUNING.period).heartbeat.value < 2**32


@given(ANY, ANY, ANY, ANY, st.integers(0, 255), st.integers(0, 255))
def test_whatever_is_heard_every_server_can_tell_it(a, b, c, d, state, reason):
    view = CellView(0.0)
    view.take_comparison(comparison(measured=a, estimated_nonlinear=b, state=state), 1.0, 0.1)
    view.take_fused(SimpleNamespace(msh=c, trusted=True), 1.0, 0.1)
    view.take_calm(calm(reason=reason, time_until_calm=d), 1.0, 0.1)
    view.take_event(SimpleNamespace(kind=reason, source=state))
    found = view.state(1.0)
    for signal in SIGNALS:
        value, quality = getattr(found, signal.name)
        assert math.isfinite(value) or quality is BAD
    assert len(registers(found)) == REGISTERS
    document("cell", found, datetime(2026, 1, 1, tzinfo=UTC))


@pytest.mark.parametrize(
    ("server", "module"),
    [
        (ModbusServer(ModbusSettings("127.0.0.1", 1)), "pymodbus"),
        (OpcUaServer(OpcUaSettings("cell", "127.0.0.1", 1)), "asyncua"),
        (MqttPublisher(MqttSettings("cell", "127.0.0.1", 1)), "aiomqtt"),
    ],
)
def test_a_library_that_is_absent_is_named_with_its_remedy(monkeypatch, server, module):
    for name in [module, *(one for one in sys.modules if one.startswith(f"{module}."))]:
        monkeypatch.setitem(sys.modules, name, None)
    told = rf"{module} is not installed \(pip install -r requirements/plc\.txt\)"
    with pytest.raises(SloshPlcError, match=told), ServedCell().serve(server):
        pass


def test_every_register_is_told_in_the_table_of_signals():
    words = registers(seen().state(10.0))
    found = {}
    for signal in SIGNALS:
        high, low, quality, spare = words[signal.address : signal.address + 4]
        code = ">f" if signal.kind is Type.NUMBER else ">I"
        (found[signal.name],) = struct.unpack(code, struct.pack(">HH", high, low))
        assert (quality, spare) == (GOOD, 0)
    assert found["estimated_limit"] == pytest.approx(0.03)
    assert found["heartbeat"] == 100

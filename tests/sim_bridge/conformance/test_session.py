"""Sessions notice what differs, and leave the vehicle as they found it."""

import pytest

from sim_bridge.conformance import Outcome, Plan, load_catalogue
from sim_bridge.conformance.catalogue import Family, parse_catalogue
from sim_bridge.conformance.simulated import run_simulated

PX4 = load_catalogue(Family.PX4)
MODES = "modes: {LOITER: 0x03040000, LAND: 0x06040000, POSCTL: 0x00030000}"


def outcome(state, *steps, plan=None, watch=None):
    lines = "\n".join(f"    - {step}" for step in steps)
    text = f"family: px4\nrecorded: x\n{MODES}\nentries:\n- id: a/b\n  source: x\n  state: {state}\n  steps:\n{lines}\n"
    session = run_simulated(parse_catalogue(text, "test"), plan or Plan(fly=True), watch=watch)
    return session.results[0] if session.results else None, session


VERSION = "{command: REQUEST_MESSAGE, params: ['id:AUTOPILOT_VERSION']}"


@pytest.mark.parametrize(
    ("steps", "reason"),
    [
        ([VERSION, "{ack: DENIED}"], "step 2: COMMAND_ACK: ACCEPTED, DENIED expected"),
        ([VERSION, "{ack: ACCEPTED, of: NAV_LAND}"], "step 2: COMMAND_ACK: it is for command 512"),
        (["{expect: MISSION_ACK}"], "step 1: no MISSION_ACK within 2.5 s"),
        (["{expect: HEARTBEAT, within: 0.001}"], "only after"),
        (["{expect: HEARTBEAT, after: 30, within: 40}"], "instead of 30 s or more"),
        ([VERSION, "{expect: AUTOPILOT_VERSION, fields: {vendor_id: 7}}"], "vendor_id is 0, 7 expected"),
        (["{never: HEARTBEAT, for: 2}"], "none expected"),
        (["{shows: {mode: POSCTL}}"], "HEARTBEAT: mode LOITER, POSCTL expected"),
        (["{shows: {armed: true}}"], "disarmed, armed expected"),
        (["{keeps: {status: 4}, for: 1.5}"], "system_status 3, 4 expected"),
        (["{moves: {vn: [1, 2]}}"], "vn is"),
        (["{rate: HEARTBEAT, hz: [2, 3], for: 2}"], "HEARTBEAT came 1.0 times a second, 2 to 3 expected"),
        (["{ready: false}"], "the pre-arm bit is True, False expected"),
        (["{ground: true}", "{command: COMPONENT_ARM_DISARM, params: [1]}", "{text: Nope}"], "Armed by external"),
        (["{parameter: {NO_SUCH: 1}}"], "parameter NO_SUCH: the autopilot does not take it"),
    ],
)
def test_differences_are_noticed(steps, reason):
    result, session = outcome("ready", *steps)
    assert result.outcome is Outcome.DIFFERS
    assert reason in result.reason
    assert session.problem == ""


def test_parameters_are_put_back_even_when_an_entry_fails():
    values = []

    def watch(session):
        values.extend(
            heard.message.param_value
            for heard in session.dialogue.heard
            if heard.message.get_type() == "PARAM_VALUE" and heard.time_s == session.dialogue.time_s
        )

    result, session = outcome("ready", "{parameter: {MPC_XY_VEL_MAX: 5.0}}", "{shows: {armed: true}}", watch=watch)
    assert result.outcome is Outcome.DIFFERS
    assert values == [12.0, 5.0, 12.0]
    assert session.problem == ""


def test_an_aborted_session_lands():
    calls = []

    def watch(session):
        if session.current is not None and session.dialogue.landed is False and not calls:
            calls.append(session.dialogue.time_s)
            session.abort()

    result, session = outcome("streaming", "{wait: 1000}", watch=watch)
    assert calls
    assert result is None
    assert session.problem == "aborted"
    assert session.finished
    assert not session.dialogue.armed
    assert session.dialogue.landed


def test_motors_stand_still_unless_asked_for():
    armed = []
    session = run_simulated(PX4, Plan(only=("arm", "takeoff", "mode")), watch=lambda s: armed.append(s.dialogue.armed))
    assert not any(armed)
    skipped = {result.entry.id: result.reason for result in session.results if result.outcome is Outcome.SKIPPED}
    assert skipped["arm/accepted"] == "may start motors: needs --fly"
    assert session.results


def test_what_may_crash_comes_last_and_only_if_asked_for():
    session = run_simulated(PX4, Plan(only=("disarm",), fly=True))
    reasons = {result.entry.id: result.reason for result in session.results}
    assert reasons["disarm/forced-in-the-air"] == "may crash the autopilot: needs --dangerous"
    assert session.results[-1].entry.dangerous


def test_a_silent_autopilot_ends_the_session(monkeypatch):
    monkeypatch.setattr("sim_bridge.conformance.simulated._exchange", lambda *_: None)
    session = run_simulated(PX4, Plan())
    assert session.finished
    assert session.problem == "no heartbeat of an autopilot within 30 s"
    assert session.results == []

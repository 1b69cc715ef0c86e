"""The failsafe ladder: every condition reaches each of its stages within its promised time, and ends."""

import pytest

from onboard.flight.events import Event
from onboard.flight.failsafes import RULES, Action, Condition, Severity
from onboard.flight.failsafes_page import PAGE, page
from onboard.flight.ladder import Ladder
from onboard.flight.reactions import following
from onboard.messages import FlightState

TICK_S = 0.02


def test_every_condition_is_in_the_table_and_gets_milder_before_it_gets_harsher() -> None:
    assert set(RULES) == set(Condition)
    for rule in RULES.values():
        actions = [stage.action for stage in rule.stages]
        assert actions == sorted(set(actions))
        assert [stage.after_s for stage in rule.stages] == sorted(stage.after_s for stage in rule.stages)


@pytest.mark.parametrize("condition", list(Condition))
def test_each_stage_begins_in_time_is_told_once_and_ends_once(condition: Condition) -> None:
    ladder, rule, now = Ladder(), RULES[condition], 100.0
    told: list[Event] = []
    begun: dict[Action, float] = {}
    while now < 100.0 + max(rule.within_s) + 1.0:
        action = ladder.update({condition: "so much"}, now)
        told += ladder.events()
        if action is not None:
            begun.setdefault(action, now - 100.0)
        now += TICK_S
    for stage, within_s in zip(rule.stages, rule.within_s, strict=True):
        assert begun[stage.action] <= within_s - rule.noticed_s
    assert [(event.severity, event.condition) for event in told] == [(rule.severity, condition)] * len(rule.stages)
    assert [event.text for event in told] == [stage.told.format("so much") for stage in rule.stages]
    assert ladder.active == (condition,)
    until = now + rule.clears_s + 2 * TICK_S
    while now < until:
        ladder.update({}, now)
        now += TICK_S
    assert ladder.action is None
    assert [event.text for event in ladder.events()] == ([rule.over] if rule.over else [])


def test_the_most_drastic_action_wins_and_what_is_left_takes_over() -> None:
    ladder = Ladder()
    held = {Condition.CLOCK_ASTRAY: "+300 ms", Condition.PLANNER_LATE: "20 ms", Condition.BATTERY_CRITICAL: "9 %"}
    ladder.update(held, 100.0)
    assert ladder.action is Action.HOLD, "the charge must be low for a moment"
    ladder.update(held, 100.3)
    assert ladder.action is Action.RETURN
    ladder.update({**held, Condition.POSITION_UNAIDED: ""}, 100.4)
    assert ladder.action is Action.STOP, "nobody flies home blind"
    ladder.update({**held, Condition.POSITION_UNAIDED: "", Condition.TAKEN_OVER: "mode POSCTL"}, 100.5)
    assert ladder.action is Action.LET_GO
    assert ladder.active[0] is Condition.TAKEN_OVER
    ladder.update(held, 101.0)
    assert ladder.action is Action.RETURN


def test_what_comes_and_goes_within_its_time_is_one_condition() -> None:
    ladder = Ladder()
    for tick in range(200):
        ladder.update({Condition.FENCE_NEAR: ""} if tick % 50 == 0 else {}, 100.0 + TICK_S * tick)
    assert len(ladder.events()) == 1
    assert ladder.action is Action.KEEP_OFF


def test_a_clock_that_is_set_back_stalls_nothing() -> None:
    ladder = Ladder()
    ladder.update({Condition.POSITION_STALE: ""}, 100.0)
    ladder.update({Condition.POSITION_STALE: ""}, 95.0)
    ladder.update({Condition.POSITION_STALE: ""}, 95.1)
    assert ladder.action is Action.STOP
    ladder.update({}, 95.5)
    assert ladder.action is None


def test_every_action_that_moves_a_vehicle_leads_somewhere_from_a_plan() -> None:
    leads = {action: following(action, FlightState.TRACK) for action in Action}
    assert leads == {
        Action.TELL: None,
        Action.KEEP_OFF: None,
        Action.WAIT: FlightState.HOLD,
        Action.HOLD: FlightState.HOLD,
        Action.RETURN: FlightState.RETURN,
        Action.STOP: FlightState.HOLD,
        Action.LAND: FlightState.LAND,
        Action.GIVE_UP: None,
        Action.LET_GO: FlightState.RELEASED,
    }
    assert following(None, FlightState.TRACK) is None


def test_the_page_is_the_table() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert page(text) == text
    assert all(f"| {condition.value} |" in text for condition in Condition)
    assert Severity.ALERT < Severity.INFO, "as MAV_SEVERITY counts"

"""Neighbours, groups and who may descend."""

import pytest

from onboard.messages import FlightState, PeerStatus
from onboard.team import TeamTable

MISSION = 500.0


def status(
    sender: int,
    *neighbours: int,
    state: FlightState = FlightState.TRACK,
    start: float | None = MISSION,
    over_home: bool = False,
) -> PeerStatus:
    return PeerStatus(sender, start, state, (0.0, 0.0, -1.0), 0.0, neighbours, over_home, 0.0)


def test_neighbours_are_those_heard_lately() -> None:
    team = TeamTable(1, timeout_s=1.5)
    team.receive(status(3), 10.0)
    team.receive(status(2), 11.0)
    assert team.neighbours(11.4) == (2, 3)
    assert team.neighbours(12.0) == (2,)
    assert team.status(3, 12.0) is None


def test_ones_own_status_that_a_multicast_group_echoes_is_ignored() -> None:
    team = TeamTable(1, timeout_s=1.5)
    team.receive(status(1), 10.0)
    assert team.neighbours(10.0) == ()


def test_a_group_reaches_over_neighbours_neighbours() -> None:
    """1 - 2 - 3: robot 1 does not hear 3, yet plans in one order with it."""
    team = TeamTable(1, timeout_s=1.5)
    team.receive(status(2, 1, 3), 10.0)
    group = team.group(10.0, MISSION)
    assert (group.members, group.order) == ((1, 2, 3), 0)


def test_all_of_a_connected_group_agree_on_it() -> None:
    graph = {1: (2,), 2: (1, 3), 3: (2,)}
    groups = set()
    for me, neighbours in graph.items():
        team = TeamTable(me, timeout_s=1.5)
        for peer in neighbours:
            team.receive(status(peer, *graph[peer]), 10.0)
        groups.add(team.group(10.0, MISSION).members)
    assert groups == {(1, 2, 3)}


def test_only_robots_that_fly_plans_of_this_mission_are_in_the_group() -> None:
    team = TeamTable(2, timeout_s=1.5)
    team.receive(status(1, 2, state=FlightState.TAKEOFF), 10.0)
    team.receive(status(3, 2, start=400.0), 10.0)
    team.receive(status(4, 2, 1, state=FlightState.HOLD), 10.0)
    group = team.group(10.0, MISSION)
    assert (group.members, group.order) == ((2, 4), 0)


def test_who_began_some_epochs_later_plans_with_the_others_and_who_is_out_of_their_rhythm_does_not() -> None:
    """2 hears all; 3 began three epochs later, 4 half an epoch; all agree on who plans with whom."""
    starts = {1: MISSION, 2: MISSION, 3: MISSION + 3.6, 4: MISSION + 0.6}
    seen = {}
    for me, start in starts.items():
        team = TeamTable(me, timeout_s=1.5, epoch_s=1.2)
        for peer, begun in starts.items():
            team.receive(status(peer, *starts, start=begun), 10.0)
        seen[me] = team.group(10.0, start).members
    assert seen == {1: (1, 2, 3), 2: (1, 2, 3), 3: (1, 2, 3), 4: (4,)}


def test_a_robot_alone_is_a_group() -> None:
    assert TeamTable(9, timeout_s=1.5).group(10.0, MISSION).members == (9,)


def test_nobody_descends_while_a_neighbour_may_cross_below() -> None:
    team = TeamTable(1, timeout_s=1.5)
    assert team.may_descend(10.0)
    team.receive(status(2, state=FlightState.RETURN), 10.0)
    assert not team.may_descend(10.0)
    team.receive(status(2, state=FlightState.RETURN, over_home=True), 10.1)
    team.receive(status(3, state=FlightState.LANDED), 10.1)
    assert team.may_descend(10.1)


@pytest.mark.parametrize(
    ("state", "over_home", "may_descend"),
    [
        (FlightState.TRACK, False, False),
        (FlightState.RETURN, False, False),
        (FlightState.RETURN, True, True),
        (FlightState.STANDBY, True, False),
        (FlightState.LAND, True, True),
        (FlightState.LANDED, True, True),
    ],
)
def test_who_is_heard_no_more_keeps_those_above_it_up_unless_it_was_out_of_the_way(
    state: FlightState, over_home: bool, may_descend: bool
) -> None:
    above, lowest = TeamTable(1, timeout_s=1.5, below=[2]), TeamTable(1, timeout_s=1.5)
    assert not above.may_descend(10.0), "never heard: it may fly"
    for team in (above, lowest):
        team.receive(status(2, state=state, over_home=over_home), 10.0)
    assert above.may_descend(12.0) is may_descend
    assert lowest.may_descend(12.0)

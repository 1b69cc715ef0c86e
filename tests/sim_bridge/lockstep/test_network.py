"""The radio of the lock-step world: who hears whom, and what becomes of messages."""

import json
from typing import Any

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from onboard.messages import ExploredTile
from sim_bridge.lockstep.config import NetworkConfig
from sim_bridge.lockstep.network import Network, components, wire_bytes

LINE = np.array([[0.0, 0.0], [4.0, 0.0], [8.0, 0.0], [20.0, 0.0]])
IDS = [2, 3, 5, 9]


def tile(number: int) -> ExploredTile:
    return ExploredTile(number, 0, 500, bytes(128))


def network(seed: int = 0, **config: Any) -> Network:
    parsed = NetworkConfig.model_validate_json(json.dumps(config))
    return Network(parsed, IDS, [np.random.default_rng([seed, i]) for i in IDS])


@pytest.mark.parametrize("seed", range(5))
def test_components_are_those_of_an_independent_implementation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    adjacency = np.triu(rng.random((20, 20)) < 0.06, 1)
    adjacency |= adjacency.T
    count, labels = connected_components(adjacency, directed=False)
    found = components(adjacency)
    assert len(found) == count
    assert sorted(index for group in found for index in group) == list(range(20))
    assert all(len({labels[index] for index in group}) == 1 and list(group) == sorted(group) for group in found)
    assert [group[0] for group in found] == sorted(group[0] for group in found)


def test_the_age_of_a_tile_is_on_the_air_only_when_told() -> None:
    assert wire_bytes(tile(0)) == 12 + 134, "as in the paper's teams, which never forget"
    assert wire_bytes(ExploredTile(0, 0, 500, bytes(128), 3)) == 12 + 136


def test_range_decides_who_hears_whom_and_who_plans_together() -> None:
    radio = network(range_m=5.0)
    radio.connect(0, LINE)
    assert [radio.neighbours(index) for index in range(4)] == [(3,), (2, 5), (3,), ()]
    assert radio.groups() == [(2, 3, 5), (9,)]
    unlimited, silent = network(), network(range_m=0.0)
    unlimited.connect(0, LINE)
    silent.connect(0, np.zeros((4, 2)))
    assert unlimited.groups() == [(2, 3, 5, 9)]
    assert silent.groups() == [(2,), (3,), (5,), (9,)], "range 0 is no radio, even at the same place"


def test_a_partition_splits_the_team_for_its_time() -> None:
    radio = network(partitions=[{"from_step": 2, "until_step": 4, "groups": [[2, 5], [9]]}])
    for step, groups in [
        (1, [(2, 3, 5, 9)]),
        (2, [(2, 5), (3,), (9,)]),
        (3, [(2, 5), (3,), (9,)]),
        (4, [(2, 3, 5, 9)]),
    ]:
        radio.connect(step, LINE)
        assert radio.groups() == groups


def test_messages_arrive_once_in_order_at_their_step() -> None:
    radio = network(range_m=5.0)
    radio.connect(0, LINE)
    messages = [tile(number) for number in range(3)]
    radio.broadcast(0, messages, 1)
    assert radio.deliver(1, 0) == []
    assert radio.deliver(1, 1) == messages
    assert radio.deliver(1, 1) == []
    assert radio.deliver(2, 1) == radio.deliver(3, 1) == radio.deliver(0, 1) == []
    assert radio.traffic == (3, 3 * wire_bytes(messages[0]), 3, 0)


def test_delay_and_jitter_in_steps() -> None:
    radio = network(delay_steps=2, jitter_steps=1)
    radio.connect(0, LINE)
    radio.broadcast(0, [tile(number) for number in range(400)], 10)
    assert radio.deliver(1, 11) == []
    first, second = radio.deliver(1, 12), radio.deliver(1, 13)
    assert len(first) + len(second) == 400
    assert 150 < len(first) < 250


def test_loss_duplication_and_reordering_have_their_probability() -> None:
    messages = [tile(number) for number in range(2000)]
    radio = network(loss=0.3)
    radio.connect(0, LINE)
    radio.broadcast(0, messages, 0)
    heard = radio.deliver(1, 0)
    assert len(heard) == pytest.approx(1400, abs=4 * (2000 * 0.21) ** 0.5)
    assert heard == [message for message in messages if message in heard], "in order"
    assert radio.traffic.lost == pytest.approx(3 * 600, abs=4 * (6000 * 0.21) ** 0.5)

    radio = network(duplication=0.25)
    radio.connect(0, LINE)
    radio.broadcast(0, messages, 0)
    assert len(radio.deliver(1, 0)) == pytest.approx(2500, abs=4 * (2000 * 0.1875) ** 0.5)

    radio = network(reordering=0.5)
    radio.connect(0, LINE)
    radio.broadcast(0, messages, 0)
    heard = radio.deliver(1, 0)
    assert heard != messages
    assert sorted(message.tile_north for message in heard) == list(range(2000))


def test_faults_repeat_with_their_seed_and_receivers_differ() -> None:
    def lost(seed: int, receiver: int) -> list[ExploredTile]:
        radio = network(seed, loss=0.5)
        radio.connect(0, LINE)
        radio.broadcast(0, [tile(number) for number in range(50)], 0)
        return radio.deliver(receiver, 0)  # type: ignore[return-value]

    assert lost(0, 1) == lost(0, 1)
    assert lost(0, 1) != lost(1, 1)
    assert lost(0, 1) != lost(0, 2)


def test_a_partition_names_each_robot_once_and_takes_time() -> None:
    with pytest.raises(ValueError, match="listed twice"):
        network(partitions=[{"from_step": 0, "until_step": 4, "groups": [[2], [2]]}])
    with pytest.raises(ValueError, match="not after from_step"):
        network(partitions=[{"from_step": 4, "until_step": 4, "groups": []}])

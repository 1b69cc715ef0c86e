"""A tiny experiment, and a cluster in this process."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from distributed import Client, LocalCluster

TINY = """\
name: tiny
question: Does it run?
trials: 2
steps: 8
seed: 7
axis: radio range, m
setting:
  mission: {horizon: 4, replan_steps: 4, fence: [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]], separation_m: 0.0}
  primitives: [[1.0, 0.0], [1.0, 2.0], [1.0, -2.0]]
  sensor: {range_std_m: 0.1, bearing_std_deg: 5.0, max_range_m: 6.0, fov_deg: 120.0}
  targets: {model: double_integrator, noise: 0.001}
  estimation: {neighbour_timeout_s: 0.1}
  exploration: {cell_m: 1.0, max_landmarks: 2}
  team: {robots: 3}
  world:
    truth: {count: 4}
    budget: {nodes: 500}
arms:
  - {label: none, value: 0.0, changes: {world.radio.range_m: 0.0}}
  - {label: all, value: 30.0}
comparisons:
  - {claim: Radio helps, metric: known_by_robot, arm: all, against: none, expect: more}
"""


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.yaml"
    path.write_text(TINY, encoding="utf-8")
    return path


@pytest.fixture
def edited(tmp_path: Path) -> Callable[[str, str], Path]:
    """The tiny experiment with one piece of text replaced."""

    def edit(old: str, new: str) -> Path:
        assert TINY.count(old) == 1
        path = tmp_path / "edited.yaml"
        path.write_text(TINY.replace(old, new), encoding="utf-8")
        return path

    return edit


@pytest.fixture
def make_client() -> Iterator[Callable[[int], Client]]:
    """Clients of clusters whose workers are threads of this process."""
    made: list[tuple[LocalCluster, Client]] = []

    def make(workers: int) -> Client:
        cluster = LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0", memory_limit=0
        )
        client = Client(cluster)
        made.append((cluster, client))
        return client

    yield make
    for cluster, client in made:
        client.close()
        cluster.close()

"""Figures, snapshot and film: files that hold what they should."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from matplotlib.patches import Ellipse, Wedge
from PIL import Image

from sim_bridge.experiments import figures, report, snapshot, statistics
from sim_bridge.experiments.loader import load_experiment
from sim_bridge.experiments.records import TrialTask
from sim_bridge.experiments.store import ResultFolder
from sim_bridge.experiments.trial import build_world, run_trial
from sim_bridge.figure_files import save


def task_of(tiny: Path, arm: int = 1, trial: int = 0) -> TrialTask:
    experiment = load_experiment(tiny)
    return TrialTask(arm, trial, 11 + trial, 8, experiment.arms[arm].setting)


def test_figures_and_summary_of_a_run(tiny: Path, tmp_path: Path) -> None:
    experiment = load_experiment(tiny)
    store = ResultFolder(tmp_path / "run", experiment, 2, 8, resume=False)
    for arm in (0, 1):
        for trial in (0, 1):
            store.write(run_trial(task_of(tiny, arm, trial)))
    arms = statistics.arm_trials(store.merge(), experiment)
    summary = statistics.summarise(experiment, arms, store.machine_records())
    curves = figures.draw_curves(arms)
    assert [axes.get_title() for axes in curves.axes] == [
        "entropy per known target, nats",
        "targets known to a robot",
        "position RMSE per known target, m",
    ]
    labels = [text.get_text() for text in curves.legends[0].get_texts()]
    assert labels == ["none (2 trials)", "all (2 trials)"], "too few for a band"
    assert len(curves.axes[1].lines) == 2 * (1 + 2), "so each trial is drawn beside the mean"
    line = curves.axes[1].lines[0]
    expected = np.mean([arms[0].values["known_by_robot"][trial] for trial in (0, 1)], axis=0)
    assert np.allclose(line.get_ydata(), expected)
    for name, figure in [
        ("curves", curves),
        ("means", figures.draw_means(summary)),
        ("costs", figures.draw_costs(experiment.axis, summary)),
    ]:
        png, svg = save(figure, tmp_path / name)
        with Image.open(png) as image:
            assert min(image.size) > 100
        assert ET.parse(svg).getroot().tag.endswith("svg")
    page = report.markdown(summary)
    assert "| none | 2 |" in page
    assert "| none | 3 | 4 |" in page, "costs, by number of robots and targets"
    assert "| Radio helps | known_by_robot: all − none |" in page


def test_the_snapshot_shows_robots_plans_estimates_truth_and_landmarks(tiny: Path, tmp_path: Path) -> None:
    task = task_of(tiny)
    world = build_world(task.setting, task.seed)
    for _ in range(6):
        world.step()
    figure = figures.Figure()
    axes = figure.subplots()
    snapshot.draw_world(axes, world, task)
    known = {target for robot in world.robots for target in robot.agent.tracks}
    assert known
    assert sum(isinstance(patch, Wedge) for patch in axes.patches) == 3
    assert sum(isinstance(patch, Ellipse) for patch in axes.patches) == len(known)
    markers = [line.get_marker() for line in axes.lines]
    assert markers.count("x") == 4, "the truth"
    assert markers.count("+") == sum(robot.agent.landmark_count for robot in world.robots)
    paths = [line for line in axes.lines if len(line.get_xdata()) == 61]
    for robot, path in zip(world.robots, paths, strict=True):
        assert robot.agent.own_plan is not None
        start = robot.agent.own_plan.start
        assert (path.get_xdata()[0], path.get_ydata()[0]) == (start.east_m, start.north_m)


def test_an_ellipse_lies_along_its_covariance(tiny: Path) -> None:
    """95 % of the points drawn from the belief lie inside the ellipse."""
    task = task_of(tiny)
    world = build_world(task.setting, task.seed)
    for _ in range(6):
        world.step()
    axes = figures.Figure().subplots()
    snapshot.draw_world(axes, world, task)
    ellipses = [patch for patch in axes.patches if isinstance(patch, Ellipse)]
    tracks = [track for robot in world.robots for track in robot.agent.tracks.values()]
    target = min(track.target_id for track in tracks)
    best = min((t for t in tracks if t.target_id == target), key=lambda t: t.entropy_nats)
    points = np.random.default_rng(0).multivariate_normal(best.mean[:2], best.covariance[:2, :2], 4000)
    inside = (
        ellipses[0].get_path().contains_points(ellipses[0].get_patch_transform().inverted().transform(points[:, ::-1]))
    )
    assert abs(inside.mean() - 0.95) < 0.02


def test_snapshot_and_film_are_files(tiny: Path, tmp_path: Path) -> None:
    png, svg = snapshot.snapshot(task_of(tiny), 3, tmp_path / "moment")
    assert png.stat().st_size > 1000
    assert "step 3, 1.5 s" in svg.read_text(encoding="utf-8")
    film = snapshot.animate(task_of(tiny), tmp_path / "film", every=4)
    with Image.open(film) as image:
        assert getattr(image, "n_frames", 1) == 2


def test_the_report_says_whether_a_claim_holds() -> None:
    def row(expect: str, holds: bool | None) -> str:
        value = {"mean": 1.0, "low": 0.5, "high": 1.5}
        entry = {"claim": "c", "metric": "m", "arm": "a", "against": "b", "from_step": 100, "expect": expect}
        entry |= {"difference": value, "holds": holds}
        return report.markdown({"experiment": "e", "question": "q", "arms": [], "comparisons": [entry]}).splitlines()[
            -1
        ]

    assert row("less", True) == "| c | m from step 100: a − b | 1.000 ± 0.500 | yes |"
    assert row("less", False).endswith("| no |")
    assert row("either", True).endswith("| differs |")
    assert row("either", False).endswith("| no difference shown |")
    assert row("more", None).endswith("| too few trials |")

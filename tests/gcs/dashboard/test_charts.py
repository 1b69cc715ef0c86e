"""Charts: what is new is appended, and one that has nothing to show says so."""

import math

import pytest

from gcs.dashboard.charts import CHARTS, Charts
from gcs.dashboard.history import FlightHistory
from gcs.dashboard.view import MapBounds

T0 = 1.5e9
IDS = [1, 2, 3]


@pytest.fixture
def history(scenario):
    return FlightHistory(IDS, MapBounds(scenario))


def words(charts):
    """What blank charts say, by name."""
    said = {}
    for name, plot in charts.figures.items():
        for renderer in plot.renderers:
            if "words" in renderer.data_source.data:
                said[name] = "".join(renderer.data_source.data["words"])
    return {name: text for name, text in said.items() if text}


def test_a_chart_without_values_says_so_until_it_has_one(history, fake_team, scenario, make_team):
    silent = make_team(scenario)
    history.add(silent.monitor.state(T0))
    charts = Charts(history, IDS, 5, truth_known=True)
    assert words(charts) == dict.fromkeys(set(CHARTS) - {"found"}, "nothing yet")
    history.add(fake_team.monitor.state(T0 + 1.0))
    charts.refresh()
    assert set(words(charts)) == {"loss", "entropy", "rmse"}, "one moment tells no loss, and no step is complete"


def test_before_the_first_sample_there_are_finite_axes(history):
    charts = Charts(history, IDS, None, truth_known=False)
    assert set(words(charts)) == set(CHARTS)
    assert words(charts)["rmse"] == "truth unknown"
    for plot in charts.figures.values():
        (blank,) = [r.data_source.data for r in plot.renderers if "words" in r.data_source.data]
        assert all(math.isfinite(value) for value in (*blank["time"], *blank["value"]))
        assert blank["time"][0] < blank["time"][-1]


def test_after_a_restart_what_has_no_value_any_more_is_blank_again(history, fake_team, scenario, make_team):
    history.add(fake_team.monitor.state(T0))
    charts = Charts(history, IDS, 5, truth_known=True)
    assert "cost" not in words(charts)
    history.restart()
    history.add(make_team(scenario).monitor.state(T0))
    charts.refresh()
    assert words(charts)["cost"] == "nothing yet"

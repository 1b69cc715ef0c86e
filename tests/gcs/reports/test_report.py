"""Reports: pages that need nothing but themselves, with figures that show the flight."""

import base64
import csv
import re
import shutil
from html.parser import HTMLParser
from io import BytesIO

import pytest
from PIL import Image
from typer.testing import CliRunner

from gcs.cli import app
from gcs.errors import GroundError
from gcs.recording.reader import open_recording
from gcs.reports.compare import write_comparison
from gcs.reports.figures import FIGURES
from gcs.reports.flight_series import read_series
from gcs.reports.report import write_report


class Parts(HTMLParser):
    """What a browser would load, and what it would show."""

    def __init__(self, html):
        super().__init__()
        self.links = []
        self.images = []
        self.text = []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("src", "href", "srcset", "action", "data", "poster"):
                (self.images if tag == "img" else self.links).append(value)

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def series(flown):
    return read_series(open_recording(flown.folder))


def check_page(path, names):
    """Self-contained, with one picture for each name, which is no empty one; its text."""
    html = path.read_text(encoding="utf-8")
    parts = Parts(html)
    assert parts.links == ["data:,"]
    assert not re.search(r"https?:|//\w+\.\w+|@import|url\(", re.sub(r"base64,[A-Za-z0-9+/=]+", "", html))
    assert len(parts.images) == len(names)
    for source in parts.images:
        picture = Image.open(BytesIO(base64.b64decode(source.removeprefix("data:image/png;base64,")))).convert("RGB")
        assert picture.width >= 1000
        assert len(picture.getcolors(1 << 24)) > 20
    folder = path.with_name(f"{path.stem}-figures")
    files = {file.name for file in folder.iterdir() if file.suffix != ".csv"}
    assert files == {f"{name}.{kind}" for name in names for kind in ("png", "svg")}
    for name in names:
        assert (folder / f"{name}.svg").read_text().count("<path") > 5
    return " ".join(" ".join(parts.text).split())


def test_a_report_shows_the_flight_and_asks_nobody(series, flown, tmp_path):
    write_report(series, tmp_path / "new" / "report.html")
    text = check_page(tmp_path / "new" / "report.html", list(FIGURES))
    assert f"{flown.summary['discovered']} of 5" in text
    assert f"{flown.summary['rmse_m']:.2f} m" in text
    for event in flown.events:
        assert " ".join(event.text.split()) in text
    assert "seed 3" in text
    assert "step_s: 0.5" in text, "the configuration"
    assert text.count("landed, disarmed") == 3


def test_numbers_of_the_figures_come_along(series, flown, tmp_path):
    folder = write_report(series, tmp_path / "report.html")
    rows, plans = (
        list(csv.DictReader((folder / f"{name}.csv").read_text().splitlines())) for name in ("series", "plans")
    )
    assert [float(row["time_s"]) for row in rows] == pytest.approx(series.times_s, abs=1e-6)
    assert float(rows[-1]["targets_found"]) == flown.summary["discovered"]
    assert {row["vehicle2_state"] for row in rows} >= {"TAKEOFF", "TRACK", "LANDED"}
    assert rows[0]["rmse_m"] == "", "nothing is known yet"
    live = {round(state.time_s - series.zero_s, 1): state for state in flown.states}
    row = next(row for row in rows if float(row["time_s"]) > 4.0)
    state = live[round(float(row["time_s"]), 1)]
    assert float(row["vehicle2_north_m"]) == pytest.approx(state.vehicle(2).north_m, abs=0.3)
    assert float(row["explored_share"]) == pytest.approx(state.explored.share, abs=0.02)
    for vehicle in flown.summary["vehicles"]:
        assert sum(row["vehicle"] == str(vehicle["id"]) for row in plans) == vehicle["plans"]


def test_what_came_over_a_radio_stays_text(series, tmp_path):
    series.events.append(series.events[0].__class__(series.zero_s, 4, "vehicle 1", "<script>alert(1)</script>"))
    write_report(series, tmp_path / "report.html")
    series.events.pop()
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script" not in html
    assert "&lt;script&gt;" in html


def test_flights_are_laid_over_each_other(series, flown, tmp_path):
    copy = tmp_path / "another"
    shutil.copytree(flown.folder, copy)
    flights = [series, read_series(open_recording(copy))]
    write_comparison(flights, tmp_path / "comparison.html")
    text = check_page(
        tmp_path / "comparison.html", ["discovery", "entropy", "rmse", "explored", "planning", "tracking"]
    )
    assert "2 flights compared" in text
    assert text.count(f"{flown.summary['rmse_m']:.2f} m") == 2
    assert flown.folder.name in text
    assert "another" in text


def test_a_place_that_cannot_be_written_is_named(series, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(GroundError, match="cannot be written"):
        write_report(series, tmp_path / "file" / "report.html")


def test_the_commands_say_where_the_pages_are_and_what_is_wrong(flown, tmp_path):
    folder = tmp_path / "flight"
    shutil.copytree(flown.folder, folder)
    result = CliRunner().invoke(app, ["report", str(folder)])
    assert (result.exit_code, result.stderr) == (0, "")
    assert str(folder / "report.html") in result.stdout
    check_page(folder / "report.html", list(FIGURES))
    result = CliRunner().invoke(app, ["report", str(tmp_path), "-o", str(tmp_path / "latest.html")])
    assert result.exit_code == 0
    assert f"Flight of {flown.scenario.name}" in (tmp_path / "latest.html").read_text()
    (empty := tmp_path / "empty").mkdir()
    for command in (("report", empty), ("replay", empty), ("compare", folder, tmp_path), ("compare", folder)):
        result = CliRunner().invoke(app, [*map(str, command)])
        assert result.exit_code == 2
        assert "recording" in result.stderr

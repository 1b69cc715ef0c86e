"""A replay in a real browser: it plays by itself, pauses, and goes where one clicks on the slider."""

import shutil
import time

import pytest

from gcs.dashboard.board import DashboardFeed
from gcs.dashboard.player_bar import PlayerBar
from gcs.dashboard.replay_board import ReplayBoard
from gcs.dashboard.server import find_port, serve_dashboard
from gcs.operator_desk import OperatorDesk
from gcs.recording.player import Player
from gcs.recording.reader import open_recording

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here: apt-get install chromium")


def test_play_pause_and_seek(flown):
    recording = open_recording(flown.folder)
    feed = DashboardFeed(OperatorDesk())
    address = find_port("127.0.0.1", 5700)
    player = Player(recording, speed=0.5)
    wrong: list[str] = []
    asked: list[str] = []
    with (
        serve_dashboard(
            recording.scenario, feed, address, lambda _, feed: ReplayBoard(feed, player), lambda: PlayerBar(player)
        ),
        playwright.sync_playwright() as driver,
    ):
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(address.url)
        page.get_by_text("replay:").wait_for()
        assert page.locator("#orders").get_by_role("button", name="Land").count() == 0, "nobody to command"
        wait_until(lambda: player.position_s > 0.5)
        page.locator("#orders").get_by_role("button", name="Pause").click()
        wait_until(lambda: not player.playing)
        paused_s = player.position_s
        shown_s = "Bokeh.documents[0].get_model_by_name('position').value"
        wait_until(lambda: page.evaluate(shown_s) == pytest.approx(paused_s, abs=0.06))
        track = page.locator("#orders .noUi-base").bounding_box()
        page.mouse.click(track["x"] + 0.6 * track["width"], track["y"] + 0.5 * track["height"])
        wait_until(lambda: player.position_s == pytest.approx(0.6 * player.duration_s, rel=0.05))
        assert player.position_s > paused_s
        page.get_by_text("target 1 found by").or_(page.get_by_text("found by vehicle")).first.wait_for()
        seconds = int(player.position_s)
        page.get_by_text(f"0:{seconds:02d} / ").wait_for()
        page.locator("#orders").get_by_role("button", name="Play").click()
        there_s = player.position_s
        wait_until(lambda: player.position_s > there_s + 0.5)
        browser.close()
    assert wrong == []
    own = (address.url, "data:", "blob:")
    assert [url for url in asked if not url.startswith(own)] == []


def wait_until(condition, limit_s=30.0):
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    assert condition()

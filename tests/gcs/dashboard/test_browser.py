"""The dashboard in a real browser: Chromium, driven by playwright, against a team of the test's own.

Where there is no Chromium these tests are skipped; `.ci/run` installs one.
"""

import shutil
import threading
import time
from dataclasses import dataclass, field

import pytest

from gcs.commands import ONBOARD
from gcs.dashboard.board import Board, DashboardFeed
from gcs.dashboard.server import Address, find_port, serve_dashboard
from gcs.mission import Phase
from gcs.operator_desk import Action, OperatorDesk, Way, command_for
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import CommandOutcome

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here: apt-get install chromium")

PATIENCE_MS = 15_000


@dataclass
class Flight:
    """A team that speaks ten times a second to a dashboard, and obeys."""

    team: object
    desk: OperatorDesk
    feed: DashboardFeed
    address: Address
    orders: list = field(default_factory=list)
    result: int | None = 0
    over: threading.Event = field(default_factory=threading.Event)
    phase: Phase = Phase.FLYING
    stopped: bool = False
    server_stopped: bool = False

    def fly(self) -> None:
        while not self.over.wait(0.1):
            now_s = time.time()
            if self.stopped:
                continue
            # Beliefs and plans hold at steps of 0.5 s.
            self.team.speak(now_s - now_s % 0.5 if now_s % 0.5 < 0.1 else now_s, targets=5)
            state = self.team.monitor.state(now_s)
            for order in self.desk.take():
                self.orders.append(order)
                for vehicle in state.vehicles:
                    if vehicle.id in order.vehicles:
                        command = command_for(order.action, vehicle, now_s)
                        target = (command.target_system, command.target_component)
                        way = Way.ONBOARD if command.target_component == ONBOARD else Way.DIRECT
                        self.desk.opened(order.action, vehicle.id, (way,), now_s)
                        self.desk.ended(CommandOutcome(command.command, target, self.result), now_s)
            self.team.monitor.advance(now_s)
            for event in self.team.monitor.take_events():
                self.feed.event(event)
            self.feed.show(state, self.phase.value, None)


@pytest.fixture
def flight(scenario, make_team):
    desk = OperatorDesk()
    feed = DashboardFeed(desk)
    address = find_port("127.0.0.1", 5300)
    flight = Flight(make_team(scenario), desk, feed, address)

    class StoppableBoard(Board):
        def refresh(self) -> None:
            while flight.server_stopped:
                time.sleep(0.1)
            super().refresh()

    with serve_dashboard(scenario, feed, address, StoppableBoard):
        thread = threading.Thread(target=flight.fly)
        thread.start()
        yield flight
        flight.over.set()
        thread.join()


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def page(browser, flight):
    """An open dashboard; at the end, nothing may have gone wrong in the browser or been asked of anybody else."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.set_default_timeout(PATIENCE_MS)
    wrong: list[str] = []
    asked: list[str] = []
    page.on("console", lambda message: wrong.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("requestfailed", lambda request: wrong.append(f"failed: {request.url}"))
    page.on("request", lambda request: asked.append(request.url))
    page.on("websocket", lambda socket: asked.append(socket.url))
    page.goto(flight.address.url)
    page.locator("tr[data-vehicle='3']").wait_for()
    yield page
    page.close()
    assert wrong == []
    own = (flight.address.url, flight.address.url.replace("http", "ws"), "data:", "blob:")
    assert [url for url in asked if not url.startswith(own)] == []


def source(page, column, layer):
    """A column of the layer whose source has these columns, as the browser holds it."""
    return page.evaluate(
        """([column, layer]) => {
            for (const model of Bokeh.documents[0].all_models) {
                if (model.type === "ColumnDataSource" && layer.every((name) => name in model.data))
                    return Array.from(model.data[column]);
            }
        }""",
        [column, layer],
    )


def wait_until(condition, limit_s=10.0):
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(0.1)
    assert condition()


def test_the_map_shows_all_vehicles_and_targets_and_follows_them(page, flight):
    wait_until(lambda: source(page, "label", ["fov_from"]) == ["1", "2", "3"])
    wait_until(lambda: source(page, "label", ["spread"]) == ["1", "2", "3", "4", "5"])
    assert source(page, "label", ["error", "place", "label"]) == ["1", "2", "3", "4", "5"]
    flight.team.places[2] = (2.5, 6.25)
    wait_until(lambda: source(page, "x", ["fov_from"])[1] == 6.25, 1.5)


def point(page, row):
    """Where a vehicle's mark is on the screen, px."""
    return page.evaluate(
        """(row) => {
            const map = Bokeh.documents[0].roots().find((root) => root.name === "map");
            const view = Bokeh.index.find_one(map), box = view.el.getBoundingClientRect();
            const source = Array.from(Bokeh.documents[0].all_models).find((m) => m.data && "fov_from" in m.data);
            const [x, y] = [source.data.x[row], source.data.y[row]];
            return [box.x + view.frame.x_scale.compute(x), box.y + view.frame.y_scale.compute(y)];
        }""",
        row,
    )


def test_hovering_gives_numbers_with_units(page, flight):
    wait_until(lambda: source(page, "label", ["fov_from"]) == ["1", "2", "3"])
    page.mouse.move(*point(page, 1))
    page.get_by_text("2.00 m N, 3.00 m E").first.wait_for()
    page.get_by_text("m/s, heading").first.wait_for()


def test_metres_north_and_east_are_equally_long(page):
    per_metre = page.evaluate(
        """() => {
            const map = Bokeh.documents[0].roots().find((root) => root.name === "map");
            return [map.inner_width / (map.x_range.end - map.x_range.start),
                    map.inner_height / (map.y_range.end - map.y_range.start)];
        }"""
    )
    assert per_metre[0] == pytest.approx(per_metre[1], rel=0.01)


def test_the_table_moves_on_and_a_dead_vehicle_turns_red_within_five_seconds(page, flight):
    row = page.locator("tr[data-vehicle='2']")
    assert "TRACK" in row.inner_text()
    assert page.locator("tr.silent").count() == 0
    died = time.monotonic()
    flight.team.dead.add(2)
    page.locator("tr.silent[data-vehicle='2']").wait_for()
    assert time.monotonic() - died < 5.0
    assert "SILENT" in row.inner_text()
    assert page.locator("tr.silent").count() == 1
    page.get_by_text("vehicle 2 silent").wait_for()
    assert page.title().startswith("vehicle 2 silent")
    flight.team.dead.clear()
    page.locator("tr[data-vehicle='2']:not(.silent)").wait_for()


def test_what_is_old_is_said_to_be_old_whoever_stopped(page, flight):
    """The flight's side behind a server that lives, then the whole ground station, as with SIGSTOP."""
    late = page.get_by_text("s behind: what you see is old")
    flight.stopped = True
    late.wait_for()
    flight.stopped = False
    late.wait_for(state="hidden")
    stale = page.get_by_text("Nothing has come from the ground station for")
    assert not stale.is_visible()
    flight.server_stopped = True
    stale.wait_for()
    flight.server_stopped = False
    stale.wait_for(state="hidden")


def test_the_end_of_a_flight_is_no_lost_connection(page, flight):
    lost = page.locator("#lost")
    assert "The vehicles fly on without it" in lost.text_content()
    assert page.title() == "flying · lab · ARVI"
    flight.phase = Phase.DONE
    wait_until(lambda: "The flight is over" in lost.text_content())
    assert page.title() == "on the ground · lab · ARVI"


def test_a_reload_in_flight_recovers_with_its_history(page, flight):
    wait_until(lambda: len(source(page, "time", ["entropy", "time"])) >= 6)
    page.reload()
    page.locator("tr[data-vehicle='3']").wait_for()
    wait_until(lambda: len(source(page, "time", ["entropy", "time"])) >= 6)
    assert page.get_by_text("target 5 known already to vehicle 1").count() == 1


def test_an_order_needs_a_confirmation_and_shows_its_end(page, flight):
    page.get_by_role("button", name="Pause", exact=True).click()
    page.get_by_text("Pause all 3 vehicles?").wait_for()
    page.get_by_role("button", name="Cancel").click()
    page.get_by_role("button", name="Cancel").wait_for(state="hidden")
    assert flight.orders == []
    page.locator("#orders").get_by_role("combobox").select_option(label="vehicle 2")
    page.get_by_role("button", name="Land", exact=True).click()
    page.get_by_role("button", name="Confirm land").click()
    page.get_by_text("acknowledged").wait_for()
    assert [(order.action, order.vehicles) for order in flight.orders] == [(Action.LAND, (2,))]


def test_the_emergency_stop_is_armed_then_confirmed_within_seconds(page, flight):
    stop, off = page.get_by_role("button", name="Emergency stop"), page.get_by_role("button", name="MOTORS OFF")
    stop.click()
    page.get_by_text("what flies falls").wait_for()
    off.wait_for(state="hidden", timeout=8_000)  # nobody confirmed: it is disarmed again
    assert flight.orders == []
    stop.click()
    off.click()
    page.get_by_text("Emergency stop vehicles 1, 2, 3").wait_for()
    assert [(order.action, order.vehicles) for order in flight.orders] == [(Action.STOP, (1, 2, 3))]


@pytest.mark.parametrize("size", [(1280, 720), (1024, 768)])
def test_a_question_moves_nothing_and_its_answers_are_in_sight(page, size):
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    bar = page.locator("#orders")
    before = bar.bounding_box()
    page.get_by_role("button", name="Emergency stop").click()
    off = page.get_by_role("button", name="MOTORS OFF")
    off.wait_for()
    box = off.bounding_box()
    assert 0 <= box["x"] < box["x"] + box["width"] <= size[0]
    assert bar.bounding_box() == before


def test_a_refusal_and_a_silence_are_shown(page, flight):
    for result, words in ((mavlink.MAV_RESULT_DENIED, "refused: denied"), (None, "timed out: no answer")):
        flight.result = result
        page.get_by_role("button", name="Resume", exact=True).click()
        page.get_by_role("button", name="Confirm resume").click()
        page.get_by_text(words).first.wait_for()


def test_absurd_telemetry_breaks_nothing(page, flight):
    flight.team.places = {1: (1e9, -1e9), 2: (float("nan"), float("nan")), 3: (float("inf"), 0.0)}
    page.get_by_text("is absurd").wait_for()
    wait_until(lambda: source(page, "label", ["fov_from"]) == [])
    flight.team.places = {}
    wait_until(lambda: source(page, "label", ["fov_from"]) == ["1", "2", "3"])


def test_the_theme_is_switched_and_remembered(page):
    theme = "document.documentElement.dataset.theme"
    assert page.evaluate(theme) == "light"
    page.get_by_role("button", name="Dark").click()
    page.wait_for_function(f"{theme} === 'dark'")
    page.reload()
    page.locator("tr[data-vehicle='1']").wait_for()
    assert page.evaluate(theme) == "dark"


def test_events_are_searched(page):
    page.get_by_text("target 5 known already to vehicle 1").wait_for()
    page.get_by_placeholder("search events").fill("target 3")
    page.get_by_text("target 5 known already to vehicle 1").wait_for(state="hidden")
    assert page.get_by_text("target 3 known already to vehicle 1").count() == 1

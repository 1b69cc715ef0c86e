"""Where the dashboard is served, when it is started, and that its end is not the flight's."""

import io
import socket
import urllib.request

import pytest
from rich.console import Console

from gcs.dashboard.board import Board, DashboardFeed
from gcs.dashboard.server import Address, find_port
from gcs.dashboard.start import BothDisplays, DashboardOptions, open_dashboard
from gcs.errors import GroundError
from gcs.operator_desk import Action, OperatorDesk, Order
from gcs.team import Event

T0 = 1.5e9
HOST = "127.0.0.1"


@pytest.fixture
def taken():
    """A TCP port that somebody listens on."""
    with socket.socket() as listener:
        listener.bind((HOST, 0))
        listener.listen()
        yield listener.getsockname()[1]


def test_a_port_in_use_gives_way_to_the_next_free_one(taken):
    address = find_port(HOST, taken)
    assert address.port > taken
    assert address.url == f"http://{HOST}:{address.port}/"


def test_an_address_of_another_machine_is_refused():
    with pytest.raises(GroundError, match=r"192\.0\.2\.1"):
        find_port("192.0.2.1", 5006)


@pytest.mark.parametrize(
    ("host", "alone"), [(HOST, True), ("localhost", True), ("0.0.0.0", False), ("10.1.2.3", False)]
)
def test_who_can_reach_an_address(host, alone):
    assert Address(host, 5006).loopback_only is alone


@pytest.mark.parametrize(
    ("wanted", "headless", "served"),
    [(None, False, True), (None, True, False), (True, True, True), (False, False, False)],
)
def test_headless_serves_none_unless_asked(scenario, taken, wanted, headless, served):
    console = Console(file=io.StringIO(), width=200)
    options = DashboardOptions(wanted, HOST, taken)
    with open_dashboard(options, scenario, OperatorDesk(), console, headless=headless) as dashboard:
        assert (dashboard is not None) is served
        if dashboard is not None:
            with urllib.request.urlopen(dashboard.url, timeout=20.0) as answer:
                text = answer.read().decode()
            assert f"{scenario.name} · ARVI" in text
            assert "https://cdn" not in text, "nothing comes from the internet"
            assert f"{dashboard.url} (TCP port {taken} is in use)" in console.file.getvalue()
    if dashboard is not None:
        with pytest.raises(OSError, match="refused"):
            urllib.request.urlopen(dashboard.url, timeout=5.0)


class Recorded:
    def __init__(self):
        self.shown, self.events = 0, []

    def show(self, team, phase, time_left_s):
        self.shown += 1

    def event(self, event):
        self.events.append(event)


def test_a_dashboard_that_fails_is_told_once_and_the_flight_goes_on(fake_team):
    terminal, feed = Recorded(), DashboardFeed(OperatorDesk())
    both = BothDisplays(terminal, feed)
    team = fake_team.monitor.state(T0)
    both.show(team, "flying", None)
    feed.failure = "OSError: gone"
    for _ in range(3):
        both.show(team, "flying", None)
    assert terminal.shown == 4
    assert [event.text for event in terminal.events] == ["it ended, the flight goes on: OSError: gone"]


def test_the_board_takes_each_moment_and_event_once(scenario, fake_team):
    desk = OperatorDesk()
    feed = DashboardFeed(desk)
    board = Board(scenario, feed)
    board.refresh()
    assert board.moment is None
    assert board.estimates(None) == {}
    feed.event(Event(T0, 6, "team", "hello"))
    feed.show(fake_team.monitor.state(T0 + 0.5), "flying", 3.0)
    for _ in range(3):
        board.refresh()
    assert (board.events.serial, board.history.serial, board.moment.phase) == (1, 1, "flying")
    assert board.estimates(1)["label"] == ["1", "2"]
    assert board.estimates(1) is board.estimates(1), "worked out once for all pages"
    feed.order(Order(Action.PAUSE, (1,)))
    assert [order.action for order in desk.take()] == [Action.PAUSE]


def test_a_page_asks_for_the_theme_that_a_browser_remembers(scenario):
    from bokeh.document import Document

    from gcs.dashboard.page import build_page

    board = Board(scenario, DashboardFeed(OperatorDesk()))
    themes = [build_page(Document(), board, name).theme.name for name in ("dark", "light", None, "<b>")]
    assert themes == ["dark", "light", "light", "light"]

"""A dashboard that other machines reach lets in who has its token, and nobody else, by page or by WebSocket."""

import http.client
import io
import re
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from rich.console import Console

from gcs.dashboard.start import DashboardOptions, open_dashboard
from gcs.operator_desk import OperatorDesk
from onboard.config import load_scenario

LAB = Path(__file__).parents[3] / "configs" / "lab.yaml"
WEBSOCKET = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Protocol": "bokeh, nonsense",
}


@pytest.fixture(scope="module")
def printed():
    """What the terminal shows of a dashboard on all interfaces."""
    console = Console(file=io.StringIO(), width=200)
    with open_dashboard(
        DashboardOptions(True, "0.0.0.0", 5800), load_scenario(LAB), OperatorDesk(), console, headless=True
    ) as served:
        assert "token" not in served.url, "what stands in titles and recordings does not open the door"
        yield console.file.getvalue()


def get(printed, path, **headers):
    entrance = urlsplit(re.search(r"http://\S+", printed).group())
    connection = http.client.HTTPConnection("127.0.0.1", entrance.port, timeout=20.0)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read().decode() if answer.status != 101 else ""
    connection.close()
    return answer, body, entrance.query


def test_the_address_is_printed_with_the_token_once(printed):
    assert len(re.findall(r"\?token=[\w-]{32}\b", printed)) == 1


@pytest.mark.parametrize(
    "path", ["/", "/ws", "/metadata", "/autoload.js?bokeh-autoload-element=x", "/?token=", "/?token=guess"]
)
def test_without_the_token_there_is_a_readable_403(printed, path):
    answer, body, query = get(printed, path, **(WEBSOCKET if path == "/ws" else {}))
    assert answer.status == 403
    assert "Open the address that" in body
    assert query.removeprefix("token=") not in body


def test_the_token_opens_page_and_websocket_by_a_cookie_that_the_page_does_not_know(printed):
    _, _, query = get(printed, "/")
    answer, _, _ = get(printed, f"/?theme=dark&{query}")
    assert (answer.status, answer.headers["Location"]) == (302, "/?theme=dark")
    cookie = answer.headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    cookie = cookie.split(";")[0]
    answer, body, _ = get(printed, "/?theme=dark", Cookie=cookie)
    assert answer.status == 200
    assert "lab · ARVI" in body
    assert query.removeprefix("token=") not in body
    host = {"Origin": "http://127.0.0.1:" + re.search(r":(\d+)/", printed).group(1)}
    assert get(printed, "/ws", Cookie=cookie, **host, **WEBSOCKET)[0].status == 101
    assert get(printed, "/ws", Cookie=cookie[:-1] + "é", **host, **WEBSOCKET)[0].status == 403
    assert get(printed, "/ws", Cookie=cookie, Origin="http://elsewhere.example", **WEBSOCKET)[0].status == 403

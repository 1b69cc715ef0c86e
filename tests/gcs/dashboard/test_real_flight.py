"""The dashboard of a real `arvi fly`: up before takeoff, its buttons reach the vehicles, a killed process turns red."""

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import yaml

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here: apt-get install chromium"),
]


class Fly:
    """``arvi fly`` in a process of its own, and what it has printed."""

    def __init__(self, config: Path) -> None:
        self.config = config
        command = [
            *(sys.executable, "-m", "gcs", "fly", str(config), "--headless", "--dashboard", "--duration", "120"),
            *("--record", str(config.parent / "flights")),
        ]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self.process.stdout:
            self.lines.append(line)

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(30.0)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self._reader.join(5.0)
        self.process.stdout.close()

    def url(self) -> str:
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            for line in list(self.lines):
                found = re.match(r"dashboard: (http\S+)", line)
                if found:
                    return found.group(1)
            time.sleep(0.1)
        raise AssertionError("no address printed:\n" + "".join(self.lines))

    def onboard_pid(self, vehicle_id: int) -> int:
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    arguments = (entry / "cmdline").read_text().split("\0")
                except OSError:
                    continue  # it ended while we looked
                if str(self.config) in arguments and arguments[-3:-1] == ["--vehicle", str(vehicle_id)]:
                    return int(entry.name)
        raise AssertionError(f"no onboard process of vehicle {vehicle_id}")


@pytest.fixture
def fly(own_ports):
    data = yaml.safe_load(own_ports.read_text(encoding="utf-8"))
    data["mission"]["takeoff_time_s"] = 10.0
    own_ports.write_text(yaml.safe_dump(data), encoding="utf-8")
    flight = Fly(own_ports)
    yield flight
    flight.end()


def order(page, button, vehicle):
    page.locator("#orders").get_by_role("combobox").select_option(label=f"vehicle {vehicle}")
    page.get_by_role("button", name=button, exact=True).click()
    page.get_by_role("button", name=f"Confirm {button.lower()}").click()


def labels(page, *columns):
    """Labels of the map's layer whose source has these columns and fewest others, as the browser holds it."""
    return page.evaluate(
        """(columns) => Bokeh.documents[0].all_models.size && Array.from(Bokeh.documents[0].all_models)
            .filter((m) => m.type === "ColumnDataSource" && columns.every((name) => name in m.data))
            .sort((a, b) => Object.keys(a.data).length - Object.keys(b.data).length)
            .map((m) => Array.from(m.data.label))[0]""",
        list(columns),
    )


def wait_until(condition, limit_s):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.2)


def test_buttons_change_modes_and_a_killed_process_is_landed_past(fly):
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        wrong: list[str] = []
        asked: list[str] = []
        page.on("console", lambda message: wrong.append(message.text) if message.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        url = fly.url()
        page.goto(url)
        first, second = (page.locator(f"tr[data-vehicle='{i}']") for i in (1, 2))
        first.wait_for(timeout=60_000)
        for row in (first, second):
            row.filter(has_text="TRACK").wait_for(timeout=60_000)
        said = [re.search("dashboard: http|-> ARM", line) for line in list(fly.lines)]
        assert next(filter(None, said)).group().startswith("dashboard"), "it is up before anybody arms"
        assert labels(page, "fov_from") == ["1", "2"]
        wait_until(lambda: labels(page, "error", "place", "label") == ["1", "2", "3", "4", "5"], 30.0)

        order(page, "Pause", "1")
        first.filter(has_text="HOLD").wait_for(timeout=30_000)
        order(page, "Resume", "1")
        first.filter(has_text="TRACK").wait_for(timeout=30_000)
        page.locator("p.acknowledged").filter(has_text="Resume vehicle 1 (onboard process)").wait_for(timeout=30_000)

        page.reload()
        first.filter(has_text="TRACK").wait_for(timeout=30_000)
        page.locator("p.acknowledged").filter(has_text="Resume vehicle 1").wait_for(timeout=30_000)

        order(page, "Hold", "1")
        page.locator("p.acknowledged").filter(has_text="Hold vehicle 1 (autopilot, MAVSDK)").wait_for(timeout=30_000)
        first.filter(has_text=re.compile(r"RELEASED\s*LOITER\s*armed")).wait_for(timeout=30_000)
        order(page, "Resume", "1")  # it has let go, and says so
        page.locator("p.refused").filter(has_text="refused: state is RELEASED").wait_for(timeout=30_000)

        os.kill(fly.onboard_pid(2), signal.SIGKILL)
        killed = time.monotonic()
        page.locator("tr.silent[data-vehicle='2']").wait_for(timeout=30_000)
        assert time.monotonic() - killed < 5.0
        order(page, "Land", "2")
        page.locator("p.acknowledged").filter(has_text="Land vehicle 2 (autopilot, MAVSDK)").wait_for(timeout=30_000)
        second.filter(has_text=re.compile(r"SILENT\s*LAND")).wait_for(timeout=30_000)

        page.locator("#orders").get_by_role("combobox").select_option(label="vehicle 1")
        page.get_by_role("button", name="Emergency stop").click()
        page.get_by_role("button", name="MOTORS OFF").click()
        page.locator("p.acknowledged").filter(has_text="Emergency stop vehicle 1").wait_for(timeout=30_000)
        first.filter(has_text=re.compile(r"LOITER\s*no")).wait_for(timeout=30_000)
        assert wrong == []
        own = (url, url.replace("http", "ws"), "data:", "blob:")
        assert [request for request in asked if not request.startswith(own)] == []
        browser.close()

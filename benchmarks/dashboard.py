"""The dashboard with a synthetic team: the server's share of a core, and the delay from a message to the browser.

A process sends what vehicles send, over UDP, at their rates; `arvi gcs` serves the page; Chromium shows it. The first
vehicle's east coordinate is the time at which it was sent, so the browser knows how old what it shows is.

    python benchmarks/dashboard.py --vehicles 20 --targets 50 --seconds 30
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml
from playwright.sync_api import sync_playwright

from onboard.config import load_scenario
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.team_messages import primitives_checksum

PERIOD_S = 100.0
"""The stamp's: east = (time mod 100 s) / 10, in m; the page rounds to millimetres, 10 ms."""

WATCH = """
() => {
  window.ages = [];
  window.updates = 0;
  for (const model of Bokeh.documents[0].all_models) {
    if (model.type === "Spinner") model.properties.tags.change.connect(() => { window.updates += 1; });
    if (model.type === "ColumnDataSource" && "fov_from" in model.data) {
      let last = null;
      model.properties.data.change.connect(() => {
        const at = model.data.label.indexOf("1"), x = model.data.x[at];
        if (at < 0 || x === last) return;
        last = x;
        window.ages.push(((Date.now() / 1e3) % 100 - 10 * x + 100) % 100);
      });
    }
  }
}
"""


def write_scenario(folder: Path, vehicles: int, targets: int, port: int) -> Path:
    """A hundred metres square; hardware as far as the ground station knows, but for the truth of the targets."""
    side = math.ceil(math.sqrt(vehicles))
    data = {
        "name": "synthetic",
        "mission": {"fence": [[0, 0], [100, 0], [100, 100], [0, 100]]},
        "primitives": [[1.0, 0.0], [1.0, 1.0], [1.0, -1.0]],
        "sensor": {"range_std_m": 0.3, "bearing_std_deg": 5.0, "max_range_m": 10.0, "fov_deg": 94.0},
        "targets": {"model": "double_integrator", "noise": 0.1},
        "exploration": {"cell_m": 1.0},
        "vehicles": [
            {"id": i + 1, "home": [5.0 + 90.0 * (i // side) / side, 5.0 + 90.0 * (i % side) / side], "layer_m": 2.0}
            for i in range(vehicles)
        ],
        "ground": {"url": f"udpin:127.0.0.1:{port}"},
        "simulation": {"ground_robots": {"count": targets}},
    }
    path = folder / "synthetic.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


class Team:
    """Says what a flying team says: rates as measured on PX4 and as the onboard processes have them."""

    def __init__(self, config: Path, targets: int) -> None:
        self.scenario = load_scenario(config)
        self.targets = targets
        self.checksum = primitives_checksum(self.scenario.primitive_set)
        host, port = self.scenario.ground.url.split(":")[1:]
        self.ground = (host, int(port))
        self.sockets = {}
        self.codecs = {}
        for vehicle in (*self.scenario.vehicles, None):
            for component in (1, 191) if vehicle is not None else (1,):
                key = (vehicle.id if vehicle is not None else self.scenario.simulation.system_id, component)
                self.sockets[key] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                self.codecs[key] = Codec(*key)
        self.bytes = 0
        self.frames = 0

    def say(self, system: int, component: int, message: mavlink.MAVLink_message) -> None:
        """Send a message as a component."""
        frame = self.codecs[system, component].encode(message)
        self.sockets[system, component].sendto(frame, self.ground)
        self.bytes += len(frame)
        self.frames += 1

    def place(self, i: int, now_s: float) -> tuple[float, float]:
        """North m, east m of a vehicle."""
        north, east = self.scenario.vehicles[i].home
        if i == 0:
            return north, (now_s % PERIOD_S) / 10.0
        return north + 4.0 * math.sin(0.2 * now_s + i), east + 4.0 * math.cos(0.2 * now_s + i)

    def autopilots(self, now_s: float) -> None:
        """At 10 Hz."""
        for i, vehicle in enumerate(self.scenario.vehicles):
            attitude = mavlink.MAVLink_attitude_message(0, 0.0, 0.0, (0.2 * now_s + i) % 6.28 - 3.14, 0.0, 0.0, 0.0)
            self.say(vehicle.id, 1, attitude)
            place = self.place(i, time.time())
            self.say(vehicle.id, 1, mavlink.MAVLink_local_position_ned_message(0, *place, -1.5, 0.6, 0.8, 0.0))

    def heartbeats(self) -> None:
        """At 1 Hz."""
        for vehicle in self.scenario.vehicles:
            self.say(vehicle.id, 1, mavlink.MAVLink_heartbeat_message(2, 12, 128, 0x00060000, 4, 3))
            self.say(vehicle.id, 191, mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
            self.say(vehicle.id, 1, mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_IN_AIR))

    def step(self, now_s: float, start_s: float) -> None:
        """At 2 Hz: status and beliefs of every robot, truth; plans and landmarks at 1 Hz."""
        usec = round(now_s * 1e6)
        ids = [vehicle.id for vehicle in self.scenario.vehicles]
        for i, vehicle in enumerate(ids):
            time.sleep(0.001)  # their clocks agree, but their ticks at 50 Hz do not
            others = [other for other in ids if other != vehicle][:32]
            spare = 32 - len(others)
            place = self.place(i, now_s)
            status = mavlink.MAVLink_planner_status_message(
                usec, round(start_s * 1e6), *place, -1.5, 0.5, 0.1, 0.4, 0.02, 100, 9, 0, 0, 0, 5, 0,
                [*others, *[0] * spare], FlightState.TRACK, len(ids), i, self.targets, 4, 0,
                [(vehicle * other) % 30 for other in others] + [255] * spare,
            )  # fmt: skip
            self.say(vehicle, 191, status)
            for target in range(1, self.targets + 1):
                at = self.target(target, now_s, 0.1 * math.sin(vehicle + target))
                information = [25.0, 3.0, 0.0, 0.0, 60.0, 0.0, 0.0, 4.0, 0.0, 4.0]
                vector = [25.0 * at[0] + 3.0 * at[1], 3.0 * at[0] + 60.0 * at[1], 0.0, 0.0]
                self.say(vehicle, 191, mavlink.MAVLink_target_belief_message(usec, vector, information, target, 0, 3))
            if round(now_s / 0.5) % 2 == 0:
                plan = mavlink.MAVLink_arvi_plan_message(
                    usec, *place, 0.5, -12.5, -14.0, 0.1, 0.2, 0.12, 0.15, 4321, 64, self.checksum,
                    [0, 1, 2, 0, 0, 1, 1, 0, 2, 2, 0, 0, *[0] * 52], 12, 3,
                )  # fmt: skip
                self.say(vehicle, 191, plan)
                tile = mavlink.MAVLink_explored_tile_message(i % 3, i // 3 % 3, 1000, [(i + usec) % 256] * 128)
                self.say(vehicle, 191, tile)
        for target in range(1, self.targets + 1):
            truth = mavlink.MAVLink_target_truth_message(usec, *self.target(target, now_s, 0.0), 0.0, 0.0, target)
            self.say(self.scenario.simulation.system_id, 1, truth)

    def target(self, target: int, now_s: float, off_m: float) -> tuple[float, float]:
        """North m, east m of a target, or of a belief that is off."""
        return (
            50.0 + 40.0 * math.sin(0.05 * now_s + target) + off_m,
            50.0 + 40.0 * math.cos(0.03 * now_s + 1.7 * target) + off_m,
        )

    def speak(self, until_s: float) -> None:
        """Speak until a UNIX time, s."""
        start_s = math.floor(time.time())
        due = dict.fromkeys(("autopilots", "heartbeats", "step"), 0.5 * math.ceil(2.0 * time.time()))
        while (now_s := time.time()) < until_s:
            if now_s >= due["autopilots"]:
                due["autopilots"] += 0.1
                self.autopilots(now_s)
            if now_s >= due["heartbeats"]:
                due["heartbeats"] += 1.0
                self.heartbeats()
            if now_s >= due["step"]:
                self.step(due["step"], start_s)
                due["step"] += 0.5
            time.sleep(max(0.0, min(due.values()) - time.time()))


def cpu_s(pid: int) -> float:
    """User and system time of a process with all its threads, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory_mb(pid: int) -> float:
    for line in Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) / 1024
    return math.nan


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


def share_of_core(pid: int, seconds: float) -> float:
    """CPU seconds per second while this waits."""
    before, began = cpu_s(pid), time.monotonic()
    time.sleep(seconds)
    return (cpu_s(pid) - before) / (time.monotonic() - began)


def measure(arguments: argparse.Namespace) -> dict[str, float]:
    """Start everything, look, and end it."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        config = write_scenario(folder, arguments.vehicles, arguments.targets, free_port())
        log = stack.enter_context((folder / "gcs.log").open("w+"))
        record = ["--record", str(folder / "flights")] if arguments.record else ["--no-record"]
        command = [sys.executable, "-m", "gcs", "gcs", str(config), "--headless", "--dashboard", *record]
        station = stack.enter_context(subprocess.Popen([*command, "--dashboard-port", "5400"], stdout=log, stderr=log))
        stack.callback(station.terminate)
        speaker = [sys.executable, __file__, "--speak", str(config), "--targets", str(arguments.targets)]
        team = stack.enter_context(subprocess.Popen(speaker))
        stack.callback(team.terminate)
        url = None
        while url is None:
            assert station.poll() is None, (folder / "gcs.log").read_text()
            words = (folder / "gcs.log").read_text().split()
            url = words[words.index("dashboard:") + 1] if "dashboard:" in words else None
            time.sleep(0.1)
        time.sleep(5.0)
        without_page = share_of_core(station.pid, arguments.seconds / 2)
        driver = stack.enter_context(sync_playwright())
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(url)
        page.locator(f"tr[data-vehicle='{arguments.vehicles}']").wait_for(timeout=60_000)
        page.evaluate(WATCH)
        time.sleep(3.0)
        page.evaluate("window.ages.length = window.updates = 0")
        with_page = share_of_core(station.pid, arguments.seconds)
        ages, updates = page.evaluate("[window.ages, window.updates]")
        if arguments.screenshot:
            page.screenshot(path=arguments.screenshot)
        browser.close()
        return {
            "vehicles": arguments.vehicles,
            "targets": arguments.targets,
            "cpu_without_page": round(without_page, 3),
            "cpu_with_page": round(with_page, 3),
            "memory_mb": round(memory_mb(station.pid)),
            "updates_per_s": round(updates / arguments.seconds, 2),
            "new_positions_per_s": round(len(ages) / arguments.seconds, 2),
            "delay_median_s": round(statistics.median(ages), 3),
            "delay_p95_s": round(sorted(ages)[math.ceil(0.95 * len(ages)) - 1], 3),
            "delay_max_s": round(max(ages), 3),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--targets", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--record", action="store_true", help="record the flight, too, as `arvi gcs` does by itself")
    parser.add_argument("--screenshot", help="PNG of the page at the end")
    parser.add_argument("--speak", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.speak is not None:
        Team(arguments.speak, arguments.targets).speak(math.inf)
    else:
        print(json.dumps(measure(arguments), indent=2))


if __name__ == "__main__":
    main()

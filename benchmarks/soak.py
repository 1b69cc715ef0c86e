"""A long flight of real processes under watch: does memory, a file, a thread, a process or a delay grow?

Flies a scenario with `arvi fly`, recorded, its dashboard served and looked at by one client, and samples every process
of the flight from /proc. Afterwards the recording tells, minute by minute, how late plans and messages were. Linux.

    python benchmarks/soak.py configs/soak.yaml --minutes 60
    python benchmarks/soak.py configs/soak.yaml --minutes 12 --json soak.json

The flight has a network of its own with `unshare --net` in front, so that its ports disturb nobody:

    sudo unshare --net sh -c 'ip link set lo up; exec python benchmarks/soak.py'

Exits with 0 when all holds, 1 when not, 2 when it cannot be flown.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gcs.recording.tlog import read_tlog
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec, message_id

SAMPLE_S = 5.0
SETTLE_S = 300.0
"""Kernels, caches and rings fill in the first five minutes; what grows after them is judged."""
MAX_GROWTH = 0.05
ENDING_S = 30.0
"""At the end of a flight, the vehicles land and the processes end."""
WINDOW_S = 60.0
"""What is compared: the first minute after settling, and the last minute."""
MAX_LATER_S = 0.005
"""How much the median delay of a message may grow."""

_PAGE = os.sysconf("SC_PAGE_SIZE")
_TICK = os.sysconf("SC_CLK_TCK")

LOOK = """
import sys, time
from bokeh.client import pull_session
session = pull_session(url=sys.argv[1])
while True:
    session.force_roundtrip()
    time.sleep(1.0)
"""
"""A client of the dashboard, which takes every change as a browser's tab does."""


@dataclass(frozen=True)
class Sample:
    """One process at one moment.

    Attributes:
        time_s: Since the flight's processes were started, s.
        name: Which process.
        pid: Its id.
        rss_mb: Resident memory, MB.
        files: Open file descriptors.
        threads: Threads.
        cpu_s: Processor time used so far, s.
        waited_s: Time for which its threads were ready and had no processor so far, s.
    """

    time_s: float
    name: str
    pid: int
    rss_mb: float
    files: int
    threads: int
    cpu_s: float
    waited_s: float


@dataclass(frozen=True)
class Minute:
    """How late one vehicle was in one minute of its mission.

    Attributes:
        vehicle: System id.
        minute: Counted from its first plan.
        plans: Plans made.
        late: Plans that missed their slot.
        plan_s: 99th percentile of the time that a plan took, s.
        budget_s: Median of the time that it was given, s.
        delay_s: Median age of a status when the ground heard it, s.
        delay_p99_s: Its 99th percentile, s.
        gap_max_s: Longest pause between setpoints of the flight so far, s.
    """

    vehicle: int
    minute: int
    plans: int
    late: int
    plan_s: float
    budget_s: float
    delay_s: float
    delay_p99_s: float
    gap_max_s: float


@dataclass(frozen=True)
class Verdict:
    """One judgement.

    Attributes:
        what: What was judged.
        holds: Whether it is as it should be.
        before: In the first minute after settling.
        after: In the last minute.
    """

    what: str
    holds: bool
    before: float
    after: float


def descendants(root: int) -> list[int]:
    """Process ids of the tree below a process, itself first."""
    found = [root]
    for pid in found:
        for task in Path(f"/proc/{pid}/task").glob("*/children"):
            try:
                found.extend(int(child) for child in task.read_text().split())
            except OSError:  # it has just ended
                continue
    return found


def look_at(pid: int, time_s: float) -> Sample | None:
    """A process now; None when it has ended, or has not become a program yet."""
    folder = Path(f"/proc/{pid}")
    try:
        name = name_of(folder.joinpath("cmdline").read_text().split("\0"))
        pages = int(folder.joinpath("statm").read_text().split()[1])
        fields = folder.joinpath("stat").read_text().rpartition(")")[2].split()
        tasks = list(folder.joinpath("task").iterdir())
        waited_ns = sum(int(task.joinpath("schedstat").read_text().split()[1]) for task in tasks)
        files = len(list(folder.joinpath("fd").iterdir()))
    except (OSError, IndexError, ValueError):
        return None
    if name is None:
        return None
    cpu_s = (int(fields[11]) + int(fields[12])) / _TICK
    return Sample(time_s, name, pid, pages * _PAGE / 1e6, files, len(tasks), cpu_s, waited_ns / 1e9)


def name_of(arguments: list[str]) -> str | None:
    """What a process of a flight is, by its arguments; None for one that only starts another."""
    line = " ".join(arguments).strip()
    if not line or "leash.py" in line:
        return None
    for pattern, name in (
        (r"-m onboard .*--vehicle (\d+)", "vehicle {}"),
        (r"-m sim_bridge ", "bridge"),
        (r"onboard\.(planning\.)?warmup", "warm-up"),
        (r"mavsdk_worker", "mavsdk"),
        (r" fly ", "ground"),
    ):
        if (match := re.search(pattern, line)) is not None:
            return name.format(*match.groups())
    return line[:40]


def judge(samples: Iterable[Sample], minutes: Iterable[Minute], settle_s: float = SETTLE_S) -> list[Verdict]:
    """Compare the last minute with the first one after settling.

    Args:
        samples: Of all processes.
        minutes: Of all vehicles.
        settle_s: Age of the flight from which on growth counts, s.

    Raises:
        ValueError: The flight was too short to judge.
    """
    taken = [sample for sample in samples if sample.name != "warm-up"]
    end_s = max((sample.time_s for sample in taken), default=0.0) - ENDING_S
    if end_s < settle_s + 2.0 * WINDOW_S:
        raise ValueError(f"{end_s:.0f} s of samples; at least {settle_s + 2.0 * WINDOW_S:.0f} s are needed")
    first = [sample for sample in taken if settle_s <= sample.time_s < settle_s + WINDOW_S]
    last = [sample for sample in taken if end_s - WINDOW_S < sample.time_s <= end_s]
    verdicts = []
    names = sorted({sample.name for sample in (*first, *last)})
    for name in names:
        one, other = ([s for s in some if s.name == name] for some in (first, last))
        if not one or not other:
            verdicts.append(Verdict(f"{name}: lives all the time", False, float(len(one)), float(len(other))))
            continue
        verdicts.append(Verdict(f"{name}: processes", *_same([s.pid for s in one], [s.pid for s in other])))
        before, after = (statistics.median(s.rss_mb for s in some) for some in (one, other))
        verdicts.append(Verdict(f"{name}: resident memory, MB", after <= before * (1.0 + MAX_GROWTH), before, after))
        for what in ("files", "threads"):
            before, after = (statistics.median(getattr(s, what) for s in some) for some in (one, other))
            verdicts.append(Verdict(f"{name}: {what}", after <= before, before, after))
    for vehicle in sorted({minute.vehicle for minute in minutes}):
        own = [minute for minute in minutes if minute.vehicle == vehicle]
        settled = [minute for minute in own if minute.minute >= settle_s / WINDOW_S] or own
        before, after = (statistics.median(m.delay_s for m in some) for some in (settled[:5], settled[-5:]))
        verdicts.append(
            Verdict(
                f"vehicle {vehicle}: a status's delay, ms", after <= before + MAX_LATER_S, 1e3 * before, 1e3 * after
            )
        )
        before, after = (float(sum(m.late for m in some)) for some in (own, settled))
        verdicts.append(Verdict(f"vehicle {vehicle}: late plans, all and after settling", before == 0.0, before, after))
    return verdicts


def _same(before: list[int], after: list[int]) -> tuple[bool, float, float]:
    """Whether the same processes are there, and how many."""
    return set(before) == set(after), float(len(set(before))), float(len(set(after)))


def read_minutes(folder: Path) -> list[Minute]:
    """How late each vehicle was, minute by minute, from a flight's recording."""
    minutes = []
    for path in sorted(folder.glob("vehicle*_onboard.tlog")):
        vehicle = int(re.findall(r"\d+", path.name)[0])
        codec = Codec(vehicle, 0)
        heard: dict[int, list[tuple[float, Any]]] = {}
        begin_s = None
        for time_usec, frame in read_tlog(path):
            if message_id(frame) not in (mavlink.MAVLINK_MSG_ID_PLANNER_STATUS, mavlink.MAVLINK_MSG_ID_ARVI_PLAN):
                continue
            time_s = time_usec / 1e6
            for message in codec.decode(frame):
                if begin_s is None and isinstance(message, mavlink.MAVLink_arvi_plan_message):
                    begin_s = time_s
                if begin_s is not None:
                    heard.setdefault(int((time_s - begin_s) // WINDOW_S), []).append((time_s, message))
        late_before = 0
        for number, messages in sorted(heard.items()):
            status = [(s, m) for s, m in messages if isinstance(m, mavlink.MAVLink_planner_status_message)]
            plans = [m for _, m in messages if isinstance(m, mavlink.MAVLink_arvi_plan_message)]
            if not status or not plans:
                continue
            delays = [time_s - message.time_usec / 1e6 for time_s, message in status]
            late = status[-1][1].deadline_misses
            minutes.append(
                Minute(
                    vehicle,
                    number,
                    len(plans),
                    late - late_before,
                    percentile([plan.planning_time for plan in plans], 0.99),
                    statistics.median(plan.budget for plan in plans),
                    statistics.median(delays),
                    percentile(delays, 0.99),
                    max(message.setpoint_gap_max for _, message in status),
                )
            )
            late_before = late
    return minutes


def percentile(values: list[float], fraction: float) -> float:
    """The smallest value that at least this fraction of the values does not exceed."""
    return sorted(values)[max(0, math.ceil(fraction * len(values)) - 1)]


class Watch:
    """A flight and who looks at it.

    Args:
        config: What is flown.
        duration_s: From step 0 to landing, s.
        folder: For logs, recording and summary.
    """

    def __init__(self, config: Path, duration_s: float, folder: Path) -> None:
        self._folder = folder
        self._log = folder / "arvi.log"
        self.samples: list[Sample] = []
        self.loads: list[float] = []
        command = [
            sys.executable, "-m", "gcs", "fly", str(config), "--duration", f"{duration_s:g}", "--headless",
            "--dashboard", "--record", str(folder), "--record-limit", "20000", "--json", str(folder / "summary.json"),
        ]  # fmt: skip
        with self._log.open("wb") as output:
            self._flight = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        self._looker: subprocess.Popen[bytes] | None = None

    def run(self) -> int:
        """Watch until the flight is over; its exit code."""
        begin_s = time.monotonic()
        told_s = 0.0
        try:
            while self._flight.poll() is None:
                time.sleep(SAMPLE_S)
                now_s = time.monotonic() - begin_s
                self._look_at_dashboard()
                self.loads.append(os.getloadavg()[0])
                seen = [look_at(pid, now_s) for pid in descendants(self._flight.pid)]
                self.samples += [sample for sample in seen if sample is not None]
                if now_s - told_s >= WINDOW_S:
                    told_s = now_s
                    memory = ", ".join(f"{s.name} {s.rss_mb:.0f}" for s in seen if s is not None)
                    print(f"{now_s / 60.0:5.1f} min, load {self.loads[-1]:.1f}; MB: {memory}", flush=True)
                    (self._folder / "samples.json").write_text(json.dumps([asdict(s) for s in self.samples]))
        finally:
            if self._looker is not None:
                self._looker.kill()
                self._looker.wait()
            if self._flight.poll() is None:
                self._flight.send_signal(signal.SIGINT)
                self._flight.wait()
        return self._flight.returncode

    def _look_at_dashboard(self) -> None:
        if self._looker is not None:
            return
        found = re.search(r"http://[\w.:]+[\w/?=-]*", self._log.read_text(errors="replace"))
        if found is not None:
            command = [sys.executable, "-c", LOOK, found.group().rstrip("/")]
            with (self._folder / "looker.log").open("wb") as output:
                self._looker = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)

    @property
    def last_words(self) -> str:
        """The end of what the flight printed."""
        return "\n".join(self._log.read_text(errors="replace").splitlines()[-30:])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("config", type=Path, nargs="?", default=Path("configs/soak.yaml"))
    parser.add_argument("--minutes", type=float, default=60.0, help="from step 0 to landing; at least 8")
    parser.add_argument("--folder", type=Path, help="for recording, logs and samples; a temporary one unless given")
    parser.add_argument("--json", type=Path, help="write verdicts, minutes and samples")
    options = parser.parse_args()
    if options.minutes < 8.0:
        parser.error("--minutes: less than 8 tell nothing after five minutes of settling")
    folder = options.folder or Path(tempfile.mkdtemp(prefix="soak-"))
    folder.mkdir(parents=True, exist_ok=True)
    print(f"everything is kept in {folder}", flush=True)
    watch = Watch(options.config, 60.0 * options.minutes, folder)
    returncode = watch.run()
    print(watch.last_words)
    recordings = [path.parent for path in folder.glob("*/vehicle*_onboard.tlog")]
    if returncode == 2 or not recordings:
        return 2
    minutes = read_minutes(recordings[0])
    verdicts = [Verdict("flight: exit code", returncode == 0, 0.0, float(returncode)), *judge(watch.samples, minutes)]
    load = statistics.median(watch.loads)
    print(
        f"\nload average of the whole machine: median {load:.1f}, most {max(watch.loads):.1f}; {os.cpu_count()} cores"
    )
    print_table(verdicts, watch.samples, minutes)
    if options.json is not None:
        document = {
            "load_median": load,
            "verdicts": [asdict(verdict) for verdict in verdicts],
            "minutes": [asdict(minute) for minute in minutes],
            "samples": [asdict(sample) for sample in watch.samples],
        }
        options.json.write_text(json.dumps(document, indent=1))
    return 0 if all(verdict.holds for verdict in verdicts) else 1


def print_table(verdicts: list[Verdict], samples: list[Sample], minutes: list[Minute]) -> None:
    """The verdicts, each process's use of the processor, and the lateness of each vehicle."""
    print("\n| | after 5 min | at the end | holds |\n| --- | ---: | ---: | --- |")
    for verdict in verdicts:
        print(
            f"| {verdict.what} | {verdict.before:.4g} | {verdict.after:.4g} | {'yes' if verdict.holds else '**no**'} |"
        )
    print("\n| process | cores | waited for a core, % of its time |\n| --- | ---: | ---: |")
    for name in sorted({sample.name for sample in samples} - {"warm-up"}):
        own = [sample for sample in samples if sample.name == name]
        length_s = own[-1].time_s - own[0].time_s
        if length_s > 0.0:
            used_s, waited_s = own[-1].cpu_s - own[0].cpu_s, own[-1].waited_s - own[0].waited_s
            print(f"| {name} | {used_s / length_s:.3f} | {100.0 * waited_s / length_s:.2f} |")
    print(
        "\n| vehicle | plans | late | slowest minute's plans (p99), ms | given, ms | delay p99, ms | longest gap, ms |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for vehicle in sorted({minute.vehicle for minute in minutes}):
        own_minutes = [minute for minute in minutes if minute.vehicle == vehicle]
        print(
            f"| {vehicle} | {sum(m.plans for m in own_minutes)} | {sum(m.late for m in own_minutes)} | "
            f"{1e3 * max(m.plan_s for m in own_minutes):.0f} | "
            f"{1e3 * statistics.median(m.budget_s for m in own_minutes):.0f} | "
            f"{1e3 * max(m.delay_p99_s for m in own_minutes):.0f} | {1e3 * own_minutes[-1].gap_max_s:.0f} |"
        )


if __name__ == "__main__":
    sys.exit(main())

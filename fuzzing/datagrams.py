"""``python -m fuzzing.datagrams CONFIG --each 100000``: random datagrams into every UDP socket of a flying team.

It flies the scenario as ``arvi fly`` does, waits until all vehicles fly their plans, writes into every UDP socket that
the flight's processes have, those of links that are connected to somebody else included, lets the team land, and
judges: no process has ended, no vehicle has left TRACK while it was shot at, no setpoint came later than 0.1 s. A
ground station may miss heartbeats meanwhile, since its sockets overflow; that is counted, and is no change of state.
"""

from __future__ import annotations

import argparse
import itertools
import json
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fuzzing.seeds import frames
from onboard.protocol.codec import Codec

__all__ = ["UdpSocket", "family", "flood", "main", "random_datagrams", "sockets_of"]

MAX_GAP_S = 0.1
_STRANGER = 77
_READY_S, _LANDING_S = 150.0, 60.0
_LAST_LINES = 60
_LEFT = re.compile(r"vehicle \d+: TRACK -> ")
_SILENT = "SILENT"
_PROGRESS = re.compile(r"\b(\d+): ([A-Z]+|not heard) ")


@dataclass(frozen=True, slots=True)
class UdpSocket:
    """One UDP socket of a process.

    Attributes:
        pid: Of its process.
        port: On which it is bound.
        connected: Whether the system lets in only what comes from one remote.
    """

    pid: int
    port: int
    connected: bool


def family(pid: int) -> list[int]:
    """A process and all that descend from it."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, ValueError):
                continue  # it ended while we looked
    found = [pid]
    for member in found:
        found += [child for child, parent in parents.items() if parent == member]
    return found


def sockets_of(pids: list[int]) -> list[UdpSocket]:
    """Every UDP socket of these processes, from Linux's own lists."""
    bound = {}
    for line in Path("/proc/net/udp").read_text().splitlines()[1:]:
        fields = line.split()
        bound[fields[9]] = (int(fields[1].partition(":")[2], 16), fields[2] != "00000000:0000")
    found = []
    for pid in pids:
        for descriptor in Path(f"/proc/{pid}/fd").iterdir():
            try:
                inode = str(descriptor.readlink()).removeprefix("socket:[").removesuffix("]")
            except OSError:
                continue  # closed while we looked
            if inode in bound:
                found.append(UdpSocket(pid, *bound[inode]))
    return sorted(found, key=lambda one: (one.pid, one.port))


def random_datagrams(seed: int) -> Iterator[bytes]:
    """Endless datagrams: noise of any size, damaged and cut frames, several in one, and whole ones of a stranger."""
    source = random.Random(seed)
    whole = frames(Codec(_STRANGER, 1))
    while True:
        match source.randrange(8):
            case 0:
                yield source.randbytes(source.choice((0, 1, 2, 20, 1400, 4096, 9000)))
            case 1:
                yield b"\xfd" + source.randbytes(source.randrange(300))
            case 2:
                yield source.choice(whole)
            case 3:
                yield b"".join(source.choices(whole, k=3))[source.randrange(40) :]
            case 4:
                frame = source.choice(whole)
                yield frame[: source.randrange(len(frame))]
            case 5:
                damaged = bytearray(source.choice(whole))
                for _ in range(1 + source.randrange(4)):
                    damaged[source.randrange(len(damaged))] ^= 1 << source.randrange(8)
                yield bytes(damaged)
            case _:
                yield source.randbytes(source.randrange(280))


def flood(targets: list[UdpSocket], each: int, rate_hz: float, seed: int, goes_on: Callable[[], bool]) -> int:
    """Write so many datagrams into each socket, in turn; how many were written.

    Args:
        targets: On the loopback interface.
        each: How many into each of them.
        rate_hz: Into all together.
        seed: Of the datagrams.
        goes_on: Asked now and then; ends it when false.
    """
    written, begun_s = 0, time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for datagram, target in zip(
            random_datagrams(seed), itertools.chain.from_iterable(itertools.repeat(targets, each)), strict=False
        ):
            sender.sendto(datagram, ("127.0.0.1", target.port))
            written += 1
            if written % 50 == 0:
                time.sleep(max(begun_s + written / rate_hz - time.monotonic(), 0.0))
            if written % 1000 == 0 and not goes_on():
                break
    return written


class _Flight:
    """``arvi fly`` in a process of its own, and what its lines say."""

    def __init__(self, config: Path, summary: Path) -> None:
        self.problems: list[str] = []
        self.states: dict[int, str] = {}
        self.last_lines: deque[str] = deque(maxlen=_LAST_LINES)
        self.watched = False
        self.looks = self.missing = 0
        command = [sys.executable, "-m", "gcs", "fly", str(config), "--headless", "--no-record", "--duration", "inf"]
        self.process = subprocess.Popen(
            [*command, "--json", str(summary)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.last_lines.append(line)
            if " | " in line:
                self.states = {int(vehicle): state for vehicle, state in _PROGRESS.findall(line)}
            if self.watched:
                self._judge(line)

    def _judge(self, line: str) -> None:
        if _LEFT.search(line):
            self.problems.append(f"left TRACK: {line.strip()}")
        if " | " in line:
            self.looks += len(self.states)
            self.missing += sum(state == _SILENT for state in self.states.values())
            if not set(self.states.values()) <= {"TRACK", _SILENT}:
                self.problems.append(f"does not track: {line.strip()}")

    @property
    def tracks(self) -> bool:
        return bool(self.states) and set(self.states.values()) == {"TRACK"}

    @property
    def runs(self) -> bool:
        return self.process.poll() is None


def main(arguments: list[str] | None = None) -> int:
    """Fly and flood; the exit code: 0 when the team did not mind, 1 when it did."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing.datagrams", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("config", type=Path, metavar="CONFIG", help="scenario, e.g. configs/lab.yaml")
    parser.add_argument("--each", type=int, default=1000, metavar="N", help="datagrams into each socket (1000)")
    parser.add_argument("--rate", type=float, default=8000.0, metavar="HZ", help="into all together (8000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the datagrams (1)")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="arvi-datagrams-") as folder:
        summary_path = Path(folder) / "summary.json"
        flight = _Flight(options.config, summary_path)
        problems = flight.problems
        try:
            _wait(lambda: flight.tracks or not flight.runs, _READY_S)
            before = family(flight.process.pid)
            targets = sockets_of(before)
            open_ones = sum(not target.connected for target in targets)
            flight.watched = True
            begun_s = time.monotonic()
            written = flood(targets, options.each, options.rate, options.seed, lambda: flight.runs)
            took_s = time.monotonic() - begun_s
            flight.watched = False
            problems += [f"process {pid} has ended" for pid in before if not Path(f"/proc/{pid}").exists()]
        finally:
            flight.process.send_signal(signal.SIGINT)
            code = flight.process.wait(_LANDING_S)
        summary = json.loads(summary_path.read_text())
    gaps_s = {vehicle["id"]: vehicle["setpoint_gap_max_s"] for vehicle in summary["vehicles"]}
    problems += [f"vehicle {i}: a setpoint {gap_s:.3f} s late" for i, gap_s in gaps_s.items() if gap_s > MAX_GAP_S]
    problems += [f"the flight ended with {code}: {summary['problems']}"] if code else []
    sys.stdout.write(
        f"{written} datagrams in {took_s:.0f} s into {len(targets)} sockets of {len(before)} processes "
        f"({open_ones} of them open to everybody); longest setpoint gaps, s: {gaps_s}; "
        f"targets found {summary['discovered']} of {summary['targets']}; "
        f"the ground station missed a vehicle in {flight.missing} of {flight.looks} looks\n"
    )
    sys.stdout.writelines(f"  {problem}\n" for problem in problems)
    if problems:
        sys.stdout.writelines(f"  | {line}" for line in flight.last_lines)
    return 1 if problems else 0


def _wait(condition: Callable[[], bool], limit_s: float) -> None:
    end_s = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end_s:
            raise SystemExit(f"not ready within {limit_s:.0f} s")
        time.sleep(0.1)


if __name__ == "__main__":
    sys.exit(main())

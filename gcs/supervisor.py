"""Child processes that are watched, and never outlive their launcher.

Each child leads a session of its own, so that the terminal's Ctrl-C reaches the launcher alone; each hangs on a leash
(``leash.py``) and is killed by the kernel when the launcher dies without a chance to stop it. Output goes to one log
file per child.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from gcs.leash import leashed
from gcs.output import printable

__all__ = ["ChildExit", "Supervisor", "tail"]

_TAIL_BYTES = 8192
_THREAD_LIMITS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
"""Matrices of four rows gain nothing from a thread pool, and one per process would crowd out the others."""


@dataclass(frozen=True, slots=True)
class ChildExit:
    """How a child ended.

    Attributes:
        name: Which child.
        returncode: Exit code, or minus the signal's number.
        expected: Whether it had been told to stop.
        log: Its log file.
        last_lines: The end of its log.
    """

    name: str
    returncode: int
    expected: bool
    log: Path
    last_lines: tuple[str, ...]

    @property
    def reason(self) -> str:
        """``exit code 1`` or ``killed by SIGKILL``."""
        if self.returncode >= 0:
            return f"exit code {self.returncode}"
        try:
            return f"killed by {signal.Signals(-self.returncode).name}"
        except ValueError:
            return f"killed by signal {-self.returncode}"


class Supervisor:
    """Starts, watches and stops child processes.

    Args:
        log_folder: An existing folder for ``NAME.log``.
        ended: Called in the event loop, once for each child that ends.

    Attributes:
        log_folder: Where the logs are.
    """

    def __init__(self, log_folder: Path, ended: Callable[[ChildExit], None]) -> None:
        self.log_folder = log_folder
        self._ended = ended
        self._children: dict[str, asyncio.subprocess.Process] = {}
        self._watchers: dict[str, asyncio.Task[None]] = {}
        self._stopping: set[str] = set()

    async def start(self, name: str, program: list[str], environment: Mapping[str, str] | None = None) -> int:
        """Start a program, given with its full path; its process id.

        Raises:
            OSError: It cannot be started, or its log cannot be written.
        """
        log = self.log_folder / f"{name}.log"
        inherited = {**_THREAD_LIMITS, **os.environ, "PYTHONUNBUFFERED": "1", **(environment or {})}
        with log.open("ab") as output:
            child = await asyncio.create_subprocess_exec(
                *leashed(program),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=output,
                stderr=asyncio.subprocess.STDOUT,
                start_new_session=True,
                env=inherited,
            )
        self._children[name] = child
        self._watchers[name] = asyncio.create_task(self._watch(name, child, log), name=f"watch {name}")
        return child.pid

    def running(self) -> tuple[str, ...]:
        """Names of the children that live."""
        return tuple(name for name, child in self._children.items() if child.returncode is None)

    def cpu_times_s(self) -> dict[str, float]:
        """CPU seconds that each living child has used, where the system tells (Linux's /proc)."""
        times = {}
        for name in self.running():
            used = _cpu_time_s(self._children[name].pid)
            if used is not None:
                times[name] = used
        return times

    async def wait(self, name: str) -> int:
        """Wait until a child has ended; its exit code, or minus the signal's number."""
        await self._watchers[name]
        returncode = self._children[name].returncode
        assert returncode is not None
        return returncode

    async def stop(self, grace_s: float) -> None:
        """Ask all children to end (SIGTERM), and after a while make them (SIGKILL); returns when all are gone."""
        self._signal_all(signal.SIGTERM)
        if await self._all_ended(grace_s):
            return
        self.kill()
        await self._all_ended(None)

    def send(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a child that lives; what comes of it is not expected."""
        if name in self.running():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._children[name].pid, number)

    def kill(self) -> None:
        """End all children at once (SIGKILL)."""
        self._signal_all(signal.SIGKILL)

    async def _all_ended(self, timeout_s: float | None) -> bool:
        watchers = [watcher for watcher in self._watchers.values() if not watcher.done()]
        if not watchers:
            return True
        _, pending = await asyncio.wait(watchers, timeout=timeout_s)
        return not pending

    def _signal_all(self, number: signal.Signals) -> None:
        for name in self.running():
            self._stopping.add(name)
            # The whole group, for children that have children; they lead the group that bears their id.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._children[name].pid, number)

    async def _watch(self, name: str, child: asyncio.subprocess.Process, log: Path) -> None:
        returncode = await child.wait()
        self._ended(ChildExit(name, returncode, name in self._stopping, log, tail(log)))


def tail(log: Path, lines: int = 12) -> tuple[str, ...]:
    """The last lines of a log file that are not empty; none when it cannot be read."""
    try:
        with log.open("rb") as file:
            file.seek(0, os.SEEK_END)
            file.seek(max(0, file.tell() - _TAIL_BYTES))
            text = file.read().decode("utf-8", errors="replace")
    except OSError:
        return ()
    return tuple(printable(line.rstrip()) for line in text.splitlines() if line.strip())[-lines:]


def _cpu_time_s(pid: int) -> float | None:
    """User and system time: fields 14 and 15 of proc(5)'s stat, counted from after the name, which may hold spaces."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    except OSError:
        return None
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

"""What the computer that a preflight check runs on needs: a right clock, keys, compiled kernels, room on its disk.

:func:`look` reads the system, :func:`judge` says what it means; nothing else here does I/O.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from gcs.checks import Check, Outcome
from gcs.preflight import check_signing
from onboard.config import Scenario
from onboard.protocol.signing import SigningError
from onboard.realtime import make_this_thread_urgent

__all__ = ["ClockState", "HostFacts", "judge", "look", "read_clock"]

GOOD_CLOCK_S = 0.02
"""From where on plans and detections of a team fit together; the onboard processes warn from there on, too."""
GOOD_DISK_BYTES = 2_000_000_000
"""What a recording takes at most (--record-limit)."""
LEAST_DISK_BYTES = 100_000_000
COLD_S = 5.0
"""Loading kernels from the cache takes a second or two, compiling them ten or more."""

_TIME_ERROR = 5
_WARM_PATIENCE_S = 600.0


@dataclass(frozen=True, slots=True)
class ClockState:
    """What the kernel knows of its clock (adjtimex(2)), as chrony, ntpd, timesyncd or ptp tell it.

    Attributes:
        synchronised: Whether somebody disciplines it.
        estimated_error_s: What they think of it, s.
        maximum_error_s: At most, s.
    """

    synchronised: bool
    estimated_error_s: float
    maximum_error_s: float


@dataclass(frozen=True, slots=True)
class HostFacts:
    """What was read of this computer.

    Attributes:
        clock: None where the system does not tell.
        key_problem: Why the signing key cannot be used; empty if it can, None without signing.
        state_problem: Why signing's timestamps cannot be kept; empty if they can.
        warm_s: How long loading every kernel took, s; None if it failed.
        disk_folder: Where recordings go.
        disk_free_bytes: Room there; None if it cannot be written to.
        urgent: Whether a thread may have real-time priority.
    """

    clock: ClockState | None
    key_problem: str | None
    state_problem: str
    warm_s: float | None
    disk_folder: Path
    disk_free_bytes: int | None
    urgent: bool


def judge(scenario: Scenario, facts: HostFacts) -> list[Check]:
    """Whether this computer is ready for a scenario."""
    return [
        _clock(scenario, facts.clock),
        _key(scenario, facts),
        _kernels(facts.warm_s),
        _disk(facts),
        Check.of(
            "real-time priority",
            Outcome.PASS if facts.urgent else Outcome.WARN,
            "allowed" if facts.urgent else "not allowed: on a busy computer setpoints may come late",
            "LimitRTPRIO=1 (systemd), or '@arvi - rtprio 1' in /etc/security/limits.conf",
        ),
    ]


def look(scenario: Scenario, recordings: Path) -> HostFacts:
    """Read this computer; loads all kernels, which compiles them where that was never done.

    Args:
        scenario: Names the key.
        recordings: Folder for recordings, which need not exist.
    """
    key_problem, state_problem = None, ""
    if scenario.signing is not None:
        key_problem = _problem_of_key(scenario)
        state_problem = _problem_of_folder(Path(scenario.signing.state_folder))
    folder = _nearest(recordings)
    free = shutil.disk_usage(folder).free if os.access(folder, os.W_OK) else None
    return HostFacts(read_clock(), key_problem, state_problem, _warm_up(), recordings, free, _may_be_urgent())


def read_clock() -> ClockState | None:
    """The state of the system's clock; None where there is no adjtimex(2)."""
    timex = _Timex()
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    except (OSError, AttributeError):
        return None
    if state < 0:
        return None
    return ClockState(state != _TIME_ERROR, timex.esterror * 1e-6, timex.maxerror * 1e-6)


class _Timex(ctypes.Structure):
    """The head of ``struct timex`` (linux/timex.h), and room for the rest; ``modes`` 0 only reads."""

    _fields_ = [
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_long * 32),
    ]


def _clock(scenario: Scenario, clock: ClockState | None) -> Check:
    wanted = f"synchronised (chrony, PTP) to within {1e3 * GOOD_CLOCK_S:.0f} ms: a team's plans are in UNIX time"
    if clock is None:
        return Check("this computer's clock", Outcome.WARN, "the system does not tell", wanted)
    if not clock.synchronised:
        # One computer agrees with itself.
        alone = scenario.simulation is not None or len(scenario.vehicles) == 1
        return Check("this computer's clock", Outcome.WARN if alone else Outcome.FAIL, "not synchronised", wanted)
    good = clock.estimated_error_s <= GOOD_CLOCK_S
    found = f"synchronised, error about {1e3 * clock.estimated_error_s:.2f} ms, at most {clock.maximum_error_s:.3f} s"
    return Check.of("this computer's clock", Outcome.PASS if good else Outcome.WARN, found, wanted)


def _key(scenario: Scenario, facts: HostFacts) -> Check:
    if scenario.signing is None:
        wanted = "signing: {key_file: …} with a key from arvi keygen: without one whoever reaches the links commands"
        outcome = Outcome.WARN if scenario.unsigned else Outcome.PASS  # no vehicle's link leaves this computer
        return Check.of("signing key", outcome, "none: links are unsigned", wanted)
    path = scenario.signing.key_file
    if facts.key_problem:
        return Check("signing key", Outcome.FAIL, facts.key_problem, f"{path}, mode 0600, readable by this user")
    if facts.state_problem:
        wanted = f"a folder that this user can write to: {scenario.signing.state_folder}"
        return Check("signing key", Outcome.FAIL, facts.state_problem, wanted)
    return Check("signing key", Outcome.PASS, f"{path}, readable by this user alone")


def _kernels(warm_s: float | None) -> Check:
    wanted = "python -m onboard.warmup ends with 0"
    if warm_s is None:
        return Check("kernels", Outcome.FAIL, "they do not load", wanted)
    if warm_s > COLD_S:
        found = f"took {warm_s:.0f} s: they were compiled just now, or this computer is busy"
        return Check("kernels", Outcome.WARN, found, f"loaded within {COLD_S:.0f} s, as the next start will")
    return Check("kernels", Outcome.PASS, f"loaded in {warm_s:.1f} s")


def _disk(facts: HostFacts) -> Check:
    free = facts.disk_free_bytes
    wanted = f"{GOOD_DISK_BYTES / 1e9:g} GB free for a recording in {facts.disk_folder}"
    if free is None:
        return Check("disk", Outcome.WARN, f"{facts.disk_folder} cannot be written to", wanted)
    outcome = Outcome.PASS if free >= GOOD_DISK_BYTES else Outcome.WARN
    return Check.of("disk", Outcome.FAIL if free < LEAST_DISK_BYTES else outcome, f"{free / 1e9:.1f} GB free", wanted)


def _problem_of_key(scenario: Scenario) -> str:
    try:
        check_signing(scenario)
    except SigningError as error:
        return str(error)
    return ""


def _problem_of_folder(folder: Path) -> str:
    nearest = _nearest(folder)
    return "" if os.access(nearest, os.W_OK | os.X_OK) else f"{nearest} cannot be written to"


def _nearest(folder: Path) -> Path:
    """The folder, or what there is of the way to it."""
    folder = folder.expanduser().absolute()
    while not folder.is_dir() and folder != folder.parent:
        folder = folder.parent
    return folder


def _warm_up() -> float | None:
    begin_s = time.monotonic()
    try:
        subprocess.run(
            [sys.executable, "-m", "onboard.warmup"], check=True, capture_output=True, timeout=_WARM_PATIENCE_S
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return time.monotonic() - begin_s


def _may_be_urgent() -> bool:
    """Asked in a thread of its own, which takes its priority with it."""
    answers: list[bool] = []
    thread = threading.Thread(target=lambda: answers.append(make_this_thread_urgent()))
    thread.start()
    thread.join()
    return answers == [True]

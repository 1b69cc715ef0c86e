"""Real, tiny child processes: started, watched, stopped, and never left behind."""

import asyncio
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from gcs.supervisor import Supervisor, tail

SLEEP = "import time; print('here', flush=True); time.sleep(60)"
STUBBORN = f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {SLEEP}"


@pytest.fixture
def exits():
    return []


@pytest.fixture
async def supervisor(tmp_path, exits):
    supervisor = Supervisor(tmp_path, exits.append)
    yield supervisor
    supervisor.kill()
    await supervisor.stop(1.0)


def python(code):
    return [sys.executable, "-c", textwrap.dedent(code)]


def exists(pid):
    """Whether a process lives; one that has ended and waits to be reaped by init does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


async def until(condition, timeout_s=10.0):
    async with asyncio.timeout(timeout_s):
        while not condition():
            await asyncio.sleep(0.01)


def said(supervisor, name, word="here"):
    return lambda: word in "".join(tail(supervisor.log_folder / f"{name}.log"))


async def test_an_end_is_reported_with_its_reason_and_last_lines(supervisor, exits):
    await supervisor.start("a", python("print('one'); print('two'); raise SystemExit(3)"))
    assert await supervisor.wait("a") == 3
    (child,) = exits
    assert (child.name, child.returncode, child.expected, child.reason) == ("a", 3, False, "exit code 3")
    assert child.last_lines == ("one", "two")
    assert supervisor.running() == ()


async def test_a_signal_is_named(supervisor, exits):
    pid = await supervisor.start("a", python(SLEEP))
    await until(said(supervisor, "a"))
    os.kill(pid, signal.SIGKILL)
    await supervisor.wait("a")
    assert exits[0].reason == "killed by SIGKILL"
    assert not exits[0].expected


async def test_stop_asks_first_and_then_makes(supervisor, exits):
    await supervisor.start("willing", python(SLEEP))
    await supervisor.start("stubborn", python(STUBBORN))
    await until(said(supervisor, "willing"))
    await until(said(supervisor, "stubborn"))
    await supervisor.stop(grace_s=0.3)
    assert {child.name: child.returncode for child in exits} == {
        "willing": -signal.SIGTERM,
        "stubborn": -signal.SIGKILL,
    }
    assert all(child.expected for child in exits)


async def test_children_of_children_go_too(supervisor):
    code = f"""
        import subprocess, sys
        child = subprocess.Popen([sys.executable, "-c", {SLEEP!r}])
        print("child", child.pid, flush=True)
        child.wait()
    """
    await supervisor.start("a", python(code))
    await until(said(supervisor, "a", "here"))
    pid = int(next(line for line in tail(supervisor.log_folder / "a.log") if line.startswith("child")).split()[1])
    assert exists(pid)
    await supervisor.stop(grace_s=2.0)
    await until(lambda: not exists(pid))


async def test_each_child_leads_a_session_so_that_ctrl_c_passes_it_by(supervisor):
    pid = await supervisor.start("a", python(SLEEP))
    await until(said(supervisor, "a"))
    assert os.getsid(pid) == pid != os.getsid(0)


async def test_cpu_time_is_counted_while_a_child_lives(supervisor):
    await supervisor.start(
        "busy", python("x = 0\nfor i in range(3_000_000): x += i\nprint('here', flush=True)\ninput()")
    )
    await supervisor.start("idle", python(SLEEP))
    await until(lambda: said(supervisor, "idle")() and "busy" not in supervisor.running())
    times = supervisor.cpu_times_s()
    assert set(times) == {"idle"}
    assert 0.0 <= times["idle"] < 5.0


@pytest.mark.skipif(sys.platform != "linux", reason="prctl is Linux's")
async def test_children_die_with_a_launcher_that_is_killed(tmp_path):
    launcher = f"""
        import asyncio
        from pathlib import Path
        from gcs.supervisor import Supervisor

        async def main():
            supervisor = Supervisor(Path({str(tmp_path)!r}), print)
            for name, code in (("willing", {SLEEP!r}), ("stubborn", {STUBBORN!r})):
                print(await supervisor.start(name, [{sys.executable!r}, "-c", code]), flush=True)
            await asyncio.sleep(60)

        asyncio.run(main())
    """
    process = subprocess.Popen(python(launcher), stdout=subprocess.PIPE, text=True)
    with process:
        pids = [int(process.stdout.readline()) for _ in range(2)]
        logs = [tmp_path / "willing.log", tmp_path / "stubborn.log"]
        await until(lambda: all("here" in "".join(tail(log)) for log in logs))
        assert all(exists(pid) for pid in pids)
        process.kill()
        await until(lambda: not any(exists(pid) for pid in pids))


def test_tail_defuses_control_sequences(tmp_path):
    (tmp_path / "a.log").write_text("\x1b[2Jgone\n")
    assert tail(tmp_path / "a.log") == ("·[2Jgone",)


def test_tail_is_bounded_and_survives_anything(tmp_path):
    log = tmp_path / "a.log"
    log.write_bytes(b"\n".join(b"line %d" % i for i in range(100_000)) + b"\n\xff\xfe\n\n")
    lines = tail(log, 3)
    assert lines[0:2] == ("line 99998", "line 99999")
    assert len(lines) == 3
    assert tail(tmp_path / "missing.log") == ()

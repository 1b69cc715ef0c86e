"""Real motion capture through the library motioncapture, from a server that speaks OptiTrack's NatNet."""

import asyncio
import math
import sys
import time

import pytest

from onboard.config.mocap import RealMocapConfig
from sim_bridge.mocap.library import LibraryReader, parse_frame
from tests.sim_bridge.mocap.natnet_server import CONNECT, REQUEST_MODELS, NatNetServer


def settings(port, provider="optitrack", host="127.0.0.1"):
    return RealMocapConfig(provider=provider, host=host, options={"port_command": port}, bodies={"drone one": 1})


class Reading:
    """A reader at work, and how long the event loop ever stood still meanwhile."""

    def __init__(self, config, **options):
        self.frames, self.texts, self.longest_s = [], [], 0.0
        self._reader = LibraryReader(config, self.frames.append, lambda n: self.texts.append(n.text), **options)

    async def __aenter__(self):
        self._tasks = [asyncio.ensure_future(self._reader.run()), asyncio.ensure_future(self._tick())]
        return self

    async def __aexit__(self, *_):
        for task in self._tasks:
            task.cancel()
        await asyncio.wait(self._tasks)

    async def _tick(self):
        while True:
            began = time.monotonic()
            await asyncio.sleep(0.005)
            self.longest_s = max(self.longest_s, time.monotonic() - began)

    async def until(self, condition, limit_s=30.0):
        end = time.monotonic() + limit_s
        while not condition():
            assert time.monotonic() < end, (len(self.frames), self.texts)
            await asyncio.sleep(0.02)


@pytest.fixture
def server():
    made = []

    def make(*arguments, **keywords):
        made.append(NatNetServer(*arguments, **keywords))
        return made[-1]

    yield make
    for one in made:
        one.close()


async def test_bodies_arrive_by_name_with_the_poses_that_the_server_sent(server):
    half = math.pi / 8

    def poses(now_s):
        return [
            (math.sin(now_s), 1.5, -2.0, math.cos(half), 0.0, math.sin(half), 0.0, True),
            (9.0, 9.0, 9.0, 1.0, 0.0, 0.0, 0.0, False),  # not tracked in this frame
        ]

    optitrack = server(["drone one", "hidden"], poses)
    async with Reading(settings(optitrack.command_port)) as reading:
        await reading.until(lambda: len(reading.frames) > 100)
    assert {CONNECT, REQUEST_MODELS} <= set(optitrack.requests)
    for frame in reading.frames:
        assert set(frame.bodies) == {"drone one"}
        x, *rest = frame.bodies["drone one"]
        assert rest == pytest.approx([1.5, -2.0, math.cos(half), 0.0, math.sin(half), 0.0], abs=1e-6)
        # Stamped on arrival: the sine that the server sent is at most a busy machine's delay older.
        assert x == pytest.approx(math.sin(frame.received_s), abs=0.25)
    (text,) = reading.texts
    assert text.startswith("motion capture optitrack sees drone one (")


async def test_a_server_that_falls_silent_is_said_and_found_again(server):
    talking = True
    optitrack = server(["drone one"], lambda _: [(0.0, 1.0, 2.0, 1.0, 0.0, 0.0, 0.0, True)] if talking else None)
    async with Reading(settings(optitrack.command_port), patience_s=1.0) as reading:
        await reading.until(lambda: reading.frames)
        talking = False
        await reading.until(lambda: any("no frames" in text for text in reading.texts))
        count = len(reading.frames)
        talking = True
        await reading.until(lambda: len(reading.frames) > count + 10)
    assert [text.split(" sees")[0].split(": ")[-1] for text in reading.texts] == [
        "motion capture optitrack",
        "no frames",
        "motion capture optitrack",
    ]


async def test_a_host_that_does_not_answer_never_stops_the_event_loop():
    """The library waits for ever, with the interpreter lock in its hands: that must not be ours."""
    async with Reading(settings(1), patience_s=0.1) as reading:
        await reading.until(lambda: reading.texts)
        assert reading.texts == ["motion capture optitrack at 127.0.0.1: no frames"]
        await asyncio.sleep(5.5)  # it tries again, and says it no second time
        assert len(reading.texts) == 1
    assert reading.longest_s < 1.0


async def test_a_provider_that_the_library_does_not_have_is_named():
    async with Reading(settings(1, provider="cinema")) as reading:
        await reading.until(lambda: reading.texts)
    assert reading.texts == ["motion capture cinema at 127.0.0.1: cinema at 127.0.0.1: Unknown motion capture type!"]


async def test_a_reader_that_ends_is_said_with_its_last_words_and_started_anew():
    program = [sys.executable, "-c", "import sys; sys.stderr.write('no such camera\\n'); sys.exit(9)"]
    async with Reading(settings(1), program=program) as reading:
        await reading.until(lambda: reading.texts)
    assert reading.texts == ["motion capture optitrack at 127.0.0.1: no such camera"]


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"{",
        b"[]",
        b'{"t": 1}',
        b'{"t": "x", "b": {}}',
        b'{"t": 1, "b": {"a": [1, 2]}}',
        b'{"t": 1, "b": {"a": "seven c"}}',
        b'{"t": 1, "b": []}',
    ],
)
def test_lines_that_are_no_frames_are_none(line):
    assert parse_frame(line) is None

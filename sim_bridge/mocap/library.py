"""Keeps a reader process of a motion capture system alive, and hands on what it reads."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
import time
from collections.abc import Callable
from typing import cast

from onboard.config.mocap import RealMocapConfig
from sim_bridge.mocap.bodies import Frame, Numbers
from sim_bridge.mocap.reader import NOT_INSTALLED
from sim_bridge.notices import Notice

__all__ = ["LibraryReader", "parse_frame"]

_START_S = 4.0
"""Until a reader can have connected on a busy machine."""
PAUSE_S = 1.0
"""Between two starts."""
_MAX_LINE_BYTES = 1 << 20


def parse_frame(line: bytes) -> Frame | None:
    """The frame in a line of the reader; None if it is none."""
    try:
        data = json.loads(line)
        bodies = {str(name): tuple(float(number) for number in numbers) for name, numbers in data["b"].items()}
        received_s = float(data["t"])
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    if any(len(numbers) != 7 for numbers in bodies.values()):
        return None
    return Frame(received_s, cast("dict[str, Numbers]", bodies))


class LibraryReader:
    """Reads one system until cancelled.

    Args:
        config: Which system.
        receive: Called in the event loop with each frame.
        tell: Called with what an operator should know; the same text only once in a row.
        patience_s: Without a frame for so long, the reader is started anew: the libraries do not notice that a server
            was restarted.
        program: What is started; the reader unless given.
    """

    def __init__(
        self,
        config: RealMocapConfig,
        receive: Callable[[Frame], None],
        tell: Callable[[Notice], None],
        *,
        patience_s: float = 6.0,
        program: list[str] | None = None,
    ) -> None:
        self._config = config
        self._receive = receive
        self._tell = tell
        self._patience_s = patience_s
        settings = {"hostname": config.host, **{name: _text(value) for name, value in config.options.items()}}
        self._program = program or [
            sys.executable,
            "-m",
            "sim_bridge.mocap.reader",
            config.provider,
            *(f"{name}={value}" for name, value in settings.items()),
        ]
        self._last_text = ""
        self._connected = False

    async def run(self) -> None:
        """Read; start the reader anew whenever it ends or falls silent."""
        while True:
            code, last_words = await self._read()
            self._connected = False
            reason = last_words or ("no frames" if code is None else f"its reader ended with code {code}")
            self._say(f"motion capture {self._config.provider} at {self._config.host}: {reason}")
            await asyncio.sleep(PAUSE_S if code != NOT_INSTALLED else 60.0)

    async def _read(self) -> tuple[int | None, str]:
        """One reader from start to end: its exit code, None if it was silent; and its last words."""
        process = await asyncio.create_subprocess_exec(
            *self._program,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            limit=_MAX_LINE_BYTES,
        )
        assert process.stdout is not None
        assert process.stderr is not None
        patience_s = self._patience_s + _START_S
        words = asyncio.ensure_future(_last_line(process.stderr))
        try:
            while True:
                try:
                    # Not wait_for: Python 3.11's loses a cancellation that comes together with a line.
                    async with asyncio.timeout(patience_s):
                        line = await process.stdout.readline()
                except TimeoutError:
                    return None, ""
                if not line:
                    return await process.wait(), await words
                patience_s = self._patience_s
                self._hand_on(line)
        finally:
            words.cancel()
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    def _hand_on(self, line: bytes) -> None:
        frame = parse_frame(line)
        if frame is None:
            return
        if not self._connected:
            self._connected = True
            names = ", ".join(sorted(frame.bodies))
            late_ms = 1e3 * (time.time() - frame.received_s)
            self._last_text = ""
            self._tell(
                Notice(f"motion capture {self._config.provider} sees {names} ({late_ms:.0f} ms on the way)", severity=6)
            )
        self._receive(frame)

    def _say(self, text: str) -> None:
        if text != self._last_text:
            self._last_text = text
            self._tell(Notice(text))


async def _last_line(stream: asyncio.StreamReader) -> str:
    """The last line of a stream that is not empty."""
    last = ""
    while line := await stream.readline():
        last = line.decode(errors="replace").strip() or last
    return last


def _text(value: str | float | bool) -> str:
    """As the library wants settings: all of them texts."""
    return str(value).lower() if isinstance(value, bool) else str(value)

"""Standard output that may go away, and text that may be hostile: neither must keep anybody from landing."""

from __future__ import annotations

import io
import os
import sys
from functools import partial
from typing import IO, cast

from rich.console import Console

__all__ = ["SteadyOutput", "is_read", "open_console", "printable"]

_WIDTH_WITHOUT_TERMINAL = 100


class SteadyOutput(io.TextIOBase):
    """A text stream that turns to nothing when its end is gone, instead of raising.

    Args:
        stream: Where to write while that is possible; has a file descriptor.

    Attributes:
        gone: Whether nobody reads it any more.
    """

    def __init__(self, stream: io.TextIOWrapper) -> None:
        super().__init__()
        self.gone = False
        self._stream = stream

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The stream's encoding, by which rich chooses its characters."""
        return self._stream.encoding

    def write(self, text: str) -> int:
        """Write text, or nothing when nobody is there to read it."""
        try:
            return self._stream.write(text)
        except OSError:
            self._give_up()
            return len(text)

    def flush(self) -> None:
        """Hand over what has been written."""
        try:
            self._stream.flush()
        except OSError:
            self._give_up()

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """The stream's file descriptor."""
        return self._stream.fileno()

    def _give_up(self) -> None:
        """From now on the descriptor leads nowhere: what is buffered, and what Python flushes at exit, goes there."""
        self.gone = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)


def open_console() -> Console:
    """Standard output; wide enough for our tables where it is no terminal, and has no width.

    Text is printed as it is: what vehicles, files and paths are called may look like rich's markup.
    """
    output = cast(IO[str], SteadyOutput(sys.stdout) if isinstance(sys.stdout, io.TextIOWrapper) else sys.stdout)
    plain = partial(Console, file=output, markup=False, emoji=False, highlight=False)
    console = plain()
    return console if console.is_terminal else plain(width=_WIDTH_WITHOUT_TERMINAL)


def is_read(console: Console) -> bool:
    """Whether somebody may still read what is printed."""
    return not (isinstance(console.file, SteadyOutput) and console.file.gone)


def printable(text: str) -> str:
    """Text that is safe on a terminal: what comes from outside may hold control sequences."""
    return "".join(character if character.isprintable() else "·" for character in text)

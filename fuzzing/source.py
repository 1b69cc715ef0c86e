"""Bytes as a source of choices, so that a fuzzer's mutations stay near meaningful inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

__all__ = ["ByteSource"]

T = TypeVar("T")


class ByteSource:
    """Takes values from the front of a byte string; zeros follow its end."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    @property
    def left(self) -> int:
        """Bytes not yet taken."""
        return max(len(self._data) - self._at, 0)

    def take(self, count: int) -> bytes:
        """The next bytes; exactly ``count``."""
        piece = self._data[self._at : self._at + count]
        self._at += count
        return piece.ljust(count, b"\0")

    def below(self, bound: int) -> int:
        """An integer from 0 to ``bound`` − 1."""
        size = max(1, (bound.bit_length() + 7) // 8)
        return int.from_bytes(self.take(size), "little") % bound

    def pick(self, values: Sequence[T]) -> T:
        """One of several values."""
        return values[self.below(len(values))]

"""STATUSTEXT longer than one message (https://mavlink.io/en/messages/common.html#STATUSTEXT)."""

from __future__ import annotations

from onboard.protocol import dialect as mavlink

__all__ = ["StatusTextAssembler", "encode_status_text"]

CHUNK_BYTES = 50
MAX_BYTES = 250
_MAX_OPEN_TEXTS = 64


def encode_status_text(severity: int, text: str, text_id: int) -> list[mavlink.MAVLink_statustext_message]:
    """The messages of one text: one if it fits, else chunks that share an id.

    Args:
        severity: MAV_SEVERITY.
        text: ASCII, as receivers read it; other characters become question marks. Cut after 250 bytes.
        text_id: Number of the text on this link; wraps at 65535 and skips 0, which marks a text of one message.
    """
    data = text.encode("ascii", errors="replace")[:MAX_BYTES]
    if len(data) <= CHUNK_BYTES:
        return [mavlink.MAVLink_statustext_message(severity, data)]
    number = (text_id - 1) % 0xFFFF + 1
    # A last chunk that is full would leave the end open: an empty one closes it.
    starts = range(0, len(data) + 1, CHUNK_BYTES)
    return [
        mavlink.MAVLink_statustext_message(severity, data[start : start + CHUNK_BYTES], number, sequence)
        for sequence, start in enumerate(starts)
    ]


class StatusTextAssembler:
    """Puts chunks of texts together again, for any number of senders."""

    def __init__(self) -> None:
        self._open: dict[tuple[int, int, int], list[str]] = {}

    def receive(self, message: mavlink.MAVLink_statustext_message) -> tuple[int, str] | None:
        """Severity and text once the last chunk is here; None before. A text with a lost chunk is given up."""
        if message.id == 0:
            return message.severity, message.text
        key = (message.get_srcSystem(), message.get_srcComponent(), message.id)
        if message.chunk_seq == 0:
            self._open.pop(key, None)
            while len(self._open) >= _MAX_OPEN_TEXTS:
                self._open.pop(next(iter(self._open)))
            self._open[key] = []
        chunks = self._open.get(key)
        if chunks is None or message.chunk_seq != len(chunks):
            self._open.pop(key, None)
            return None
        chunks.append(message.text)
        if len(message.text) == CHUNK_BYTES and len(chunks) * CHUNK_BYTES < MAX_BYTES + CHUNK_BYTES:
            return None
        del self._open[key]
        return message.severity, "".join(chunks)

"""What an autopilot has to send, in order, and what it has to say in words."""

from __future__ import annotations

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.links import LINKS, LinkName

__all__ = ["Outbox"]

_TEXT_BYTES = 50


class Outbox:
    """Messages that wait to be taken.

    Attributes:
        text_links: The links that STATUSTEXT goes to; each firmware has its own rule for that.
    """

    def __init__(self) -> None:
        self.text_links: set[LinkName] = set()
        self._messages: list[tuple[LinkName, mavlink.MAVLink_message]] = []
        self._text_id = 0

    def __len__(self) -> int:
        return len(self._messages)

    def send(self, link: LinkName, message: mavlink.MAVLink_message) -> None:
        """Queue a message."""
        self._messages.append((link, message))

    def insert(self, place: int, link: LinkName, message: mavlink.MAVLink_message) -> None:
        """Queue a message before what has been queued from a place (``len`` of an earlier moment) on."""
        self._messages.insert(place, (link, message))

    def take(self) -> list[tuple[LinkName, mavlink.MAVLink_message]]:
        """Take all messages out."""
        messages, self._messages = self._messages, []
        return messages

    def say(self, severity: int, text: str) -> None:
        """Send STATUSTEXT (severity: MAV_SEVERITY), in chunks with an id of their own where it is long."""
        data = text.encode()
        chunks = [data[i : i + _TEXT_BYTES] for i in range(0, len(data), _TEXT_BYTES)]
        text_id = 0
        if len(chunks) > 1:
            self._text_id = text_id = self._text_id % 0xFFFF + 1
        for link in LINKS:
            if link in self.text_links:
                for index, chunk in enumerate(chunks):
                    self.send(link, mavlink.MAVLink_statustext_message(severity, chunk, text_id, index))

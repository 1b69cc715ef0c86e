"""What goes out on a link beside the dialect's messages: messages that it does not have, and plain text."""

from __future__ import annotations

from onboard.protocol import dialect as mavlink

__all__ = ["PlainText", "RawMessage"]


class RawMessage(mavlink.MAVLink_message):
    """A message that the project's dialect does not have, packed by whoever sends it.

    Args:
        message_id: Its id.
        name: Its name.
        crc_extra: The checksum over its definition, from the dialect that has it.
        payload: Its fields as on the wire.
    """

    def __init__(self, message_id: int, name: str, crc_extra: int, payload: bytes) -> None:
        mavlink.MAVLink_message.__init__(self, message_id, name)
        self._extra = crc_extra
        self.payload_bytes = payload

    def pack(self, mav: mavlink.MAVLink, force_mavlink1: bool = False) -> bytes:
        """The frame."""
        return self._pack(mav, self._extra, self.payload_bytes, force_mavlink1)


class PlainText(mavlink.MAVLink_message):
    """Characters that are no MAVLink, as a console writes them.

    Args:
        text: What is written.
    """

    def __init__(self, text: str) -> None:
        mavlink.MAVLink_message.__init__(self, -1, "PLAIN_TEXT")
        self.text = text

    def pack(self, mav: mavlink.MAVLink, force_mavlink1: bool = False) -> bytes:
        """The characters."""
        return self.text.encode()

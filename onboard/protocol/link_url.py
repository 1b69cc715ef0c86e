"""The URL that names a link."""

from __future__ import annotations

from dataclasses import dataclass

from onboard.errors import OnboardError

__all__ = ["DATAGRAM_KINDS", "LinkUrl", "TransportError"]

DATAGRAM_KINDS = ("udpin", "udpout", "mcast")
"""Links that carry datagrams over UDP."""

_MAX_PORT = 65535
_MAX_BAUD = 10_000_000
_FORMS = "udpin:HOST:PORT, udpout:HOST:PORT, mcast:GROUP:PORT, tcp:HOST:PORT and serial:DEVICE:BAUD are"


class TransportError(OnboardError):
    """A link that cannot be opened; the text names its URL and the reason."""


@dataclass(frozen=True, slots=True)
class LinkUrl:
    """A link's URL in parts.

    Attributes:
        kind: ``udpin``, ``udpout``, ``mcast``, ``tcp`` or ``serial``.
        host: Host name or address; of a serial link the device.
        port: UDP or TCP port; of a serial link the rate, baud.
    """

    kind: str
    host: str
    port: int

    @classmethod
    def parse(cls, url: str) -> LinkUrl:
        """The parts of a URL.

        Raises:
            TransportError: It is none of these kinds.
        """
        kind, _, rest = url.partition(":")
        host, _, port = rest.removeprefix("//").rpartition(":")
        known = kind in DATAGRAM_KINDS or kind in ("tcp", "serial")
        limit = _MAX_BAUD if kind == "serial" else _MAX_PORT
        if not known or not host or not port.isdecimal() or not 0 < int(port) <= limit:
            raise TransportError(f"{url!r} is no link; {_FORMS}")
        return cls(kind, host, int(port))

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"

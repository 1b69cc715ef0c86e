"""The links of one onboard process, without sockets: frames to messages and back, signed, counted and bounded."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum

from onboard.counts import Counts
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec, RefusalNotice
from onboard.protocol.rate_limit import RateLimit
from onboard.protocol.signing import LinkSigning, SignedLink, Signing

__all__ = ["COMPONENT", "MAX_RATES_HZ", "LinkName", "Links"]

COMPONENT: int = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""An onboard process's component id (191)."""


class LinkName(StrEnum):
    """The four links of an onboard process."""

    AUTOPILOT = "autopilot"
    PEERS = "peers"
    SENSOR = "sensor"
    GROUND = "ground"


MAX_RATES_HZ = {LinkName.AUTOPILOT: 10_000.0, LinkName.PEERS: 2000.0, LinkName.SENSOR: 2000.0, LinkName.GROUND: 100.0}
"""Messages of one sender on a link: a peer may tell of a thousand targets in every step of half a second."""

_SIGNED = {LinkName.PEERS: SignedLink.PEERS, LinkName.GROUND: SignedLink.GROUND}


class Links:
    """One vehicle's four links.

    Args:
        vehicle_id: Whose.
        counts: What is counted.
        signing: Signs what goes to peers and ground, and lets in from there only what the team's key signed; None
            leaves both open.
    """

    def __init__(self, vehicle_id: int, counts: Counts, signing: Signing | None = None) -> None:
        self._counts = counts
        self._signing = signing
        self._codecs = {name: Codec(vehicle_id, COMPONENT, self._signing_of(name)) for name in LinkName}
        self._limits = {name: RateLimit(MAX_RATES_HZ[name]) for name in LinkName}
        self._notice = RefusalNotice()
        self._out: list[tuple[LinkName, bytes]] = []

    def _signing_of(self, link: LinkName) -> LinkSigning | None:
        return None if self._signing is None or link not in _SIGNED else self._signing.link(_SIGNED[link])

    def advance(self, time_s: float) -> None:
        """It is this UNIX time: what is signed from now on says so."""
        if self._signing is not None:
            self._signing.advance(time_s)

    def receive(self, link: LinkName, datagram: bytes, time_s: float) -> Iterator[mavlink.MAVLink_message]:
        """The messages of a datagram that arrived at a UNIX time; what is no frame, or too much, is counted."""
        self.advance(time_s)
        if link is LinkName.PEERS:
            self._counts.peer_bytes_received += len(datagram)
        for message in self._codecs[link].decode(datagram):
            if self._limits[link].lets_in(message.get_srcSystem(), time_s):
                yield message
            else:
                self._counts.refused += 1

    def send(self, message: mavlink.MAVLink_message, *links: LinkName) -> None:
        """Send a message on links."""
        for link in links:
            frame = self._codecs[link].encode(message)
            if link is LinkName.PEERS:
                self._counts.peer_bytes_sent += len(frame)
            self._out.append((link, frame))

    def outbox(self) -> list[tuple[LinkName, bytes]]:
        """Frames to send, in order, with their links."""
        out, self._out = self._out, []
        return out

    @property
    def rejected(self) -> int:
        """Pieces of datagrams that were no valid frame, and frames whose signature was refused."""
        return sum(codec.rejected + codec.refused.total() for codec in self._codecs.values())

    def refusals(self, time_s: float) -> list[str]:
        """What to tell the operator, at a UNIX time, of frames that signed links refuse."""
        notices = [self._notice.update(link, codec.refused, time_s) for link, codec in self._codecs.items()]
        return [notice for notice in notices if notice is not None]

"""The links of an onboard process: what is let in, what is signed, what is counted."""

from onboard.counts import Counts
from onboard.links import COMPONENT, MAX_RATES_HZ, LinkName, Links
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.signing import SignedLink, Signing, SigningKey

NOW = 1_800_000_000.0
TILE = mavlink.MAVLink_explored_tile_message(0, 0, 250, [1] * 128)


def test_frames_go_out_in_order_and_bytes_to_and_from_peers_are_counted() -> None:
    counts = Counts()
    links = Links(1, counts)
    beat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    links.send(beat, LinkName.AUTOPILOT, LinkName.GROUND)
    links.send(TILE, LinkName.PEERS)
    out = links.outbox()
    assert [link for link, _ in out] == [LinkName.AUTOPILOT, LinkName.GROUND, LinkName.PEERS]
    assert links.outbox() == []
    frame = out[-1][1]
    (sent,) = Codec(99, 1).decode(frame)
    assert (sent.get_srcSystem(), sent.get_srcComponent(), sent.get_type()) == (1, COMPONENT, "EXPLORED_TILE")
    assert len(list(links.receive(LinkName.PEERS, 2 * frame, NOW))) == 2
    assert (counts.peer_bytes_sent, counts.peer_bytes_received) == (len(frame), 2 * len(frame))


def test_a_sender_that_floods_is_heard_no_more_often_than_it_may_and_others_are_heard_all_the_same() -> None:
    counts = Counts()
    links = Links(1, counts)
    flood, other = Codec(2, COMPONENT).encode(TILE), Codec(3, COMPONENT).encode(TILE)
    heard = sum(len(list(links.receive(LinkName.PEERS, 50 * flood, NOW))) for _ in range(50))
    assert heard == MAX_RATES_HZ[LinkName.PEERS] == 2500 - counts.refused
    assert len(list(links.receive(LinkName.PEERS, other, NOW))) == 1


def test_with_a_key_peers_and_ground_get_signed_frames_and_are_heard_only_with_them() -> None:
    key = SigningKey(bytes(range(32)))
    links = Links(1, Counts(), Signing(key))
    links.advance(NOW)
    links.send(TILE, *LinkName)
    signed = {link for link, frame in links.outbox() if frame[2] & mavlink.MAVLINK_IFLAG_SIGNED}
    assert signed == {LinkName.PEERS, LinkName.GROUND}
    theirs = Signing(key)
    theirs.advance(NOW)
    for link, signed_link in ((LinkName.PEERS, SignedLink.PEERS), (LinkName.GROUND, SignedLink.GROUND)):
        assert len(list(links.receive(link, Codec(2, COMPONENT).encode(TILE), NOW))) == 0
        assert len(list(links.receive(link, Codec(2, COMPONENT, theirs.link(signed_link)).encode(TILE), NOW))) == 1
    for link in (LinkName.AUTOPILOT, LinkName.SENSOR):
        assert len(list(links.receive(link, Codec(2, COMPONENT).encode(TILE), NOW))) == 1
    assert links.rejected == 2
    assert links.refusals(NOW) == [
        f"1 frames refused on the {link} link; so far 1 unsigned" for link in (LinkName.PEERS, LinkName.GROUND)
    ]
    assert links.refusals(NOW) == [], "once is enough"

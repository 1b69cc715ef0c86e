"""Frames out of a stream of bytes, cut and soiled in every way."""

import random

from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.framing import FrameBuffer

CODEC = Codec(1, 1)
FRAMES = [CODEC.encode(mavlink.MAVLink_ping_message(i, i, 0, 0)) for i in range(8)]
FRAMES += [CODEC.encode(mavlink.MAVLink_statustext_message(6, b"a text with \xfd and \xfe in it", 0, 0))]


def fed(data, cuts):
    buffer, pieces, start = FrameBuffer(), [], 0
    for cut in [*sorted(cuts), len(data)]:
        pieces += buffer.feed(data[start:cut])
        start = cut
    return pieces


@settings(max_examples=200, deadline=None)
@given(st.lists(st.sampled_from(FRAMES), max_size=12), st.randoms(use_true_random=False))
def test_frames_come_out_whole_wherever_the_stream_is_cut(frames, rng: random.Random):
    data = b"".join(frames)
    cuts = {rng.randrange(len(data) + 1) for _ in range(rng.randrange(20))} if data else set()
    assert fed(data, cuts) == frames


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=40).filter(lambda data: not set(data) & {0xFD, 0xFE}), st.integers(0, 60))
def test_what_is_no_frame_comes_out_apart(garbage, cut):
    data = FRAMES[0] + garbage + FRAMES[1]
    pieces = fed(data, {min(cut, len(data))})
    assert [piece for piece in pieces if piece in FRAMES] == FRAMES[:2]
    assert b"".join(pieces) == data


@settings(max_examples=200, deadline=None)
@given(st.integers(0, len(FRAMES[0]) - 1), st.integers(1, 255))
def test_a_broken_byte_costs_no_more_than_what_follows_within_a_frame(place, change):
    """Once enough follows to show that the broken header lies, the stream is read again."""
    broken = bytearray(FRAMES[0])
    broken[place] ^= change
    pieces = fed(bytes(broken) + b"".join(FRAMES[1:8]) * 3, set())
    assert sum(piece in FRAMES for piece in pieces) >= 7

"""STATUSTEXT chunks: https://mavlink.io/en/messages/common.html#STATUSTEXT."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.status_text import StatusTextAssembler, encode_status_text

PRINTABLE = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=400)


def over_the_wire(severity: int, text: str, number: int) -> list[mavlink.MAVLink_statustext_message]:
    sender, receiver = Codec(1, 191), Codec(255, 190)
    received = []
    for message in encode_status_text(severity, text, number):
        received += receiver.decode(sender.encode(message))
    return received  # type: ignore[return-value]


@given(PRINTABLE, st.integers(0, 200_000))
def test_any_text_arrives_whole_up_to_250_bytes(text: str, number: int) -> None:
    assembler = StatusTextAssembler()
    results = [assembler.receive(message) for message in over_the_wire(4, text, number)]
    assert results[-1] == (4, text[:250])
    assert all(result is None for result in results[:-1])


def test_what_is_not_ascii_is_marked_not_garbled() -> None:
    (message,) = over_the_wire(4, "40 µs", 1)
    assert StatusTextAssembler().receive(message) == (4, "40 ?s")


@pytest.mark.parametrize("length", [49, 50, 51, 99, 100, 101, 250])
def test_lengths_at_the_edges_of_chunks(length: int) -> None:
    assembler = StatusTextAssembler()
    results = [assembler.receive(message) for message in over_the_wire(6, "x" * length, 1)]
    assert results[-1] == (6, "x" * length)


def test_a_lost_chunk_gives_the_text_up_and_the_next_one_arrives() -> None:
    assembler = StatusTextAssembler()
    first = over_the_wire(6, "a" * 120, 1)
    assert [assembler.receive(message) for message in (first[0], first[2])] == [None, None]
    assert assembler.receive(over_the_wire(6, "short", 2)[0]) == (6, "short")


def test_texts_of_two_senders_do_not_mix() -> None:
    assembler = StatusTextAssembler()
    a = encode_status_text(6, "a" * 60, 1)
    b = encode_status_text(6, "b" * 60, 1)
    receiver = Codec(255, 190)
    pairs = []
    for left, right in zip(a, b, strict=True):
        pairs += receiver.decode(Codec(1, 191).encode(left)) + receiver.decode(Codec(2, 191).encode(right))
    texts = [assembler.receive(message) for message in pairs]  # type: ignore[arg-type]
    assert texts[-2:] == [(6, "a" * 60), (6, "b" * 60)]

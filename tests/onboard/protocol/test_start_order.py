"""MAV_CMD_ARVI_START: the time of step 0 survives the wire to the microsecond."""

import random

import pytest

from onboard.clock import usec
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.start_order import encode_start, read_start


def arrived(message: mavlink.MAVLink_message) -> mavlink.MAVLink_command_int_message:
    (heard,) = Codec(1, 191).decode(Codec(255, 190).encode(message))
    assert isinstance(heard, mavlink.MAVLink_command_int_message)
    return heard


@pytest.mark.parametrize("start_s", [1_500_000_008.5, 1_500_000_008.1, 1_500_000_007.9999999])
def test_it_names_whom_and_when(start_s: float) -> None:
    order = arrived(encode_start(3, 191, start_s))
    assert (order.target_system, order.target_component, order.command) == (3, 191, mavlink.MAV_CMD_ARVI_START)
    assert 0 <= order.y < 1_000_000
    assert read_start(order) == pytest.approx(start_s, abs=1e-6)


def test_who_passes_it_on_means_the_same_time() -> None:
    """Read, told again and read again it is the same float, so missions can be told apart by it."""
    draw = random.Random(1)
    for _ in range(300):
        told = read_start(arrived(encode_start(3, 191, 1_800_000_000.0 + draw.randrange(10**12) * 1e-6)))
        assert read_start(arrived(encode_start(3, 191, told))) == told
        assert usec(told) / 1e6 == told

"""What PX4's telemetry means for a start."""

import pytest

from onboard.flight.px4 import Px4
from onboard.flight.telemetry import Telemetry
from onboard.protocol.px4_modes import Px4Mode


@pytest.mark.parametrize(
    ("mode", "prearm_ok", "ready"),
    [
        (Px4Mode.LOITER, True, True),
        (Px4Mode.LOITER, False, False),
        # After a flight PX4 is in OFFBOARD, and its bit is off for want of setpoints, which come with the start.
        (Px4Mode.OFFBOARD, False, True),
        (Px4Mode.POSCTL, False, False),
    ],
)
def test_the_health_bit_speaks_of_the_active_mode(mode, prearm_ok, ready):
    heard = Telemetry()
    heard.mode, heard.prearm_ok = int(mode), prearm_ok
    assert (Px4().lacks(heard) == "") is ready

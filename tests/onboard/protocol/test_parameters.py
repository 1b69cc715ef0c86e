"""MAVLink's parameter protocol: https://mavlink.io/en/services/parameter.html."""

import struct

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.parameters import ParameterClient

INT32, REAL32 = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32


class Autopilot:
    """Answers as an autopilot does; the first ``deaf`` messages are lost."""

    def __init__(self, *, bytewise: bool, deaf: int = 0) -> None:
        self.held: dict[str, tuple[float, int]] = {"YAW_MAX": (200.0, REAL32), "CTRL": (7.0, INT32)}
        self.bytewise = bytewise
        self.deaf = deaf
        self.client = ParameterClient((1, 1), timeout_s=1.0, attempts=3, window=4)
        self.client.bytewise = bytewise
        self.heard: list[str] = []
        self.time_s = 0.0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            self.time_s += 0.1
            for message in self.client.poll(self.time_s):
                self._take(message)

    def _take(self, sent: mavlink.MAVLink_message) -> None:
        (message,) = Codec(1, 1).decode(Codec(1, 191).encode(sent))
        name = message.param_id
        self.heard.append(name)
        if self.deaf > 0:
            self.deaf -= 1
            return
        if name not in self.held:
            return
        value, kind = self.held[name]
        if isinstance(message, mavlink.MAVLink_param_set_message):
            assert message.param_type == kind, "an autopilot is silent about a wrong type"
            value = message.param_value
            if self.bytewise and kind == INT32:
                (value,) = struct.unpack("<i", struct.pack("<f", value))
            self.held[name] = (value, kind)
        if self.bytewise and kind == INT32:
            (value,) = struct.unpack("<f", struct.pack("<i", int(value)))
        answer = mavlink.MAVLink_param_value_message(name.encode(), value, kind, 2, 0)
        (received,) = Codec(1, 191).decode(Codec(1, 1).encode(answer))
        assert isinstance(received, mavlink.MAVLink_param_value_message)
        self.client.receive(received)


@pytest.mark.parametrize("bytewise", [True, False])
def test_values_of_both_types_are_read_and_set_and_read_back(bytewise: bool) -> None:
    autopilot = Autopilot(bytewise=bytewise)
    autopilot.client.read(["YAW_MAX", "CTRL"])
    autopilot.run(0.2)
    assert {name: p.value for name, p in autopilot.client.values.items()} == {"YAW_MAX": 200.0, "CTRL": 7.0}
    autopilot.client.set("CTRL", 11)
    autopilot.client.set("YAW_MAX", 171.9)
    autopilot.run(0.2)
    assert not autopilot.client.busy
    assert autopilot.held["CTRL"][0] == 11
    assert autopilot.client.values["CTRL"].value == 11.0
    assert autopilot.client.values["YAW_MAX"].value == pytest.approx(171.9)


def test_a_lost_request_is_repeated() -> None:
    autopilot = Autopilot(bytewise=True, deaf=2)
    autopilot.client.read(["CTRL"])
    autopilot.run(1.5)
    assert autopilot.client.busy
    autopilot.run(1.0)
    assert autopilot.client.values["CTRL"].value == 7.0


def test_silence_means_that_the_name_is_unknown() -> None:
    autopilot = Autopilot(bytewise=True)
    autopilot.client.read(["NO_SUCH", "CTRL"])
    autopilot.run(4.0)
    assert autopilot.client.unknown == {"NO_SUCH"}
    assert autopilot.heard.count("NO_SUCH") == 3
    assert not autopilot.client.busy


def test_no_more_than_a_window_is_under_way() -> None:
    autopilot = Autopilot(bytewise=True, deaf=100)
    autopilot.client.read([f"P{i}" for i in range(20)])
    autopilot.run(0.5)
    assert autopilot.heard == ["P0", "P1", "P2", "P3"]


def test_a_set_that_is_refused_shows_the_old_value() -> None:
    autopilot = Autopilot(bytewise=False)
    autopilot.client.read(["YAW_MAX"])
    autopilot.run(0.2)
    autopilot.client.set("YAW_MAX", 10.0)
    held = autopilot.held["YAW_MAX"]
    for _ in range(40):
        autopilot.run(0.1)
        autopilot.held["YAW_MAX"] = held
    stubborn = mavlink.MAVLink_param_value_message(b"YAW_MAX", 200.0, REAL32, 2, 0)
    (received,) = Codec(1, 191).decode(Codec(1, 1).encode(stubborn))
    assert isinstance(received, mavlink.MAVLink_param_value_message)
    autopilot.client.receive(received)
    assert autopilot.client.values["YAW_MAX"].value == 200.0
    assert not autopilot.client.busy

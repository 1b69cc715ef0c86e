"""The bridge as a real process on ports of its own: it speaks, stops on a signal, and says why it cannot start."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter

import pytest
import yaml

from onboard.config import load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.__main__ import main
from sim_bridge.bridge import Outgoing, Port, build_bridge
from sim_bridge.ports import find_ports
from sim_bridge.process import BridgeProcess, run_bridge
from tests.shifted_lab import LAB, SHIFT, shifted_lab

NOON = 1_790_000_000.0


def lab_on_own_ports(folder):
    path = folder / "lab.yaml"
    path.write_text(yaml.safe_dump(shifted_lab()), encoding="utf-8")
    return path


def listener(port):
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", port + SHIFT))
    sock.setblocking(False)
    return sock


def start(path, *options):
    command = [sys.executable, "-m", "sim_bridge", str(path), *options]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})


def collect(socks, until, limit_s):
    """Messages by socket, ``(message, sender's port)``, until a condition on them holds."""
    codec = Codec(255, 190)
    heard = {name: [] for name in socks}
    end = time.monotonic() + limit_s
    while not until(heard):
        assert time.monotonic() < end, {name: Counter(m.get_type() for m, _ in heard[name]) for name in heard}
        for name, sock in socks.items():
            try:
                datagram, sender = sock.recvfrom(65536)
            except BlockingIOError:
                continue
            heard[name] += [(message, sender[1] - SHIFT) for message in codec.decode(datagram)]
    assert codec.rejected == 0
    return heard


def types(messages):
    return {message.get_type() for message, _ in messages}


@pytest.mark.system
@pytest.mark.parametrize("allowed", [True, False])
def test_faults_are_injected_by_the_ground_stations_command_where_the_scenario_allows_it(tmp_path, allowed):
    path = lab_on_own_ports(tmp_path)
    data = yaml.safe_load(path.read_text(encoding="utf-8"))
    data["simulation"]["allow_live_faults"] = allowed
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    ground = listener(14550)
    process = start(path)
    try:
        heard = collect({"ground": ground}, lambda heard: "VEHICLE_TRUTH" in types(heard["ground"]), limit_s=30.0)
        bridge_port = next(port for message, port in heard["ground"] if message.get_srcSystem() == 250)
        inject = mavlink.MAVLink_command_long_message(
            250, 1, mavlink.MAV_CMD_INJECT_FAILURE, 0, mavlink.FAILURE_UNIT_SENSOR_VIO, 1, 2, 0, 0, 0, 0
        )
        for system in (254, 255):  # only the configured ground station is obeyed
            ground.sendto(Codec(system, 190).encode(inject), ("127.0.0.1", bridge_port + SHIFT))
        heard = collect(
            {"ground": ground}, lambda heard: {"COMMAND_ACK", "STATUSTEXT"} <= types(heard["ground"]), limit_s=5.0
        )["ground"]
        (ack,) = [message for message, _ in heard if message.get_type() == "COMMAND_ACK"]
        texts = "".join(message.text for message, _ in heard if message.get_type() == "STATUSTEXT")
        assert (ack.command, ack.target_system, ack.get_srcSystem()) == (mavlink.MAV_CMD_INJECT_FAILURE, 255, 250)
        assert ack.result == (mavlink.MAV_RESULT_ACCEPTED if allowed else mavlink.MAV_RESULT_DENIED)
        assert ("fault begins: mocap off, vehicles 2" if allowed else "fault refused") in texts
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=10)
        ground.close()


@pytest.mark.system
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_speaks_on_every_port_and_ends_cleanly(tmp_path, number):
    socks = {n: listener(14540 + n - 1) for n in (1, 2, 3)} | {"ground": listener(14550)}
    peers = {n: socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for n in (1, 2, 3)}
    process = start(lab_on_own_ports(tmp_path))
    try:
        heard = collect(
            socks,
            lambda heard: (
                all("HEARTBEAT" in types(heard[n]) for n in (1, 2, 3))
                and {m.get_srcSystem() for m, _ in heard["ground"] if m.get_type() == "HEARTBEAT"} == {1, 2, 3}
                and {"TARGET_TRUTH", "VEHICLE_TRUTH"} <= types(heard["ground"])
            ),
            limit_s=30.0,
        )
        for n in (1, 2, 3):
            assert {(m.get_srcSystem(), m.get_srcComponent()) for m, _ in heard[n]} == {(n, 1)}
            assert {port for _, port in heard[n]} == {14580 + n - 1}
        for message, port in heard["ground"]:
            if message.get_srcSystem() != 250:
                assert port == 18570 + message.get_srcSystem() - 1
        assert {m.target_id for m, _ in heard["ground"] if m.get_type() == "TARGET_TRUTH"} == {1, 2, 3, 4, 5}

        # A command is answered on the link on which it came.
        request = mavlink.MAVLink_command_long_message(2, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0)
        socks[2].sendto(Codec(2, 191).encode(request), ("127.0.0.1", 14581 + SHIFT))
        heard = collect({2: socks[2]}, lambda heard: "AUTOPILOT_VERSION" in types(heard[2]), limit_s=5.0)
        assert "COMMAND_ACK" in types(heard[2])

        # All radios that have spoken MAVLink and are within 3 m hear a broadcast, byte for byte; its sender does not.
        hello = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
        for n, sock in peers.items():
            sock.setblocking(False)
            sock.sendto(Codec(n, 191).encode(hello), ("127.0.0.1", 14640 + n - 1 + SHIFT))
        time.sleep(0.1)
        for sock in peers.values():
            drain(sock)
        peers[2].sendto(b"\x00not even a frame", ("127.0.0.1", 14641 + SHIFT))
        time.sleep(0.1)
        assert {n: drain(sock) for n, sock in peers.items()} == {
            1: [b"\x00not even a frame"],
            2: [],
            3: [b"\x00not even a frame"],
        }

        process.send_signal(number)
        _, log = process.communicate(timeout=10.0)
        assert process.returncode == 0, log
        assert "radio 2 to 1" in log
        assert "Traceback" not in log
    finally:
        process.kill()
        process.wait()
        for sock in (*socks.values(), *peers.values()):
            sock.close()


def drain(sock):
    received = []
    while True:
        try:
            received.append(sock.recv(65536))
        except BlockingIOError:
            return received


@pytest.mark.system
def test_a_second_copy_names_the_port_and_leaves_the_first_alone(tmp_path):
    path = lab_on_own_ports(tmp_path)
    sock = listener(14540)
    first = start(path)
    try:
        collect({1: sock}, lambda heard: "HEARTBEAT" in types(heard[1]), limit_s=30.0)
        second = start(path)
        _, log = second.communicate(timeout=20.0)
        assert second.returncode == 2
        assert f"UDP port {14580 + SHIFT} is in use" in log
        assert "Stop the other" in log
        assert "Traceback" not in log
        collect({1: sock}, lambda heard: "HEARTBEAT" in types(heard[1]), limit_s=5.0)
        first.send_signal(signal.SIGINT)
        first.communicate(timeout=10.0)
        assert first.returncode == 0
    finally:
        first.kill()
        first.wait()
        sock.close()


async def test_a_value_that_does_not_fit_its_field_stops_nobody_else(tmp_path, caplog):
    scenario = load_scenario(lab_on_own_ports(tmp_path))
    bridge = build_bridge(scenario, None, NOON)
    overflow = mavlink.MAVLink_system_time_message(2**64, 0)
    clock = iter([NOON + 0.001 * k for k in range(1000)])
    process = BridgeProcess(bridge, find_ports(scenario), 250, lambda: next(clock), ground_id=255)
    sock = listener(14540)
    await process.open()
    try:
        for _ in range(2):
            fine = mavlink.MAVLink_heartbeat_message(2, 12, 29, 0, 3, 3)
            outgoing = [Outgoing(Port.ONBOARD, 1, overflow), Outgoing(Port.ONBOARD, 1, fine)]
            bridge.outbox = lambda outgoing=outgoing: outgoing
            process.send()
        messages = [message for datagram in drain(sock) for message in Codec(255, 190).decode(datagram)]
        assert [message.get_type() for message in messages] == ["HEARTBEAT", "HEARTBEAT"]
        assert [message.get_seq() for message in messages] == [0, 1]
        assert caplog.text.count("vehicle 1: SYSTEM_TIME holds a value that its field cannot") == 1
    finally:
        process.close()
        sock.close()


def test_a_scenario_without_simulation_is_refused(caplog):
    scenario = load_scenario(LAB).model_copy(update={"simulation": None})
    assert run_bridge(scenario) == 2
    assert "has no section simulation" in caplog.text


def test_a_failure_in_the_simulation_ends_the_process_with_its_cause(tmp_path, monkeypatch, caplog):
    def fail(*_):
        raise ZeroDivisionError("the physics broke")

    monkeypatch.setattr("sim_bridge.bridge.Bridge.advance", fail)
    assert run_bridge(load_scenario(lab_on_own_ports(tmp_path))) == 1
    assert "the physics broke" in caplog.text
    # The sockets are free again.
    listener(14580).close()


def test_a_broken_configuration_is_said_and_exits_2(tmp_path, capsys):
    path = tmp_path / "broken.yaml"
    path.write_text("name: [", encoding="utf-8")
    assert main([str(path)]) == 2
    assert "not valid YAML" in capsys.readouterr().err


def test_a_negative_seed_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main([str(lab_on_own_ports(tmp_path)), "--seed", "-1"])
    assert stop.value.code == 2
    assert "a seed is not negative" in capsys.readouterr().err

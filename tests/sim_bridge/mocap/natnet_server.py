"""A server of OptiTrack's protocol NatNet 3.1 (unicast), as far as a client needs it: connection, bodies, frames.

Layout: https://docs.optitrack.com/developer-tools/natnet-sdk (direct depacketization).
"""

import socket
import struct
import threading
import time

CONNECT, SERVER_INFO, REQUEST_MODELS, MODELS, FRAME = 0, 1, 4, 5, 7
RIGID_BODY = 1


def message(kind, payload):
    return struct.pack("<HH", kind, len(payload)) + payload


def server_info(data_port):
    name = b"a motion capture server of a test".ljust(256, b"\0")
    versions = bytes((1, 0, 0, 0, 3, 1, 0, 0))
    return message(SERVER_INFO, name + versions + struct.pack("<QHB4s", 1_000_000, data_port, 0, bytes(4)))


def models(names):
    bodies = b"".join(
        struct.pack("<i", RIGID_BODY) + name.encode() + b"\0" + struct.pack("<ii3fi", index, -1, 0.0, 0.0, 0.0, 0)
        for index, name in enumerate(names, start=1)
    )
    return message(MODELS, struct.pack("<i", len(names)) + bodies)


def frame(number, bodies):
    """``bodies``: position x, y, z, quaternion w, x, y, z and whether it is tracked, in the order of the names."""
    parts = [struct.pack("<iii", number, 0, 0), struct.pack("<i", len(bodies))]
    for index, (x, y, z, w, qx, qy, qz, tracked) in enumerate(bodies, start=1):
        parts.append(struct.pack("<i7ffh", index, x, y, z, qx, qy, qz, w, 0.0005, int(tracked)))
    parts.append(struct.pack("<4i", 0, 0, 0, 0))  # skeletons, labelled markers, force plates, devices
    parts.append(struct.pack("<IIdQQQhi", 0, 0, 0.0, 0, 0, 0, 0, 0))
    return message(FRAME, b"".join(parts))


class NatNetServer:
    """Serves poses at a rate, in a thread, until closed.

    Args:
        names: Of the rigid bodies.
        poses: Called with the time, s; gives the bodies of a frame, or None to send none.
        rate_hz: Of frames.
    """

    def __init__(self, names, poses, rate_hz=100.0):
        self.names, self.poses, self.period_s = names, poses, 1.0 / rate_hz
        self._commands = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._commands.bind(("127.0.0.1", 0))
        self._commands.setblocking(False)
        self.command_port = self._commands.getsockname()[1]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.data_port = probe.getsockname()[1]
        self.requests = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def close(self):
        self._stop.set()
        self._thread.join()
        self._commands.close()

    def _serve(self):
        number, due = 0, time.monotonic()
        while not self._stop.is_set():
            self._answer()
            bodies = self.poses(time.time())
            if bodies is not None:
                number += 1
                self._commands.sendto(frame(number, bodies), ("127.0.0.1", self.data_port))
            due += self.period_s
            self._stop.wait(max(0.0, due - time.monotonic()))

    def _answer(self):
        while True:
            try:
                datagram, address = self._commands.recvfrom(2048)
            except (BlockingIOError, ConnectionRefusedError):
                return
            (kind,) = struct.unpack_from("<H", datagram)
            self.requests.append(kind)
            if kind == CONNECT:
                self._commands.sendto(server_info(self.data_port), address)
            elif kind == REQUEST_MODELS:
                self._commands.sendto(models(self.names), address)

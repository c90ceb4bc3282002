# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sends the poses of a Kestrel camera, which exists in this example only, to ArduPilot as ODOMETRY.

Usage: kestrel_camera | kestrel_bridge.py HOST:PORT

The camera writes a line of JSON a pose: position and velocity east, north, up (m, m/s), a quaternion x, y, z, w that
turns its body axes (forward, left, up) into those of the world, its own clock in us, a confidence from 0 to 3, and the
number of the map that it knows its place on. A new map has another origin.
"""

import json
import math
import socket
import sys
from dataclasses import dataclass
from typing import Protocol, Self

from pymavlink.dialects.v20 import ardupilotmega as mavlink

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # w, x, y, z

LOCAL_FRD, BODY_FRD = 20, 12
INTERVAL_US = 25_000  # the autopilot's estimator looks at one sample in 20 ms, at most
QUALITY = {0: -1, 1: 25, 2: 75, 3: 100}  # of the camera's confidence; -1 is failed, and 0 would be unknown
SIGMA_M, SIGMA_RAD = 0.05, 0.02

_HALF = math.sqrt(0.5)
_NED_FROM_ENU: Quaternion = (0.0, _HALF, _HALF, 0.0)
_FLU_FROM_FRD: Quaternion = (0.0, 1.0, 0.0, 0.0)


class Port(Protocol):
    """Where the autopilot is: a serial port, a socket, or a test."""

    def write(self, data: bytes) -> object: ...

    def read(self) -> bytes: ...


class UdpPort:
    """The autopilot at a UDP address; ``read`` waits for ``timeout_s`` at most."""

    def __init__(self, address: tuple[str, int], timeout_s: float = 0.0) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(timeout_s)
        self._socket.connect(address)

    def write(self, data: bytes) -> None:
        self._socket.send(data)

    def read(self) -> bytes:
        try:
            return self._socket.recv(65535)
        except (TimeoutError, BlockingIOError):
            return b""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._socket.close()


@dataclass(frozen=True)
class CameraPose:
    """A line of the camera."""

    time_us: int
    position_enu: Vector
    velocity_enu: Vector
    quat_xyzw: Quaternion
    confidence: int
    map_id: int


class Bridge:
    """Takes poses and sends them, once the autopilot has been heard."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self._mav = mavlink.MAVLink(port, srcSystem=1, srcComponent=mavlink.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY)
        self._mav.robust_parsing = True
        self._next_us: int | None = None
        self._map_id: int | None = None
        self._resets = 0
        self.autopilot_heard = False

    def greet(self) -> None:
        """Send a heartbeat; to be called once a second."""
        self._mav.heartbeat_send(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)

    def listen(self) -> None:
        """Read what the autopilot says."""
        for message in self._mav.parse_buffer(self._port.read()) or ():
            if message.get_type() == "HEARTBEAT" and message.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
                self.autopilot_heard = True

    def wait_for_autopilot(self) -> None:
        """Wait until the autopilot has been heard."""
        while not self.autopilot_heard:
            self.greet()
            self.listen()

    def take(self, pose: CameraPose) -> None:
        """Send a pose, unless the last one sent was a moment ago."""
        if self._map_id not in (None, pose.map_id):
            self._resets = (self._resets + 1) % 256
            self._next_us = None
        self._map_id = pose.map_id
        if not self.autopilot_heard or (self._next_us is not None and pose.time_us < self._next_us):
            return
        self._next_us = pose.time_us + INTERVAL_US
        w, x, y, z = attitude_of(pose.quat_xyzw)
        self._mav.odometry_send(
            pose.time_us,
            LOCAL_FRD,
            BODY_FRD,
            *ned_of(pose.position_enu),
            (w, x, y, z),
            *rotated((w, -x, -y, -z), ned_of(pose.velocity_enu)),
            0.0,
            0.0,
            0.0,
            diagonal(SIGMA_M**2, SIGMA_RAD**2),
            [math.nan] * 21,
            self._resets,
            mavlink.MAV_ESTIMATOR_TYPE_VIO,
            QUALITY[pose.confidence],
        )


def ned_of(enu: Vector) -> Vector:
    """Turn east, north, up into north, east, down."""
    east, north, up = enu
    return north, east, -up


def attitude_of(quat_xyzw: Quaternion) -> Quaternion:
    """Turn the camera's attitude (FLU to ENU) into the autopilot's (FRD to NED; w, x, y, z)."""
    x, y, z, w = quat_xyzw
    return product(product(_NED_FROM_ENU, (w, x, y, z)), _FLU_FROM_FRD)


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the product of two quaternions."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def rotated(quat: Quaternion, vector: Vector) -> Vector:
    """Return a vector turned by a quaternion."""
    w, x, y, z = quat
    return product(product(quat, (0.0, *vector)), (w, -x, -y, -z))[1:]


def diagonal(position: float, attitude: float) -> list[float]:
    """Return the upper triangle of a covariance matrix, row by row."""
    variances = [position] * 3 + [attitude] * 3
    return [variances[row] if row == column else 0.0 for row in range(6) for column in range(row, 6)]


def main() -> None:
    """Send what the camera writes, from standard input."""
    host, _, port = sys.argv[1].rpartition(":")
    with UdpPort((host, int(port)), timeout_s=1.0) as udp:
        bridge = Bridge(udp)
        bridge.wait_for_autopilot()
        for line in sys.stdin:
            bridge.take(CameraPose(**json.loads(line)))


if __name__ == "__main__":
    main()

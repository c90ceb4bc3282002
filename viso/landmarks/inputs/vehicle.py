# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's pose and fix, and aircraft, from MAVLink: messages, a stream of bytes, or a telemetry log (.tlog).

A pose is made of each ATTITUDE, as the yaw matters most; its position is that of the last LOCAL_POSITION_NED, carried
on with its velocity. GLOBAL_POSITION_INT is a fix, above mean sea level, and ADSB_VEHICLE an aircraft.

Times are on the clock of the arrivals: the autopilot's stamps plus the smallest delay of the last messages, which
removes the jitter of arrivals. The delay of the fastest of these messages remains.
"""

import math
from collections import Counter, deque
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from mav_handlers.links.tlog import TlogError, read_tlog
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ADSB_VEHICLE, ATTITUDE, GLOBAL_POSITION_INT, LOCAL_POSITION_NED, Message
from viso.landmarks.adsb_vehicle import from_message
from viso.landmarks.inputs.base import InputFileError, Refused, counted, ned_R_frd, not_null_island, pose_from_ned
from viso.landmarks.types import Event, GeodeticPoint, GlobalFix

POSITION_REACH_S: Final = 1.0
"""A position is carried on with its velocity for no longer than this."""
STEP_S: Final = 1.0
"""A larger step between the clocks means that one was set, or that the autopilot has booted."""
DELAYS: Final = 1000

_OfVehicle = ATTITUDE | GLOBAL_POSITION_INT | LOCAL_POSITION_NED


class ArrivalTimes:
    """Converts a sender's stamps to the clock of arrival."""

    def __init__(self) -> None:
        self._delays_s: deque[float] = deque(maxlen=DELAYS)
        self._last_s = -math.inf

    def t_s(self, stamp_s: float, arrival_s: float) -> float:
        """Return the time of a stamp on the clock of arrival."""
        delay_s = arrival_s - stamp_s
        sooner = bool(self._delays_s) and delay_s < min(self._delays_s) - STEP_S
        if sooner or stamp_s < self._last_s - STEP_S:
            self._delays_s.clear()
        self._last_s = stamp_s
        self._delays_s.append(delay_s)
        return stamp_s + min(self._delays_s)


class MavlinkReader:
    """Makes poses, fixes and aircraft reports from messages; other messages are ignored and not counted."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        self._times = ArrivalTimes()
        self._position: LOCAL_POSITION_NED | None = None

    def take(self, message: Message, arrival_s: float) -> list[Event]:
        """Return the events of a message of the vehicle or an aircraft. Never raises because of its content."""
        events: list[Event] = []
        with counted(self.refused):
            if isinstance(message, _OfVehicle):
                events = self._of_vehicle(message, arrival_s)
            elif isinstance(message, ADSB_VEHICLE):
                events = [from_message(message, arrival_s)]
        return events

    def _of_vehicle(self, message: _OfVehicle, arrival_s: float) -> list[Event]:
        boot_s = message.time_boot_ms * 1e-3
        t_s = self._times.t_s(boot_s, arrival_s)
        if isinstance(message, ATTITUDE):
            return [self._pose(message, boot_s, t_s)]
        if isinstance(message, LOCAL_POSITION_NED):
            numbers = (message.x, message.y, message.z, message.vx, message.vy, message.vz)
            if not all(map(math.isfinite, numbers)):
                raise Refused("a position that is not finite")
            self._position = message
            return []
        not_null_island(message.lat, message.lon)
        return [GlobalFix(t_s, GeodeticPoint(message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3))]

    def _pose(self, message: ATTITUDE, boot_s: float, t_s: float) -> Event:
        if not (message.roll or message.pitch or message.yaw):  # ArduPilot's value before it has an attitude
            raise Refused("an attitude that is not known yet")
        attitude = ned_R_frd(message.roll, message.pitch, message.yaw)
        at = self._position
        if at is None or abs(boot_s - at.time_boot_ms * 1e-3) > POSITION_REACH_S:
            raise Refused("an attitude without a position")
        ahead_s = boot_s - at.time_boot_ms * 1e-3
        position_ned = (at.x + at.vx * ahead_s, at.y + at.vy * ahead_s, at.z + at.vz * ahead_s)
        return pose_from_ned(t_s, position_ned, attitude)


class MavlinkStream:
    """Makes events from the bytes of a link; of several vehicles, only the first that sends poses is used for them."""

    def __init__(self) -> None:
        self._reader = MavlinkReader()
        self._codec = Codec(system_id=255, component_id=0)
        self._vehicle: tuple[int, int] | None = None
        self.refused = self._reader.refused

    def feed(self, data: bytes, arrival_s: float) -> list[Event]:
        """Return the events of the messages that these bytes complete."""
        self._codec.feed(data)
        events: list[Event] = []
        while (received := self._codec.next_received()) is not None:
            if not isinstance(received, Received):
                self.refused["bytes that are no MAVLink frame"] += 1
            elif received.message is not None and self._is_ours(received):
                events += self._reader.take(received.message, arrival_s)
        return events

    def _is_ours(self, received: Received) -> bool:
        if not isinstance(received.message, _OfVehicle):
            return True
        sender = (received.header.system_id, received.header.component_id)
        self._vehicle = self._vehicle or sender
        if sender != self._vehicle:
            self.refused["a message of another vehicle"] += 1
        return sender == self._vehicle


class TlogFile:
    """A telemetry log; times of arrival are those of its entries, which ground stations count from 1970."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stream = MavlinkStream()
        self.refused = self._stream.refused

    def events(self) -> Iterator[Event]:
        """Yield the log's events. Raises InputFileError if it cannot be read."""
        try:
            reader = read_tlog(self._path)
        except TlogError as error:
            raise InputFileError(str(error)) from error
        for entry in reader:
            yield from self._stream.feed(entry.data, entry.time_us * 1e-6)
        lost = reader.skipped_bytes + reader.truncated_bytes
        if lost:
            self.refused["damaged bytes of the log"] += lost

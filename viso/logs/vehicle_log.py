# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The records that a vehicle itself writes to its log.

Source: AP_Logger/LogFile.cpp, AP_Logger/LoggerMessageWriter.cpp, ArduCopter/Log.cpp.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from ap_core.clock import Clock
from ap_core.fmath import degrees, f32
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import ARM, ATT, DSF, ERR, EV, MAV, MAVC, MODE, MSG, ORGN, VER
from ap_core.quaternion import Quaternion
from mav_handlers.channel import Channel
from mav_handlers.transfers.mission_items import MissionItem
from viso.firmware.releases import DEFAULT, Firmware
from viso.logs.logger import Logger

ORGN_EKF: Final = 0
ORGN_HOME: Final = 1
CMD: Final = "CMD"
MISE: Final = "MISE"

_BOARD_TYPE_SITL: Final = 3
_NO_BOARD_SUBTYPE: Final = 65535
_EKF3: Final = 3
_BUILT_FOR_COPTER: Final = 2
_FULL_TURN_CD: Final = 36_000


class VehicleLog:
    """Writes records, each stamped with the time of writing; the rest of a record is the arguments."""

    def __init__(self, logger: Logger, clock: Clock, firmware: Firmware = DEFAULT) -> None:
        self._logger = logger
        self._clock = clock
        self._firmware = firmware
        self._texts = 0

    def start(self, banner: Sequence[str], mode: int, reason: int) -> None:
        """Write what every log begins with, after what describes it: firmware, frame, mode."""
        firmware = self._firmware
        self.text(banner[0])
        version = (firmware.major, firmware.minor, firmware.patch, firmware.release_type)
        build = (0, _BUILT_FOR_COPTER, firmware.log.filter_version, 0, 0)
        numbers = (*version, int(firmware.source_hash, 16), firmware.banner, *build)
        self._logger.write(VER, (self._clock.micros64(), _BOARD_TYPE_SITL, _NO_BOARD_SUBTYPE, *numbers))
        for line in banner[1:]:
            self.text(line)
        self.mode(mode, reason)

    def attitude(self, quat: Quaternion | None, yaw_rad: np.float32) -> None:
        """Write ATT, the wanted attitude being the present one; nothing while there is none."""
        if quat is not None:
            roll, pitch, yaw = degrees(quat.get_euler_roll()), degrees(quat.get_euler_pitch()), degrees(yaw_rad)
            heading = yaw if yaw >= 0 else yaw + f32(360)
            angles = (roll, roll, pitch, pitch, heading, heading)
            self._logger.write(ATT, (self._clock.micros64(), *angles, _EKF3))

    def simulated(self, place: Location, rpy_rad: Sequence[float], quat_wxyz: Sequence[float]) -> None:
        """Write SIM, where a simulated vehicle really is: roll, pitch and yaw, and its attitude, body (FRD) to NED.

        Source: SITL/SITL.cpp, SIM::Log_Write_SIMSTATE, which cuts off what is below 0.01 deg.
        """
        roll, pitch, yaw = (100 * math.degrees(angle) for angle in rpy_rad)
        angles = int(roll), int(pitch), int(yaw % _FULL_TURN_CD)
        labels = "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4"
        values = (self._clock.micros64(), *angles, 0.01 * place.alt_cm, place.lat, place.lng, *quat_wxyz)
        self._logger.write_named("SIM", labels, "sddhmDU----", "FBBB0GG0000", "QccCfLLffff", values)

    def statistics(self, channels: Iterable[Channel]) -> None:
        """Write DSF, and MAV for each active link."""
        now_us = self._clock.micros64()
        self._logger.write(DSF, (now_us, self._logger.dropped, 0, self._logger.size, 0, 0, 0))
        for channel in channels:
            if channel.active:
                counts = (channel.codec.frames_sent, channel.frames_received, channel.packets_dropped)
                slowness = (channel.stream_slowdown_ms, channel.times_full)
                self._logger.write(MAV, (now_us, channel.index, *counts, 0, *slowness, 0))

    def event(self, event: int) -> None:
        """Write EV."""
        self._logger.write(EV, (self._clock.micros64(), event))

    def error(self, subsystem: int, code: int) -> None:
        """Write ERR."""
        self._logger.write(ERR, (self._clock.micros64(), subsystem, code))

    def place(self, kind: int, place: Location) -> None:
        """Write ORGN: the EKF origin (0) or home (1)."""
        self._logger.write(ORGN, (self._clock.micros64(), kind, place.lat, place.lng, place.alt_cm))

    def mode(self, mode: int, reason: int) -> None:
        """Write MODE; ``reason`` is a ModeReason."""
        self._logger.write(MODE, (self._clock.micros64(), mode, mode, reason))

    def arming(self, *, armed: bool, checks: int, forced: bool, method: int) -> None:
        """Write ARM; ``checks`` as ARMING_CHECK has them, ``method`` an AP_Arming::Method."""
        values = (int(armed), checks, int(forced), method)
        self._logger.write(ARM, (self._clock.micros64(), *values))

    def text(self, text: str) -> None:
        """Write MSG, which holds the first 64 characters (AP_Logger_Backend::Write_Message)."""
        release = self._firmware.log
        self._logger.write(MSG, (self._clock.micros64(), *release.message_head(self._texts), text))
        self._texts += 1

    def parameter(self, name: str, value: np.float32) -> None:
        """Write PARM of a change."""
        self._logger.write_parameter(name, value)

    def command(self, values: Sequence[LogValue]) -> None:
        """Write MAVC: everything after TimeUS."""
        self._logger.write(MAVC, (self._clock.micros64(), *values))

    def mission_item(self, name: str, total: int, seq: int, item: MissionItem) -> None:
        """Write CMD, an item of a mission, or MISE, one that begins (AP_Logger_Backend::Write_Mission_Cmd)."""
        labels = "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"
        values = (self._clock.micros64(), total, seq, item.command, *item.params, item.x, item.y, item.z, item.frame)
        self._logger.write_named(name, labels, "s-------DUm-", "F-------GG0-", "QHHHffffLLfB", values)

    def timesync(self, system_id: int, round_trip_us: int) -> None:
        """Write TSYN."""
        values = (self._clock.micros64(), system_id, round_trip_us)
        self._logger.write_named("TSYN", "TimeUS,SysID,RTT", "s-s", "F-F", "QBQ", values)

    def aux_function(self, function: int, position: int, source: int, index: int, result: bool) -> None:
        """Write AUXF: an auxiliary function, and what ran it."""
        head = self._clock.micros64(), function, position, source
        if self._firmware.log.has_index_of_aux_function:
            labels = "TimeUS,function,pos,source,index,result"
            self._logger.write_named("AUXF", labels, "s#----", "F-----", "QHBBHB", (*head, index, int(result)))
        else:
            labels = "TimeUS,function,pos,source,result"
            self._logger.write_named("AUXF", labels, "s#---", "F----", "QHBBB", (*head, int(result)))

    def named_value(self, time_boot_ms: int, name: str, value: float, system_id: int, component_id: int) -> None:
        """Write NVAL: somebody's named value, with the sender's ids."""
        values = (self._clock.micros64(), time_boot_ms, name, value, system_id, component_id)
        self._logger.write_named("NVAL", "TimeUS,TimeBootMS,Name,Value,SSys,SCom", "ss#---", "FC----", "QINfBB", values)

    def dropped(self) -> int:
        """Return the number of records lost."""
        return self._logger.dropped

    def failed(self) -> bool:
        """Return whether the log cannot be written."""
        return self._logger.failure is not None

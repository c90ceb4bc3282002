# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The reports of a vehicle's own filter in telemetry: EKF_STATUS_REPORT, SYS_STATUS, HEARTBEAT, texts."""

import re
from collections.abc import Mapping, Sequence
from itertools import dropwhile
from typing import Final

import numpy as np

from mav_handlers.wire.messages import (
    EKF_STATUS_REPORT,
    GLOBAL_POSITION_INT,
    GPS_GLOBAL_ORIGIN,
    HEARTBEAT,
    SYS_STATUS,
    Message,
)
from viso.doctor.evidence.own_filter import (
    CHANNELS,
    OwnFilter,
    VisionSensor,
    Witness,
    aiding_texts,
    says_origin,
    sources_over,
    spans_between,
)

MAV_MODE_FLAG_SAFETY_ARMED: Final = 128
MAV_SYS_STATUS_SENSOR_VISION_POSITION: Final = 1 << 7
_FAILSAFE: Final = re.compile(r"EKF (variance|Failsafe(?! Cleared))")
_LANE: Final = re.compile(r"EKF primary changed:(\d)")
_SOURCE_SET: Final = re.compile(r"Using EKF Source Set (\d)")


class FilterListener:
    """Collects what one autopilot reports about its filter and its vision sensor."""

    MESSAGES: Final = ("EKF_STATUS_REPORT", "SYS_STATUS", "HEARTBEAT")

    def __init__(self) -> None:
        self._reports: list[tuple[int, int, tuple[float, ...]]] = []
        self._sensors: list[tuple[int, int, int, int]] = []
        self._armed: list[tuple[int, bool]] = []
        self._places, self._has_place = 0, False
        self._end_us = 0

    def take(self, time_us: int, message: Message | None) -> None:
        """Take a message that came at a time in us since boot."""
        self._end_us = time_us
        if isinstance(message, EKF_STATUS_REPORT):
            ratios = (
                message.velocity_variance,
                message.pos_horiz_variance,
                message.pos_vert_variance,
                message.compass_variance,
            )
            self._reports.append((time_us, message.flags, ratios))
        elif isinstance(message, SYS_STATUS):
            bits = (
                message.onboard_control_sensors_present,
                message.onboard_control_sensors_enabled,
                message.onboard_control_sensors_health,
            )
            self._sensors.append((time_us, *bits))
        elif isinstance(message, GPS_GLOBAL_ORIGIN):
            self._has_place = True
        elif isinstance(message, GLOBAL_POSITION_INT):  # of 0, 0 without an origin
            self._places += 1
            self._has_place |= message.lat != 0 or message.lon != 0
        elif isinstance(message, HEARTBEAT):
            self._armed.append((time_us, bool(message.base_mode & MAV_MODE_FLAG_SAFETY_ARMED)))

    def own_filter(
        self,
        params: Mapping[str, float],
        changes: Sequence[tuple[int, str, float]],
        texts: Sequence[tuple[int, str]],
    ) -> OwnFilter:
        """Return what was collected; ``params`` are those at first, changes have time, name and new value."""
        time_us = np.array([report[0] for report in self._reports], dtype=np.int64)
        flags = np.array([report[1] for report in self._reports], dtype=np.int64)
        ratios = np.array([report[2] for report in self._reports], dtype=np.float64).reshape(-1, len(CHANNELS))
        switches = [(at, int(match[1]) - 1) for at, text in texts if (match := _SOURCE_SET.match(text))]
        reported = [(at, by_extnav) for at, by_extnav, _ in aiding_texts(texts)]
        states = list(dropwhile(lambda state: not state[1], self._armed))
        return OwnFilter(
            witness=Witness.TELEMETRY,
            record="EKF_STATUS_REPORT" if len(time_us) else "",
            time_us=time_us,
            ratios=np.where(np.isfinite(ratios), ratios, np.nan),
            flags=flags,
            timeouts=np.zeros(len(flags), dtype=np.int64),
            sources=sources_over(time_us, params, changes, switches, reported),
            innovation_us=np.zeros(0, dtype=np.int64),
            innovations=np.zeros((0, len(CHANNELS))),
            armed=spans_between(states, 0, self._end_us) if self._armed else None,
            texts=tuple(texts),
            failsafes=tuple((at, text) for at, text in texts if _FAILSAFE.match(text)),
            lanes=tuple((at, int(match[1])) for at, text in texts if (match := _LANE.match(text))),
            vision=self._vision(),
            has_origin=True if self._has_place or says_origin(texts) else False if self._places else None,
        )

    def _vision(self) -> VisionSensor | None:
        if not self._sensors:
            return None
        table = np.array(self._sensors, dtype=np.int64)
        present, enabled, healthy = (table[:, 1:] & MAV_SYS_STATUS_SENSOR_VISION_POSITION != 0).T
        return VisionSensor(table[:, 0], present, enabled, healthy)

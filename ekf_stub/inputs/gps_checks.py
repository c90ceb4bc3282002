# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether GPS is good enough to start with (AP_NavEKF3/AP_NavEKF3_VehicleStatus.cpp, calcGpsGoodToAlign).

The checks are those of the default of EK3_GPS_CHECK. Accuracies are taken as they are, without the firmware's filter.
"""

from typing import Final

from ap_core.cint import u32
from ekf_stub.inputs.gps_sample import FIX_3D, GpsSample

MIN_INTERVAL_MS: Final = 50
PASS_TIME_MS: Final = 10_000
FAIL_TIME_MS: Final = 5000
MAX_HDOP: Final = 250
MIN_SATS: Final = 6
HYSTERESIS: Final = 1.3

_MAX_HORIZONTAL_M: Final = 5.0
_MAX_VERTICAL_M: Final = 7.5
_MAX_SPEED_MS: Final = 1.0


class GpsChecks:
    """Judges every solution.

    Attributes:
        good: whether GPS has passed for 10 s, and not failed for 5 s since.
        reason: what the last failure was, in the words of the pre-arm check; None before the first solution.
        newest: the last solution with a 3D fix.
    """

    def __init__(self) -> None:
        self.good = False
        self.reason: str | None = None
        self.newest: GpsSample | None = None
        self._last_ms = 0
        self._failed_ms: int | None = None
        self._passed_ms = 0

    def update(self, sample: GpsSample, now_ms: int) -> GpsSample | None:
        """Look at the receiver's last solution; return it when it is new and has a 3D fix (readGpsData)."""
        if u32(sample.time_ms - self._last_ms) <= MIN_INTERVAL_MS:
            return None
        self._last_ms = sample.time_ms
        if sample.fix_type < FIX_3D:
            self.reason = "Waiting for 3D fix"
            return None
        self.newest = sample
        self._judge(sample, now_ms)
        return sample

    def _judge(self, sample: GpsSample, now_ms: int) -> None:
        failure = self._failure_of(sample)
        if failure is not None:
            self.reason = failure
        if self._failed_ms is None:
            self.reason = "EKF starting GPS checks"
            self._failed_ms = now_ms
        if failure is not None:
            self._failed_ms = now_ms
        else:
            self._passed_ms = now_ms
        if not self.good and now_ms - self._failed_ms > PASS_TIME_MS:
            self.good = True
        elif self.good and now_ms - self._passed_ms > FAIL_TIME_MS:
            self.good = False

    def _failure_of(self, sample: GpsSample) -> str | None:
        scale = HYSTERESIS if self.good else 1.0
        limits = (
            (sample.horizontal_accuracy, _MAX_HORIZONTAL_M, "GPS horiz error {:.1f}m (needs {:.1f})"),
            (sample.vertical_accuracy, _MAX_VERTICAL_M, "GPS vert error {:.1f}m (needs < {:.1f})"),
            (sample.speed_accuracy, _MAX_SPEED_MS, "GPS speed error {:.1f} (needs < {:.1f})"),
        )
        # The last failure is the one that is told.
        failure = None
        for value, limit, text in limits:
            if value is not None and value > limit * scale:
                failure = text.format(value, limit * scale)
        if sample.hdop > MAX_HDOP:
            failure = f"GPS HDOP {sample.hdop * 0.01:.1f} (needs 2.5)"
        if sample.num_sats < MIN_SATS:
            failure = f"GPS numsats {sample.num_sats} (needs 6)"
        return failure

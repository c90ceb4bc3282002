# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether GPS is good enough to start with (AP_NavEKF3/AP_NavEKF3_VehicleStatus.cpp, calcGpsGoodToAlign)."""

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from ap_core.cint import u32
from ap_core.location import Location
from ekf_stub.filter.inertial import limited
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
_MAX_DRIFT_M: Final = 3.0
_MAX_AVERAGE_MS: Final = 0.3
_DRIFT_TIME_S: Final = 10.0
_DRIFT_LIMIT_M: Final = 10.0
_MIN_INTERVAL_S: Final = 0.01
_AVERAGE_SHARE: Final = 0.1
_AVERAGE_LIMIT_MS: Final = 10.0
# Of EK3_GPS_CHECK:
_SATS, _HDOP, _SPEED_ERR, _POS_ERR, _YAW_ERR, _DRIFT, _VERT_SPEED, _HORIZ_SPEED = (1 << bit for bit in range(8))


class GpsSurroundings(NamedTuple):
    """What else says whether GPS is to be believed.

    ``speed_accuracy`` is the worst of the last seconds, m/s, 0 without any; ``horizontal_speed`` that of the last fix
    at the horizon, m/s. ``mag_x`` and ``mag_y`` are ratios of the compass's innovations to their gates, squared,
    ``yaw`` that of yaw.
    """

    speed_accuracy: float = 0.0
    horizontal_speed: float = 0.0
    on_ground: bool = True
    mag_x: float = 0.0
    mag_y: float = 0.0
    yaw: float = 0.0


class GpsChecks:
    """Judges every solution, before and in flight.

    Attributes:
        good: whether GPS has passed for 10 s, and not failed for 5 s since.
        reason: what the last failure was, in the words of the pre-arm check; None before the first solution.
        newest: the last solution with a 3D fix.
    """

    def __init__(self, get_float: Callable[[str], float]) -> None:
        self._get_float = get_float
        self.good = False
        self.reason: str | None = None
        self.newest: GpsSample | None = None
        self._last_ms = 0
        self._failed_ms: int | None = None
        self._passed_ms = self._judged_ms = 0
        self._place = Location(0, 0, 0)
        self._drift_m = self._climb_ms = self._speed_ms = 0.0

    def update(self, sample: GpsSample) -> GpsSample | None:
        """Look at the receiver's last solution; return it when it is new and has a 3D fix (readGpsData)."""
        if u32(sample.time_ms - self._last_ms) <= MIN_INTERVAL_MS:
            return None
        self._last_ms = sample.time_ms
        if sample.fix_type < FIX_3D:
            self.reason = "Waiting for 3D fix"
            return None
        self.newest = sample
        return sample

    def judge(self, sample: GpsSample, now_ms: int, around: GpsSurroundings) -> None:
        """Find out whether GPS is good by a solution that `update` has returned."""
        self._follow_motion(sample, now_ms, around)
        failure = None
        for failure in self._failures(sample, around):
            self.reason = failure  # the last one is the one that is told
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

    def _follow_motion(self, sample: GpsSample, now_ms: int, around: GpsSurroundings) -> None:
        interval_s = limited(1e-3 * (now_ms - self._judged_ms), _MIN_INTERVAL_S, _DRIFT_TIME_S)
        self._judged_ms = now_ms
        north, east, _ = (float(value) for value in self._place.distance_ned(sample.location).to_tuple())
        self._place = sample.location
        drift = (self._drift_m + (north * north + east * east) ** 0.5) * (1.0 - interval_s / _DRIFT_TIME_S)
        self._drift_m = min(drift, _DRIFT_LIMIT_M)
        if around.on_ground:
            self._speed_ms = _averaged(self._speed_ms, around.horizontal_speed)
            if sample.has_vertical_velocity:
                self._climb_ms = _averaged(self._climb_ms, float(sample.vel_ned.z))

    def _failures(self, sample: GpsSample, around: GpsSurroundings) -> Iterator[str]:
        """Return what fails, in the firmware's order."""
        checks = int(self._get_float("GPS_CHECK"))
        scale = 0.01 * self._get_float("CHECK_SCALE") * (HYSTERESIS if self.good else 1.0)
        slow = _MAX_AVERAGE_MS * scale
        climb = abs(self._climb_ms) if sample.has_vertical_velocity else 0.0
        if checks & _DRIFT and around.on_ground and self._drift_m > _MAX_DRIFT_M * scale:
            yield f"GPS drift {self._drift_m:.1f}m (needs {_MAX_DRIFT_M * scale:.1f})"
        if checks & _VERT_SPEED and around.on_ground and climb > slow:
            yield f"GPS vertical speed {climb:.2f}m/s (needs {slow:.2f})"
        if checks & _HORIZ_SPEED and around.on_ground and self._speed_ms > slow:
            # FIRMWARE PARITY: what it tells is the drift.
            yield f"GPS horizontal speed {self._drift_m:.2f}m/s (needs {slow:.2f})"
        limits = (
            (_POS_ERR, sample.horizontal_accuracy, _MAX_HORIZONTAL_M, "GPS horiz error {:.1f}m (needs {:.1f})"),
            (_POS_ERR, sample.vertical_accuracy, _MAX_VERTICAL_M, "GPS vert error {:.1f}m (needs < {:.1f})"),
            (_SPEED_ERR, around.speed_accuracy, _MAX_SPEED_MS, "GPS speed error {:.1f} (needs < {:.1f})"),
        )
        for bit, value, limit, text in limits:
            if checks & bit and value is not None and value > limit * scale:
                yield text.format(value, limit * scale)
        if checks & _HDOP and sample.hdop > MAX_HDOP:
            yield f"GPS HDOP {sample.hdop * 0.01:.1f} (needs 2.5)"
        if checks & _SATS and sample.num_sats < MIN_SATS:
            yield f"GPS numsats {sample.num_sats} (needs 6)"
        if checks & _YAW_ERR and max(around.mag_x, around.mag_y, around.yaw) > 1:
            yield f"Mag yaw error x={around.mag_x:.1f} y={around.mag_y:.1f}"


def _averaged(average: float, value: float) -> float:
    return limited(average + _AVERAGE_SHARE * (value - average), -_AVERAGE_LIMIT_MS, _AVERAGE_LIMIT_MS)

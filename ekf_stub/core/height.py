# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which sensor gives the height, what it says, and how high the origin is.

Source: AP_NavEKF3_PosVelFusion.cpp (selectHeightForFusion), AP_NavEKF3_Measurements.cpp (correctEkfOriginHeight).
"""

from typing import Final, final

from ekf_stub.core.aiding import Aiding, Vehicle
from ekf_stub.core.covariance import POS_D
from ekf_stub.core.ext_nav import ExtNav
from ekf_stub.core.gps import CENTI, HEIGHT_TO_HORIZONTAL, Gps
from ekf_stub.core.params import BARO, EXTNAV, GPS, NONE, RANGEFINDER, EkfSources, Params
from ekf_stub.core.samples import BaroSample, ObsRing
from ekf_stub.core.state import State
from ekf_stub.core.terrain import Terrain
from ekf_stub.core.vectors import larger, length2, limited, since_ms, single, square

# Bits of EK3_OGN_HGT_MASK:
_BY_BARO: Final = 1  # GPS corrects the origin's height while height comes from the barometer
_BY_RANGE: Final = 2  # the same, while it comes from a range finder
IN_MEASUREMENTS: Final = 4  # it is the heights measured that are corrected, and not what is told of the origin
_BARO_DRIFT_M_S: Final = 0.05000000074505806
_STEEPEST: Final = 0.25
_MAX_RATIO: Final = 25.0


@final
class OriginHeight:
    """The height of a core's origin above mean sea level.

    Attributes:
        alt_cm: as it was set.
        reference_m: as GPS has it by now.
        variance: of that, m^2.
    """

    def __init__(self) -> None:
        self.alt_cm = 0
        self.reference_m = 0.0
        self.variance = 0.0
        self._corrected_ms = 0

    def put(self, alt_cm: int) -> None:
        """Put the origin at a height."""
        self.alt_cm, self.reference_m = alt_cm, CENTI * alt_cm

    @property
    def excess_m(self) -> float:
        """How much higher the origin is than it was set, in single precision."""
        return single(self.reference_m - CENTI * self.alt_cm)

    def correct(self, horizon_ms: int, innovation_m: float, variance: float, drift_m_s: float, is_good: bool) -> None:
        """Correct it by a solution of the GPS, if that is good enough to be believed.

        ``innovation_m`` is the filter's height less that of GPS, ``variance`` that of this difference, m^2,
        ``drift_m_s`` how fast the sensor that gives the height may drift.
        """
        dt = limited(0.001 * (horizon_ms - self._corrected_ms), 0.0, 1.0)
        self._corrected_ms = horizon_ms
        self.variance += square(drift_m_s * dt)
        total = self.variance + variance
        if is_good and square(innovation_m) / total < _MAX_RATIO:
            gain = self.variance / total
            self.reference_m -= gain * innovation_m
            self.variance -= gain * self.variance


FRESH_MS: Final = 500
_GPS_LOST_MS: Final = 2000
_HEIGHT_RETRY_MS: Final = 5000
_HEIGHT_RETRY_WITH_VELOCITY_MS: Final = 10_000
_NO_HEIGHT_PERIOD_MS: Final = 70
_NO_HEIGHT_NOISE: Final = 2.0
_GROUND_EFFECT_SCALER: Final = 4.0
_LEAST_UPRIGHT: Final = 0.7
_GROUND_LOST_MS: Final = 1000
_LOWER_SWITCH: Final = 0.7
_OFFSET_GAIN: Final = 0.1
_OFFSET_STEP_LIMIT: Final = 5.0


@final
class HeightSource:
    """Chooses the source of height, and measures by it.

    Attributes:
        active: the source, a number of EK3_SRCn_POSZ.
        is_new: whether it gave another height in this step.
        down, variance: what was measured last, m and m^2.
        is_lost: nothing has passed the gate for too long.
        baro: heights that wait for the horizon.
        baro_height: the last that came due.
        terrain: the ground, from which a range finder tells the height.
        terrain_is_stable: as the vehicle says, heights may count from it.
        velocity_is_valid: the horizontal velocity was known in the step before.
    """

    def __init__(
        self,
        params: Params,
        state: State,
        aiding: Aiding,
        sources: EkfSources,
        ext_nav: ExtNav,
        gps: Gps,
        origin_height: OriginHeight,
        terrain: Terrain,
        ring_size: int,
    ) -> None:
        self._params = params
        self._state = state
        self._aiding = aiding
        self._sources = sources
        self._ext_nav = ext_nav
        self._gps = gps
        self._origin_height = origin_height
        self.terrain = terrain
        self.terrain_is_stable = True
        self.velocity_is_valid = False
        self.baro: ObsRing[BaroSample] = ObsRing(ring_size)
        self.baro_height = 0.0
        self.active = BARO
        self._fused = BARO
        self._baro_offset = 0.0
        self.is_new = False
        self.is_lost = False
        self.down = 0.0
        self.variance = 1.0

    def select(self, now_ms: int, vehicle: Vehicle) -> bool:
        """Choose and measure, once a step; say whether the source has changed and the height must follow."""
        baro = self.baro.recall(self._ext_nav.horizon_ms)
        if baro is not None:
            self.baro_height = baro.height
        self._choose(now_ms)
        if baro is not None and self.active != BARO:
            error = baro.height + self._state.pos[2] - self._baro_offset
            self._baro_offset += _OFFSET_GAIN * limited(error, -_OFFSET_STEP_LIMIT, _OFFSET_STEP_LIMIT)
        if self._gps.is_due:
            self._correct_origin()
        self.is_new = self._measure(now_ms, baro, vehicle)
        has_changed = self.is_new and self.active != self._fused
        if has_changed:
            self._fused = self.active
        return has_changed

    def _mask(self) -> int:
        """Return the bit of EK3_OGN_HGT_MASK that is about the source of height."""
        return _BY_BARO if self.active == BARO else _BY_RANGE if self.active == RANGEFINDER else 0

    def _correct_origin(self) -> None:
        """Let GPS tell how high the origin is, while height comes from another sensor."""
        fix, gps = self._gps.delayed, self._gps
        if fix is None or not int(self._params.OGN_HGT_MASK) & self._mask():
            return
        by_slope = _STEEPEST * length2(self._state.vel[0], self._state.vel[1])
        self._origin_height.correct(
            self._ext_nav.horizon_ms,
            fix.pos[2] - self._state.pos[2],
            square(gps.height_accuracy) + self._state.cov.var(POS_D),
            _BARO_DRIFT_M_S if self.active == BARO else by_slope,
            gps.accuracy_good,
        )

    def _excess_m(self) -> float:
        """Return by how much higher a measurement is to count."""
        mask = int(self._params.OGN_HGT_MASK)
        return self._origin_height.excess_m if mask & IN_MEASUREMENTS and mask & self._mask() else 0.0

    def check_timeout(self, now_ms: int, imu_is_bad: bool) -> None:
        """Find out whether height is lost, as it is with accelerometers that have been bad for a while."""
        has_velocity = self._ext_nav.have_velocity or self._gps.tells_climb
        with_velocity = has_velocity and not self._aiding.vel_timeout
        retry_ms = _HEIGHT_RETRY_WITH_VELOCITY_MS if with_velocity else _HEIGHT_RETRY_MS
        self.is_lost = imu_is_bad or now_ms - self._aiding.height_ms > retry_ms

    def use_pose(self) -> None:
        """Measure by the last pose, whatever the source is."""
        pose = self._ext_nav.pose
        if pose is not None:
            self.down, self.variance = pose.pos[2], square(limited(pose.err, 0.1, 10.0))

    def _choose(self, now_ms: int) -> None:
        source, gps, ext_nav = self._sources.pos_z(), self._gps, self._ext_nav
        ext_nav_is_fresh = ext_nav.have_pose and since_ms(now_ms, ext_nav.pose_stamp_ms) < FRESH_MS
        range_is_fresh = self.terrain.ranges.is_fresh(now_ms)
        gps_age_ms = since_ms(now_ms, gps.received_ms)
        if source == NONE:
            self.active = NONE
        elif source == RANGEFINDER and range_is_fresh:
            self.active = RANGEFINDER
        elif range_is_fresh and (source == BARO or source == GPS) and self._params.RNG_USE_HGT > 0:
            self._switch_range(now_ms, source)
        elif source == BARO:
            self.active = BARO
        elif source == GPS and gps_age_ms < FRESH_MS and gps.newest is not None and gps.accuracy_good:
            self.active = GPS
        elif source == EXTNAV and ext_nav_is_fresh:
            self.active = EXTNAV
        gps_is_lost = self.active == GPS and (gps_age_ms > _GPS_LOST_MS or not gps.height_good)
        ext_nav_is_lost = self.active == EXTNAV and not ext_nav_is_fresh
        if gps_is_lost or ext_nav_is_lost or (self.active == RANGEFINDER and not range_is_fresh):
            self.active = BARO

    def _switch_range(self, now_ms: int, source: int) -> None:
        """Take the range finder near the ground while the vehicle is slow, and its source of height otherwise."""
        terrain, above = self.terrain, self.terrain.above
        highest = 0.01 * terrain.ranges.max_distance * self._params.RNG_USE_HGT
        speed = length2(self._state.vel[0], self._state.vel[1]) if self.velocity_is_valid else 0.0
        limit = self._params.RNG_USE_SPD
        is_too_fast = self.velocity_is_valid and speed > limit
        is_slow = not self.velocity_is_valid or speed < larger(limit - 1, 0.5 * limit)
        is_low = above < _LOWER_SWITCH * highest and now_ms - terrain.valid_ms < _GROUND_LOST_MS
        if self.active == RANGEFINDER and (above > highest or is_too_fast or not self.terrain_is_stable):
            self.active = source
        elif is_low and is_slow and self.terrain_is_stable and self._upright() >= _LEAST_UPRIGHT:
            self.active = RANGEFINDER

    def _upright(self) -> float:
        return self._state.rotation[2][2]

    def _measure(self, now_ms: int, baro: BaroSample | None, vehicle: Vehicle) -> bool:
        params, gps = self._params, self._gps
        if self.active == EXTNAV and self._ext_nav.has_pose:
            self.use_pose()
        elif self.active == RANGEFINDER and self.terrain.ranges.is_due:
            return self._measure_by_range()
        elif self.active == GPS and gps.is_due and gps.delayed is not None:
            noise = HEIGHT_TO_HORIZONTAL * params.POSNE_M_NSE
            accuracy = gps.height_accuracy
            self.down = gps.delayed.pos[2]
            self.variance = square(limited(accuracy, noise, 100.0) if accuracy > 0 else limited(noise, 0.1, 10.0))
        elif self.active == BARO and baro is not None:
            self.down = self._baro_offset - baro.height - self._excess_m()
            self.variance = square(limited(params.ALT_M_NSE, 0.1, 100.0))
            if vehicle.near_ground:
                self.variance *= _GROUND_EFFECT_SCALER
        elif self.active == NONE and now_ms - self._aiding.height_ms > _NO_HEIGHT_PERIOD_MS:
            self.down = 0.0
            in_air = limited(params.ALT_M_NSE, _NO_HEIGHT_NOISE, 100.0)
            self.variance = square(_NO_HEIGHT_NOISE if vehicle.on_ground else in_air)
        else:
            return False
        return True

    def _measure_by_range(self) -> bool:
        """Measure by the range to flat ground; say whether the vehicle is upright enough for that."""
        upright, ranges = self._upright(), self.terrain.ranges
        if upright < _LEAST_UPRIGHT:
            return False
        self.down = self.terrain.down - larger(ranges.distance * upright, ranges.on_ground) - self._excess_m()
        by_slope = square(ranges.distance * self._params.TERR_GRAD) * larger(0.0, 1.0 - upright * upright)
        self.variance = square(limited(self._params.RNG_M_NSE, 0.1, 10.0)) + by_slope
        return True

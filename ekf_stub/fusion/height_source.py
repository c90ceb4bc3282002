# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which sensor gives the height, and what it says (AP_NavEKF3_PosVelFusion.cpp, selectHeightForFusion)."""

import math
from dataclasses import dataclass
from typing import Final

from ap_core.cint import u32
from ekf_stub.filter.inertial import limited
from ekf_stub.filter.states import POS
from ekf_stub.fusion.measurements import BaroSample
from ekf_stub.fusion.origin_height import BARO_DRIFT_M_S, BY_BARO, BY_RANGE, IN_MEASUREMENTS, STEEPEST
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.fusion.terrain import Terrain
from ekf_stub.inputs.gps_reading import HEIGHT_TO_HORIZONTAL
from ekf_stub.inputs.obs_ring import ObsRing
from ekf_stub.inputs.sources import Z_BARO, Z_EXTNAV, Z_GPS, Z_NONE, Z_RANGE, SourceZ

FRESH_MS: Final = 500
GPS_LOST_MS: Final = 2000
HEIGHT_RETRY_MS: Final = 5000
HEIGHT_RETRY_WITH_VELOCITY_MS: Final = 10_000
NO_HEIGHT_PERIOD_MS: Final = 70
NO_HEIGHT_NOISE: Final = 2.0
GROUND_EFFECT_SCALER: Final = 4.0
LEAST_UPRIGHT: Final = 0.7
GROUND_LOST_MS: Final = 1000
LOWER_SWITCH: Final = 0.7
_OFFSET_GAIN: Final = 0.1
_OFFSET_STEP_LIMIT: Final = 5.0

BARO: Final = "baro"
EXT_NAV: Final = "ext_nav"
GPS: Final = "gps"
RANGE: Final = "range"
NO_SOURCE: Final = "none"

_MASKS: Final = {BARO: BY_BARO, RANGE: BY_RANGE}
_POS_D: Final = POS.stop - 1
_BY_Z: Final = {Z_BARO: BARO, Z_GPS: GPS}


@dataclass(frozen=True, slots=True)
class Vehicle:
    """What the filter knows of the vehicle in a step.

    Attributes:
        armed: as it says.
        on_ground, in_flight: each surely so; both may be False.
        near_ground: take-off or touch-down is expected, and with it a wrong air pressure.
        tilt_aligned: roll and pitch are known.
    """

    armed: bool
    on_ground: bool
    in_flight: bool
    near_ground: bool = False
    tilt_aligned: bool = True


class HeightSource(Fusion):
    """Chooses the source of height, and measures by it.

    Attributes:
        active: the source.
        is_new: whether it gave another height in this step.
        down, variance: what was measured last, m and m^2.
        is_lost: nothing has passed the gate for too long.
        baro: heights that wait for the horizon.
        baro_height: the last that came due.
        terrain: the ground, from which a range finder tells the height.
        terrain_is_stable: as the vehicle says, heights may count from it.
        velocity_is_valid: the horizontal velocity was known in the step before.
    """

    def __init__(self, parts: FilterParts, terrain: Terrain) -> None:
        super().__init__(parts)
        self._origin_height = parts.origin_height
        self.terrain = terrain
        self.terrain_is_stable = True
        self.velocity_is_valid = False
        self.baro: ObsRing[BaroSample] = ObsRing(parts.ring_size)
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
        baro = self.baro.recall(self._ingest.horizon_ms).sample if self.baro.samples else None
        if baro is not None:
            self.baro_height = baro.height
        self._choose(now_ms)
        if baro is not None and self.active != BARO:
            error = baro.height + self._state.down - self._baro_offset
            self._baro_offset += _OFFSET_GAIN * limited(error, -_OFFSET_STEP_LIMIT, _OFFSET_STEP_LIMIT)
        if self._gps.is_due:
            self._correct_origin()
        self.is_new = self._measure(now_ms, baro, vehicle)
        has_changed = self.is_new and self.active != self._fused
        if has_changed:
            self._fused = self.active
        return has_changed

    def _correct_origin(self) -> None:
        """Let GPS tell how high the origin is, while height comes from another sensor."""
        fix, gps = self._gps.delayed, self._gps
        if fix is None or not int(self._get_float("OGN_HGT_MASK")) & _MASKS.get(self.active, 0):
            return
        by_slope = STEEPEST * math.hypot(*self._state.vel[:2].tolist())
        self._origin_height.correct(
            self._ingest.horizon_ms,
            float(fix.pos[2]) - self._state.down,
            gps.height_accuracy**2 + self._state.cov.item(_POS_D, _POS_D),
            drift_m_s=BARO_DRIFT_M_S if self.active == BARO else by_slope,
            is_good=gps.accuracy_good,
        )

    def _excess_m(self) -> float:
        """Return by how much higher a measurement is to count."""
        mask = int(self._get_float("OGN_HGT_MASK"))
        is_wanted = mask & IN_MEASUREMENTS and mask & _MASKS[self.active]
        return self._origin_height.excess_m if is_wanted else 0.0

    def check_timeout(self, now_ms: int, *, imu_is_bad: bool = False) -> None:
        """Find out whether height is lost, as it is with accelerometers that have been bad for a while."""
        has_velocity = self._ingest.have_velocity or self._gps.tells_climb
        with_velocity = has_velocity and not self._aiding.vel_timeout
        retry_ms = HEIGHT_RETRY_WITH_VELOCITY_MS if with_velocity else HEIGHT_RETRY_MS
        self.is_lost = imu_is_bad or now_ms - self._aiding.times.height > retry_ms

    def use_pose(self) -> None:
        """Measure by the last pose, whatever the source is."""
        pose = self._delayed.pose
        if pose is not None:
            self.down, self.variance = float(pose.pos[2]), limited(pose.err, 0.1, 10.0) ** 2

    def _choose(self, now_ms: int) -> None:
        source = self._sources.pos_z()
        ext_nav_is_fresh = self._ingest.have_pose and u32(now_ms - self._ingest.pose_stamp_ms) < FRESH_MS
        range_is_fresh = self.terrain.ranges.is_fresh(now_ms)
        if source == Z_NONE:
            self.active = NO_SOURCE
        elif source == Z_RANGE and range_is_fresh:
            self.active = RANGE
        elif range_is_fresh and source in _BY_Z and self._get_float("RNG_USE_HGT") > 0:
            self._switch_range(now_ms, _BY_Z[SourceZ(source)])
        elif source == Z_BARO:
            self.active = BARO
        elif source == Z_GPS and self._gps_age_ms(now_ms) < FRESH_MS and self._gps.newest and self._gps.accuracy_good:
            self.active = GPS
        elif source == Z_EXTNAV and ext_nav_is_fresh:
            self.active = EXT_NAV
        gps_is_lost = self.active == GPS and self._gps_age_ms(now_ms) > GPS_LOST_MS
        ext_nav_is_lost = self.active == EXT_NAV and not ext_nav_is_fresh
        if gps_is_lost or ext_nav_is_lost or (self.active == RANGE and not range_is_fresh):
            self.active = BARO

    def _switch_range(self, now_ms: int, source: str) -> None:
        """Take the range finder near the ground while the vehicle is slow, and its source of height otherwise."""
        terrain, above = self.terrain, self.terrain.above
        highest = 0.01 * terrain.ranges.max_distance * self._get_float("RNG_USE_HGT")
        north, east, _ = self._state.vel.tolist()
        speed = math.hypot(north, east) if self.velocity_is_valid else 0.0
        limit = self._get_float("RNG_USE_SPD")
        is_too_fast = self.velocity_is_valid and speed > limit
        is_slow = not self.velocity_is_valid or speed < max(limit - 1, 0.5 * limit)
        is_low = above < LOWER_SWITCH * highest and now_ms - terrain.valid_ms < GROUND_LOST_MS
        if self.active == RANGE and (above > highest or is_too_fast or not self.terrain_is_stable):
            self.active = source
        elif is_low and is_slow and self.terrain_is_stable and self._upright() >= LEAST_UPRIGHT:
            self.active = RANGE

    def _upright(self) -> float:
        return self._state.rotation.item(2, 2)

    def _gps_age_ms(self, now_ms: int) -> int:
        return u32(now_ms - self._gps.received_ms)

    def _measure(self, now_ms: int, baro: BaroSample | None, vehicle: Vehicle) -> bool:
        if self.active == EXT_NAV and self._delayed.has_pose:
            self.use_pose()
        elif self.active == RANGE and self.terrain.ranges.is_due:
            return self._measure_by_range()
        elif self.active == GPS and self._gps.is_due and self._gps.delayed is not None:
            noise = HEIGHT_TO_HORIZONTAL * self._get_float("POSNE_M_NSE")
            accuracy = self._gps.height_accuracy
            self.down = float(self._gps.delayed.pos[2])
            self.variance = (limited(accuracy, noise, 100.0) if accuracy > 0 else limited(noise, 0.1, 10.0)) ** 2
        elif self.active == BARO and baro is not None:
            self.down = self._baro_offset - baro.height - self._excess_m()
            self.variance = limited(self._get_float("ALT_M_NSE"), 0.1, 100.0) ** 2
            if vehicle.near_ground:
                self.variance *= GROUND_EFFECT_SCALER
        elif self.active == NO_SOURCE and now_ms - self._aiding.times.height > NO_HEIGHT_PERIOD_MS:
            self.down = 0.0
            in_air = limited(self._get_float("ALT_M_NSE"), NO_HEIGHT_NOISE, 100.0)
            self.variance = (NO_HEIGHT_NOISE if vehicle.on_ground else in_air) ** 2
        else:
            return False
        return True

    def _measure_by_range(self) -> bool:
        """Measure by the range to flat ground; say whether the vehicle is upright enough for that."""
        upright, ranges = self._upright(), self.terrain.ranges
        if upright < LEAST_UPRIGHT:
            return False
        self.down = self.terrain.down - max(ranges.distance * upright, ranges.on_ground) - self._excess_m()
        by_slope = (ranges.distance * self._get_float("TERR_GRAD")) ** 2 * max(0.0, 1.0 - upright * upright)
        self.variance = limited(self._get_float("RNG_M_NSE"), 0.1, 10.0) ** 2 + by_slope
        return True

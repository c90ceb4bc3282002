# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where releases of EKF3 differ, and which of it a release has (AP_NavEKF3, AP_NavEKF/EKFGSF_yaw.cpp)."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class FilterRelease:
    """What a release does.

    Attributes:
        gsf_asks_load: whether the accelerometers count for the tilt of the GSF is asked of the load that they show, not
            of how much they counted last.
        fuses_rest: a vehicle that stands still counts as having no velocity while nothing measures one. Whether it
            stands still is tested with a compass as well, and no bias of an accelerometer is learned on the ground
            unless it does (SelectVelPosFusion, updateMovementCheck, CovariancePrediction).
        resets_height_by_its_source: height starts at that of external navigation only if that is its source
            (setAidingMode).
        refuses_early_origin: an origin is refused until the filter has a state; else it is taken, and then lost
            (setOriginLLH).
        relative_needs_no_yaw: relative aiding goes on as the vehicle is disarmed without a source of yaw
            (controlFilterModes).
        learns_field_on_ground: EK3_MAG_CAL has 7, which estimates magnetic fields on the ground and in flight
            (setWindMagStateLearningMode).
        forgets_frozen: what the bias of an accelerometer's axis that is not learned has to do with that of another is
            forgotten (CovariancePrediction).
        flow_limit: what the parameter is called, after ``EK3_``, that the filter asks for as MAX_FLOW.
        weighs_as_gps: whatever measures position and velocity has the accuracies of GPS while that gives them, and a
            velocity of external navigation that comes due with a solution of GPS lends that its error (FuseVelPosNED).
        scales_all_noise: with few satellites the noise of every position and velocity counts for more, not only of
            those of GPS (FuseVelPosNED).
        fuses_any_climb: with a horizontal velocity the vertical one is fused as well once external navigation has
            given one, or while GPS gives one, whatever its source is (FuseVelPosNED).
        keeps_compass: a compass that was taken for another one is kept on the ground, too (update_mag_selection,
            tryChangeCompass).
        lanes_are_automatic: EK3_OPTIONS has no bit to switch lanes by hand, and it is the core that was left that waits
            10 s until it may be taken again (NavEKF3::UpdateFilter).
        checks_estimator_number: arming asks for an AHRS_EKF_TYPE that the vehicle takes as it is
            (AP_AHRS::pre_arm_check).
        aligns_source_in_use: EK3_SRC_OPTIONS aligns external navigation to flow even if it is the source of position
            (align_inactive_sources).
        shares_source_set: EK3_SRC_OPTIONS has no bit that gives each core a source set of its own (getActiveSourceSet).
    """

    gsf_asks_load: bool = False
    fuses_rest: bool = False
    resets_height_by_its_source: bool = False
    refuses_early_origin: bool = False
    relative_needs_no_yaw: bool = False
    learns_field_on_ground: bool = False
    forgets_frozen: bool = False
    flow_limit: str = "MAX_FLOW"
    weighs_as_gps: bool = False
    scales_all_noise: bool = False
    fuses_any_climb: bool = False
    keeps_compass: bool = False
    lanes_are_automatic: bool = False
    aligns_source_in_use: bool = False
    checks_estimator_number: bool = False
    shares_source_set: bool = False


STABLE_4_6: Final = FilterRelease(
    weighs_as_gps=True,
    scales_all_noise=True,
    fuses_any_climb=True,
    keeps_compass=True,
    lanes_are_automatic=True,
    aligns_source_in_use=True,
    shares_source_set=True,
)
JULY_2025: Final = FilterRelease()
FEBRUARY_2026: Final = FilterRelease(
    gsf_asks_load=True, forgets_frozen=True, flow_limit="FLOW_MAX", checks_estimator_number=True
)
STABLE_4_7: Final = FilterRelease(
    gsf_asks_load=True,
    resets_height_by_its_source=True,
    refuses_early_origin=True,
    relative_needs_no_yaw=True,
    forgets_frozen=True,
    flow_limit="FLOW_MAX",
    checks_estimator_number=True,
)
"""Copter 4.7.1: its branch left the master on 6 March 2026 and took origin and height resets over later.

FIRMWARE PARITY: calcTiltErrorVariance and FuseDeclination sum up in another order since January 2026; it is their last
digits that differ, so all releases share one form here.
"""
APRIL_2026: Final = FilterRelease(True, True, True, True, True, True, True, "FLOW_MAX", checks_estimator_number=True)

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Differences between releases at the endpoint, and the settings of each release."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ap_core.cint import int_of_float, u8
from ap_core.fmath import f32
from ap_core.param_info import is_equal
from mav_handlers.covariance import (
    ErrorFormula,
    cube_root_of_squares,
    no_errors,
    no_velocity_error,
    pose_errors,
    root_of_sum,
    velocity_error,
)
from mav_handlers.params.names import MAV_NAMES, MAV_NAMES_WITH_RANGE, SYSID_NAMES, EndpointParams

RESET_FACTORY_DEFAULT, RESET_ALL_DEFAULT = 2, 4
DO_SET_GLOBAL_ORIGIN: Final = 611
THOUSAND: Final = f32(1000)
THOUSANDTH: Final = f32(0.001)

Errors = tuple[np.float32, np.float32]
"""Position error (m) and attitude error (rad)."""


def is_factory_default(action: float) -> bool:
    """Return whether a storage action is PARAM_RESET_FACTORY_DEFAULT."""
    return is_equal(f32(action), f32(RESET_FACTORY_DEFAULT))


def is_any_default(action: float) -> bool:
    """Return whether a storage action, cut to a byte, is PARAM_RESET_FACTORY_DEFAULT or PARAM_RESET_ALL_DEFAULT."""
    return u8(int_of_float(action)) in (RESET_FACTORY_DEFAULT, RESET_ALL_DEFAULT)


@dataclass(frozen=True, slots=True)
class EndpointRelease:
    """The behaviour of a release.

    Attributes:
        error_formula: computes an error from three variances.
        mocap_errors: computes both errors from the covariance of ATT_POS_MOCAP.
        tells_param_errors: whether PARAM_ERROR answers a read or set that fails; otherwise there is no answer.
        sends_origin_at_once: if true, GPS_GLOBAL_ORIGIN goes to the client that has set the origin, before the texts
            about it, and to all when home follows in the next pass of the main loop (GCS_MAVLINK::set_ekf_origin). If
            false, the texts come first, and GPS_GLOBAL_ORIGIN goes to all in the next pass, in which home follows
            without a second one.
        params: the names of the endpoint's parameters.
        resets_parameters: takes the first parameter of MAV_CMD_PREFLIGHT_STORAGE, returns whether to erase all stored
            parameters.
        highres_field_scale: factor from mGauss to the unit of the field in HIGHRES_IMU.
        velocity_error: computes the error of a velocity (m/s) from the covariance of VISION_SPEED_ESTIMATE.
        unknown_messages: what it cannot send, of all that some release can: a rate or a request for one is refused.
        unstreamed: what it can send, but has in no stream group, of what others have there.
        sends_disabled_gps: whether there is a GPS_RAW_INT while GPS1_TYPE is 0.
        unknown_commands: commands that it does not support, of all that some release does.
        tells_interval_on_request: whether MAV_CMD_REQUEST_MESSAGE of MESSAGE_INTERVAL is answered.
        refuses_zero_origin: whether latitude, longitude and altitude of 0 are no origin (GCS_MAVLINK::set_ekf_origin).
        most_origin_alt_mm: the largest altitude in SET_GPS_GLOBAL_ORIGIN, above and below; None for any.
        reboots_for_others: whether a restart of another component restarts the autopilot.
        counts_drops: whether SYS_STATUS counts dropped packets and dropped log messages; if not, they are 0.
        all_sensors_updated: HIGHRES_IMU.fields_updated if all sensors are there.
        telem_delay_more: telemetry waits for so much more than its delay, in units of 1024 ms.
        refuses_speed_of_0: the answer to MAV_CMD_DO_CHANGE_SPEED without a positive speed: DENIED if true, else FAILED.
        stops_at_forces: whether a target that asks for a force, which is not supported, makes a vehicle in GUIDED hold;
            otherwise it does nothing.
        spells_modes_out: whether names of flight modes are words; otherwise they are in capitals.
        lists_selectable_modes: whether AVAILABLE_MODES tells which modes a user cannot select.
        calibrates_in_steps: whether the calibration of a barometer is acknowledged as in progress, and again when it is
            done, within a second. (It waits for an airspeed sensor, whether or not there is one.)
        counts_home: whether home, once set, is an item of the mission that counts.
        tells_bad_items_by_type: whether the answer to a request for an item that does not exist depends on the kind of
            mission: the count and an error for a mission, and an error for the first item of a fence. Otherwise all are
            out of sequence, and only MISSION_REQUEST_INT gets the count.
        checks_waypoint_delay: whether a time at a waypoint that does not fit is refused.
        repeats_jumps: whether a jump that was done as often as asked for is counted from 0 when it is met again.
    """

    error_formula: ErrorFormula
    mocap_errors: Callable[[Sequence[float], ErrorFormula], Errors]
    tells_param_errors: bool
    sends_origin_at_once: bool
    params: EndpointParams
    resets_parameters: Callable[[float], bool] = is_factory_default
    highres_field_scale: np.float32 = THOUSAND
    velocity_error: Callable[[Sequence[float]], np.float32] = no_velocity_error
    unknown_messages: frozenset[str] = frozenset({"AOA_SSA", "DEEPSTALL", "RC_CHANNELS_SCALED"})
    unstreamed: frozenset[str] = frozenset()
    sends_disabled_gps: bool = True
    unknown_commands: frozenset[int] = frozenset()
    tells_interval_on_request: bool = True
    refuses_zero_origin: bool = True
    most_origin_alt_mm: int | None = None
    reboots_for_others: bool = True
    counts_drops: bool = True
    all_sensors_updated: int = 0x1FFF
    telem_delay_more: int = 0
    refuses_speed_of_0: bool = True
    stops_at_forces: bool = True
    spells_modes_out: bool = False
    lists_selectable_modes: bool = False
    calibrates_in_steps: bool = False
    counts_home: bool = True
    tells_bad_items_by_type: bool = False
    checks_waypoint_delay: bool = False
    repeats_jumps: bool = True

    def streams(self, name: str) -> bool:
        """Return whether a message of a stream group is sent with it."""
        return name not in self.unknown_messages and name not in self.unstreamed


JULY_2025: Final = EndpointRelease(cube_root_of_squares, no_errors, False, True, MAV_NAMES)
STABLE_4_6: Final = replace(
    JULY_2025,
    params=SYSID_NAMES,
    unknown_messages=frozenset({"AVAILABLE_MODES", "AVAILABLE_MODES_MONITOR", "FLIGHT_INFORMATION"}),
    unknown_commands=frozenset({DO_SET_GLOBAL_ORIGIN}),
    tells_interval_on_request=False,
    refuses_zero_origin=False,
    counts_drops=False,
    all_sensors_updated=0xFFFF,
    telem_delay_more=1,
    refuses_speed_of_0=False,
    stops_at_forces=False,
    calibrates_in_steps=True,
    counts_home=False,
    tells_bad_items_by_type=True,
    repeats_jumps=False,
)
FEBRUARY_2026: Final = EndpointRelease(
    root_of_sum,
    pose_errors,
    True,
    False,
    MAV_NAMES_WITH_RANGE,
    unknown_messages=JULY_2025.unknown_messages | {"HWSTATUS"},
    unstreamed=frozenset({"RANGEFINDER"}),
    sends_disabled_gps=False,
    most_origin_alt_mm=83_000_000,
    reboots_for_others=False,
    spells_modes_out=True,
    checks_waypoint_delay=True,
)
STABLE_4_7: Final = replace(FEBRUARY_2026, highres_field_scale=THOUSANDTH, lists_selectable_modes=True)
APRIL_2026: Final = replace(STABLE_4_7, resets_parameters=is_any_default, velocity_error=velocity_error)

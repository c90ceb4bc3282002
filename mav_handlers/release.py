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
    """

    error_formula: ErrorFormula
    mocap_errors: Callable[[Sequence[float], ErrorFormula], Errors]
    tells_param_errors: bool
    sends_origin_at_once: bool
    params: EndpointParams
    resets_parameters: Callable[[float], bool] = is_factory_default
    highres_field_scale: np.float32 = THOUSAND
    velocity_error: Callable[[Sequence[float]], np.float32] = no_velocity_error


STABLE_4_6: Final = EndpointRelease(cube_root_of_squares, no_errors, False, True, SYSID_NAMES)
JULY_2025: Final = replace(STABLE_4_6, params=MAV_NAMES)
FEBRUARY_2026: Final = EndpointRelease(root_of_sum, pose_errors, True, False, MAV_NAMES_WITH_RANGE)
STABLE_4_7: Final = replace(FEBRUARY_2026, highres_field_scale=THOUSANDTH)
APRIL_2026: Final = replace(STABLE_4_7, resets_parameters=is_any_default, velocity_error=velocity_error)

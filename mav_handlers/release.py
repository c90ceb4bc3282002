# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Differences between releases at the endpoint, and the strategy of each release."""

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
from mav_handlers.params.names import MAV_NAMES, MAV_NAMES_WITH_RANGE, EndpointParams

RESET_FACTORY_DEFAULT, RESET_ALL_DEFAULT = 2, 4
THOUSAND: Final = f32(1000)
THOUSANDTH: Final = f32(0.001)

Errors = tuple[np.float32, np.float32]
"""Of position (m) and of attitude (rad)."""


def is_factory_default(action: float) -> bool:
    """Return whether a storage action is PARAM_RESET_FACTORY_DEFAULT."""
    return is_equal(f32(action), f32(RESET_FACTORY_DEFAULT))


def is_any_default(action: float) -> bool:
    """Return whether a storage action, cut to a byte, is PARAM_RESET_FACTORY_DEFAULT or PARAM_RESET_ALL_DEFAULT."""
    return u8(int_of_float(action)) in (RESET_FACTORY_DEFAULT, RESET_ALL_DEFAULT)


@dataclass(frozen=True, slots=True)
class EndpointRelease:
    """What a release does.

    Attributes:
        error_formula: makes an error of three variances.
        mocap_errors: makes both errors of the covariance of ATT_POS_MOCAP.
        tells_param_errors: whether PARAM_ERROR answers what cannot be read or set; else nothing does.
        sends_origin_at_once: whether GPS_GLOBAL_ORIGIN goes to the client that has set an origin, ahead of the texts
            that this brings, and to all when home follows (GCS_MAVLINK::set_ekf_origin; home is set by the next pass of
            the main loop, when the texts are gone). Else the texts come first, and then GPS_GLOBAL_ORIGIN with the next
            pass, to all; home follows in that pass, and brings no second one.
        params: the names of the endpoint's parameters.
        resets_parameters: takes the first parameter of MAV_CMD_PREFLIGHT_STORAGE, says whether it is to forget all
            stored parameters.
        highres_field_scale: what HIGHRES_IMU has a field in mGauss multiplied by.
        velocity_error: makes the error of a velocity (m/s) of the covariance of VISION_SPEED_ESTIMATE.
    """

    error_formula: ErrorFormula
    mocap_errors: Callable[[Sequence[float], ErrorFormula], Errors]
    tells_param_errors: bool
    sends_origin_at_once: bool
    params: EndpointParams
    resets_parameters: Callable[[float], bool] = is_factory_default
    highres_field_scale: np.float32 = THOUSAND
    velocity_error: Callable[[Sequence[float]], np.float32] = no_velocity_error


REFERENCE: Final = EndpointRelease(cube_root_of_squares, no_errors, False, True, MAV_NAMES)
"""The master of October 2025."""

FEBRUARY_2026: Final = EndpointRelease(root_of_sum, pose_errors, True, False, MAV_NAMES_WITH_RANGE)
APRIL_2026: Final = replace(
    FEBRUARY_2026,
    resets_parameters=is_any_default,
    highres_field_scale=THOUSANDTH,
    velocity_error=velocity_error,
)

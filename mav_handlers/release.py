# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where releases differ at the endpoint, and which strategy a release has for each such place."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from mav_handlers.covariance import ErrorFormula, cube_root_of_squares, no_errors
from mav_handlers.params.names import MAV_NAMES, EndpointParams

if TYPE_CHECKING:
    from mav_handlers.context import Context

Errors = tuple[np.float32, np.float32]
"""Of position (m) and of attitude (rad)."""


@dataclass(frozen=True, slots=True)
class EndpointRelease:
    """What a release does.

    Attributes:
        error_formula: makes an error of three variances.
        mocap_errors: makes both errors of the covariance of ATT_POS_MOCAP.
        tells_param_errors: whether PARAM_ERROR answers what cannot be read or set; else nothing does.
        tell_origin: tells of an origin that a client has just set.
        params: the names of the endpoint's parameters.
    """

    error_formula: ErrorFormula
    mocap_errors: Callable[[Sequence[float], ErrorFormula], Errors]
    tells_param_errors: bool
    tell_origin: "Callable[[Context], None]"
    params: EndpointParams


def tell_origin_at_once(ctx: "Context") -> None:
    """Send GPS_GLOBAL_ORIGIN to the requester, and then the texts; all are told when home follows.

    Source: GCS_MAVLINK::set_ekf_origin; home is set by the next pass of the main loop, when the texts are gone.
    """
    ctx.endpoint.send_origin(ctx.channel, ctx.now_us)
    ctx.endpoint.send_texts_first()


def tell_origin_after_texts(ctx: "Context") -> None:
    """Send the texts that setting the origin brought, and then GPS_GLOBAL_ORIGIN with the next pass, to all.

    Home follows in that pass, and brings no second one.
    """
    ctx.endpoint.send_texts_first()
    ctx.endpoint.request_message_everywhere("GPS_GLOBAL_ORIGIN")


REFERENCE: Final = EndpointRelease(cube_root_of_squares, no_errors, False, tell_origin_at_once, MAV_NAMES)
"""The master of October 2025."""

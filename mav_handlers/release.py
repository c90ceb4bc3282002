# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where releases differ at the endpoint, and which strategy a release has for each such place."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from mav_handlers.channel import Channel
from mav_handlers.covariance import ErrorFormula, cube_root_of_squares, no_errors
from mav_handlers.params.names import MAV_NAMES, EndpointParams

Errors = tuple[np.float32, np.float32]
"""Of position (m) and of attitude (rad)."""


class OriginSender(Protocol):
    """What sends word of an origin."""

    def request_message_everywhere(self, name: str) -> None:
        """Queue a message to be sent once at the next poll, on every link."""

    def send_origin(self, channel: Channel, now_us: int) -> None:
        """Send GPS_GLOBAL_ORIGIN at once, if there is an origin."""

    def send_texts_first(self) -> None:
        """Send the texts that wait when the bytes at hand have been dealt with, ahead of what the next poll sends."""


@dataclass(frozen=True, slots=True)
class EndpointRelease:
    """What a release does.

    Attributes:
        error_formula: makes an error of three variances.
        mocap_errors: makes both errors of the covariance of ATT_POS_MOCAP.
        tells_param_errors: whether PARAM_ERROR answers what cannot be read or set; else nothing does.
        tell_origin: tells of an origin that a client has just set over a link, at a time in us since boot.
        params: the names of the endpoint's parameters.
    """

    error_formula: ErrorFormula
    mocap_errors: Callable[[Sequence[float], ErrorFormula], Errors]
    tells_param_errors: bool
    tell_origin: Callable[[OriginSender, Channel, int], None]
    params: EndpointParams


def tell_origin_at_once(endpoint: OriginSender, channel: Channel, now_us: int) -> None:
    """Send GPS_GLOBAL_ORIGIN to the requester, and then the texts; all are told when home follows.

    Source: GCS_MAVLINK::set_ekf_origin; home is set by the next pass of the main loop, when the texts are gone.
    """
    endpoint.send_origin(channel, now_us)
    endpoint.send_texts_first()


def tell_origin_after_texts(endpoint: OriginSender, _channel: Channel, _now_us: int) -> None:
    """Send the texts that setting the origin brought, and then GPS_GLOBAL_ORIGIN with the next pass, to all.

    Home follows in that pass, and brings no second one.
    """
    endpoint.send_texts_first()
    endpoint.request_message_everywhere("GPS_GLOBAL_ORIGIN")


REFERENCE: Final = EndpointRelease(cube_root_of_squares, no_errors, False, tell_origin_at_once, MAV_NAMES)
"""The master of October 2025."""

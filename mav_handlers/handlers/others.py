# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of messages that are neither navigation, parameter, clock nor command."""

from typing import Final

import numpy as np

from ap_core.cint import i16, int_of_float
from ap_core.location import Location
from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.home import OriginResult, set_ekf_origin
from mav_handlers.handlers.commands.modes import set_mode
from mav_handlers.handlers.commands.results import MavResult
from mav_handlers.params.names import OPTION_NO_STREAM_REQUESTS
from mav_handlers.radio import adapted_slowdown_ms
from mav_handlers.senders import STREAM_GROUPS
from mav_handlers.senders.intervals import ADSB_GROUP, StreamGroup, set_interval, stream_interval_ms, streamed
from mav_handlers.verdicts import HANDLED, MODE_REFUSED, ORIGIN_REFUSED
from mav_handlers.wire.messages import (
    AUTOPILOT_VERSION_REQUEST,
    HEARTBEAT,
    RADIO,
    RADIO_STATUS,
    REQUEST_DATA_STREAM,
    SET_GPS_GLOBAL_ORIGIN,
    SET_MODE,
    STATUSTEXT,
)

STREAM_ALL: Final = 0


def handle_heartbeat(_ctx: Context, _message: HEARTBEAT) -> Verdict:
    """Accept a heartbeat; it has no effect here."""
    return HANDLED


def handle_statustext(ctx: Context, message: STATUSTEXT) -> Verdict:
    """Log another system's text, with its origin (GCS_MAVLINK::handle_statustext)."""
    header = ctx.header
    if ctx.vehicle.release.params.is_ground_station(ctx.vehicle.params, header.system_id):
        prefix = "GCS:"
    else:
        prefix = f"SRC={header.system_id}/{header.component_id}:"
    ctx.vehicle.log.text(prefix + message.text)
    return HANDLED


def handle_autopilot_version_request(ctx: Context, _message: AUTOPILOT_VERSION_REQUEST) -> Verdict:
    """Queue AUTOPILOT_VERSION."""
    ctx.channel.request("AUTOPILOT_VERSION")
    return HANDLED


def handle_set_gps_global_origin(ctx: Context, message: SET_GPS_GLOBAL_ORIGIN) -> Verdict:
    """Set the origin from degE7 and mm; the altitude loses precision in float32, as in the firmware.

    Source: GCS_MAVLINK::handle_set_gps_global_origin.
    """
    most_mm = ctx.vehicle.release.most_origin_alt_mm
    if most_mm is not None and abs(message.altitude) > most_mm:
        return ORIGIN_REFUSED
    alt_cm = int_of_float(float(np.float32(message.altitude) * np.float32(0.1)))
    location = Location(message.latitude, message.longitude, alt_cm)
    return HANDLED if set_ekf_origin(ctx, location) is OriginResult.SET else ORIGIN_REFUSED


def handle_set_mode(ctx: Context, message: SET_MODE) -> Verdict:
    """Enter a mode or set the safety switch (GCS_MAVLINK::handle_set_mode).

    The only answer is the next heartbeat, or a text if the mode is refused.
    """
    result = set_mode(ctx, message.base_mode, message.custom_mode)
    return HANDLED if result is MavResult.ACCEPTED else MODE_REFUSED


def handle_request_data_stream(ctx: Context, message: REQUEST_DATA_STREAM) -> Verdict:
    """Set the rate of a group of messages, in memory only (GCS_MAVLINK::handle_request_data_stream)."""
    if message.start_stop > 1 or _options(ctx) & OPTION_NO_STREAM_REQUESTS:
        return HANDLED
    rate_hz = i16(message.req_message_rate) if message.start_stop == 1 else 0
    for stream_id, group in STREAM_GROUPS.items():
        if message.req_stream_id in (STREAM_ALL, stream_id):
            _set_rate(ctx, group, rate_hz)
    if message.req_stream_id == STREAM_ALL:
        _set_rate(ctx, ADSB_GROUP, rate_hz)
    return HANDLED


def _options(ctx: Context) -> int:
    return ctx.vehicle.release.params.link_options(ctx.vehicle.params, ctx.channel.port)


def _set_rate(ctx: Context, group: StreamGroup, rate_hz: int) -> None:
    release = ctx.vehicle.release
    ctx.vehicle.params.set(release.params.stream_rate(ctx.channel.port, group[0]), rate_hz)
    for name in streamed(release, group):
        set_interval(ctx.channel, name, stream_interval_ms(rate_hz), ctx.now_us)


def handle_radio_status(ctx: Context, message: RADIO_STATUS | RADIO) -> Verdict:
    """Adapt the intervals to a radio's free transmit buffer (GCS_MAVLINK::handle_radio_status)."""
    ctx.vehicle.endpoint.radio.report(message.txbuf, ctx.now_us)
    ctx.channel.stream_slowdown_ms = adapted_slowdown_ms(ctx.channel.stream_slowdown_ms, message.txbuf)
    return HANDLED

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of the parameter protocol (GCS_MAVLink/GCS_Param.cpp)."""

from typing import Final

import numpy as np

from ap_core.param import ParamOutcome
from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.params.pump import start_param_list
from mav_handlers.params.reads import BY_NAME, MAV_PARAM_ERROR_DOES_NOT_EXIST, NO_INDEX, find_requested
from mav_handlers.verdicts import HANDLED, PARAM_NOT_FINITE, PARAM_QUEUE_FULL, PARAM_READ_ONLY, PARAM_UNKNOWN
from mav_handlers.wire.messages import PARAM_ERROR, PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET, PARAM_VALUE

MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE: Final = 2
MAV_PARAM_ERROR_PERMISSION_DENIED: Final = 3

_MAV_SEVERITY_WARNING: Final = 4


def handle_param_request_list(ctx: Context, _message: PARAM_REQUEST_LIST) -> Verdict:
    """Send the banner texts and start the list at index 0 (handle_param_request_list)."""
    ctx.vehicle.endpoint.send_banner(ctx.channel)
    start_param_list(ctx.vehicle.params, ctx.channel, ctx.now_us)
    return HANDLED


def handle_param_request_read(ctx: Context, message: PARAM_REQUEST_READ) -> Verdict:
    """Queue a read, of unknown parameters too; those get no reply or PARAM_ERROR.

    Source: GCS_MAVLINK::handle_param_request_read.
    """
    sender = ctx.header.system_id, ctx.header.component_id
    if not ctx.vehicle.endpoint.param_reads.request(ctx.channel, message, ctx.now_us, sender):
        return PARAM_QUEUE_FULL
    return PARAM_UNKNOWN if find_requested(ctx.vehicle.params, message) is None else HANDLED


def handle_param_set(ctx: Context, message: PARAM_SET) -> Verdict:
    """Set a parameter in its stored type, and echo it to every active link (handle_param_set)."""
    params = ctx.vehicle.params
    result = params.set_from_mavlink(message.param_id, np.float32(message.param_value))
    if result.outcome is ParamOutcome.UNKNOWN:
        _tell_error(ctx, message, MAV_PARAM_ERROR_DOES_NOT_EXIST)
        return PARAM_UNKNOWN
    if result.outcome is ParamOutcome.NOT_FINITE:
        _tell_error(ctx, message, MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
        return PARAM_NOT_FINITE
    if result.outcome is ParamOutcome.READ_ONLY:
        text = f"Param write denied ({message.param_id})"
        ctx.vehicle.texts.send_text(_MAV_SEVERITY_WARNING, text)
        _tell_error(ctx, message, MAV_PARAM_ERROR_PERMISSION_DENIED)
        for echo in result.echoes:
            reply = PARAM_VALUE(echo.name, float(echo.value), echo.wire_type, params.count, NO_INDEX)
            ctx.channel.send(reply)
        return PARAM_READ_ONLY
    # One record with the sender's spelling; the echoes are logged when they are sent.
    ctx.vehicle.log.parameter(message.param_id, result.value)
    ctx.vehicle.endpoint.echo_parameters(result.echoes)
    return HANDLED


def _tell_error(ctx: Context, message: PARAM_SET, error: int) -> None:
    """Send PARAM_ERROR if the release has it (GCS_MAVLINK::send_param_error)."""
    if ctx.vehicle.release.tells_param_errors and ctx.channel.has_space_for(PARAM_ERROR):
        ids = ctx.header.system_id, ctx.header.component_id
        ctx.channel.send(PARAM_ERROR(*ids, message.param_id, BY_NAME, error))

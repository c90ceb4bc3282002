# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of file and log transfer, and of the signing set-up."""

from typing import Final

from ap_core.verdict import Verdict
from mav_handlers.context import Context
from mav_handlers.transfers.ftp import FtpPeer
from mav_handlers.verdicts import HANDLED
from mav_handlers.wire.messages import (
    FILE_TRANSFER_PROTOCOL,
    LOG_ERASE,
    LOG_REQUEST_DATA,
    LOG_REQUEST_END,
    LOG_REQUEST_LIST,
    SETUP_SIGNING,
)

_MAV_SEVERITY_WARNING: Final = 4
_BITS_PER_BYTE: Final = 10


def handle_file_transfer_protocol(ctx: Context, message: FILE_TRANSFER_PROTOCOL) -> Verdict:
    """Give a request to the file server and send its first replies (GCS_MAVLINK::handle_file_transfer_protocol)."""
    baud = ctx.channel.baud
    peer = FtpPeer(
        ctx.channel.index,
        ctx.header.system_id,
        ctx.header.component_id,
        None if baud is None else baud // _BITS_PER_BYTE,
    )
    ctx.endpoint.send_ftp_replies(ctx.endpoint.ftp.handle(bytes(message.payload), ctx.now_us, peer))
    return HANDLED


def handle_log_request_list(ctx: Context, message: LOG_REQUEST_LIST) -> Verdict:
    """Start a listing of logs."""
    verdict = ctx.endpoint.log_transfer.request_list(
        ctx.channel.index,
        message.start,
        message.end,
        ctx.vehicle.copter.is_armed(),
        writes_enabled=ctx.vehicle.is_initialised(),
    )
    ctx.endpoint.pump_log_transfer(ctx.channel, ctx.now_us)
    return verdict


def handle_log_request_data(ctx: Context, message: LOG_REQUEST_DATA) -> Verdict:
    """Start the transfer of a part of a log."""
    verdict = ctx.endpoint.log_transfer.request_data(
        ctx.channel.index,
        message.id,
        message.ofs,
        message.count,
        ctx.vehicle.copter.is_armed(),
        writes_enabled=ctx.vehicle.is_initialised(),
    )
    ctx.endpoint.pump_log_transfer(ctx.channel, ctx.now_us)
    return verdict


def handle_log_request_end(ctx: Context, _message: LOG_REQUEST_END) -> Verdict:
    """Stop a transfer."""
    vehicle = ctx.vehicle
    return ctx.endpoint.log_transfer.request_end(
        ctx.channel.index, vehicle.copter.is_armed(), writes_enabled=vehicle.is_initialised()
    )


def handle_log_erase(ctx: Context, _message: LOG_ERASE) -> Verdict:
    """Delete every log."""
    vehicle = ctx.vehicle
    return ctx.endpoint.log_transfer.erase(
        ctx.channel.index, vehicle.copter.is_armed(), writes_enabled=vehicle.is_initialised()
    )


def handle_setup_signing(ctx: Context, message: SETUP_SIGNING) -> Verdict:
    """Store a signing key and use it at once; texts go to the asking link alone."""

    def tell(text: str) -> None:
        ctx.vehicle.texts.send_text_to(ctx.channel.index, _MAV_SEVERITY_WARNING, text)

    return ctx.endpoint.signing.setup(message, ctx.endpoint.channels, armed=ctx.vehicle.copter.is_armed(), tell=tell)

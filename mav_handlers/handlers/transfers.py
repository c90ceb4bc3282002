# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of file and log transfer, and of the signing set-up."""

from typing import Final

from ap_core.verdict import Verdict
from mav_handlers.channel import Context
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
    """Pass a request to the file server and send its first replies (GCS_MAVLINK::handle_file_transfer_protocol)."""
    baud = ctx.channel.baud
    peer = FtpPeer(
        ctx.channel.index,
        ctx.header.system_id,
        ctx.header.component_id,
        None if baud is None else baud // _BITS_PER_BYTE,
    )
    endpoint = ctx.vehicle.endpoint
    endpoint.send_ftp_replies(endpoint.ftp.handle(bytes(message.payload), ctx.now_us, peer))
    return HANDLED


def _refuse(ctx: Context) -> Verdict | None:
    armed, writes_enabled = ctx.vehicle.copter.is_armed(), ctx.vehicle.copter.has_booted
    return ctx.vehicle.log_transfer.refuse(ctx.channel.index, armed=armed, writes_enabled=writes_enabled)


def handle_log_request_list(ctx: Context, message: LOG_REQUEST_LIST) -> Verdict:
    """Start to list the logs."""
    transfer, link = ctx.vehicle.log_transfer, ctx.channel.index
    verdict = _refuse(ctx) or transfer.request_list(link, message.start, message.end)
    ctx.vehicle.endpoint.pump_log_transfer(ctx.channel, ctx.now_us)
    return verdict


def handle_log_request_data(ctx: Context, message: LOG_REQUEST_DATA) -> Verdict:
    """Start the transfer of a part of a log."""
    transfer, link = ctx.vehicle.log_transfer, ctx.channel.index
    verdict = _refuse(ctx) or transfer.request_data(link, message.id, message.ofs, message.count)
    ctx.vehicle.endpoint.pump_log_transfer(ctx.channel, ctx.now_us)
    return verdict


def handle_log_request_end(ctx: Context, _message: LOG_REQUEST_END) -> Verdict:
    """Stop a transfer."""
    return _refuse(ctx) or ctx.vehicle.log_transfer.request_end()


def handle_log_erase(ctx: Context, _message: LOG_ERASE) -> Verdict:
    """Delete every log."""
    return _refuse(ctx) or ctx.vehicle.log_transfer.erase()


def handle_setup_signing(ctx: Context, message: SETUP_SIGNING) -> Verdict:
    """Store a signing key and use it at once; texts go to the requesting link alone."""

    def tell(text: str) -> None:
        ctx.vehicle.texts.send_text_to(ctx.channel.index, _MAV_SEVERITY_WARNING, text)

    endpoint, armed = ctx.vehicle.endpoint, ctx.vehicle.copter.is_armed()
    return endpoint.signing.setup(message, endpoint.channels, armed=armed, tell=tell)

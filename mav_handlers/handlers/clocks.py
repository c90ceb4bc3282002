# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of the clock messages (GCS_Common.cpp, handle_timesync and handle_system_time_message)."""

from typing import Final

from ap_core.cint import float_of_u64, i64, u32
from ap_core.fmath import f32
from ap_core.verdict import Verdict
from mav_handlers.channel import Channel, Context
from mav_handlers.verdicts import HANDLED
from mav_handlers.wire.messages import SYSTEM_TIME, TIMESYNC

TIMESYNC_PERIOD_US: Final = 10_000_000

_MILLI: Final = f32(0.001)


def handle_timesync(ctx: Context, message: TIMESYNC) -> Verdict:
    """Answer a request at once; log the round trip of an answer to our own request."""
    arrival_us = ctx.channel.arrival_us(TIMESYNC, ctx.read_us, ctx.now_us) or ctx.now_us
    if message.tc1 == 0:
        ctx.channel.send(TIMESYNC(i64(arrival_us * 1000), message.ts1))
        return HANDLED
    if message.ts1 == ctx.channel.timesync_ts1:
        round_trip_ns = arrival_us * 1000 - message.ts1
        ctx.vehicle.log.timesync(ctx.header.system_id, int(float_of_u64(round_trip_ns) * _MILLI))
    return HANDLED


def send_timesync(channel: Channel, now_us: int, system_id: int) -> None:
    """Send a TIMESYNC request, at most once in 10 s; the stamp's last digits are our system id."""
    if now_us < timesync_due_us(channel):
        return
    channel.timesync_sent_us = now_us
    channel.timesync_ts1 = i64(now_us * 1000 + system_id)
    channel.send(TIMESYNC(0, channel.timesync_ts1))


def timesync_due_us(channel: Channel) -> int:
    """Return the time of the next TIMESYNC request, us since boot."""
    return channel.timesync_sent_us + TIMESYNC_PERIOD_US


def handle_system_time(ctx: Context, message: SYSTEM_TIME) -> Verdict:
    """Offer a time of day to the vehicle; BRD_RTC_TYPES decides whether it is taken."""
    known_before = ctx.vehicle.rtc.utc_us() != 0
    ctx.vehicle.rtc.take_system_time(message.time_unix_usec)
    if not known_before and ctx.vehicle.rtc.utc_us():
        endpoint = ctx.vehicle.endpoint
        endpoint.signing.update_timestamp(endpoint.channels, ctx.vehicle.rtc.utc_us(), u32(ctx.now_us // 1000))
    return HANDLED

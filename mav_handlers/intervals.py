# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When periodic messages are due on a link (GCS_Common.cpp, set_message_interval and the deferred messages)."""

from typing import Final

from mav_handlers.channel import Channel
from mav_handlers.ports import VehiclePort
from mav_handlers.senders import SENDERS, STREAM_GROUPS

MAX_INTERVAL_MS: Final = 60_000
# Intervals below 0.8 of the main loop of 400 Hz are refused: 1 and 2 ms.
MIN_INTERVAL_MS: Final = 3
HEARTBEAT_INTERVAL_MS: Final = 1000
_SLOW_FACTOR: Final = 4


def stream_interval_ms(rate_hz: int) -> int | None:
    """Return the interval of a stream rate (int16) in whole milliseconds, or None when it is off.

    Rates above 1000 Hz come out as 0 ms, which is off; the quotient of a negative rate wraps to a huge interval.
    Source: GCS_MAVLINK::get_interval_for_stream, GCS_MAVLINK::cap_message_interval.
    """
    interval_ms = 1000 // abs(rate_hz) if rate_hz else 0
    if interval_ms == 0:
        return None
    return max(interval_ms, MIN_INTERVAL_MS) if rate_hz > 0 else MAX_INTERVAL_MS


def default_interval_ms(vehicle: VehiclePort, channel: Channel, name: str) -> int | None:
    """Return the interval of a message that nobody asked for otherwise, or None when it is off."""
    if name == "HEARTBEAT":
        return HEARTBEAT_INTERVAL_MS
    for suffix, names in STREAM_GROUPS.values():
        if name in names:
            return stream_interval_ms(vehicle.params.get_int(f"MAV{channel.index + 1}{suffix}"))
    return None


def set_interval(channel: Channel, name: str, interval_ms: int | None, now_us: int) -> None:
    """Start a message at an interval, or stop it with None."""
    if interval_ms is None:
        channel.intervals_ms.pop(name, None)
        channel.last_sent_us.pop(name, None)
        return
    channel.intervals_ms[name] = interval_ms
    channel.last_sent_us[name] = now_us


def set_defaults(vehicle: VehiclePort, channel: Channel, now_us: int) -> None:
    """Give every message its interval at boot; the heartbeat starts at once."""
    for name in SENDERS:
        set_interval(channel, name, default_interval_ms(vehicle, channel, name), now_us)
    channel.last_sent_us["HEARTBEAT"] = now_us - HEARTBEAT_INTERVAL_MS * 1000


def due_messages(channel: Channel, now_us: int, *, slow: bool = False) -> list[str]:
    """Return the messages that are due, in the firmware's order, and note them as sent.

    While a parameter list is being sent, and again when the link is ``slow``, everything but the heartbeat comes at a
    quarter of its rate (get_reschedule_interval_ms).
    """
    factor = (_SLOW_FACTOR if channel.param_list is not None else 1) * (_SLOW_FACTOR if slow else 1)
    due = []
    for name in SENDERS:
        interval_ms = channel.intervals_ms.get(name)
        if interval_ms is None:
            continue
        interval_us = min(interval_ms * (1 if name == "HEARTBEAT" else factor), MAX_INTERVAL_MS) * 1000
        late_us = now_us - channel.last_sent_us[name] - interval_us
        if late_us >= 0:
            # Keeps the phase unless a turn was missed altogether.
            channel.last_sent_us[name] = now_us - late_us if late_us < interval_us else now_us
            due.append(name)
    return due

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The interval of each message of a link (GCS_Common.cpp, set_ap_message_interval and the defaults)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Final, TypeGuard

from mav_handlers.channel import MAX_INTERVAL_MS, Channel
from mav_handlers.release import EndpointRelease
from mav_handlers.schedule import DEFERRED, NEXT_PARAM
from mav_handlers.senders import SENDERS, STREAM_GROUPS
from mav_handlers.wire.codec import message_name

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

# Intervals below 0.8 of the main loop of 400 Hz are too fast: 1 and 2 ms.
MIN_INTERVAL_MS: Final = 3
HEARTBEAT_INTERVAL_MS: Final = 1000
HIGH_LATENCY2_INTERVAL_MS: Final = 5000
PARAMS_INTERVAL_MS: Final = 100
PARAMS_MAX_INTERVAL_MS: Final = 1000

StreamGroup = tuple[str, tuple[str, ...]]
"""The suffix of a group's parameter, and its messages."""

# Groups without an id of their own: the suffix of their parameter, and their messages.
PARAMS_GROUP: Final = ("_PARAMS", (NEXT_PARAM, "AVAILABLE_MODES"))
ADSB_GROUP: Final = ("_ADSB", ("ADSB_VEHICLE", "AIS_VESSEL"))

# The order in which groups get their intervals at boot, by id: POSITION, then RAW_CTRL and RC_CHAN.
_BOOT_ORDER: Final = (1, 2, 6, 4, 3, 10, 11, 12)


def stream_interval_ms(rate_hz: int) -> int | None:
    """Return the interval of a stream rate (int16) in whole milliseconds, or None when it is off.

    Rates above 1000 Hz come out as 0 ms, which is off; the quotient of a negative rate wraps to a huge interval.
    Source: GCS_MAVLINK::get_interval_for_stream.
    """
    interval_ms = 1000 // abs(rate_hz) if rate_hz else 0
    if interval_ms == 0:
        return None
    return interval_ms if rate_hz > 0 else MAX_INTERVAL_MS


def can_send(name: str | None, release: EndpointRelease) -> TypeGuard[str]:
    """Return whether there is a message of that name, and the release can send it."""
    return name in SENDERS and name not in release.unknown_messages


def streamed(release: EndpointRelease, group: StreamGroup) -> Iterator[str]:
    """Yield the messages of a stream group that a release sends with it."""
    return (name for name in group[1] if release.streams(name))


def _boot_groups(release: EndpointRelease) -> Iterator[tuple[str, tuple[str, ...]]]:
    for group in (*(STREAM_GROUPS[stream_id] for stream_id in _BOOT_ORDER), PARAMS_GROUP, ADSB_GROUP):
        yield group[0], (*streamed(release, group),)


def _group_interval_ms(vehicle: Vehicle, channel: Channel, suffix: str) -> int | None:
    return stream_interval_ms(vehicle.params.get_int(vehicle.release.params.stream_rate(channel.port, suffix)))


def default_interval_ms(vehicle: Vehicle, channel: Channel, name: str) -> int | None:
    """Return the default interval of a message, or None when it is off.

    A rate of 500 Hz or more gives an interval that is refused (1 and 2 ms).
    Source: GCS_MAVLINK::get_default_interval_for_ap_message.
    """
    if name == "HEARTBEAT":
        return HEARTBEAT_INTERVAL_MS
    if name == "HIGH_LATENCY2":
        return HIGH_LATENCY2_INTERVAL_MS
    if name in channel.card_intervals_ms:
        return channel.card_intervals_ms[name] or None
    for suffix, names in _boot_groups(vehicle.release):
        if name in names:
            return _group_interval_ms(vehicle, channel, suffix)
    return None


def by_name(release: EndpointRelease, intervals_ms: Mapping[int, int]) -> dict[str, int]:
    """Convert intervals by message id to intervals by name, without messages that cannot be sent."""
    names = {message_id: message_name(message_id) for message_id in intervals_ms}
    return {name: intervals_ms[number] for number, name in names.items() if can_send(name, release)}


def set_interval(channel: Channel, name: str, interval_ms: int | None, now_us: int) -> None:
    """Start a message at an interval, at least 3 ms, or stop it with None.

    The parameter pump never stops: off means 100 ms, and the maximum is 1000 ms.
    """
    wanted_ms = interval_ms or 0
    if name == NEXT_PARAM:
        wanted_ms = min(wanted_ms, PARAMS_MAX_INTERVAL_MS) or PARAMS_INTERVAL_MS
    if wanted_ms:
        wanted_ms = max(wanted_ms, MIN_INTERVAL_MS)
    timers = channel.deferred if name in DEFERRED else channel.buckets
    timers.set_interval(name, wanted_ms, now_us // 1000)
    channel.rest.end()


def set_defaults(vehicle: Vehicle, channel: Channel, now_us: int) -> None:
    """Set every message's interval at boot, and send a heartbeat at once.

    Source: GCS_MAVLINK::initialise_message_intervals_from_streamrates, initialise_message_intervals_from_config_files.
    """
    for suffix, names in _boot_groups(vehicle.release):
        interval_ms = _group_interval_ms(vehicle, channel, suffix)
        for name in names:
            set_interval(channel, name, interval_ms, now_us)
    set_interval(channel, "HEARTBEAT", HEARTBEAT_INTERVAL_MS, now_us)
    for name, interval_ms in channel.card_intervals_ms.items():
        set_interval(channel, name, interval_ms, now_us)
    # FIRMWARE PARITY: the firmware's first heartbeat comes 1 s later, or in the first blocking delay of initialisation.
    channel.request("HEARTBEAT")

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""RC_CHANNELS_OVERRIDE, and RC_CHANNELS that shows it."""

from typing import TYPE_CHECKING

from mav_handlers.senders.parked import rc_channels
from mav_handlers.verdicts import HANDLED, NOT_ACCEPTED
from mav_handlers.wire.messages import RC_CHANNELS_OVERRIDE

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench

AT_REST = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800, *(0,) * 8)


def shown(bench: "Bench") -> tuple[int, ...]:
    message = rc_channels(bench.vehicle, bench.client.channel, bench.now_us)
    return tuple(getattr(message, f"chan{number}_raw") for number in range(1, 17))


def test_channels_are_at_rest_unless_overridden(bench: "Bench") -> None:
    assert shown(bench) == AT_REST


def test_ground_station_overrides_sixteen_channels(bench: "Bench") -> None:
    assert bench.client.tell(RC_CHANNELS_OVERRIDE(1, 1, *range(1100, 1900, 100), *range(1101, 1901, 100))) == HANDLED
    assert shown(bench) == (*range(1100, 1900, 100), *range(1101, 1901, 100))


def test_first_eight_are_left_by_65535_and_given_back_by_0(bench: "Bench") -> None:
    bench.client.tell(RC_CHANNELS_OVERRIDE(1, 1, *(1600,) * 8))
    bench.client.tell(RC_CHANNELS_OVERRIDE(1, 1, 65535, 0, *(65535,) * 6))
    assert shown(bench) == (1600, AT_REST[1], *(1600,) * 6, *AT_REST[8:])


def test_others_are_left_by_0_and_65535_and_given_back_by_65534(bench: "Bench") -> None:
    bench.client.tell(RC_CHANNELS_OVERRIDE(1, 1, *(65535,) * 8, *(1600,) * 8))
    bench.client.tell(RC_CHANNELS_OVERRIDE(1, 1, *(65535,) * 8, 0, 65535, 65534))
    assert shown(bench) == (*AT_REST[:8], 1600, 1600, 0, *(1600,) * 5)


def test_others_than_the_ground_station_override_nothing(bench: "Bench") -> None:
    bench.vehicle.params.set("MAV_GCS_SYSID", 7)
    assert bench.client.tell(RC_CHANNELS_OVERRIDE(1, 1, *(1500,) * 8)) == NOT_ACCEPTED
    assert shown(bench) == AT_REST

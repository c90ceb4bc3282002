# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""TIMESYNC and SYSTEM_TIME."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.verdicts import HANDLED
from mav_handlers.wire.messages import SETUP_SIGNING, SYSTEM_TIME, TIMESYNC

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

FROM_SYSTEM_TIME = 2
YEAR_2026_US = 1_767_225_600_000_000
YEAR_2022_US = 1_640_995_200_000_000
YEAR_2015_US = 1_420_070_400_000_000
YEAR_2022_STAMP, YEAR_2026_STAMP = ((time_us - YEAR_2015_US) // 10 for time_us in (YEAR_2022_US, YEAR_2026_US))


@pytest.fixture
def filter_starts() -> bool:
    return False


def requests(client: "Client") -> list[int]:
    return [message.ts1 for message in client.read_of(TIMESYNC) if message.tc1 == 0]


def utc_us(bench: "Bench") -> int:
    return bench.vehicle.rtc.utc_us()


class TestTimesync:
    """Requests, replies, and what a reply does."""

    @pytest.fixture
    def asked(self, make_bench: "MakeBench") -> "Bench":
        """Return a vehicle that logs, and has just sent its first request."""
        return make_bench(until_ms=10_000, has_log=True)

    def test_request_is_answered_at_once_with_the_arrival_time_in_ns(self, client: "Client") -> None:
        client.tell(TIMESYNC(0, 12345))
        assert client.read() == [TIMESYNC(5_000_000_000, 12345)]

    def test_answer_takes_the_transport_time_off(self, make_bench: "MakeBench") -> None:
        client = make_bench(bauds=(115200,)).client
        client.tell(TIMESYNC(0, 12345))
        assert client.read() == [TIMESYNC((5_000_000 - 86 * 28) * 1000, 12345)]

    def test_answer_has_the_time_at_which_the_link_was_read(self, client: "Client") -> None:
        client.tell(TIMESYNC(0, 12345), read_us=4_990_000)
        assert client.read() == [TIMESYNC(4_990_000_000, 12345)]

    @pytest.mark.parametrize("stamp", [-1, 0, (1 << 63) - 1, -(1 << 63)])
    def test_stamp_of_a_request_comes_back_unchanged(self, client: "Client", stamp: int) -> None:
        client.tell(TIMESYNC(0, stamp))
        assert [message.ts1 for message in client.read_of(TIMESYNC)] == [stamp]

    def test_own_requests_come_every_10_s(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=0, filter_runs=False)
        bench.run_ms(21_000)
        assert [stamp // 1_000_000 for stamp in requests(bench.client)] == [10_000, 20_000]

    def test_stamp_of_an_own_request_ends_in_the_system_id(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV_SYSID=7, until_ms=0, filter_runs=False)
        bench.run_ms(11_000)
        assert requests(bench.client) == [10_000_000_007]

    # The stamp's last digits are no time: they cost a microsecond, until float32 is too coarse for them.
    @pytest.mark.parametrize(("delay_ms", "round_trip_us"), [(5, 4999), (20, 20_000)])
    def test_matching_reply_is_logged_with_its_round_trip_time(
        self, asked: "Bench", delay_ms: int, round_trip_us: int
    ) -> None:
        asked.run_ms(delay_ms)
        assert asked.client.tell(TIMESYNC(99, 10_000_000_001)) is HANDLED
        [record] = asked.logged("TSYN")
        assert (record["SysID"], record["RTT"]) == (255, round_trip_us)

    def test_round_trip_ends_with_the_arrival_of_the_reply(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(115200,), until_ms=10_000, has_log=True)
        bench.run_ms(5)
        bench.client.tell(TIMESYNC(99, 10_000_000_001))
        assert [record["RTT"] for record in bench.logged("TSYN")] == [4999 - 86 * 28]

    def test_each_matching_reply_is_logged(self, asked: "Bench") -> None:
        asked.client.tell(TIMESYNC(99, 10_000_000_001), TIMESYNC(99, 10_000_000_001))
        assert len(asked.logged("TSYN")) == 2

    def test_reply_to_anything_else_is_ignored(self, asked: "Bench") -> None:
        asked.client.tell(TIMESYNC(99, 10_000_000_002))
        assert asked.logged("TSYN") == []
        assert asked.client.read() == []

    def test_reply_before_any_request_is_ignored(self, make_bench: "MakeBench") -> None:
        bench = make_bench(has_log=True)
        bench.client.tell(TIMESYNC(99, 0))
        assert bench.logged("TSYN") == []

    @pytest.mark.slow
    def test_reply_on_another_link_is_ignored(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None), until_ms=0, has_log=True)
        late = bench.clients[1].channel
        late.timesync_sent_us = 5_000_000
        bench.run_ms(11_000)
        bench.clients[1].tell(TIMESYNC(99, 10_000_000_001))
        assert bench.logged("TSYN") == []

    def test_request_is_dropped_when_the_peer_does_not_read(self, client: "Client") -> None:
        while client.channel.send(TIMESYNC(1, 1)):
            pass
        lost = client.channel.frames_not_sent
        client.tell(TIMESYNC(0, 5))
        assert client.channel.frames_not_sent == lost + 1
        assert TIMESYNC(5_000_000_000, 5) not in client.read()


class TestSystemTime:
    """SYSTEM_TIME, in."""

    def test_it_is_ignored_by_default(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(SYSTEM_TIME(YEAR_2026_US, 0)) is HANDLED
        assert utc_us(bench) == 0

    def test_it_sets_the_clock_when_brd_rtc_types_admits_it(self, make_bench: "MakeBench") -> None:
        bench = make_bench(BRD_RTC_TYPES=FROM_SYSTEM_TIME)
        bench.client.tell(SYSTEM_TIME(YEAR_2026_US, 0))
        bench.run_ms(10)
        assert utc_us(bench) == YEAR_2026_US + 10_000

    def test_it_moves_the_stamps_of_signatures_on_once_it_is_known(self, make_bench: "MakeBench") -> None:
        bench = make_bench(BRD_RTC_TYPES=FROM_SYSTEM_TIME)
        bench.client.tell(SETUP_SIGNING(1, 1, tuple(range(32)), 0))
        signing = bench.client.channel.codec.signing
        assert signing is not None
        bench.client.tell(SYSTEM_TIME(YEAR_2022_US - 1, 0))
        assert signing.timestamp < YEAR_2022_STAMP
        bench.client.tell(SYSTEM_TIME(YEAR_2022_US + 1_000_000, 0))
        assert YEAR_2022_STAMP < (known := signing.timestamp) < YEAR_2026_STAMP
        bench.client.tell(SYSTEM_TIME(YEAR_2026_US, 0))
        assert known <= signing.timestamp < YEAR_2026_STAMP

    @pytest.mark.parametrize(("time_us", "taken"), [(YEAR_2022_US - 1, False), (YEAR_2022_US, True)])
    def test_time_before_2022_is_ignored(self, make_bench: "MakeBench", time_us: int, taken: bool) -> None:
        bench = make_bench(BRD_RTC_TYPES=FROM_SYSTEM_TIME)
        bench.client.tell(SYSTEM_TIME(time_us, 0))
        assert (utc_us(bench) != 0) is taken

    def test_clock_never_runs_backwards(self, make_bench: "MakeBench") -> None:
        bench = make_bench(BRD_RTC_TYPES=FROM_SYSTEM_TIME)
        bench.client.tell(SYSTEM_TIME(YEAR_2026_US, 0), SYSTEM_TIME(YEAR_2026_US - 1_000_000, 0))
        assert utc_us(bench) == YEAR_2026_US

    def test_time_beyond_every_date_is_ignored(self, make_bench: "MakeBench") -> None:
        bench = make_bench(BRD_RTC_TYPES=FROM_SYSTEM_TIME)
        bench.client.tell(SYSTEM_TIME((1 << 64) - 1, 0))
        assert utc_us(bench) == 0

    def test_time_just_within_64_signed_bits_is_still_told(self, make_bench: "MakeBench") -> None:
        bench = make_bench(BRD_RTC_TYPES=FROM_SYSTEM_TIME, MAV1_EXTRA3=10)
        bench.client.tell(SYSTEM_TIME((1 << 63) - 1, 0))
        bench.run_ms(100)
        assert [message.time_unix_usec for message in bench.client.read_of(SYSTEM_TIME)] == [(1 << 63) - 1 + 100_000]

    def test_sample_times_do_not_depend_on_the_clock(self, make_bench: "MakeBench") -> None:
        bench = make_bench(BRD_RTC_TYPES=FROM_SYSTEM_TIME, MAV1_EXTRA3=10)
        bench.client.tell(SYSTEM_TIME(YEAR_2026_US, 0))
        bench.run_ms(100)
        [message] = bench.client.read_of(SYSTEM_TIME)
        assert (message.time_unix_usec, message.time_boot_ms) == (YEAR_2026_US + 100_000, 5100)

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stream requests, other people's texts and heartbeats, and the request for the version."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.verdicts import HANDLED, NOT_ACCEPTED
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    ATTITUDE,
    AUTOPILOT_VERSION,
    AUTOPILOT_VERSION_REQUEST,
    HEARTBEAT,
    PARAM_VALUE,
    REQUEST_DATA_STREAM,
    STATUSTEXT,
    SYS_STATUS,
    SYSTEM_TIME,
)
from viso.firmware.releases import FEBRUARY_2026

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

ALL, EXT_STAT, RAW_CTRL, EXTRA1, EXTRA3 = 0, 2, 4, 10, 12
START, STOP = 1, 0
STREAMS = ("RAW_SENS", "EXT_STAT", "RC_CHAN", "RAW_CTRL", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3", "PARAMS", "ADSB")


@pytest.fixture
def filter_starts() -> bool:
    return False


def request(stream: int, rate_hz: int, start_stop: int = START, target: int = 1) -> REQUEST_DATA_STREAM:
    return REQUEST_DATA_STREAM(target, 1, stream, rate_hz, start_stop)


def rates(bench: "Bench", number: int = 1) -> dict[str, int]:
    return {name: bench.vehicle.params.get_int(f"MAV{number}_{name}") for name in STREAMS}


def received_per_second(bench: "Bench", kind: type[ATTITUDE | SYS_STATUS | SYSTEM_TIME]) -> int:
    bench.client.read()
    bench.run_ms(1000)
    return len(bench.client.read_of(kind))


class TestRequestDataStream:
    """REQUEST_DATA_STREAM."""

    @pytest.mark.parametrize(("stream", "kind"), [(EXT_STAT, SYS_STATUS), (EXTRA1, ATTITUDE), (EXTRA3, SYSTEM_TIME)])
    def test_messages_of_the_group_come_at_the_rate(
        self, bench: "Bench", client: "Client", stream: int, kind: type[ATTITUDE | SYS_STATUS | SYSTEM_TIME]
    ) -> None:
        assert client.tell(request(stream, 10)) is HANDLED
        bench.run_ms(1000)
        assert received_per_second(bench, kind) == 10

    def test_first_burst_holds_the_first_message_of_the_group(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXT_STAT, 10))
        bench.run_ms(100)
        assert [type(message) for message in client.read() if not isinstance(message, HEARTBEAT)] == [SYS_STATUS]

    def test_messages_of_other_groups_stay_off(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXT_STAT, 10))
        assert received_per_second(bench, ATTITUDE) == 0

    def test_interval_is_in_whole_milliseconds(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXTRA1, 3))
        assert client.channel.intervals_ms["ATTITUDE"] == 333

    def test_nothing_is_acknowledged_or_echoed(self, quiet_bench: "Bench") -> None:
        quiet_bench.client.tell(request(RAW_CTRL, 10))
        quiet_bench.run_ms(900)
        assert quiet_bench.client.read() == []

    def test_stop_switches_off_whatever_the_rate(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXTRA1, 10), request(EXTRA1, 10, STOP))
        assert received_per_second(bench, ATTITUDE) == 0
        assert rates(bench)["EXTRA1"] == 0

    def test_rate_zero_switches_off(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXTRA1, 10), request(EXTRA1, 0))
        assert received_per_second(bench, ATTITUDE) == 0

    def test_any_other_start_stop_is_ignored(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXTRA1, 10, 2))
        assert rates(bench)["EXTRA1"] == 0

    def test_all_means_every_group_but_the_parameters(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(ALL, 4))
        assert rates(bench) == {name: 0 if name == "PARAMS" else 4 for name in STREAMS}
        intervals_ms = client.channel.intervals_ms
        assert (intervals_ms["ADSB_VEHICLE"], intervals_ms["PARAM_VALUE"]) == (250, 100)
        assert "AVAILABLE_MODES" not in intervals_ms

    @pytest.mark.parametrize("stream", [5, 7, 9, 13, 255])
    def test_unknown_group_is_ignored(self, bench: "Bench", client: "Client", stream: int) -> None:
        client.tell(request(stream, 4))
        assert set(rates(bench).values()) == {0}

    def test_other_target_is_ignored(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXTRA1, 10, target=9))
        assert rates(bench)["EXTRA1"] == 0

    def test_only_the_own_link_is_affected(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[1].tell(request(EXTRA1, 10))
        assert (rates(bench, 1)["EXTRA1"], rates(bench, 2)["EXTRA1"]) == (0, 10)
        bench.run_ms(1000)
        assert [len(client.read_of(ATTITUDE)) for client in bench.clients] == [0, 10]

    def test_rate_is_not_saved(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXTRA1, 10))
        bench.run_ms(500)
        assert client.read_of(PARAM_VALUE) == []
        assert "MAV1_EXTRA1" not in bench.vehicle.params.stored_values()

    def test_it_overrides_an_interval_set_individually(self, bench: "Bench", client: "Client") -> None:
        client.command(511, 30, 100_000)
        client.tell(request(EXTRA1, 2))
        assert received_per_second(bench, ATTITUDE) == 2

    def test_it_is_ignored_with_option_bit_2(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV1_OPTIONS=4)
        bench.client.tell(request(EXTRA1, 10))
        assert rates(bench)["EXTRA1"] == 0
        assert received_per_second(bench, ATTITUDE) == 0

    def test_rate_is_kept_as_a_signed_number(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXTRA1, 65535))
        assert rates(bench)["EXTRA1"] == -1
        assert client.channel.intervals_ms["ATTITUDE"] == 60_000

    def test_rate_beyond_1000_hz_is_off(self, bench: "Bench", client: "Client") -> None:
        client.tell(request(EXTRA1, 10), request(EXTRA1, 2000))
        assert "ATTITUDE" not in client.channel.intervals_ms


class TestStatustext:
    """STATUSTEXT, in."""

    def test_whole_text_is_logged_after_its_prefix(self, bench: "Bench", client: "Client") -> None:
        client.codec.system_id = 7
        client.tell(STATUSTEXT(6, "x" * 50))
        assert [fields["Message"] for fields in bench.logged("MSG")] == [f"SRC=7/190:{'x' * 50}"]

    def test_several_ground_stations_may_be_in_charge_of_the_later_firmware(self, make_bench: "MakeBench") -> None:
        bench = make_bench(firmware=FEBRUARY_2026, MAV_GCS_SYSID=250, MAV_GCS_SYSID_HI=252)
        for system in (249, 250, 252, 253):
            bench.client.codec.system_id = system
            bench.client.tell(STATUSTEXT(6, "hello"))
        prefixes = [str(fields["Message"]).partition("hello")[0] for fields in bench.logged("MSG")]
        assert prefixes == ["SRC=249/190:", "GCS:", "GCS:", "SRC=253/190:"]

    def test_they_alone_are_obeyed_with_option_bit_0(self, make_bench: "MakeBench") -> None:
        params = {"MAV_OPTIONS": 1, "MAV_GCS_SYSID": 250, "MAV_GCS_SYSID_HI": 252}
        bench = make_bench(firmware=FEBRUARY_2026, **params)
        verdicts = []
        for system in (249, 250, 251, 252, 253):
            bench.client.codec.system_id = system
            verdicts.append(bench.client.tell(STATUSTEXT(6, "hello")))
        assert verdicts == [NOT_ACCEPTED, HANDLED, HANDLED, HANDLED, NOT_ACCEPTED]

    def test_text_of_the_ground_station_is_logged_as_such(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(STATUSTEXT(6, "hello")) is HANDLED
        assert [fields["Message"] for fields in bench.logged("MSG")] == ["GCS:hello"]

    def test_text_of_anybody_else_is_logged_with_its_source(self, bench: "Bench", client: "Client") -> None:
        client.codec = Codec(7, 197)
        client.tell(STATUSTEXT(6, "hello"))
        assert [fields["Message"] for fields in bench.logged("MSG")] == ["SRC=7/197:hello"]

    def test_ground_station_is_the_one_of_mav_gcs_sysid(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV_GCS_SYSID=7)
        bench.client.codec = Codec(7, 190)
        bench.client.tell(STATUSTEXT(6, "hello"))
        assert [fields["Message"] for fields in bench.logged("MSG")] == ["GCS:hello"]

    def test_text_is_not_repeated(self, bench: "Bench", client: "Client") -> None:
        client.tell(STATUSTEXT(6, "hello"))
        bench.run_ms(100)
        assert client.read() == []


class TestAutopilotVersionRequest:
    """AUTOPILOT_VERSION_REQUEST."""

    def test_it_is_answered_with_the_next_pass(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(AUTOPILOT_VERSION_REQUEST(1, 1)) is HANDLED
        assert client.read() == []
        bench.run_ms(3)
        [version] = client.read_of(AUTOPILOT_VERSION)
        assert (version.capabilities, version.flight_sw_version, version.uid) == (59823, 0x04070000, 0)


class TestHeartbeat:
    """HEARTBEAT, in."""

    def test_it_has_no_effect_but_to_make_the_link_active(self, quiet_bench: "Bench") -> None:
        assert quiet_bench.client.tell(HEARTBEAT(6, 8, 0, 0, 4, 3)) is HANDLED
        quiet_bench.run_ms(900)
        assert quiet_bench.client.read() == []
        written = {name for name, _ in quiet_bench.records}
        assert {name for name in written if not name.startswith("XK")} == {"ATT", "DSF", "MAV"}

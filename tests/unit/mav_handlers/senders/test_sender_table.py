# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of messages: what there is, in which order, in which group."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers import senders
from mav_handlers.senders import SENDERS, STREAM_GROUPS, nothing_to_report
from mav_handlers.senders.intervals import can_send
from mav_handlers.wire.codec import message_id
from mav_handlers.wire.messages import COMMAND_INT, REQUEST_DATA_STREAM, Message
from tests.places import DATA

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client
    from tests.unit.mav_handlers.senders.conftest import Desk

# Seen with everything at one rate.
OBSERVED = (DATA / "burst_order.txt").read_text(encoding="ascii").split()
NOT_SAID = {"SIMSTATE", "WIND", "TERRAIN_REQUEST", "TERRAIN_REPORT", "ESC_TELEMETRY_1_TO_4"}
SAID = [name for name in OBSERVED if name not in NOT_SAID]

IN_NO_STREAM = [
    "ATTITUDE_QUATERNION",
    "HOME_POSITION",
    "GPS_GLOBAL_ORIGIN",
    "EXTENDED_SYS_STATE",
    "AUTOPILOT_VERSION",
    "SCALED_IMU",
    "HIGHRES_IMU",
    "HWSTATUS",
    "ATTITUDE_TARGET",
    "POSITION_TARGET_LOCAL_NED",
    "SIM_STATE",
    "FLIGHT_INFORMATION",
]

SILENT = [name for name, builder in SENDERS.items() if builder is nothing_to_report]
ALL_STREAMS = 0


def names_of(messages: list[Message]) -> list[str]:
    return [type(message).__name__ for message in messages]


def test_public_names_are_there() -> None:
    assert all(hasattr(senders, name) for name in senders.__all__)


def test_table_is_in_the_observed_order() -> None:
    assert [name for name in SENDERS if name in OBSERVED] == OBSERVED


def test_heartbeat_comes_first() -> None:
    assert next(iter(SENDERS)) == "HEARTBEAT"


def test_every_name_is_one_of_the_dialect() -> None:
    assert all(message_id(name) >= 0 for name in SENDERS)


def test_builder_returns_the_message_of_its_row(desk: "Desk") -> None:
    for name in (name for name in SENDERS if name not in SILENT):
        message = SENDERS[name](desk.vehicle, desk.channel, 5_000_000)
        assert message is None or type(message).__name__ == name, name


@pytest.mark.parametrize("version", [1, 2])
def test_every_message_fits_its_fields(desk: "Desk", version: int) -> None:
    desk.channel.codec.version = version
    for builder in SENDERS.values():
        message = builder(desk.vehicle, desk.channel, (1 << 64) - 1)
        if message is not None and (version == 2 or message_id(type(message).__name__) < 256):
            assert desk.channel.send(message)


def test_silent_rows_say_nothing(desk: "Desk") -> None:
    assert [name for name in SILENT if not desk.has_nothing(SENDERS[name])] == []


def test_stream_groups_hold_messages_that_are_known() -> None:
    assert {name for _, names in STREAM_GROUPS.values() for name in names} <= set(SENDERS)


def test_every_message_is_in_one_stream_group_at_most() -> None:
    names = [name for _, group in STREAM_GROUPS.values() for name in group]
    assert len(names) == len(set(names))


def test_groups_have_the_ids_of_request_data_stream() -> None:
    assert {stream_id: suffix for stream_id, (suffix, _) in STREAM_GROUPS.items()} == {
        1: "_RAW_SENS",
        2: "_EXT_STAT",
        3: "_RC_CHAN",
        4: "_RAW_CTRL",
        6: "_POSITION",
        10: "_EXTRA1",
        11: "_EXTRA2",
        12: "_EXTRA3",
    }


def test_messages_in_no_stream_are_known() -> None:
    assert set(IN_NO_STREAM) <= set(SENDERS)
    assert {name for _, names in STREAM_GROUPS.values() for name in names}.isdisjoint(IN_NO_STREAM)


def test_silent_messages_are_accepted_and_not_sent(bench: "Bench", client: "Client") -> None:
    for name in (name for name in SILENT if can_send(name, bench.vehicle.release)):
        assert client.command(512, message_id(name)) == 0, name
        assert client.command(511, message_id(name), 100_000) == 0, name
    bench.run_ms(300)
    assert client.read() == []


def test_all_streams_at_one_rate_come_in_the_observed_order(bench: "Bench", client: "Client") -> None:
    client.tell(REQUEST_DATA_STREAM(1, 1, ALL_STREAMS, 4, 1))
    client.tell(COMMAND_INT(1, 1, 0, 511, 0, 0, 0.0, -1.0, 0.0, 0.0, 0, 0, 0.0))
    # The first burst is fixed when its first message gets its rate.
    bench.run_ms(400)
    client.read()
    bench.run_ms(250)
    burst = names_of(client.read())
    assert burst == [name for name in SAID if name in burst]
    assert set(SAID) - set(burst) <= {"LOCAL_POSITION_NED", "EKF_STATUS_REPORT"}

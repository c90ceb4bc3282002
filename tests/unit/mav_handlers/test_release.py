# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the endpoint of each firmware says and does where releases differ."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from ap_core.param import ParamTable
from mav_handlers.params.names import link_options_of_port, options_of_port
from mav_handlers.senders.inertial import highres_imu
from mav_handlers.senders.sys_status import sys_status
from mav_handlers.verdicts import TARGET_REFUSED
from mav_handlers.wire.codec import message_id
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    AUTOPILOT_VERSION,
    COMMAND_ACK,
    COMMAND_INT,
    GPS_GLOBAL_ORIGIN,
    GPS_RAW_INT,
    HEARTBEAT,
    MISSION_ACK,
    MISSION_COUNT,
    MISSION_REQUEST,
    MISSION_REQUEST_INT,
    MISSION_REQUEST_LIST,
    PARAM_ERROR,
    PARAM_REQUEST_READ,
    PARAM_SET,
    PARAM_VALUE,
    RANGEFINDER,
    REQUEST_DATA_STREAM,
    SET_GPS_GLOBAL_ORIGIN,
    SET_POSITION_TARGET_LOCAL_NED,
    STATUSTEXT,
    VISION_POSITION_ESTIMATE,
    Message,
)
from viso.firmware.releases import APRIL_2026, FEBRUARY_2026, JULY_2025, PROFILES, STABLE_4_6, STABLE_4_7, Firmware
from viso.parameters.table import make_groups
from viso.vehicle.copter.modes import ModeNumber

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

DOES_NOT_EXIST, VALUE_OUT_OF_RANGE, PERMISSION_DENIED = 1, 2, 3
ORIGIN = SET_GPS_GLOBAL_ORIGIN(1, -353632610, 1491652300, 584000)
EXTERNAL = {"EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 0, "EK3_SRC1_POSZ": 6, "EK3_SRC1_VELZ": 0, "EK3_SRC1_YAW": 6}
every_firmware = pytest.mark.parametrize("firmware", PROFILES.values(), ids=lambda one: one.name)
silent_firmware = pytest.mark.parametrize("firmware", [STABLE_4_6, JULY_2025], ids=lambda one: one.name)

UNKNOWN = PARAM_SET(1, 1, "NO_SUCH", 1.0, 9)
NOT_A_NUMBER = PARAM_SET(1, 1, "VISO_SCALE", math.nan, 9)
INFINITE = PARAM_SET(1, 1, "VISO_SCALE", math.inf, 9)
UNKNOWN_NAME = PARAM_REQUEST_READ(1, 1, "NO_SUCH", -1)
UNKNOWN_INDEX = PARAM_REQUEST_READ(1, 1, "VISO_TYPE", 9999)


def answers(bench: "Bench", *messages: Message) -> list[Message]:
    """Return what comes of messages within a quarter of a second, but for what comes anyway."""
    bench.client.tell(*messages)
    bench.run_ms(250)
    return [one for one in bench.client.read() if not isinstance(one, HEARTBEAT)]


@pytest.mark.parametrize("message", [UNKNOWN, NOT_A_NUMBER, INFINITE, UNKNOWN_NAME, UNKNOWN_INDEX])
@silent_firmware
def test_what_cannot_be_read_or_set_is_met_with_silence(
    make_bench: "MakeBench", firmware: Firmware, message: Message
) -> None:
    assert answers(make_bench(firmware=firmware), message) == []


@pytest.mark.parametrize(
    ("message", "answer"),
    [
        (UNKNOWN, PARAM_ERROR(255, 190, "NO_SUCH", -1, DOES_NOT_EXIST)),
        (NOT_A_NUMBER, PARAM_ERROR(255, 190, "VISO_SCALE", -1, VALUE_OUT_OF_RANGE)),
        (INFINITE, PARAM_ERROR(255, 190, "VISO_SCALE", -1, VALUE_OUT_OF_RANGE)),
        (UNKNOWN_NAME, PARAM_ERROR(255, 190, "NO_SUCH", -1, DOES_NOT_EXIST)),
        (UNKNOWN_INDEX, PARAM_ERROR(255, 190, "", 9999, DOES_NOT_EXIST)),
    ],
)
def test_later_firmware_tells_the_requester_why(make_bench: "MakeBench", message: Message, answer: Message) -> None:
    assert answers(make_bench(firmware=FEBRUARY_2026), message) == [answer]


def test_error_goes_to_the_requester_alone(make_bench: "MakeBench") -> None:
    bench = make_bench(firmware=FEBRUARY_2026, bauds=(None, None))
    bench.clients[1].tell(HEARTBEAT(6, 8, 0, 0, 0, 3))
    assert len(answers(bench, UNKNOWN, UNKNOWN_NAME)) == 2
    assert bench.clients[1].read_of(PARAM_ERROR) == []


def test_error_that_does_not_fit_is_not_sent(make_bench: "MakeBench") -> None:
    bench = make_bench(firmware=FEBRUARY_2026)
    while bench.client.channel.has_space_for(PARAM_ERROR):
        bench.client.channel.send(HEARTBEAT(2, 3, 0, 0, 0, 3))
    bench.client.tell(UNKNOWN)
    assert bench.client.read_of(PARAM_ERROR) == []


@every_firmware
def test_read_only_parameter_is_told_by_its_value_and_where_it_is_known_the_reason(
    make_bench: "MakeBench", firmware: Firmware
) -> None:
    bench = make_bench(firmware=firmware)
    bench.vehicle.params.apply_defaults({"VISO_SCALE": 2.0}, "card", read_only=["VISO_SCALE"])
    found = answers(bench, PARAM_SET(1, 1, "VISO_SCALE", 3.0, 9))
    errors = [one for one in found if isinstance(one, PARAM_ERROR)]
    told = firmware.endpoint.tells_param_errors
    wanted = [PARAM_ERROR(255, 190, "VISO_SCALE", -1, PERMISSION_DENIED)] if told else []
    assert errors == wanted
    assert [one.param_value for one in found if isinstance(one, PARAM_VALUE)] == [2.0]
    assert [one.text for one in found if isinstance(one, STATUSTEXT)] == ["Param write denied (VISO_SCALE)"]


def navigating(make_bench: "MakeBench", firmware: Firmware) -> "Bench":
    """Return a vehicle whose filter follows external navigation, without an origin."""
    bench = make_bench(firmware=firmware, until_ms=7000, filter_runs=True, **EXTERNAL)
    for time_us in range(0, 1_000_000, 40_000):
        bench.client.tell(VISION_POSITION_ESTIMATE(time_us, 0, 0, 0, 0, 0, 0))
        bench.run_ms(40)
    bench.client.read()
    return bench


def shape(messages: list[Message]) -> list[str]:
    return [one.text if isinstance(one, STATUSTEXT) else type(one).__name__ for one in messages]


SET_TEXTS = ["EKF3 IMU0 origin set", "EKF3 IMU1 origin set"]


@pytest.mark.parametrize(
    "firmware",
    [pytest.param(STABLE_4_6, id=STABLE_4_6.name, marks=pytest.mark.slow), pytest.param(JULY_2025, id=JULY_2025.name)],
)
def test_requester_is_told_of_the_origin_twice(make_bench: "MakeBench", firmware: Firmware) -> None:
    told = shape(answers(navigating(make_bench, firmware), ORIGIN))
    assert told[0] == "GPS_GLOBAL_ORIGIN"
    assert told.count("GPS_GLOBAL_ORIGIN") == 2


def test_later_firmware_tells_of_the_origin_once_after_the_texts(make_bench: "MakeBench") -> None:
    told = shape(answers(navigating(make_bench, FEBRUARY_2026), ORIGIN))
    assert told[:2] == SET_TEXTS
    assert sorted(told[2:4]) == ["GPS_GLOBAL_ORIGIN", "HOME_POSITION"]
    assert told[4:] == ["Field Elevation Set: 584m"]


def test_later_firmware_tells_of_the_origin_without_home(make_bench: "MakeBench") -> None:
    bench = make_bench(firmware=FEBRUARY_2026, until_ms=7000)
    assert shape(answers(bench, ORIGIN)).count("GPS_GLOBAL_ORIGIN") == 1


def test_later_firmware_acknowledges_before_the_texts_of_an_origin(make_bench: "MakeBench") -> None:
    bench = navigating(make_bench, FEBRUARY_2026)
    told = answers(bench, COMMAND_INT(1, 1, 0, 611, 0, 0, 0.0, 0.0, 0.0, 0.0, -353632610, 1491652300, 584.0))
    assert isinstance(told[0], COMMAND_ACK)
    assert shape(told)[1:3] == SET_TEXTS
    assert sum(isinstance(one, GPS_GLOBAL_ORIGIN) for one in told) == 1


MOCAP = ATT_POS_MOCAP(1000, (1.0, 0.0, 0.0, 0.0), 1.0, 2.0, 3.0, tuple([4.0] * 21))


@pytest.mark.parametrize(
    ("firmware", "errors"),
    [(STABLE_4_6, (0.2, 0.2)), (JULY_2025, (0.2, 0.2)), (FEBRUARY_2026, (math.sqrt(12), 1.5))],
    ids=lambda one: one.name if isinstance(one, Firmware) else "",
)
def test_covariance_of_mocap_counts_in_the_later_firmware(
    make_bench: "MakeBench", firmware: Firmware, errors: tuple[float, float]
) -> None:
    bench = make_bench(firmware=firmware)
    bench.client.tell(MOCAP)
    [pose] = bench.poses
    assert (float(pose.posErr), float(pose.angErr)) == pytest.approx(errors)


def test_negative_sum_of_variances_is_an_internal_error_in_the_later_firmware(make_bench: "MakeBench") -> None:
    bench = make_bench(firmware=FEBRUARY_2026)
    bench.client.tell(VISION_POSITION_ESTIMATE(0, 0, 0, 0, 0, 0, 0, (-1.0,) + (0.0,) * 20))
    [pose] = bench.poses
    assert float(pose.posErr) == pytest.approx(50.1)
    assert bench.vehicle.internal_errors.mask == 0x400


@every_firmware
def test_version_and_banner_are_the_firmwares(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware)
    bench.client.command(512, 148)
    bench.run_ms(50)
    [version] = bench.client.read_of(AUTOPILOT_VERSION)
    assert version.flight_sw_version == firmware.sw_version
    assert bytes(version.flight_custom_version) == firmware.source_hash.encode()
    bench.endpoint.send_banner(bench.client.channel)
    bench.run_ms(50)
    assert firmware.banner in bench.client.read_texts()


@every_firmware
def test_ids_and_options_are_read_by_the_names_of_the_firmware(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware, bauds=(None, None))
    params, names = bench.vehicle.params, firmware.endpoint.params
    params.set(names.system_id, 7)
    bench.run_ms(1100)
    assert {frame.header.system_id for frame in bench.client.read_received()} == {7}
    params.set(names.ground_station_id, 99)
    params.set(names.only_ground_station, 1)
    assert bench.client.tell(PARAM_REQUEST_READ(7, 1, "VISO_TYPE", -1)).rule.code == "not_from_gcs"


@every_firmware
def test_rates_of_streams_have_the_names_of_the_firmware(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware, bauds=(None, None))
    bench.clients[1].tell(REQUEST_DATA_STREAM(1, 1, 10, 7, 1))
    rates = [bench.vehicle.params.get_int(firmware.endpoint.params.stream_rate(index, "_EXTRA1")) for index in (0, 1)]
    assert rates == [0, 7]


@pytest.mark.parametrize(("options", "link"), [(0, 0), (1 << 10, 2), (1 << 12, 4), (0b1010_1000_0001_1111, 0), (-1, 6)])
def test_options_of_a_port_that_concern_its_link(options: int, link: int) -> None:
    assert link_options_of_port(options) == link


def test_earlier_firmware_has_the_options_of_a_link_with_its_port() -> None:
    params = ParamTable(make_groups(3, None, STABLE_4_6.params))
    params.set("SERIAL1_OPTIONS", 1 << 10)
    assert [options_of_port(params, index) for index in range(3)] == [0, 2, 0]


def test_private_link_of_the_earlier_firmware_gets_no_texts(make_bench: "MakeBench") -> None:
    bench = make_bench(firmware=STABLE_4_6, bauds=(None, None), SERIAL1_OPTIONS=1 << 10)
    for client in bench.clients:
        client.tell(HEARTBEAT(6, 8, 0, 0, 0, 3))
    bench.vehicle.texts.send_text(6, "hello")
    bench.run_ms(50)
    assert [("hello" in client.read_texts()) for client in bench.clients] == [True, False]


# What a release can send and does

SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 511, 512
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = range(6)
ZERO_ORIGIN = SET_GPS_GLOBAL_ORIGIN(1, 0, 0, 0)


SENDERS = {
    "AVAILABLE_MODES": {"2025-07", "2026-02", "4.7", "2026-04"},
    "AVAILABLE_MODES_MONITOR": {"2025-07", "2026-02", "4.7", "2026-04"},
    "FLIGHT_INFORMATION": {"2025-07", "2026-02", "4.7", "2026-04"},
    "HWSTATUS": {"4.6", "2025-07"},
    "RC_CHANNELS_SCALED": {"4.6"},
    "AOA_SSA": {"4.6"},
    "DEEPSTALL": {"4.6"},
    "RANGEFINDER": set(PROFILES),
}
"""Which releases can send a message."""


@every_firmware
def test_message_that_only_some_releases_can_send(make_bench: "MakeBench", firmware: Firmware) -> None:
    client = make_bench(firmware=firmware).client
    answers = {
        name: [
            client.command(command, message_id(name), value)
            for command, value in ((REQUEST_MESSAGE, 0), (SET_MESSAGE_INTERVAL, -1))
        ]
        for name in SENDERS
    }
    assert answers == {
        name: [ACCEPTED, ACCEPTED] if firmware.name in releases else [FAILED, DENIED]
        for name, releases in SENDERS.items()
    }


@every_firmware
def test_gps_that_is_disabled_is_told_of_up_to_july_2025(make_bench: "MakeBench", firmware: Firmware) -> None:
    for gps_type in (0, 14):
        bench = make_bench(firmware=firmware, GPS1_TYPE=gps_type)
        assert bench.client.command(REQUEST_MESSAGE, message_id("GPS_RAW_INT")) == ACCEPTED
        bench.run_ms(10)
        came = len(bench.client.read_of(GPS_RAW_INT))
        assert came == (1 if gps_type or firmware in (STABLE_4_6, JULY_2025) else 0)


@every_firmware
def test_range_is_streamed_up_to_july_2025(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware, RNGFND1_TYPE=10, RNGFND1_ORIENT=25)
    bench.client.tell(REQUEST_DATA_STREAM(1, 1, 12, 10, 1))
    bench.run_ms(500)
    came = bool(bench.client.read_of(RANGEFINDER))
    assert came == (firmware in (STABLE_4_6, JULY_2025))
    assert bench.client.command(SET_MESSAGE_INTERVAL, message_id("RANGEFINDER"), 100_000) == ACCEPTED
    bench.run_ms(500)
    assert bench.client.read_of(RANGEFINDER)


@every_firmware
def test_interval_is_told_on_request_since_july_2025(make_bench: "MakeBench", firmware: Firmware) -> None:
    client = make_bench(firmware=firmware).client
    wanted = FAILED if firmware is STABLE_4_6 else ACCEPTED
    assert client.command(REQUEST_MESSAGE, message_id("MESSAGE_INTERVAL"), message_id("ATTITUDE")) == wanted


@every_firmware
def test_origin_by_command_came_after_4_6(make_bench: "MakeBench", firmware: Firmware) -> None:
    client = make_bench(firmware=firmware).client
    wanted = UNSUPPORTED if firmware is STABLE_4_6 else ACCEPTED
    assert client.command_int(611, -353632610, 1491652300, 584.0) == wanted


@every_firmware
def test_origin_of_zeros_is_taken_by_4_6_alone(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware)
    bench.client.tell(ZERO_ORIGIN)
    assert (bench.vehicle.ahrs.origin() is not None) == (firmware is STABLE_4_6)


@every_firmware
def test_altitude_of_an_origin_is_checked_since_february_2026(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware)
    bench.client.tell(replace(ORIGIN, altitude=83_000_001))
    assert (bench.vehicle.ahrs.origin() is None) == (firmware not in (STABLE_4_6, JULY_2025))


@every_firmware
def test_restart_of_another_component_is_denied_since_february_2026(
    make_bench: "MakeBench", firmware: Firmware
) -> None:
    bench = make_bench(firmware=firmware)
    restarts = firmware in (STABLE_4_6, JULY_2025)
    assert bench.client.command(246, 1, target=(1, 154)) == (ACCEPTED if restarts else DENIED)
    assert bench.vehicle.reboot_requested == restarts
    assert bench.client.command(246, 1, target=(1, 0)) == ACCEPTED


@every_firmware
def test_dropped_packets_are_counted_since_july_2025(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware)
    bench.client.channel.packets_dropped = 7
    status = sys_status(bench.vehicle, bench.client.channel, bench.now_us)
    assert status is not None
    assert status.errors_comm == (0 if firmware is STABLE_4_6 else 7)


@every_firmware
def test_all_bits_say_that_all_sensors_are_new_in_4_6(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware)
    updated = highres_imu(bench.vehicle, bench.client.channel, bench.now_us).fields_updated
    assert updated == (0xFFFF if firmware is STABLE_4_6 else 0x1FFF)


@every_firmware
def test_telemetry_of_4_6_begins_a_second_later(make_bench: "MakeBench", firmware: Firmware) -> None:
    name = firmware.endpoint.params.telem_delay
    bench = make_bench(firmware=firmware, until_ms=0, **{name: 2.0})
    bench.run_ms(2 * 1024 + 100)
    bench.client.read()
    bench.client.command(REQUEST_MESSAGE, message_id("HEARTBEAT"))
    bench.run_ms(800)
    assert bool(bench.client.read_of(HEARTBEAT)) == (firmware is not STABLE_4_6)


@every_firmware
def test_home_counts_as_an_item_since_july_2025(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware)
    bench.client.tell(ORIGIN)
    bench.vehicle.copter.home.set(Location(1, 1, 1), lock=True)
    bench.client.read()
    bench.client.tell(MISSION_REQUEST_LIST(1, 1))
    [count] = bench.client.read_of(MISSION_COUNT)
    assert count.count == (0 if firmware is STABLE_4_6 else 1)


@pytest.mark.parametrize(
    ("request_", "of_4_6", "later"),
    [
        (MISSION_REQUEST(1, 1, 5), (True, 1), (False, 13)),
        (MISSION_REQUEST_INT(1, 1, 5), (True, 1), (True, 13)),
        (MISSION_REQUEST_INT(1, 1, 0, 1), (False, 1), (True, 13)),
        (MISSION_REQUEST_INT(1, 1, 5, 1), (False, 13), (True, 13)),
        (MISSION_REQUEST_INT(1, 1, 0, 2), (False, 13), (True, 13)),
    ],
)
def test_item_that_is_not_there(
    make_bench: "MakeBench", request_: Message, of_4_6: tuple[bool, int], later: tuple[bool, int]
) -> None:
    for firmware, wanted in ((STABLE_4_6, of_4_6), (JULY_2025, later), (STABLE_4_7, later)):
        client = make_bench(firmware=firmware).client
        client.tell(request_)
        came = client.read()
        [ack] = [one for one in came if isinstance(one, MISSION_ACK)]
        assert (any(isinstance(one, MISSION_COUNT) for one in came), ack.type) == wanted


@every_firmware
def test_calibration_of_a_barometer_is_concluded_in_4_6(make_bench: "MakeBench", firmware: Firmware) -> None:
    bench = make_bench(firmware=firmware)
    first = bench.client.command(241, 0, 0, 1)
    again = bench.client.command(241, 0, 0, 1)
    bench.run_ms(1100)
    later = [ack.result for ack in bench.client.read_of(COMMAND_ACK)]
    steps = firmware is STABLE_4_6
    assert (first, again, later) == (
        (IN_PROGRESS, TEMPORARILY_REJECTED, [ACCEPTED]) if steps else (ACCEPTED, ACCEPTED, [])
    )
    assert bench.client.command(241, 0, 0, 1) == (IN_PROGRESS if steps else ACCEPTED)


# Flight modes


@every_firmware
def test_modes_have_words_since_february_2026(make_bench: "MakeBench", firmware: Firmware) -> None:
    copter = make_bench(firmware=firmware).vehicle.copter
    names = [mode.name for mode in copter.available_modes()][:5]
    capitals = firmware in (STABLE_4_6, JULY_2025)
    words = ["Auto RTL", "Auto", "Acro", "Stabilize", "Altitude Hold"]
    assert names == (["AUTO RTL", "AUTO", "ACRO", "STABILIZE", "ALT_HOLD"] if capitals else words)


@every_firmware
def test_modes_that_cannot_be_selected_are_told_since_4_7(make_bench: "MakeBench", firmware: Firmware) -> None:
    copter = make_bench(firmware=firmware).vehicle.copter
    hidden = {mode.custom_mode for mode in copter.available_modes() if mode.properties == 2}
    told = firmware in (STABLE_4_7, APRIL_2026)
    assert hidden == (
        {ModeNumber.FOLLOW, ModeNumber.FLOWHOLD, ModeNumber.SYSTEMID, ModeNumber.TURTLE} if told else set()
    )


@every_firmware
def test_force_makes_the_vehicle_hold_since_july_2025(
    make_bench: "MakeBench", firmware: Firmware, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, held = make_bench(firmware=firmware, flies=True), list[object]()
    copter = bench.vehicle.copter
    assert copter.flight is not None
    copter.set_mode(ModeNumber.GUIDED)
    monkeypatch.setattr(copter.flight, "guide", held.append)
    ignored = 0b111_111 | 1 << 10 | 1 << 11  # all but the acceleration, which is a force by bit 9
    target = SET_POSITION_TARGET_LOCAL_NED(0, 1, 1, 1, ignored | 1 << 9, 0, 0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0)
    assert bench.client.tell(target) is TARGET_REFUSED
    assert held == ([] if firmware is STABLE_4_6 else [None])


@every_firmware
def test_speed_that_is_not_positive_is_denied_since_july_2025(make_bench: "MakeBench", firmware: Firmware) -> None:
    client = make_bench(firmware=firmware, flies=True).client
    for speed in (0.0, -1.0, math.nan):
        assert client.command(178, 1, speed) == (FAILED if firmware is STABLE_4_6 else DENIED), speed

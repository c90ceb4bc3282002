# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a client can see of the autopilot, one test a behaviour, in the order of the checklist of parity."""

import itertools
import math
import struct
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import pytest

from ap_core.location import Location
from mav_handlers.verdicts import ODOMETRY_FRAMES
from mav_handlers.wire.messages import (
    ATTITUDE,
    COMMAND_ACK,
    COMMAND_LONG,
    EKF_STATUS_REPORT,
    FILE_TRANSFER_PROTOCOL,
    GPS_GLOBAL_ORIGIN,
    HEARTBEAT,
    HOME_POSITION,
    LOCAL_POSITION_NED,
    ODOMETRY,
    PARAM_REQUEST_LIST,
    PARAM_REQUEST_READ,
    PARAM_SET,
    PARAM_VALUE,
    REQUEST_DATA_STREAM,
    SET_GPS_GLOBAL_ORIGIN,
    STATUSTEXT,
    SYS_STATUS,
    SYSTEM_TIME,
    TIMESYNC,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    Message,
)
from tests.places import DATA

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

ALIVE = HEARTBEAT(6, 8, 0, 0, 4, 3)
POSE = VISION_POSITION_ESTIMATE(1_000_000, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
ODOM = ODOMETRY(
    1_000_000,
    20,
    12,
    1.0,
    2.0,
    3.0,
    (1.0, 0.0, 0.0, 0.0),
    4.0,
    5.0,
    6.0,
    0.0,
    0.0,
    0.0,
    (0.0,) * 21,
    (0.0,) * 21,
    quality=90,
)
DELTA = VISION_POSITION_DELTA(1_000_000, 20_000, (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 70.0)
ACCEPTED, TEMPORARILY_REJECTED, DENIED, FAILED = 0, 1, 2, 4
SET_INTERVAL, GET_INTERVAL, REQUEST_MESSAGE = 511, 510, 512
ARM, PREARM_CHECKS, AUX_FUNCTION, SOURCE_SET, SET_ORIGIN = 400, 401, 218, 42007, 611
UART_BAUD, US_PER_BYTE = 115200, 86
NO_INDEX = 65535
REAL32 = 9
ESTIMATOR_RUNS_MS = 8000

# Messages of one rate, in the order in which the firmware was seen to send them.
BURST_ORDER = (DATA / "burst_order.txt").read_text(encoding="ascii").split()


def name(message: Message) -> str:
    return type(message).__name__


def names(messages: list[Message]) -> list[str]:
    return [name(message) for message in messages]


def request_streams(client: "Client", rate_hz: int) -> None:
    client.tell(REQUEST_DATA_STREAM(1, 1, 0, rate_hz, 1))


def covariance(values: dict[int, float]) -> tuple[float, ...]:
    return tuple(values.get(index, 0.0) for index in range(21))


def feed_poses(bench: "Bench", seconds: float, rate_hz: float = 30.0, client: "Client | None" = None) -> None:
    """Send poses at rest in time with the vehicle's clock."""
    for _ in range(round(seconds * rate_hz)):
        (client or bench.client).tell(replace(POSE, usec=bench.now_us))
        bench.run_ms(1000 / rate_hz)


def lag_ms(bench: "Bench") -> float:
    """Return how much earlier the newest pose counts than it arrived."""
    fields = bench.logged("VISP")[-1]
    return float(fields["TimeUS"]) / 1000 - float(fields["CTimeMS"])


def sends(client: "Client", kind: type[Message]) -> bool:
    return any(isinstance(message, kind) for message in client.read())


def read_value(client: "Client", bench: "Bench", param: str) -> list[PARAM_VALUE]:
    client.tell(PARAM_REQUEST_READ(1, 1, param, -1))
    bench.run_ms(200)
    return client.read_of(PARAM_VALUE)


def set_value(client: "Client", bench: "Bench", param: str, value: float) -> list[PARAM_VALUE]:
    client.tell(PARAM_SET(1, 1, param, value, 9))
    bench.run_ms(50)
    return client.read_of(PARAM_VALUE)


# Link


def test_garbage_prefix_is_tolerated(bench: "Bench", client: "Client") -> None:
    events = client.send_bytes(b"\x30\x20" * 3 + client.codec.encode(POSE))
    assert [event.name for event in events] == ["BAD_DATA", "VISION_POSITION_ESTIMATE"]
    assert len(bench.poses) == 1


def test_base_mode_is_81_disarmed_and_standby_also_armed_on_the_ground(bench: "Bench", client: "Client") -> None:
    bench.run_ms(1000)
    before = client.read_of(HEARTBEAT)[-1]
    assert (before.base_mode, before.system_status) == (81, 3)
    assert client.command(ARM, 1, 2989) == ACCEPTED
    bench.run_ms(1000)
    after = client.read_of(HEARTBEAT)[-1]
    assert (after.base_mode, after.system_status) == (81 + 128, 3)


@pytest.mark.parametrize("old", ["SYSID_THISMAV", "SYSID_MYGCS", "TELEM_DELAY", "SR0_POSITION", "ARMING_SKIPCHK"])
def test_old_parameter_names_get_no_reply(bench: "Bench", client: "Client", old: str) -> None:
    assert read_value(client, bench, old) == []
    [reply] = read_value(client, bench, "MAV_SYSID")
    assert (reply.param_id, reply.param_value) == ("MAV_SYSID", 1)


def test_streams_are_off_by_default_and_a_requested_rate_is_not_saved(bench: "Bench", client: "Client") -> None:
    client.tell(ALIVE)
    bench.run_ms(2000)
    assert not sends(client, ATTITUDE)
    request_streams(client, 4)
    assert client.read_of(PARAM_VALUE) == []
    bench.run_ms(1000)
    assert sends(client, ATTITUDE)
    assert [reply.param_value for reply in read_value(client, bench, "MAV1_EXTRA1")] == [4]
    assert "MAV1_EXTRA1" not in bench.vehicle.params.stored_values()


@pytest.mark.slow
def test_burst_order_of_messages_in_a_bucket(make_bench: "MakeBench") -> None:
    bench = make_bench(until_ms=25_000)
    feed_poses(bench, 0.5)
    request_streams(bench.client, 4)
    bench.run_ms(300)
    bench.client.read()
    feed_poses(bench, 0.26)
    burst = [found for found in names(bench.client.read()) if found in BURST_ORDER]
    start = burst.index(min(burst, key=BURST_ORDER.index))
    burst = burst[start:] + burst[:start]
    assert burst == sorted(set(burst), key=BURST_ORDER.index)
    assert {"AHRS", "ATTITUDE", "SYS_STATUS", "SYSTEM_TIME", "BATTERY_STATUS"} <= set(burst)


def test_telemetry_is_four_times_slower_during_a_parameter_download(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(57600,))
    client = bench.client
    request_streams(client, 0)
    client.tell(REQUEST_DATA_STREAM(1, 1, 10, 4, 1))
    bench.run_ms(1000)
    client.read()
    bench.run_ms(1000)
    assert 3 <= len(client.read_of(ATTITUDE)) <= 5
    client.tell(PARAM_REQUEST_LIST(1, 1))
    bench.run_ms(2000)
    received = client.read()
    assert sum(isinstance(message, PARAM_VALUE) for message in received) > 20
    assert 1 <= sum(isinstance(message, ATTITUDE) for message in received) <= 3


@pytest.mark.parametrize(
    "params",
    [(60_000.0, 100_000.0), (30.0, 100_000.0, 1.0), (30.0, -2.0), (30.0, 1000.0)],
    ids=["unknown id", "param3", "below -1", "too fast"],
)
def test_511_is_denied(client: "Client", params: tuple[float, ...]) -> None:
    assert client.command(SET_INTERVAL, *params) == DENIED


def test_510_answers_before_its_ack_and_512_after(bench: "Bench", client: "Client") -> None:
    client.tell(COMMAND_LONG(1, 1, GET_INTERVAL, 0, 30, 0, 0, 0, 0, 0, 0))
    bench.run_ms(10)
    assert names(client.read())[:2] == ["MESSAGE_INTERVAL", "COMMAND_ACK"]
    client.tell(COMMAND_LONG(1, 1, REQUEST_MESSAGE, 0, 30, 0, 0, 0, 0, 0, 0))
    bench.run_ms(10)
    assert names(client.read())[:2] == ["COMMAND_ACK", "ATTITUDE"]


def test_512_for_home_before_the_origin_is_accepted_and_nothing_sent(bench: "Bench", client: "Client") -> None:
    assert client.command(REQUEST_MESSAGE, 242) == ACCEPTED
    bench.run_ms(100)
    assert not sends(client, HOME_POSITION)


def test_text_over_50_characters_is_chunked_and_100_has_an_empty_third_chunk(bench: "Bench", client: "Client") -> None:
    client.tell(ALIVE)
    for length in (50, 51, 100):
        bench.vehicle.texts.send_text(6, "x" * length)
    bench.run_ms(50)
    chunks = client.read_of(STATUSTEXT)
    assert [len(chunk.text) for chunk in chunks] == [50, 50, 1, 50, 50, 0]
    assert [chunk.chunk_seq for chunk in chunks] == [0, 0, 1, 0, 1, 2]
    ids = [chunk.id for chunk in chunks]
    assert ids[0] == 0
    assert ids[1] == ids[2] != ids[3] == ids[4] == ids[5] != 0


def test_reason_texts_arrive_after_the_ack(bench: "Bench", client: "Client") -> None:
    client.tell(ALIVE)
    client.tell(COMMAND_LONG(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0))
    bench.run_ms(50)
    received = [message for message in client.read() if isinstance(message, COMMAND_ACK | STATUSTEXT)]
    assert isinstance(received[0], COMMAND_ACK)
    assert received[0].result == FAILED
    texts = [message.text for message in received[1:] if isinstance(message, STATUSTEXT)]
    assert "Arm: VisOdom: not healthy" in texts


# Clocks


def test_timesync_echoes_ts1_and_own_requests_end_in_the_system_id(bench: "Bench", client: "Client") -> None:
    client.read()
    client.tell(TIMESYNC(0, 123_456))
    [reply] = client.read_of(TIMESYNC)
    assert (reply.tc1, reply.ts1) == (bench.now_us * 1000, 123_456)
    bench.run_ms(25_000)
    requests = client.read_of(TIMESYNC)
    assert [(request.tc1, request.ts1 % 1000) for request in requests] == [(0, 1)] * len(requests)
    gaps_s = [(late.ts1 - early.ts1) / 1e9 for early, late in itertools.pairwise(requests)]
    assert gaps_s
    assert all(10 <= gap <= 10.1 for gap in gaps_s)


@pytest.mark.parametrize(("types", "taken"), [(1, False), (2, True)])
def test_system_time_is_ignored_with_brd_rtc_types_1(make_bench: "MakeBench", types: int, taken: bool) -> None:
    bench = make_bench(BRD_RTC_TYPES=types)
    bench.client.tell(SYSTEM_TIME(1_800_000_000_000_000, 1))
    bench.client.command(REQUEST_MESSAGE, 2)
    bench.run_ms(50)
    [time] = bench.client.read_of(SYSTEM_TIME)
    assert (time.time_unix_usec != 0) is taken


# Routing


def test_vision_messages_are_forwarded_to_other_links(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(None, None))
    ground, companion = bench.clients
    for client in bench.clients:
        client.tell(ALIVE)
    bench.run_ms(50)
    for client in bench.clients:
        client.read()
    companion.tell(POSE)
    [frame] = [frame for frame in ground.read_received() if frame.header.name == "VISION_POSITION_ESTIMATE"]
    assert (frame.header.system_id, frame.header.component_id) == (255, 190)
    assert frame.message == POSE


def test_command_to_an_unknown_component_is_executed_and_acknowledged_by_1(bench: "Bench", client: "Client") -> None:
    client.tell(COMMAND_LONG(1, 42, PREARM_CHECKS, 0, 0, 0, 0, 0, 0, 0, 0))
    [ack] = [frame for frame in client.read_received() if isinstance(frame.message, COMMAND_ACK)]
    assert (ack.header.system_id, ack.header.component_id) == (1, 1)


# Time correction


def test_first_sample_s_time_is_its_arrival_less_the_transport_delay(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(UART_BAUD,))
    bench.client.tell(POSE)
    [fields] = bench.logged("VISP")
    assert fields["CTimeMS"] == (bench.now_us - US_PER_BYTE * 129) // 1000


def test_constant_stamp_lags_500_ms_in_the_end(bench: "Bench", client: "Client") -> None:
    for _ in range(40):
        client.tell(replace(POSE, usec=0))
        bench.run_ms(33)
    assert 500 <= lag_ms(bench) <= 512


def test_backward_clock_jump_lags_until_a_full_new_window(bench: "Bench", client: "Client") -> None:
    lags = []
    for number in range(250):
        jump_us = 300_000 if number >= 50 else 0
        client.tell(replace(POSE, usec=bench.now_us + 1_000_000 - jump_us))
        lags.append(lag_ms(bench))
        bench.run_ms(33)
    assert max(lags[:50]) < 2
    assert min(lags[50:200]) > 298
    assert max(lags[201:]) < 2


# Errors and gates


def test_position_error_is_the_cube_root_of_the_sum_of_squared_variances(bench: "Bench", client: "Client") -> None:
    client.tell(replace(POSE, covariance=covariance({0: 3.0, 6: 4.0, 11: 12.0})))
    assert float(bench.logged("VISP")[-1]["PErr"]) == pytest.approx(5.52877, abs=5e-6)


def test_unknown_covariance_gives_the_minimum_and_a_nan_inside_it_an_internal_error(
    bench: "Bench", client: "Client"
) -> None:
    client.tell(ALIVE, replace(POSE, covariance=covariance({0: math.nan})))
    fields = bench.logged("VISP")[-1]
    assert (float(fields["PErr"]), float(fields["AErr"])) == pytest.approx((0.2, 0.2))
    client.tell(replace(POSE, covariance=covariance({6: math.nan})))
    assert float(bench.logged("VISP")[-1]["PErr"]) == pytest.approx(50.1)
    client.command(REQUEST_MESSAGE, 1)
    bench.run_ms(50)
    [status] = client.read_of(SYS_STATUS)
    assert (status.errors_count1, status.errors_count2) == (0x400, 0)


def test_quality_below_the_minimum_is_ignored_but_refreshes_health(make_bench: "MakeBench") -> None:
    bench = make_bench(VISO_QUAL_MIN=50)
    bench.client.tell(replace(ODOM, quality=10))
    assert bench.ahrs.calls == []
    assert bench.logged("VISP")[-1]["Ign"] == 1
    assert bench.vehicle.visual_odom.healthy()


@pytest.mark.parametrize(("frame", "child"), [(1, 8), (20, 8), (16, 12), (1, 12)])
def test_odometry_in_other_frames_is_dropped_without_refreshing_health(
    bench: "Bench", client: "Client", frame: int, child: int
) -> None:
    assert client.tell(replace(ODOM, frame_id=frame, child_frame_id=child)).rule is ODOMETRY_FRAMES.rule
    assert bench.logged("VISP") == []
    client.tell(ALIVE)
    client.command(PREARM_CHECKS)
    bench.run_ms(50)
    assert "PreArm: VisOdom: not healthy" in client.read_texts()


def test_zero_quaternion_of_odometry_leaves_velocity_unrotated(bench: "Bench", client: "Client") -> None:
    client.tell(replace(ODOM, q=(0.0, 0.0, 0.0, 0.0)))
    fields = bench.logged("VISV")[-1]
    assert [float(fields[axis]) for axis in ("VX", "VY", "VZ")] == [4, 5, 6]


def test_vision_position_delta_ignores_its_time_stamp(bench: "Bench", client: "Client") -> None:
    client.tell(DELTA)
    bench.run_ms(100)
    client.tell(replace(DELTA, time_usec=1))
    assert len(bench.logged("VISO")) == 2
    early, late = (call.timeStamp_ms for call in bench.ahrs.calls)
    assert late - early == 100


def test_health_expires_after_300_ms(bench: "Bench", client: "Client") -> None:
    client.tell(POSE)
    client.command(SET_INTERVAL, 1, 20_000)
    bench.run_ms(1000)
    statuses = client.read_of(SYS_STATUS)
    healthy = [bool(status.onboard_control_sensors_health & 128) for status in statuses]
    assert healthy == sorted(healthy, reverse=True)
    assert 13 <= sum(healthy) <= 16
    assert all(status.onboard_control_sensors_present & 128 for status in statuses)


# EKF


def test_samples_closer_than_20_ms_are_dropped_and_older_ones_are_not(make_bench: "MakeBench") -> None:
    bench = make_bench(EK3_SRC1_POSXY=6, EK3_SRC1_YAW=6, until_ms=ESTIMATOR_RUNS_MS)
    for wait_ms, usec in ((0, 1_000_000), (19, 1_019_000), (1, 1_020_000), (1, 1_010_000)):
        bench.run_ms(wait_ms)
        bench.client.tell(replace(POSE, usec=usec))
    assert len(bench.poses) == 4
    counts = bench.ahrs.ext_nav_counts
    assert (counts["pose", "taken"], counts["pose", "too_soon"]) == (3, 1)


@pytest.mark.slow
def test_flags_go_from_167_to_831_without_origin_and_local_position_starts_and_stops(make_bench: "MakeBench") -> None:
    sources = {"EK3_SRC1_POSXY": 6, "EK3_SRC1_POSZ": 1, "EK3_SRC1_VELXY": 6, "EK3_SRC1_VELZ": 0, "EK3_SRC1_YAW": 1}
    bench = make_bench(filter_runs=True, until_ms=20_000, **sources)
    client = bench.client

    def seen() -> tuple[int, bool]:
        client.read()
        client.command(REQUEST_MESSAGE, 193)
        client.command(REQUEST_MESSAGE, 32)
        bench.run_ms(20)
        received = client.read()
        [report] = [message for message in received if isinstance(message, EKF_STATUS_REPORT)]
        return report.flags, any(isinstance(message, LOCAL_POSITION_NED) for message in received)

    assert seen() == (167, False)
    for _ in range(150):
        client.tell(replace(ODOM, time_usec=bench.now_us, z=0.0, vx=0.0, vy=0.0, vz=0.0))
        bench.run_ms(33)
    assert seen() == (831, True)
    bench.run_ms(6500)
    assert seen() == (831, True)
    bench.run_ms(1000)
    assert seen() == (39, True)
    bench.run_ms(8000)
    assert seen() == (167, False)


# Origin


def test_second_origin_fails_by_command_and_is_passed_over_as_a_message(bench: "Bench", client: "Client") -> None:
    assert client.command_int(SET_ORIGIN, 473977420, 85455940, 488.0) == ACCEPTED
    assert client.command_int(SET_ORIGIN, 473977421, 85455940, 488.0) == FAILED
    client.tell(SET_GPS_GLOBAL_ORIGIN(1, 1, 2, 3))
    assert bench.vehicle.ahrs.origin() == Location(473977420, 85455940, 48800)
    assert not sends(client, GPS_GLOBAL_ORIGIN)


@pytest.mark.slow
def test_requester_sees_the_origin_twice_and_home_goes_to_all_links(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(None, None), EK3_SRC1_POSXY=6, EK3_SRC1_YAW=6, until_ms=25_000, filter_runs=True)
    first, second = bench.clients
    for client in bench.clients:
        client.tell(ALIVE)
    feed_poses(bench, 1.0, client=second)
    for client in bench.clients:
        client.read()
    first.tell(SET_GPS_GLOBAL_ORIGIN(1, 473977420, 85455940, 488_000))
    feed_poses(bench, 0.2, client=second)
    at_first, at_second = (client.read() for client in bench.clients)
    assert names(at_first).count("GPS_GLOBAL_ORIGIN") == 2
    assert names(at_second).count("GPS_GLOBAL_ORIGIN") == 1
    assert names(at_first).count("HOME_POSITION") == names(at_second).count("HOME_POSITION") == 1


# Arming


def test_400_with_21196_arms_too(make_bench: "MakeBench") -> None:
    bench = make_bench(until_ms=ESTIMATOR_RUNS_MS)
    client = bench.client
    assert client.command(ARM, 1) == FAILED
    assert client.command(ARM, 1, 21196) == ACCEPTED
    assert bench.vehicle.copter.is_armed()


def test_401_is_always_accepted_while_disarmed(make_bench: "MakeBench") -> None:
    bench = make_bench(until_ms=ESTIMATOR_RUNS_MS)
    client = bench.client
    assert not bench.vehicle.copter.arming.passed
    assert client.command(PREARM_CHECKS) == ACCEPTED
    assert client.command(ARM, 1, 2989) == ACCEPTED
    assert client.command(PREARM_CHECKS) == TEMPORARILY_REJECTED


def test_source_sets_are_chosen_by_218_and_42007(bench: "Bench", client: "Client") -> None:
    client.tell(ALIVE)
    assert client.command(AUX_FUNCTION, 80, 2) == ACCEPTED
    assert client.command(AUX_FUNCTION, 90, 1) == ACCEPTED
    assert client.command(SOURCE_SET, 3) == ACCEPTED
    assert client.command(SOURCE_SET, 4) == DENIED
    assert client.command(AUX_FUNCTION, 90, 0) == ACCEPTED
    bench.run_ms(50)
    assert client.read_texts() == ["Using EKF Source Set 2", "Using EKF Source Set 1"]
    assert [event["Id"] for event in bench.logged("EV") if 85 <= int(event["Id"]) <= 87] == [86, 87, 85]


@pytest.mark.slow
def test_pre_arm_failures_repeat_after_30_s_and_changes_are_told_after_4_s(make_bench: "MakeBench") -> None:
    bench = make_bench(until_ms=0)
    client = bench.client
    told_s = []
    for _ in range(700):
        client.tell(ALIVE)
        bench.run_ms(100)
        if "PreArm: VisOdom: not healthy" in client.read_texts():
            told_s.append(bench.now_us / 1e6)
    assert len(told_s) == 2
    assert told_s[0] == pytest.approx(30.5, abs=1.0)
    assert told_s[1] - told_s[0] == pytest.approx(31, abs=1.1)
    feed_poses(bench, 3.0)
    client.read()
    silent_us = bench.now_us
    while "PreArm: VisOdom: not healthy" not in client.read_texts():
        assert bench.now_us - silent_us < 10_000_000
        client.tell(ALIVE)
        bench.run_ms(100)
    assert bench.now_us - silent_us < 3_000_000


def test_all_failing_checks_are_reported_together(bench: "Bench", client: "Client") -> None:
    client.tell(ALIVE, replace(POSE, covariance=covariance({18: math.nan})))
    bench.run_ms(1000)
    client.read()
    client.command(PREARM_CHECKS)
    bench.run_ms(50)
    texts = [text for text in client.read_texts() if text.startswith("PreArm: ")]
    assert "PreArm: VisOdom: not healthy" in texts
    assert any(text.startswith("PreArm: Internal errors 0x400 l:34 cnstring_nan") for text in texts)


# Parameters


@pytest.mark.parametrize(
    ("param", "sent", "stored"),
    [
        ("VISO_ORIENT", 10.6, 10),
        ("VISO_ORIENT", -10.6, -10),
        ("VISO_ORIENT", 300, 127),
        ("VISO_DELAY_MS", 99_999, 32_767),
        ("VISO_ORIENT", 9.99, 10),
        ("VISO_ORIENT", 9.98, 9),
    ],
)
def test_param_set_ignores_the_sent_type_rounds_by_a_hundredth_clamps_and_truncates(
    bench: "Bench", client: "Client", param: str, sent: float, stored: float
) -> None:
    client.tell(ALIVE)
    assert [reply.param_value for reply in set_value(client, bench, param, sent)] == [stored]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_param_set_to_no_number_is_met_with_silence(bench: "Bench", client: "Client", value: float) -> None:
    client.tell(ALIVE)
    assert set_value(client, bench, "VISO_ORIENT", value) == []


def test_echo_goes_to_all_links_and_is_real32_for_an_unstored_default(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(None, None))
    for client in bench.clients:
        client.tell(ALIVE)
    bench.clients[0].tell(PARAM_SET(1, 1, "VISO_DELAY_MS", 10.0, 4))
    bench.run_ms(50)
    for client in bench.clients:
        [echo] = client.read_of(PARAM_VALUE)
        assert (echo.param_id, echo.param_value, echo.param_index, echo.param_type) == (
            "VISO_DELAY_MS",
            10,
            NO_INDEX,
            REAL32,
        )


def test_first_element_of_a_vector_echoes_three_messages(bench: "Bench", client: "Client") -> None:
    client.tell(ALIVE)
    assert [reply.param_id for reply in set_value(client, bench, "VISO_POS_X", 0.5)] == [
        "VISO_POS_X",
        "VISO_POS_Y",
        "VISO_POS_Z",
    ]
    assert [reply.param_id for reply in set_value(client, bench, "VISO_POS_Y", 0.5)] == ["VISO_POS_Y"]


def test_20_reads_wait_and_5_replies_leave_every_100_ms(bench: "Bench", client: "Client") -> None:
    for _ in range(60):
        client.tell(PARAM_REQUEST_READ(1, 1, "VISO_TYPE", -1))
    groups = []
    for _ in range(8):
        bench.run_ms(100)
        groups.append(len(client.read_of(PARAM_VALUE)))
    assert [count for count in groups if count] == [5, 5, 5, 5]


def test_viso_type_0_hides_ten_parameters_which_answer_by_name(bench: "Bench", client: "Client") -> None:
    client.tell(ALIVE)
    [shown] = read_value(client, bench, "VISO_SCALE")
    set_value(client, bench, "VISO_TYPE", 0)
    [hidden] = read_value(client, bench, "VISO_SCALE")
    assert shown.param_count - hidden.param_count == 10
    assert hidden.param_value == 1


def test_viso_type_from_0_to_1_at_run_time_is_out_of_memory(make_bench: "MakeBench") -> None:
    bench = make_bench(VISO_TYPE=0)
    bench.client.tell(ALIVE)
    set_value(bench.client, bench, "VISO_TYPE", 1)
    bench.client.command(PREARM_CHECKS)
    bench.run_ms(50)
    assert "PreArm: VisOdom: out of memory" in bench.client.read_texts()


class PckReader:
    """Downloads a file as a client does, until the end of file and not until its size, and unpacks it."""

    HEADER = struct.Struct("<HBBBBBxI")
    OPEN, READ, ACK, NACK, END_OF_FILE = 4, 5, 128, 129, 6
    FORMATS: ClassVar = {1: "<b", 2: "<h", 3: "<i", 4: "<f"}

    def __init__(self, bench: "Bench", read_size: int) -> None:
        self._bench = bench
        self._read_size = read_size
        self._seq = 0

    def _ask(self, opcode: int, size: int, offset: int = 0, data: bytes = b"") -> tuple[int, bytes]:
        payload = (self.HEADER.pack(self._seq, 0, opcode, size, 0, 0, offset) + data).ljust(251, b"\0")
        self._seq += 2
        self._bench.client.read()
        self._bench.client.tell(FILE_TRANSFER_PROTOCOL(0, 1, 1, tuple(payload)))
        self._bench.run_ms(20)
        [reply] = self._bench.client.read_of(FILE_TRANSFER_PROTOCOL)
        fields = self.HEADER.unpack_from(bytes(reply.payload))
        assert fields[0] == self._seq - 1
        return fields[2], bytes(reply.payload)[12 : 12 + fields[3]]

    def download(self, path: bytes) -> tuple[int, bytes]:
        """Return the announced size and the content."""
        opcode, size = self._ask(self.OPEN, len(path), data=path)
        assert opcode == self.ACK
        content = b""
        while (part := self._ask(self.READ, self._read_size, len(content)))[0] == self.ACK:
            content += part[1]
        assert part == (self.NACK, bytes([self.END_OF_FILE]))
        return int.from_bytes(size, "little"), content

    def unpack(self, content: bytes) -> list[tuple[str, int, float, float]]:
        """Return name, type, value and default of each parameter."""
        magic, count, total = struct.unpack_from("<HHH", content)
        assert (magic, count) == (0x671C, total)
        found, name, at = [], b"", 6
        for _ in range(count):
            while content[at] == 0:
                at += 1
            kind, flags = content[at] & 15, content[at] >> 4
            shared, added = content[at + 1] & 15, (content[at + 1] >> 4) + 1
            name = name[:shared] + content[at + 2 : at + 2 + added]
            at += 2 + added
            width = struct.calcsize(self.FORMATS[kind])
            values = [
                struct.unpack_from(self.FORMATS[kind], content, at + number * width)[0] for number in range(1 + flags)
            ]
            at += width * len(values)
            assert (at - 1) // self._read_size == (at - width) // self._read_size, "a value straddles two reads"
            found.append((name.decode("ascii"), kind, values[0], values[-1]))
        assert at == len(content)
        return found


@pytest.mark.parametrize("read_size", [80, 239])
def test_size_of_param_pck_is_an_estimate_and_its_content_packed(bench: "Bench", read_size: int) -> None:
    bench.client.tell(ALIVE)
    set_value(bench.client, bench, "VISO_DELAY_MS", 77)
    size, content = PckReader(bench, read_size).download(b"@PARAM/param.pck?withdefaults=1")
    params = list(bench.vehicle.params)
    assert size == 12 * len(params) != len(content)
    unpacked = PckReader(bench, read_size).unpack(content)
    expected = [(param.name, int(param.type), float(param.value), float(param.default)) for param in params]
    assert [(param, kind) for param, kind, _, _ in unpacked] == [(param, kind) for param, kind, _, _ in expected]
    assert [values[2:] for values in unpacked] == [pytest.approx(values[2:]) for values in expected]
    assert ("VISO_DELAY_MS", 2, 77, 10) in unpacked

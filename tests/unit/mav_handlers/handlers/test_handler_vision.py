# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages that carry external navigation: what they hand over, log, and leave undone."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.verdicts import CONSUMED, DISABLED, NO_BACKEND, QUALITY_BELOW_MIN
from ekf_stub.ahrs.ahrs_settable import BodyFrameOdom
from mav_handlers.handlers.vision import odometry_frames_accepted
from mav_handlers.verdicts import ODOMETRY_FRAMES
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    COMMAND_LONG,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ODOMETRY,
    SYS_STATUS,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

NAN = math.nan
STAMP_US = 1_000_000
EULER = (0.1, -0.2, 0.3)
HALF_TURN_ABOUT_Z = (0.0, 0.0, 0.0, 1.0)

POSE = VISION_POSITION_ESTIMATE(STAMP_US, 1.0, 2.0, 3.0, *EULER, (0.0,) * 21, 7)
GLOBAL_POSE = GLOBAL_VISION_POSITION_ESTIMATE(STAMP_US, 1.0, 2.0, 3.0, *EULER, (0.0,) * 21, 7)
VICON = VICON_POSITION_ESTIMATE(STAMP_US, 1.0, 2.0, 3.0, *EULER, (0.0,) * 21)
MOCAP = ATT_POS_MOCAP(STAMP_US, (0.5, 0.5, 0.5, 0.5), 1.0, 2.0, 3.0, (0.0,) * 21)
SPEED = VISION_SPEED_ESTIMATE(STAMP_US, 1.0, 2.0, 3.0, (0.0,) * 9, 7)
DELTA = VISION_POSITION_DELTA(STAMP_US, 20_000, (0.1, 0.2, 0.3), (1.0, 2.0, 3.0), 70.0)
ODOM = ODOMETRY(
    STAMP_US,
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
    7,
    3,
    80,
)

EULER_POSES = (POSE, GLOBAL_POSE, VICON)
POSES = (*EULER_POSES, MOCAP, ODOM)
STAMPED = (*POSES, SPEED)
EVERY = (*STAMPED, DELTA)


@pytest.fixture
def filter_starts() -> bool:
    return False


def by_name(messages: tuple[Message, ...]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("message", messages, ids=lambda message: type(message).__name__)


def covariance(values: dict[int, float]) -> tuple[float, ...]:
    return tuple(values.get(index, 0.0) for index in range(21))


def logged_errors(bench: "Bench", values: dict[int, float]) -> tuple[float, float]:
    bench.client.tell(replace(POSE, covariance=covariance(values)))
    [fields] = bench.logged("VISP")
    return float(fields["PErr"]), float(fields["AErr"])


def corrected_ms(bench: "Bench") -> list[int]:
    return [call.timeStamp_ms for call in bench.ahrs.calls]


class TestHandedOver:
    """What reaches the AHRS."""

    @by_name(POSES)
    def test_position_is_handed_over_as_sent(self, bench: "Bench", client: "Client", message: Message) -> None:
        assert client.tell(message) is CONSUMED
        assert [call.pos for call in bench.poses] == [Vector3f(1, 2, 3)]

    @by_name(EULER_POSES)
    def test_euler_angles_become_a_quaternion(self, bench: "Bench", client: "Client", message: Message) -> None:
        client.tell(message)
        assert [call.quat for call in bench.poses] == [Quaternion.from_euler(*(f32(angle) for angle in EULER))]

    @by_name((MOCAP, ODOM))
    def test_quaternion_is_handed_over_as_sent(
        self, bench: "Bench", client: "Client", message: ATT_POS_MOCAP | ODOMETRY
    ) -> None:
        q = (2.0, 0.0, -3.0, 0.5)
        client.tell(replace(message, q=q))
        assert [call.quat for call in bench.poses] == [Quaternion(*q)]

    def test_speed_is_handed_over_as_sent(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(SPEED) is CONSUMED
        assert [(call.vel, call.err) for call in bench.velocities] == [(Vector3f(1, 2, 3), f32(0.1))]

    def test_odometry_hands_over_pose_then_speed(self, bench: "Bench", client: "Client") -> None:
        client.tell(ODOM)
        assert bench.ahrs.calls == [*bench.poses, *bench.velocities]
        assert len(bench.poses) == len(bench.velocities) == 1

    def test_delta_is_handed_over_with_the_time_of_handling(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(DELTA, read_us=4_000_000) is CONSUMED
        [call] = bench.ahrs.calls
        assert isinstance(call, BodyFrameOdom)
        assert (call.delAng, call.delPos) == (Vector3f(0.1, 0.2, 0.3), Vector3f(1, 2, 3))
        assert (call.quality, call.delTime) == (f32(70), f32(20_000) * f32(1e-6))
        assert (call.timeStamp_ms, call.delay_ms) == (5000, 10)

    def test_delta_ignores_its_time_stamp(self, bench: "Bench", client: "Client") -> None:
        client.tell(DELTA, replace(DELTA, time_usec=(1 << 64) - 1))
        assert corrected_ms(bench) == [5000, 5000]

    @pytest.mark.parametrize(
        ("message", "counter"),
        [(POSE, 7), (GLOBAL_POSE, 7), (VICON, 0), (MOCAP, 0), (ODOM, 7)],
        ids=lambda x: str(x)[:9],
    )
    def test_reset_counter_is_the_message_s_or_zero(
        self, bench: "Bench", client: "Client", message: Message, counter: int
    ) -> None:
        client.tell(message)
        assert [fields["Rst"] for fields in bench.logged("VISP")] == [counter]
        assert [call.resetTime_ms for call in bench.poses] == [5000 if counter else 0]

    @by_name((POSE, GLOBAL_POSE, VICON, MOCAP))
    def test_poses_but_odometry_have_quality_0(self, bench: "Bench", client: "Client", message: Message) -> None:
        client.tell(message)
        assert [fields["Q"] for fields in bench.logged("VISP")] == [0]

    def test_speed_has_quality_0_and_its_own_counter(self, bench: "Bench", client: "Client") -> None:
        client.tell(SPEED)
        assert [(fields["Q"], fields["Rst"]) for fields in bench.logged("VISV")] == [(0, 7)]

    def test_nothing_is_acknowledged(self, quiet_bench: "Bench") -> None:
        quiet_bench.client.tell(*EVERY)
        quiet_bench.run_ms(900)
        assert quiet_bench.client.read() == []


class TestRecords:
    """What is logged."""

    @by_name((POSE, GLOBAL_POSE, VICON, MOCAP))
    def test_pose_makes_one_record(self, bench: "Bench", client: "Client", message: Message) -> None:
        client.tell(message)
        assert [name for name, _ in bench.records] == ["VISP"]

    def test_speed_makes_one_record(self, bench: "Bench", client: "Client") -> None:
        client.tell(SPEED)
        assert [name for name, _ in bench.records] == ["VISV"]

    def test_delta_makes_one_record(self, bench: "Bench", client: "Client") -> None:
        client.tell(DELTA)
        assert [name for name, _ in bench.records] == ["VISO"]

    def test_odometry_makes_two_records_with_one_time(self, bench: "Bench", client: "Client") -> None:
        client.tell(ODOM)
        assert [name for name, _ in bench.records] == ["VISP", "VISV"]
        assert bench.logged("VISP")[0]["CTimeMS"] == bench.logged("VISV")[0]["CTimeMS"]

    @by_name(STAMPED)
    def test_sender_s_stamp_is_logged_as_it_is(self, bench: "Bench", client: "Client", message: Message) -> None:
        client.tell(message)
        assert {fields["RTimeUS"] for _, fields in bench.records} == {STAMP_US}


class TestOdometry:
    """Frames, rotation of the velocity, quality."""

    @pytest.mark.parametrize(("frame_id", "child_frame_id"), [(1, 8), (1, 12), (20, 8), (20, 20), (12, 12), (16, 12)])
    def test_other_frames_are_dropped_without_a_trace(
        self, bench: "Bench", client: "Client", frame_id: int, child_frame_id: int
    ) -> None:
        message = replace(ODOM, frame_id=frame_id, child_frame_id=child_frame_id)
        assert client.tell(message) is ODOMETRY_FRAMES
        assert not odometry_frames_accepted(message)
        assert (bench.ahrs.calls, bench.records) == ([], [])
        assert not bench.vehicle.visual_odom.healthy()

    def test_velocity_is_turned_by_the_quaternion(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(ODOM, q=HALF_TURN_ABOUT_Z))
        assert [call.vel for call in bench.velocities] == [Vector3f(-4, -5, 6)]

    def test_zero_quaternion_leaves_the_velocity(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(ODOM, q=(0.0,) * 4))
        assert [call.vel for call in bench.velocities] == [Vector3f(4, 5, 6)]

    def test_long_quaternion_distorts_the_velocity(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(ODOM, q=(0.0, 0.0, 0.0, 2.0)))
        assert [call.vel for call in bench.velocities] == [Vector3f(4 - 32, 5 - 40, 6)]

    @pytest.mark.parametrize(
        ("quality", "minimum", "consumed"),
        [(0, 0, True), (-1, 0, False), (-1, -1, True), (49, 50, False), (50, 50, True), (-128, 0, False)],
    )
    def test_quality_is_compared_with_the_minimum(
        self, make_bench: "MakeBench", quality: int, minimum: int, consumed: bool
    ) -> None:
        bench = make_bench(VISO_QUAL_MIN=minimum)
        verdict = bench.client.tell(replace(ODOM, quality=quality))
        assert verdict is (CONSUMED if consumed else QUALITY_BELOW_MIN)
        assert len(bench.ahrs.calls) == (2 if consumed else 0)
        assert [(fields["Ign"], fields["Q"]) for _, fields in bench.records] == [(not consumed, quality)] * 2

    def test_ignored_sample_refreshes_health(self, make_bench: "MakeBench") -> None:
        bench = make_bench(VISO_QUAL_MIN=50)
        bench.client.tell(replace(ODOM, quality=10))
        assert bench.vehicle.visual_odom.healthy()

    def test_message_without_extension_fields_has_neither_counter_nor_quality(
        self, bench: "Bench", client: "Client"
    ) -> None:
        covariance = (*(0.0,) * 20, 1.0)
        message = replace(ODOM, velocity_covariance=covariance, reset_counter=0, estimator_type=0, quality=0)
        frame = client.codec.encode(message)
        assert frame[1] == 230
        client.send_bytes(frame)
        assert [(fields["Rst"], fields["Q"]) for _, fields in bench.records] == [(0, 0)] * 2

    def test_rates_velocity_covariance_and_estimator_do_not_matter(self, bench: "Bench", client: "Client") -> None:
        client.tell(ODOM)
        odd = replace(ODOM, rollspeed=NAN, yawspeed=9.0, velocity_covariance=(NAN,) * 21, estimator_type=255)
        client.tell(odd)
        first, second = bench.poses
        assert first == second
        assert bench.vehicle.internal_errors.mask == 0


class TestErrors:
    """From covariance to the errors that are handed over and logged."""

    def test_position_error_of_3_4_12(self, bench: "Bench") -> None:
        assert logged_errors(bench, {0: 3, 6: 4, 11: 12})[0] == pytest.approx(5.52877, abs=5e-6)

    def test_attitude_error_of_half_quarter_three_quarters(self, bench: "Bench") -> None:
        assert logged_errors(bench, {15: 0.5, 18: 0.25, 20: 0.75})[1] == pytest.approx(0.95647, abs=5e-6)

    def test_odometry_has_the_same_errors(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(ODOM, pose_covariance=covariance({0: 3, 6: 4, 11: 12, 15: 0.5, 18: 0.25, 20: 0.75})))
        [call] = bench.poses
        assert [float(call.posErr), float(call.angErr)] == pytest.approx([5.52877, 0.95647], abs=5e-6)

    @pytest.mark.parametrize("values", [{}, {0: NAN, 6: 5.0, 15: 5.0}], ids=["zero", "no covariance"])
    def test_no_error_is_raised_to_the_minimum(self, bench: "Bench", values: dict[int, float]) -> None:
        assert logged_errors(bench, values) == (float(f32(0.2)), float(f32(0.2)))
        assert bench.vehicle.internal_errors.mask == 0

    @pytest.mark.parametrize("large", [1e6, math.inf, -math.inf])
    def test_large_error_is_limited(self, bench: "Bench", large: float) -> None:
        assert logged_errors(bench, {0: large, 20: large}) == (100, 1.5)

    def test_minimum_above_the_maximum_wins(self, make_bench: "MakeBench") -> None:
        assert logged_errors(make_bench(VISO_POS_M_NSE=200), {})[0] == 200

    @pytest.mark.parametrize(
        ("index", "errors"), [(6, (50.1, 0.2)), (11, (50.1, 0.2)), (18, (0.2, 0.85)), (15, (0.2, 0.85))]
    )
    def test_nan_beyond_the_first_element_gives_the_midpoint(
        self, bench: "Bench", index: int, errors: tuple[float, float]
    ) -> None:
        assert logged_errors(bench, {index: NAN}) == pytest.approx(errors)

    def test_such_a_nan_is_an_internal_error_seen_in_sys_status(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(POSE, covariance=covariance({6: NAN})), COMMAND_LONG(1, 1, 512, 0, 1, *(0.0,) * 6))
        bench.run_ms(3)
        [status] = client.read_of(SYS_STATUS)
        assert (status.errors_count1, status.errors_count2, status.errors_count4) == (0x400, 0, 1)

    def test_covariance_of_mocap_is_ignored(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(MOCAP, covariance=(NAN,) * 21))
        client.tell(replace(MOCAP, covariance=(9.0,) * 21))
        assert [(call.posErr, call.angErr) for call in bench.poses] == [(f32(0.2), f32(0.2))] * 2

    def test_covariance_of_a_speed_is_ignored(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(SPEED, covariance=(NAN,) * 9))
        assert [call.err for call in bench.velocities] == [f32(0.1)]
        assert bench.vehicle.internal_errors.mask == 0


class TestNotFinite:
    """NaN and infinity are logged and refresh health."""

    @pytest.mark.parametrize("bad", [NAN, math.inf, -math.inf])
    @by_name((POSE, MOCAP, ODOM, SPEED))
    def test_bad_position_or_velocity_is_handed_over(
        self, bench: "Bench", client: "Client", message: VISION_POSITION_ESTIMATE, bad: float
    ) -> None:
        assert client.tell(replace(message, x=bad)) is CONSUMED
        assert bench.vehicle.visual_odom.healthy()
        assert str(list(bench.records[0][1].values())[3]) == str(np.float32(bad))

    @pytest.mark.parametrize("bad", [NAN, math.inf])
    def test_bad_angle_spoils_the_attitude_alone(self, bench: "Bench", client: "Client", bad: float) -> None:
        assert client.tell(replace(POSE, roll=bad)) is CONSUMED
        [call] = bench.poses
        assert call.pos == Vector3f(1, 2, 3)
        assert np.isnan(call.quat.q1)

    @pytest.mark.parametrize("bad", [NAN, math.inf, 3e38])
    def test_bad_odometry_is_taken_without_a_warning(self, bench: "Bench", client: "Client", bad: float) -> None:
        everything = (bad,) * 21
        message = replace(ODOM, x=bad, q=(bad,) * 4, vx=bad, vy=-bad, vz=bad, pose_covariance=everything, quality=-128)
        client.tell(message, replace(message, quality=127))
        assert len(bench.ahrs.calls) == 2

    def test_bad_delta_is_taken(self, bench: "Bench", client: "Client") -> None:
        message = replace(DELTA, angle_delta=(NAN, math.inf, 0.0), position_delta=(NAN,) * 3, confidence=NAN)
        assert client.tell(replace(message, time_delta_usec=(1 << 64) - 1)) is CONSUMED
        assert len(bench.ahrs.calls) == 1


class TestTime:
    """Correction of time stamps."""

    @pytest.mark.parametrize(
        ("message", "size"),
        [(POSE, 129), (GLOBAL_POSE, 129), (VICON, 128), (MOCAP, 132), (ODOM, 245), (SPEED, 69)],
        ids=lambda value: type(value).__name__,
    )
    def test_first_sample_on_a_uart_is_as_old_as_its_transport(
        self, make_bench: "MakeBench", message: Message, size: int
    ) -> None:
        bench = make_bench(bauds=(115200,))
        bench.client.tell(message)
        assert set(corrected_ms(bench)) == {(5_000_000 - 86 * size) // 1000}

    def test_length_on_the_wire_does_not_matter(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(115200,))
        frame = bench.client.codec.encode(VISION_POSITION_ESTIMATE(STAMP_US, 0, 0, 0, 0, 0, 0))
        assert len(frame) < 30
        bench.client.send_bytes(frame)
        assert corrected_ms(bench) == [(5_000_000 - 86 * 129) // 1000]

    def test_messages_read_together_came_one_after_the_other(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(115200,))
        frames = [bench.client.codec.encode(replace(SPEED, usec=stamp)) for stamp in (0, 10_000_000, 20_000_000)]
        bench.client.send_bytes(b"".join(frames))
        # Each sender's jump makes the sample count as new, so that its time is its arrival.
        after = [len(frames[1]) + len(frames[2]), len(frames[2]), 0]
        assert corrected_ms(bench) == [(5_000_000 - 86 * (69 + unread)) // 1000 for unread in after]

    def test_network_link_has_no_transport_time(self, bench: "Bench", client: "Client") -> None:
        client.tell(POSE)
        assert corrected_ms(bench) == [5000]

    def test_time_counts_from_the_reading_of_the_link(self, bench: "Bench", client: "Client") -> None:
        client.tell(POSE, read_us=4_997_500)
        assert corrected_ms(bench) == [4997]

    def test_late_sample_keeps_its_time(self, bench: "Bench", client: "Client") -> None:
        client.tell(POSE)
        bench.run_ms(130)
        client.tell(replace(POSE, usec=STAMP_US + 30_000))
        assert corrected_ms(bench) == [5000, 5030]

    @by_name((GLOBAL_POSE, VICON, SPEED, MOCAP, ODOM))
    def test_one_corrector_serves_all_messages_of_a_link(
        self, bench: "Bench", client: "Client", message: Message
    ) -> None:
        client.tell(POSE)
        bench.run_ms(100)
        client.tell(message)
        assert set(corrected_ms(bench)[1:]) == {5000}

    def test_one_corrector_serves_all_senders_of_a_link(self, bench: "Bench", client: "Client") -> None:
        client.tell(POSE)
        bench.run_ms(100)
        client.codec = type(client.codec)(7, 197)
        client.tell(POSE)
        assert corrected_ms(bench) == [5000, 5000]

    def test_each_link_has_its_own_corrector(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[0].tell(POSE)
        bench.run_ms(100)
        bench.clients[1].tell(POSE)
        assert corrected_ms(bench) == [5000, 5100]

    def test_constant_stamp_lags_by_500_ms_in_the_end(self, bench: "Bench", client: "Client") -> None:
        for _ in range(30):
            client.tell(replace(POSE, usec=0))
            bench.run_ms(33)
        assert corrected_ms(bench)[-1] == (bench.now_us - 33_000) // 1000 - 500

    def test_dropped_odometry_does_not_step_the_corrector(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(ODOM, frame_id=1))
        bench.run_ms(100)
        client.tell(POSE)
        assert corrected_ms(bench) == [5100]

    @by_name(STAMPED)
    def test_corrector_is_stepped_while_disabled(self, make_bench: "MakeBench", message: Message) -> None:
        bench = make_bench()
        bench.vehicle.params.set("VISO_TYPE", 0)
        assert bench.client.tell(message) is DISABLED
        bench.vehicle.params.set("VISO_TYPE", 1)
        bench.run_ms(100)
        bench.client.tell(message)
        assert set(corrected_ms(bench)) == {5000}

    def test_delta_does_not_step_the_corrector(self, bench: "Bench", client: "Client") -> None:
        client.tell(DELTA)
        bench.run_ms(100)
        client.tell(POSE)
        assert corrected_ms(bench) == [5000, 5100]


class TestRefused:
    """VISO_TYPE."""

    @by_name(EVERY)
    def test_disabled_library_takes_nothing(self, make_bench: "MakeBench", message: Message) -> None:
        bench = make_bench(VISO_TYPE=0)
        assert bench.client.tell(message) is DISABLED
        assert (bench.ahrs.calls, bench.records) == ([], [])

    @by_name(EVERY)
    def test_type_that_names_no_backend_takes_nothing(self, make_bench: "MakeBench", message: Message) -> None:
        bench = make_bench(VISO_TYPE=4)
        assert bench.client.tell(message) is NO_BACKEND
        assert (bench.ahrs.calls, bench.records) == ([], [])

    @by_name(EVERY)
    def test_type_set_after_boot_takes_nothing(self, make_bench: "MakeBench", message: Message) -> None:
        bench = make_bench(VISO_TYPE=0)
        bench.vehicle.params.set("VISO_TYPE", 1)
        assert bench.client.tell(message) is NO_BACKEND
        assert not bench.vehicle.visual_odom.healthy()

    @by_name(EVERY)
    def test_any_message_refreshes_health(self, bench: "Bench", client: "Client", message: Message) -> None:
        assert not bench.vehicle.visual_odom.healthy()
        client.tell(message)
        assert bench.vehicle.visual_odom.healthy()

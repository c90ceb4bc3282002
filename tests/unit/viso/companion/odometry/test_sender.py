# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When what goes out on the wire, and where what comes in goes."""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_LONG, HEARTBEAT, ODOMETRY, RAW_IMU, STATUSTEXT, TIMESYNC, Message
from tests.unit.viso.companion.vio.strategy_rig import make_result
from viso.companion.odometry.clock_sync import ClockSync
from viso.companion.odometry.inbound import FcInbound, stream_requests
from viso.companion.odometry.sender import OdometrySender
from viso.companion.odometry.source import OdometrySource
from viso.companion.vio.config import AglSource, OdometryConfig, VioConfig
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.types import ImuSample, VioState
from viso.geometry.pose import SE3
from viso.geometry.rotation import so3_exp

AtRest = Callable[[int], ImuSample]

MS = 1_000_000


def message_at(now_us: int, quality: int = 80) -> ODOMETRY:
    return ODOMETRY(now_us, 20, 12, 0, 0, 0, (1, 0, 0, 0), 0, 0, 0, 0, 0, 0, (0,) * 21, (0,) * 21, 0, 3, quality)


class Rig:
    """A sender, and the autopilot's end of its wire."""

    def __init__(self, odometry: Callable[[int], ODOMETRY | None] = message_at, **options: Any) -> None:
        self.far, near = make_pair()
        self.clock = ClockSync()
        self.samples: list[ImuSample] = []
        self.inbound = FcInbound(self.clock, self.samples.append)
        config = OdometryConfig(**{name: options.pop(name) for name in ("rate_hz", "system_id") if name in options})
        self.sender = OdometrySender(near, odometry, self.clock, self.inbound, config, **options)
        self._codec = Codec(1, 1)
        self.frames: list[tuple[int, Received]] = []

    def run(self, end_ms: int, start_ms: int = 0, step_ms: int = 5) -> None:
        """Run the sender at every step up to an end, and keep what it sends with its time."""
        for now_ms in range(start_ms, end_ms + 1, step_ms):
            self.sender.run(now_ms * 1000)
            self.collect(now_ms)

    def collect(self, now_ms: int) -> None:
        self._codec.feed(self.far.receive())
        while (received := self._codec.next_received()) is not None:
            assert isinstance(received, Received)
            self.frames.append((now_ms, received))

    def say(self, message: Message, component_id: int = 1) -> None:
        self.far.send(Codec(1, component_id).encode(message))

    def times_ms(self, kind: type[Message]) -> list[int]:
        return [now_ms for now_ms, frame in self.frames if isinstance(frame.message, kind)]

    def messages(self, kind: type[Message]) -> list[Message]:
        return [frame.message for _, frame in self.frames if isinstance(frame.message, kind)]


def test_heartbeat_comes_every_second() -> None:
    rig = Rig()
    rig.run(2500)
    assert rig.times_ms(HEARTBEAT) == [0, 1000, 2000]


def test_component_is_that_of_visual_inertial_odometry() -> None:
    rig = Rig(system_id=3)
    rig.run(0)
    assert {(frame.header.system_id, frame.header.component_id) for _, frame in rig.frames} == {(3, 197)}


def test_odometry_comes_at_its_rate() -> None:
    rig = Rig(rate_hz=10.0)
    rig.run(450)
    assert rig.times_ms(ODOMETRY) == [0, 100, 200, 300, 400]


def test_default_rate_is_20_hz() -> None:
    rig = Rig()
    rig.run(1000)
    assert len(rig.times_ms(ODOMETRY)) == 21


@pytest.mark.parametrize("rate_hz", [3.9, 0.0, -1.0, math.nan])
def test_rate_below_4_hz_is_an_error(rate_hz: float) -> None:
    with pytest.raises(ValueError, match="rate_hz"):
        Rig(rate_hz=rate_hz)


def test_slowest_rate_keeps_the_sensor_healthy() -> None:
    rig = Rig(rate_hz=4.0)
    rig.run(2000)
    assert max(np.diff(rig.times_ms(ODOMETRY))) < 300


def test_lost_pose_comes_at_4_hz() -> None:
    rig = Rig(lambda now_us: message_at(now_us, quality=-1))
    rig.run(1000)
    assert rig.times_ms(ODOMETRY) == [0, 250, 500, 750, 1000]


def test_nothing_is_sent_while_there_is_nothing_to_say() -> None:
    rig = Rig(lambda now_us: message_at(now_us) if now_us >= 330_000 else None)
    rig.run(400)
    assert rig.times_ms(ODOMETRY) == [350, 400]


def test_what_a_late_call_has_missed_is_not_made_up_for() -> None:
    rig = Rig()
    rig.run(0)
    rig.run(3100, start_ms=3030)
    assert rig.times_ms(ODOMETRY) == [0, 3030, 3050, 3100]
    assert rig.times_ms(HEARTBEAT) == [0, 3030]


def test_nothing_is_sent_before_the_companion_is_up() -> None:
    rig = Rig(start_us=500_000)
    rig.run(499)
    assert rig.frames == []
    assert rig.sender.next_due_us() == 500_000


def test_next_due_is_the_earliest_of_all() -> None:
    rig = Rig(rate_hz=4.0)
    due = []
    for _ in range(5):
        due.append(rig.sender.next_due_us())
        rig.sender.run(due[-1])
    assert due == [0, 200_000, 250_000, 400_000, 500_000]


def test_clock_is_asked_for_and_the_answer_taken() -> None:
    rig = Rig()
    rig.run(1000)
    assert rig.times_ms(TIMESYNC) == [0, 200, 400, 600, 800, 1000]
    rig.say(TIMESYNC(999, 1000 * MS))
    rig.run(1005, start_ms=1005)
    assert rig.clock.offset_ns == 1000 * MS + 5 * MS // 2 - 999


def test_autopilots_clock_request_is_answered() -> None:
    rig = Rig()
    rig.say(TIMESYNC(0, 4242))
    rig.run(5, start_ms=5)
    assert TIMESYNC(5 * MS, 4242) in rig.messages(TIMESYNC)


def test_inertial_messages_go_to_the_inbound_side() -> None:
    rig = Rig()
    rig.say(RAW_IMU(1, 0, 0, -1000, 0, 0, 0, 0, 0, 0))
    rig.run(5, start_ms=5)
    assert [sample.accel[2] for sample in rig.samples] == pytest.approx([GRAVITY_MSS])


def test_texts_are_kept() -> None:
    rig = Rig()
    rig.say(STATUSTEXT(6, "EKF3 IMU0 is using external nav data"))
    rig.run(0)
    assert [text.text for text in rig.sender.texts] == ["EKF3 IMU0 is using external nav data"]


def test_messages_of_others_are_counted_and_left_alone() -> None:
    rig = Rig()
    rig.say(RAW_IMU(1, 0, 0, -1000, 0, 0, 0, 0, 0, 0), component_id=100)
    rig.run(0)
    assert rig.samples == []
    assert rig.sender.counters["received_from_others"] == 1


def test_message_that_is_none_of_ours_is_passed_over() -> None:
    rig = Rig()
    peer = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    rig.far.send(bytes(dialect.MAVLink_wind_message(1.0, 2.0, 3.0).pack(peer)))
    rig.say(STATUSTEXT(6, "here"))
    rig.run(0)
    assert len(rig.sender.texts) == 1


def test_noise_on_the_wire_is_counted_and_passed_over() -> None:
    rig = Rig()
    rig.far.send(b"\x00noise")
    rig.say(STATUSTEXT(6, "here"))
    rig.run(0)
    assert rig.sender.counters["received_bad_data"] > 0
    assert len(rig.sender.texts) == 1


def test_streams_are_asked_for_until_inertial_data_come() -> None:
    rig = Rig(stream_requests=stream_requests({"RAW_IMU": 100}))
    rig.run(1500)
    for ms in range(1505, 3000, 5):
        rig.say(RAW_IMU(ms * 1000, 0, 0, -1000, 0, 0, 0, 0, 0, 0))
        rig.run(ms, start_ms=ms)
    assert rig.times_ms(COMMAND_LONG) == [0, 1000]


def test_closed_wire_does_not_stop_the_sender() -> None:
    rig = Rig()
    rig.far.close()
    rig.sender.run(0)
    assert rig.sender.counters["ODOMETRY"] == 1


class Flight:
    """The whole chain on a level circle: 3 Hz camera with 150 ms of latency, 200 Hz IMU, 20 Hz odometry."""

    SPEED_M_S = 4.0
    RATE_RAD_S = 0.5
    FRAME_MS = 333
    LATENCY_MS = 150

    def __init__(self, strategy: Any, **options: Any) -> None:
        self.strategy = strategy
        self.source = OdometrySource(VioConfig(agl_source=AglSource.RANGEFINDER), world_is_north=True, **options)
        self.rig = Rig(self.source.message)
        self.strategy.restart(self.truth(0))

    def truth(self, t_ms: float) -> SE3:
        angle, radius = self.RATE_RAD_S * t_ms * 1e-3, self.SPEED_M_S / self.RATE_RAD_S
        position = [radius * math.sin(angle), radius * (1 - math.cos(angle)), 0.0]
        return SE3(so3_exp(np.array([0.0, 0.0, angle])), np.array(position))

    def fly(self, end_ms: int, state_at: Callable[[int], VioState] = lambda _t_ms: VioState.TRACKING) -> None:
        accel = np.array([0.0, self.SPEED_M_S * self.RATE_RAD_S, GRAVITY_MSS])
        gyro = np.array([0.0, 0.0, self.RATE_RAD_S])
        for now_ms in range(0, end_ms + 1, 5):
            self.source.take_imu(ImuSample(now_ms * MS, accel, gyro))
            frame_ms = now_ms - self.LATENCY_MS
            if frame_ms >= 0 and frame_ms % self.FRAME_MS < 5:
                self._frame(frame_ms - frame_ms % self.FRAME_MS, state_at(frame_ms))
            self.rig.run(now_ms, start_ms=now_ms)

    def _frame(self, t_ms: int, state: VioState) -> None:
        step = self.strategy.world_T_body.inverse() @ self.truth(t_ms)
        output = self.strategy.move(step, velocity_b=(self.SPEED_M_S, 0.0, 0.0))
        self.source.take_result(make_result(state, output, frame_id=output.frame_id, t_ns=t_ms * MS))

    def odometry(self) -> list[tuple[int, ODOMETRY]]:
        return [(t, f.message) for t, f in self.rig.frames if isinstance(f.message, ODOMETRY)]


@pytest.fixture
def flight(strategy: Any) -> Flight:
    return Flight(strategy)


def test_rate_is_kept_while_the_camera_gives_3_hz(flight: Flight) -> None:
    flight.fly(5000)
    times_ms = [now_ms for now_ms, _ in flight.odometry()]
    assert len(times_ms) > 4 * (times_ms[-1] - times_ms[0]) / 1000
    assert max(later - earlier for earlier, later in itertools.pairwise(times_ms)) <= 300


def test_messages_say_where_the_body_is_at_their_stamp(flight: Flight) -> None:
    flight.fly(4000)
    messages = [message for _, message in flight.odometry()]
    assert len(messages) > 70
    for message in messages:
        expected = flight.truth(message.time_usec * 1e-3).t
        assert (message.y, message.x, -message.z) == pytest.approx(expected.tolist(), abs=2e-3)


def test_stamps_go_forward_and_stay_fresh(flight: Flight) -> None:
    flight.fly(3000)
    stamps = [(now_ms, message.time_usec) for now_ms, message in flight.odometry()]
    assert all(later[1] > earlier[1] for earlier, later in itertools.pairwise(stamps))
    assert all(now_ms * 1000 - stamp_us <= 5000 for now_ms, stamp_us in stamps)


def test_steady_flight_never_resets(flight: Flight) -> None:
    flight.fly(5000)
    assert {message.reset_counter for _, message in flight.odometry()} == {0}


def test_covered_camera_ends_in_4_hz_and_then_silence(flight: Flight) -> None:
    flight.fly(8000, lambda t_ms: VioState.TRACKING if t_ms < 2000 else VioState.LOST)
    lost_ms = [now_ms for now_ms, message in flight.odometry() if message.quality == -1]
    assert set(np.diff(lost_ms)) == {250}
    assert lost_ms[-1] - lost_ms[0] == 3000
    assert [message.quality for _, message in flight.odometry()][-1] == -1
    assert flight.odometry()[-1][0] < 6000


def test_pymavlink_reads_the_whole_stream(flight: Flight) -> None:
    raw: list[Any] = []
    reader = dialect.MAVLink(None)

    class Tap(PairLink):
        def send(self, data: bytes) -> None:
            raw.extend(reader.parse_buffer(data) or [])

    flight.rig.sender._link = Tap("tap")
    flight.fly(2000)
    kinds = [message.get_type() for message in raw]
    assert "BAD_DATA" not in kinds
    assert kinds.count("ODOMETRY") >= 4 * 1.8
    assert all((m.frame_id, m.child_frame_id) == (20, 12) for m in raw if m.get_type() == "ODOMETRY")

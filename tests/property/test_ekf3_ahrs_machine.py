# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever comes over MAVLink, a vehicle with the filter goes on, and tells nothing that is not a number.

A machine mixes streams that make sense with messages that do not, commands and parameters. Nothing raises, no
arithmetic warns, telemetry has no NaN, and pymavlink reads the logs to their last byte. Two vehicles to which the same
happens send and log the same bytes, in whatever process.

Tried with 10 examples of 12 steps each, always the same ones, and 3 with two vehicles. All of it takes long.
"""

import hashlib
import math
import os
import random
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, ClassVar, Final

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as dialect

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from mav_handlers.wire.codec import Codec, message_id
from mav_handlers.wire.messages import (
    COMMAND_LONG,
    GPS_INPUT,
    ODOMETRY,
    PARAM_SET,
    SET_GPS_GLOBAL_ORIGIN,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from tests.places import ROOT
from viso.logs.logger import MemoryLog
from viso.vehicle.config import bench, by_ekf3
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.script.script_file import parse_script
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig

pytestmark = pytest.mark.slow

WRAP_US = (1 << 32) * 1000
DAY_US = 86_400_000_000
PERIOD_US = 35_000
TELEMETRY: Final = ("ATTITUDE", "LOCAL_POSITION_NED", "EKF_STATUS_REPORT")
ESTIMATES: Final = ("MSG", "EV", "XKF1", "XKF2", "XKF3", "XKF4", "XKFD", "XKFS", "XKQ", "XKV1", "XKV2", "ATT")
ARM_DISARM, TAKEOFF, SOURCE_SET = 400, 22, 42007
BY_FORCE = 21196.0
DEFAULTS: Final = {
    **{f"EK3_SRC1_{row}": 6.0 for row in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")},
    "VISO_TYPE": 1.0,
    "GPS1_TYPE": 14.0,
    "LOG_DISARMED": 1.0,
    "LOG_REPLAY": 1.0,
    "MAV1_EXTRA1": 10.0,
    "MAV1_EXTRA3": 5.0,
    "MAV1_POSITION": 10.0,
    "MAV1_EXT_STAT": 2.0,
}
FLIGHT: Final = """
start = "armed"
[[leg]]
shape = "point"
to_ned_m = [0, 0, -3]
duration_s = 4
[[leg]]
shape = "figure_eight"
length_m = 8
width_m = 4
period_s = 6
laps = 4
nose = "path"
"""
MAKERS: Final = {
    "bench": bench(),
    "follow": by_ekf3(FollowSource, ImuOptions()),
    "script": by_ekf3(lambda options: ScriptSource(options, parse_script(FLIGHT, "flight")), ImuOptions()),
}


class Trip:
    """A vehicle, a client that reads all it sends, and a camera that sees it move as it should.

    Args:
        kind: where inertial data come from, of ``makers``.
        start_us: when it boots.
        defaults: parameters beside ``DEFAULTS``.

    Attributes:
        told: the messages that it has sent.
        texts: its texts, with the time in us since the start.
        is_seen: whether the camera sees anything.
    """

    makers: ClassVar = MAKERS

    def __init__(self, kind: str, start_us: int = 0, **defaults: float) -> None:
        self.log = MemoryLog()
        config = VehicleConfig(
            self.makers[kind], defaults={**DEFAULTS, **defaults}, open_log=lambda: self.log, vicon=kind == "fly"
        )
        self.vehicle = Vehicle(config)
        self.channel = self.vehicle.endpoint.open_channel("link")
        self._codec = Codec(255, 190)
        self._parser = dialect.MAVLink(None)
        self.start_us = self.now_us = start_us
        self.told: list[Any] = []
        self.texts: list[tuple[int, str]] = []
        self.sent = hashlib.sha256()
        self.is_seen, self._moves = True, kind == "follow"
        self._next_us = start_us

    def run(self, seconds: float) -> None:
        """Let time pass, with what the camera sees, and look at what is told."""
        end_us = self.now_us + round(1e6 * seconds)
        while self.now_us < end_us:
            self.now_us += LOOP_PERIOD_US
            self.vehicle.advance(range(self.now_us, self.now_us + 1))
            if self.is_seen and self.now_us >= self._next_us:
                self._next_us = self.now_us + PERIOD_US
                self.send(self.seen())
            self._read()

    def send(self, message: Message) -> None:
        """Send a message to the vehicle."""
        self.vehicle.receive_bytes(self.channel, self._codec.encode(message))

    def command(self, number: int, *params: float) -> None:
        """Send a command."""
        self.send(COMMAND_LONG(1, 1, number, 0, *params, *[0.0] * (7 - len(params))))

    def seen(self) -> ODOMETRY:
        """Return what the camera sees: what the script says, else rest, or rising eights from the eighth second on."""
        stamp_us = max(0, self.now_us - 10_000)
        source = self.vehicle.ahrs.source
        if isinstance(source, ScriptSource):
            truth = source.truth(stamp_us)
            quat, (x, y, z) = truth.quat_wxyz, truth.pos_ned
            vx, vy, vz = map(float, Quaternion(*quat).inverse().rotate_vector(Vector3f(*truth.vel_ned)).to_tuple())
        else:
            phase = 0.4 * max(0.0, 1e-6 * (stamp_us - self.start_us) - 8.0) if self._moves else 0.0
            quat, (x, y, z) = (1.0, 0.0, 0.0, 0.0), (2.0 - 2.0 * math.cos(phase), math.sin(2.0 * phase), -0.2 * phase)
            vx, vy, vz = (0.8 * math.sin(phase), 0.8 * math.cos(2.0 * phase), -0.08) if phase else (0.0, 0.0, 0.0)
        variances = (0.01,) * 21
        return ODOMETRY(stamp_us, 20, 12, x, y, z, quat, vx, vy, vz, 0.0, 0.0, 0.0, variances, variances, 0, 3, 90)

    def _read(self) -> None:
        data = self.channel.take_output()
        if not data:
            return
        self.sent.update(data)
        for message in self._parser.parse_buffer(bytearray(data)) or []:
            self.told.append(message)
            if message.get_type() == "STATUSTEXT":
                self.texts.append((self.now_us - self.start_us, message.text))

    def numbers_told(self, name: str) -> Iterator[float]:
        """Yield all numbers of messages of a type."""
        for message in self.told:
            if message.get_type() == name:
                yield from (float(value) for key, value in message.to_dict().items() if key != "mavpackettype")

    def check_telemetry(self) -> None:
        """Check that nothing told is not a number; ratios may be beyond single precision, as in the firmware."""
        assert all(map(math.isfinite, (*self.numbers_told("ATTITUDE"), *self.numbers_told("LOCAL_POSITION_NED"))))
        assert not any(map(math.isnan, self.numbers_told("EKF_STATUS_REPORT")))

    def end(self) -> list[Any]:
        """End the trip; return the records that pymavlink reads in the log, which are all."""
        self.vehicle.close()
        records: list[Any] = []
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "log.BIN")
            path.write_bytes(self.log.data)
            with DFReader_binary(str(path)) as reader:
                while (record := reader.recv_msg()) is not None:
                    records.append(record)
        assert sum(record.fmt.len for record in records) == len(self.log.data)
        return records

    def fingerprint(self) -> str:
        """Return what stands for all that was sent and logged."""
        return self.sent.hexdigest() + hashlib.sha256(self.log.data).hexdigest()


# Messages that make no sense

ODD = [0.0, -0.0, 1.0, -1.0, 1e-30, 1e6, -1e6, 1e30, 3e36, -3e36, math.nan, math.inf, -math.inf]
VISION = (ODOMETRY, VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE, VISION_POSITION_DELTA)
PARAMETERS = (
    *("EK3_POS_I_GATE", "EK3_VEL_I_GATE", "EK3_GLITCH_RAD", "EK3_YAW_M_NSE", "EK3_ACC_BIAS_LIM", "EK3_TAU_OUTPUT"),
    *("EK3_VIS_VERR_MIN", "EK3_VIS_VERR_MAX", "EK3_SRC1_POSXY", "EK3_SRC1_YAW", "EK3_SRC1_VELXY", "EK3_SRC1_POSZ"),
    *("VISO_POS_X", "VISO_DELAY_MS", "VISO_SCALE", "VISO_ORIENT", "VISO_POS_M_NSE", "INS_POS1_X", "EK3_IMU_MASK"),
)
RANGES = {"int8_t": (-128, 127), "uint8_t": (0, 255), "uint16_t": (0, 65535), "uint32_t": (0, (1 << 32) - 1)}
RANGES |= {f"int{bits}_t": (-(1 << bits - 1), (1 << bits - 1) - 1) for bits in (16, 32)} | {
    "uint64_t": (0, (1 << 64) - 1)
}


def any_message(draw: random.Random, cls: type[Message]) -> Message:
    """Return a message of a type with fields of any value, many of them small."""
    raw = dialect.mavlink_map[message_id(cls.__name__)]
    kinds = dict(zip(raw.fieldnames, raw.fieldtypes, strict=True))
    lengths = dict(zip(raw.ordered_fieldnames, raw.array_lengths, strict=True))

    def one(kind: str) -> float:
        if kind != "float":
            return draw.randint(*RANGES[kind])
        return float(f32(draw.choice(ODD) if draw.random() < 0.2 else draw.uniform(-3, 3)))

    values: dict[str, Any] = {}
    for field in fields(cls):
        kind, length = kinds[field.name], lengths[field.name]
        values[field.name] = tuple(one(kind) for _ in range(length)) if length else one(kind)
    return cls(**values)


def any_vision(draw: random.Random, now_us: int) -> Message:
    """Return a vision message that may get through to the filter, whatever it says."""
    message = any_message(draw, draw.choice(VISION))
    changes: dict[str, Any] = {}
    if isinstance(message, ODOMETRY):
        changes |= {"frame_id": 20, "child_frame_id": 12, "quality": draw.randint(-1, 100)}
    if hasattr(message, "reset_counter"):
        changes["reset_counter"] = draw.choice((0, 0, 0, 1, 2))
    if draw.random() < 0.8:
        stamp = "usec" if hasattr(message, "usec") else "time_usec"
        changes[stamp] = max(0, now_us - draw.randint(0, 100_000))
    if isinstance(message, VISION_POSITION_DELTA) and draw.random() < 0.8:
        changes["time_delta_usec"] = draw.randint(10_000, 200_000)
    return replace(message, **changes)


def mischief(draw: random.Random, trip: Trip) -> None:
    """Do one thing that makes no sense, or a command that does."""
    kind = draw.choice(("vision", "vision", "vision", "vision", "gps", "param", "source", "arm", "origin", "takeoff"))
    if kind == "vision":
        for _ in range(draw.randint(1, 5)):
            trip.send(any_vision(draw, trip.now_us))
    elif kind == "gps":
        trip.send(replace(any_message(draw, GPS_INPUT), gps_id=0, fix_type=draw.randint(0, 6)))
    elif kind == "param":
        value = draw.choice(ODD) if draw.random() < 0.5 else draw.uniform(0, 10)
        trip.send(PARAM_SET(1, 1, draw.choice(PARAMETERS), value, 9))
    elif kind == "source":
        trip.command(SOURCE_SET, float(draw.randint(1, 3)))
    elif kind == "arm":
        trip.command(ARM_DISARM, float(draw.randint(0, 1)), BY_FORCE)
    elif kind == "takeoff":
        trip.command(TAKEOFF, *[0.0] * 6, 5.0)
    else:
        trip.send(any_message(draw, SET_GPS_GLOBAL_ORIGIN))


def tell_sense(trip: Trip, draw: random.Random) -> None:
    """Put right what keeps a vehicle from navigating."""
    for name, value in DEFAULTS.items():
        if name.startswith("EK3"):
            trip.send(PARAM_SET(1, 1, name, value, 9))
    trip.command(SOURCE_SET, 1.0)
    trip.run(draw.uniform(1, 3))


class AhrsMachine(RuleBasedStateMachine):
    """A vehicle, and a twin where there is one."""

    twins = 1

    @initialize(kind=st.sampled_from(sorted(MAKERS)), compass=st.booleans(), booted_s=st.sampled_from([1.0, 6.0, 9.0]))
    def boot(self, kind: str, compass: bool, booted_s: float) -> None:
        """Make the vehicle and let it boot."""
        self.trips = [Trip(kind, COMPASS_USE=float(compass)) for _ in range(self.twins)]
        self.each(lambda trip: trip.run(booted_s))

    def each(self, act: Callable[[Trip], None]) -> None:
        """Do the same to all vehicles."""
        for trip in self.trips:
            act(trip)

    @rule(seconds=st.floats(0.05, 1.5), is_seen=st.booleans())
    def go_on(self, seconds: float, is_seen: bool) -> None:
        """Let time pass, and the camera see or not."""

        def act(trip: Trip) -> None:
            trip.is_seen = is_seen
            trip.run(seconds)

        self.each(act)

    @rule(seed=st.integers(0, 1 << 32), times=st.integers(1, 8), seconds=st.floats(0.0, 0.3))
    def do_mischief(self, seed: int, times: int, seconds: float) -> None:
        """Do things that make no sense."""

        def act(trip: Trip) -> None:
            draw = random.Random(seed)
            for _ in range(times):
                mischief(draw, trip)
                trip.run(seconds)

        self.each(act)

    @rule(seed=st.integers(0, 1 << 32))
    def make_sense(self, seed: int) -> None:
        """Put right what keeps it from navigating."""
        self.each(lambda trip: tell_sense(trip, random.Random(seed)))

    @rule(seconds=st.sampled_from([0.4, 8.0, 20.0]))
    def stall(self, seconds: float) -> None:
        """Let the main loop hang."""

        def act(trip: Trip) -> None:
            trip.now_us += round(1e6 * seconds)
            trip.run(0.1)

        self.each(act)

    @invariant()
    def twins_agree(self) -> None:
        """What happens to two vehicles makes both do the same."""
        assert len({trip.fingerprint() for trip in self.trips}) == 1

    def teardown(self) -> None:
        """Look at all that was told, and read the logs."""
        for trip in getattr(self, "trips", []):
            trip.check_telemetry()
            assert trip.now_us < 4_000_000 or any(record.get_type() == "RFRH" for record in trip.end())


class TwinMachine(AhrsMachine):
    """Two vehicles to which the same happens."""

    twins = 2


def steps(examples: int) -> settings:
    """Return settings under which every run draws the same examples."""
    return settings(
        max_examples=examples,
        stateful_step_count=12,
        deadline=None,
        derandomize=True,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )


def test_whatever_comes_the_vehicle_goes_on() -> None:
    run_state_machine_as_test(AhrsMachine, settings=steps(10))


def test_two_vehicles_do_the_same() -> None:
    run_state_machine_as_test(TwinMachine, settings=steps(3))


# A long trip


def stormy_trip(kind: str, seed: int, minutes: float) -> Trip:
    """Return a vehicle that was out in a storm of messages, which makes sense every twenty seconds."""
    draw, trip = random.Random(seed), Trip(kind)
    trip.run(8)
    while trip.now_us < 60e6 * minutes:
        calm_s = draw.choice((0.02, 0.1, 0.5))
        mischief(draw, trip)
        trip.run(calm_s)
        if trip.now_us % 20_000_000 < 500_000:
            tell_sense(trip, draw)
    trip.vehicle.close()
    return trip


@pytest.mark.parametrize("kind", MAKERS)
def test_storm_of_messages_does_no_harm(kind: str) -> None:
    trip = stormy_trip(kind, 7, 1.5)
    trip.check_telemetry()
    assert all(any(message.get_type() == name for message in trip.told) for name in TELEMETRY)
    records = Counter(record.get_type() for record in trip.end())
    assert min(records[name] for name in ("REPH", "REVH", "RBOH", "RISI", "XKF1", "XKF4", "XKFD")) > 0
    started = [text for _, text in trip.texts if text == "EKF3 IMU0 is using external nav data"]
    assert len(started) > 1
    counts = trip.vehicle.ahrs.ext_nav_counts
    assert {code for _, code in counts} > {"taken", "nan", "model_fused", "model_not_finite", "model_gate_position"}


PROGRAM = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
from tests.property.test_ekf3_ahrs_machine import stormy_trip
print(stormy_trip("follow", 3, 0.25).fingerprint())
"""


def test_same_input_gives_the_same_bytes_in_any_process() -> None:
    prints = set()
    for hash_seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
        command = [sys.executable, "-c", PROGRAM]
        prints.add(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
    assert len(prints) == 1


# The wrap


def estimates_of_flight(start_us: int) -> list[tuple[Any, ...]]:
    """Return what a vehicle logs of its filter, that has seen, not seen and seen again, after 6, 22 and 24 s."""
    trip = Trip("script", start_us)
    trip.run(4)
    trip.command(ARM_DISARM, 1.0, BY_FORCE)
    for is_seen, seconds in ((True, 2), (False, 16), (True, 2)):
        trip.is_seen = is_seen
        trip.run(seconds)
    assert "EKF3 IMU0 stopped aiding" in [text for _, text in trip.texts]
    said = []
    for record in trip.end():
        values = record.to_dict()
        if record.get_type() in ESTIMATES:
            said.append((record.get_type(), values.pop("TimeUS") - start_us, *values.values()))
    return said


def test_flight_does_not_notice_the_wrap_of_milliseconds() -> None:
    usual, wrapped = map(estimates_of_flight, (20 * DAY_US, (WRAP_US - 9_000_000) // 100_000 * 100_000))
    assert len(usual) > 2000
    assert usual == wrapped

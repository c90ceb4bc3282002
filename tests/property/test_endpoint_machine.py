# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Anything at all may come over the links: the endpoint, the port and the vehicle behind them stand it.

A state machine draws messages with any field values, in MAVLink 1 and 2, from any sender, whole and damaged, on
three links of which one never reads its output, among passing time up to and beyond the wrap of the 32-bit
millisecond clock. What must hold all the while:

- nothing raises, and no arithmetic warns;
- every byte is counted once, and every frame meets exactly one verdict;
- an accepted or ignored sample makes one VISP, VISV or VISO record (ODOMETRY the first two), a dropped one none,
  and ``Ign`` says what the verdict says;
- the AHRS is handed what was accepted and nothing else, and never a sample below VISO_QUAL_MIN;
- errors handed to it lie within their limits, by the rules of the clamp;
- the camera is healthy if and only if a sample came within 300 ms, or the clock is that young (or wraps);
- queues stay within their limits;
- output is whole frames to an independent parser: those of others as they came, the own ones numbered without gaps;
- logs can be read to their last byte by pymavlink, with as many records of each type as were written.

Tried with 4 examples of 40 steps each, always the same ones; the slow test takes 60.
"""

import math
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.dialects.v20 import development

from ap_core.cint import u8, u32
from ap_core.fmath import f32
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.verdict import VerdictKind
from ap_visualodom.verdicts import DISABLED, NO_BACKEND
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.ahrs.ahrs_settable import ExtNav, SettableAhrs
from ekf_stub.ahrs.vehicle_state import compass_in_use
from mav_handlers.channel import OUTPUT_LIMIT_BYTES, Channel
from mav_handlers.endpoint import MessageEvent
from mav_handlers.handlers import VISION_MESSAGES
from mav_handlers.handlers.commands import COMMANDS
from mav_handlers.params.reads import READ_QUEUE_LENGTH
from mav_handlers.senders import SENDERS
from mav_handlers.statustext import QUEUE_CAPACITY
from mav_handlers.verdicts import NOT_ACCEPTED, ODOMETRY_FRAMES, OWN_MESSAGE
from mav_handlers.wire.codec import Codec, message_id
from mav_handlers.wire.messages import (
    COMMAND_INT,
    COMMAND_LONG,
    MESSAGES,
    ODOMETRY,
    PARAM_REQUEST_LIST,
    PARAM_REQUEST_READ,
    PARAM_SET,
    SET_GPS_GLOBAL_ORIGIN,
    TIMESYNC,
    VISION_POSITION_DELTA,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.logs.logger import MemoryLog
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.standing import BenchSource
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig

WRAP_US = (1 << 32) * 1000
LONGEST_BURST_BYTES = 7 * 280
RECORDS_OF = {ODOMETRY: ["VISP", "VISV"], VISION_SPEED_ESTIMATE: ["VISV"], VISION_POSITION_DELTA: ["VISO"]}
CALLS_OF = {
    ODOMETRY: ["ExtNav", "ExtNavVel"],
    VISION_SPEED_ESTIMATE: ["ExtNavVel"],
    VISION_POSITION_DELTA: ["BodyFrameOdom"],
}
PARAMETERS = (
    *(f"VISO_{name}" for name in ("TYPE", "ORIENT", "SCALE", "DELAY_MS", "VEL_M_NSE", "POS_M_NSE", "YAW_M_NSE")),
    *("VISO_POS_X", "VISO_POS_Y", "viso_qual_min", "VISO_QUAL_MIN", "VISO_POS"),
    *("MAV_SYSID", "MAV_GCS_SYSID", "MAV_OPTIONS", "MAV_TELEM_DELAY", "MAV1_OPTIONS", "MAV2_OPTIONS"),
    *("LOG_DISARMED", "LOG_REPLAY", "ARMING_CHECK", "ARMING_OPTIONS", "BRD_RTC_TYPES", "EK3_SRC1_YAW", "COMPASS_USE"),
)

FLOATS = st.floats(width=32) | st.sampled_from([0.0, 1.0, -1.0, 2.0, 1e-8, math.nan, math.inf, -math.inf, 3e38])
INTEGERS = {
    "int8_t": st.integers(-(1 << 7), (1 << 7) - 1),
    "uint8_t": st.integers(0, (1 << 8) - 1),
    "int16_t": st.integers(-(1 << 15), (1 << 15) - 1),
    "uint16_t": st.integers(0, (1 << 16) - 1),
    "int32_t": st.integers(-(1 << 31), (1 << 31) - 1),
    "uint32_t": st.integers(0, (1 << 32) - 1),
    "int64_t": st.integers(-(1 << 63), (1 << 63) - 1),
    "uint64_t": st.integers(0, (1 << 64) - 1),
}
EXTREMES = st.sampled_from([-(1 << 31), (1 << 31) - 1, 0, 1])
SMALL = st.integers(0, 3)
LINKS = st.integers(0, 2)
NAMES = st.sampled_from(PARAMETERS) | st.text(max_size=16)
SENDERS_IDS = st.tuples(st.sampled_from([255, 1, 7, 0]), st.sampled_from([190, 1, 197]))


DEFINITIONS = {**development.mavlink_map, **dialect.mavlink_map}


def of_type(kind: str, length: int) -> st.SearchStrategy[Any]:
    """Return the values of a field of the dialect."""
    if kind == "char":
        return NAMES.map(lambda text: text[:length])
    one = FLOATS if kind == "float" else INTEGERS[kind]
    return st.tuples(*[one] * length) if length else one


def of_class(cls: type[Message]) -> st.SearchStrategy[Message]:
    """Return all messages of a type."""
    raw = DEFINITIONS[message_id(cls.__name__)]
    kinds = dict(zip(raw.fieldnames, raw.fieldtypes, strict=True))
    lengths = dict(zip(raw.ordered_fieldnames, raw.array_lengths, strict=True))
    names = [field.name for field in fields(cls)]
    values = {name: of_type(kinds[name], lengths[name]) for name in names}
    if cls is ODOMETRY:
        values["frame_id"] = st.just(20) | st.sampled_from([1, 12])
        values["child_frame_id"] = st.just(12) | st.sampled_from([8, 20])
    if "reset_counter" in values:
        values["reset_counter"] = SMALL | values["reset_counter"]
    return st.builds(cls, **values)


VISION = st.sampled_from(sorted(VISION_MESSAGES, key=str)).flatmap(of_class)
ODOMETRIES = of_class(ODOMETRY).map(lambda message: replace(message, frame_id=20, child_frame_id=12))
ANYTHING = st.sampled_from(sorted(MESSAGES.values(), key=str)).flatmap(of_class)
COMMAND_NUMBERS = st.sampled_from(sorted(COMMANDS)) | st.integers(0, 65535)
MESSAGE_IDS = st.sampled_from([float(message_id(name)) for name in SENDERS])


class SpyAhrs(Ekf3Ahrs):
    """The AHRS of a parked vehicle, which remembers what it is given as well."""

    def __init__(self, vehicle: Vehicle) -> None:
        params = vehicle.params
        sensors = BenchSource(ImuOptions(has_compass=compass_in_use(params)))
        super().__init__(
            sensors, vehicle.clock, vehicle.sources, vehicle.replay_log, vehicle.logger, params, vehicle.texts
        )
        self.spy = SettableAhrs()

    def writeExtNavData(self, *args: Any) -> None:
        """Remember the call and log it."""
        self.spy.writeExtNavData(*args)
        super().writeExtNavData(*args)

    def writeExtNavVelData(self, *args: Any) -> None:
        """Remember the call and log it."""
        self.spy.writeExtNavVelData(*args)
        super().writeExtNavVelData(*args)

    def writeBodyFrameOdom(self, *args: Any) -> None:
        """Remember the call and log it."""
        self.spy.writeBodyFrameOdom(*args)
        super().writeBodyFrameOdom(*args)


class OutputReader:
    """Reads what a link sends with pymavlink's parser; sequence numbers must be gapless.

    Args:
        channel: the link.
        received: all frames that any link has received, some of which are passed on as they are.
    """

    def __init__(self, channel: Channel, received: set[bytes]) -> None:
        self._channel = channel
        self._received = received
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True
        self._next_sequence = 0

    def read(self) -> None:
        """Take and check what waits."""
        data = self._channel.take_output()
        assert len(data) < OUTPUT_LIMIT_BYTES + LONGEST_BURST_BYTES
        for raw in self._parser.parse_buffer(bytearray(data)) or []:
            assert raw.get_type() != "BAD_DATA", raw
            if bytes(raw.get_msgbuf()) in self._received:
                continue
            assert raw.get_seq() == self._next_sequence
            self._next_sequence = (self._next_sequence + 1) % 256
        assert self._parser.buf_len() == 0


class EndpointMachine(RuleBasedStateMachine):
    """A vehicle with three links (the last is never read), its time, and a model of what it must have done."""

    @initialize(
        viso_type=st.sampled_from([1, 1, 1, 2, 3, 0, 4]),
        qual_min=st.sampled_from([0, 0, 50, -1]),
        bauds=st.tuples(*[st.sampled_from([None, 9600, 115200])] * 3),
        version=st.sampled_from([2, 2, 1]),
        yaw_source=st.sampled_from([1, 6]),
    )
    def boot(self, viso_type: int, qual_min: int, bauds: tuple[int | None, ...], version: int, yaw_source: int) -> None:
        """Make the vehicle and let it boot."""
        self.logs: list[MemoryLog] = []
        self.written: dict[int, Counter[str]] = defaultdict(Counter)
        self.new_records: list[tuple[str, dict[str, LogValue]]] = []
        self.seen: list[Counter[tuple[str, VerdictKind, str]]] = [Counter() for _ in bauds]
        self.frame_bytes = [0] * len(bauds)
        self.delivered = [0] * len(bauds)
        self.last_sample_ms = 0
        self.now_us = 0
        self.calls_seen = 0
        self.has_backend = viso_type in (1, 2, 3)
        self.vehicle = self._make_vehicle(
            {
                "VISO_TYPE": viso_type,
                "VISO_QUAL_MIN": qual_min,
                "EK3_SRC1_YAW": yaw_source,
                "MAV1_EXTRA1": 10,
                "MAV3_EXTRA1": 50,
            }
        )
        self.channels = [
            self.vehicle.endpoint.open_channel(f"link{index}", baud=baud, version=version if index else 2)
            for index, baud in enumerate(bauds)
        ]
        self.received: set[bytes] = set()
        self.readers = [OutputReader(channel, self.received) for channel in self.channels]
        self.vehicle.endpoint.on_event = self.hear
        self.vehicle.logger.on_write = self.note_record
        for time_us in (0, 2_500_000, 3_600_000, 5_000_000):
            self.pass_time(time_us)

    def _make_vehicle(self, defaults: dict[str, float]) -> Vehicle:
        spies: list[SpyAhrs] = []

        def make_ahrs(vehicle: Vehicle) -> SpyAhrs:
            spies.append(SpyAhrs(vehicle))
            return spies[-1]

        def open_log() -> MemoryLog:
            self.logs.append(MemoryLog())
            return self.logs[-1]

        vehicle = Vehicle(VehicleConfig(make_ahrs, links=3, defaults=defaults, open_log=open_log))
        self.calls = spies[0].spy.calls
        return vehicle

    # What the vehicle says of itself

    def note_record(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Hear of a record as it is written."""
        if self.vehicle.logger.is_open:
            self.written[len(self.logs)][structure.name] += 1
        if structure.name in ("VISP", "VISV", "VISO"):
            self.new_records.append((structure.name, dict(zip(structure.fields, values, strict=True))))

    def hear(self, event: MessageEvent) -> None:
        """Hear of a message as soon as it has been dealt with, and judge what it did."""
        records, self.new_records = self.new_records, []
        calls, self.calls_seen = self.calls[self.calls_seen :], len(self.calls)
        if event.header is not None:
            verdict = event.verdict
            self.seen[event.channel][event.name, verdict.kind, verdict.rule.code] += 1
            self.frame_bytes[event.channel] += len(event.header.frame)
            self.received.add(event.header.frame)
        if type(event.message) in VISION_MESSAGES:
            self.judge_sample(event, records, calls)
        else:
            assert (records, calls) == ([], [])

    def judge_sample(self, event: MessageEvent, records: list[tuple[str, dict[str, LogValue]]], calls: Any) -> None:
        """Check records, calls and verdict of a vision message against each other and the parameters."""
        message, outcome = event.message, event.verdict.kind
        assert message is not None
        handled = outcome in (VerdictKind.ACCEPTED, VerdictKind.IGNORED)
        assert [name for name, _ in records] == (RECORDS_OF.get(type(message), ["VISP"]) if handled else [])
        consumed = CALLS_OF.get(type(message), ["ExtNav"]) if outcome is VerdictKind.ACCEPTED else []
        assert [type(call).__name__ for call in calls] == consumed
        assert all(fields.get("Ign", 0) == (outcome is VerdictKind.IGNORED) for _, fields in records)
        if handled:
            self.last_sample_ms = event.now_us // 1000
        else:
            self.judge_refusal(event)
        if outcome is VerdictKind.ACCEPTED and not isinstance(message, VISION_POSITION_DELTA):
            assert getattr(message, "quality", 0) >= self.params.get_int("VISO_QUAL_MIN")
        for call in calls:
            if isinstance(call, ExtNav):
                self.judge_error(call.posErr, self.params.get_float("VISO_POS_M_NSE"), f32(100))
                self.judge_error(call.angErr, self.params.get_float("VISO_YAW_M_NSE"), f32(1.5))

    def judge_refusal(self, event: MessageEvent) -> None:
        """Check that a sample was refused for a reason that holds."""
        verdict, header = event.verdict, event.header
        assert header is not None
        if isinstance(event.message, ODOMETRY) and verdict is ODOMETRY_FRAMES:
            assert (event.message.frame_id, event.message.child_frame_id) != (20, 12)
        elif verdict is OWN_MESSAGE:
            assert (header.system_id, header.component_id) == (self.system_id, 1)
        elif verdict is NOT_ACCEPTED:
            assert self.params.get_int("MAV_OPTIONS") & 1
        else:
            assert verdict is (NO_BACKEND if self.params.get_int("VISO_TYPE") else DISABLED)
            assert verdict is DISABLED or not self.has_backend

    @staticmethod
    def judge_error(error: np.float32, low: np.float32, high: np.float32) -> None:
        """Check an error against the clamp: within, at a limit, or in the middle for NaN."""
        with np.errstate(over="ignore"):
            middle = (low + high) / f32(2)
        assert low < error < high or error in (low, high, middle)

    @property
    def params(self) -> Any:
        """The vehicle's parameters."""
        return self.vehicle.params

    @property
    def system_id(self) -> int:
        """The vehicle's present system id."""
        return u8(self.params.get_int("MAV_SYSID"))

    # What is done to it

    def pass_time(self, time_us: int) -> None:
        """Run one pass of the main loop at a time."""
        self.now_us = time_us
        self.vehicle.advance(range(time_us, time_us + 1))
        assert self.new_records == []
        assert len(self.calls) == self.calls_seen

    def deliver(self, link: int, data: bytes, read_ago_us: int = 0) -> None:
        """Hand bytes to a link."""
        self.delivered[link] += len(data)
        read_us = max(0, self.now_us - read_ago_us)
        self.vehicle.receive_bytes(self.channels[link], data, read_us)

    @rule(link=LINKS, message=VISION, sender=SENDERS_IDS, old=st.booleans(), read_ago_us=st.sampled_from([0, 2500]))
    def send_vision(self, link: int, message: Message, sender: tuple[int, int], old: bool, read_ago_us: int) -> None:
        """Send a vision message, in MAVLink 1 where that can be."""
        version = 1 if old and message_id(type(message).__name__) < 256 else 2
        self.deliver(link, Codec(*sender, version).encode(message), read_ago_us)

    @rule(link=LINKS, message=ODOMETRIES, quality=st.sampled_from([-1, 0, 1, 49, 50, 100]) | st.none())
    def send_odometry(self, link: int, message: ODOMETRY, quality: int | None) -> None:
        """Send an ODOMETRY in the frames that are taken."""
        if quality is not None:
            message = replace(message, quality=quality)
        self.deliver(link, Codec(255, 190).encode(message))

    @rule(link=LINKS, messages=st.lists(VISION | ANYTHING, max_size=6), cuts=st.lists(st.integers(0, 900), max_size=4))
    def send_stream(self, link: int, messages: list[Message], cuts: list[int]) -> None:
        """Send several messages in pieces."""
        codec = Codec(255, 190)
        data = b"".join(codec.encode(message) for message in messages)
        for start, end in pairwise([0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]):
            self.deliver(link, data[start:end])

    @rule(link=LINKS, message=ANYTHING, sender=SENDERS_IDS)
    def send_anything(self, link: int, message: Message, sender: tuple[int, int]) -> None:
        """Send any message with any fields."""
        self.deliver(link, Codec(*sender).encode(message))

    @rule(
        link=LINKS,
        number=COMMAND_NUMBERS,
        params=st.tuples(SMALL.map(float) | MESSAGE_IDS | FLOATS, *[SMALL.map(float) | FLOATS] * 6),
        addressee=st.sampled_from([None, None, 0, 9]),
    )
    def send_command_long(self, link: int, number: int, params: tuple[float, ...], addressee: int | None) -> None:
        """Send a command."""
        system_id = self.system_id if addressee is None else addressee
        self.deliver(link, Codec(255, 190).encode(COMMAND_LONG(system_id, 1, number, 0, *params)))

    @rule(
        link=LINKS,
        number=COMMAND_NUMBERS | st.just(611),
        place=st.tuples(INTEGERS["int32_t"], INTEGERS["int32_t"], FLOATS),
        frame=st.sampled_from([0, 3, 5, 6]) | INTEGERS["uint8_t"],
    )
    def send_command_int(self, link: int, number: int, place: tuple[int, int, float], frame: int) -> None:
        """Send a command with a place."""
        message = COMMAND_INT(self.system_id, 1, frame, number, 0, 0, 0.0, 0.0, 0.0, 0.0, *place)
        self.deliver(link, Codec(255, 190).encode(message))

    @rule(link=LINKS, name=NAMES, value=SMALL.map(float) | FLOATS, kind=INTEGERS["uint8_t"])
    def set_parameter(self, link: int, name: str, value: float, kind: int) -> None:
        """Set a parameter."""
        self.deliver(link, Codec(255, 190).encode(PARAM_SET(self.system_id, 1, name, value, kind)))

    @rule(link=LINKS, name=NAMES, index=st.integers(-1, 200) | INTEGERS["int16_t"], count=st.integers(1, 25))
    def read_parameter(self, link: int, name: str, index: int, count: int) -> None:
        """Read a parameter, perhaps more often than may wait."""
        frame = Codec(255, 190).encode(PARAM_REQUEST_READ(self.system_id, 1, name, index))
        self.deliver(link, frame * count)

    @rule(link=LINKS)
    def list_parameters(self, link: int) -> None:
        """Ask for all parameters."""
        self.deliver(link, Codec(255, 190).encode(PARAM_REQUEST_LIST(self.system_id, 1)))

    @rule(link=LINKS, place=st.tuples(*[st.integers(-9, 9) | INTEGERS["int32_t"]] * 2, EXTREMES | INTEGERS["int32_t"]))
    def set_origin(self, link: int, place: tuple[int, int, int]) -> None:
        """Set the origin by message."""
        self.deliver(link, Codec(255, 190).encode(SET_GPS_GLOBAL_ORIGIN(self.system_id, *place)))

    @rule(link=LINKS, tc1=st.just(0) | INTEGERS["int64_t"], ts1=st.none() | INTEGERS["int64_t"])
    def send_timesync(self, link: int, tc1: int, ts1: int | None) -> None:
        """Ask for the time, or answer, perhaps what was asked."""
        stamp = ts1 if ts1 is not None else self.channels[link].timesync_ts1 or 0
        self.deliver(link, Codec(255, 190).encode(TIMESYNC(tc1, stamp)))

    @rule(link=LINKS, count=st.sampled_from([10, 1500]))
    def flood(self, link: int, count: int) -> None:
        """Ask for the time so often that a link that is not read runs full."""
        self.deliver(link, Codec(255, 190).encode(TIMESYNC(0, -1)) * count)

    @rule(link=LINKS, arm=st.booleans(), magic=st.sampled_from([0.0, 2989.0, 21196.0]))
    def arm_or_disarm(self, link: int, arm: bool, magic: float) -> None:
        """Arm or disarm, perhaps by force."""
        params = (float(arm), magic, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.deliver(link, Codec(255, 190).encode(COMMAND_LONG(self.system_id, 1, 400, 0, *params)))

    @rule(link=LINKS, severity=INTEGERS["uint8_t"], text=st.binary(max_size=50))
    def send_raw_text(self, link: int, severity: int, text: bytes) -> None:
        """Send a text that need not be text."""
        raw = dialect.MAVLink_statustext_message(severity, text)
        self.deliver(link, bytes(raw.pack(dialect.MAVLink(None, 7, 8))))

    @rule(link=LINKS, data=st.binary(max_size=400))
    def send_bytes(self, link: int, data: bytes) -> None:
        """Send anything but, most likely, a frame."""
        self.deliver(link, data)

    @rule(link=LINKS, message=VISION | ANYTHING, bit=st.integers(0, 2400), end=st.none() | st.integers(0, 290))
    def send_damaged(self, link: int, message: Message, bit: int, end: int | None) -> None:
        """Send a frame that has a wrong bit or lacks its end."""
        frame = bytearray(Codec(255, 190).encode(message))
        if end is None:
            frame[bit // 8 % len(frame)] ^= 1 << bit % 8
        self.deliver(link, bytes(frame[:end]))

    @rule(link=st.integers(0, 1))
    def read_output(self, link: int) -> None:
        """Read what the vehicle sends on one of the links that are read."""
        self.readers[link].read()

    @rule(passes=st.integers(1, 60))
    def run(self, passes: int) -> None:
        """Let the main loop run at its rate."""
        for _ in range(passes):
            self.pass_time(self.now_us + LOOP_PERIOD_US)

    @rule(tenths=st.integers(1, 40))
    def wait(self, tenths: int) -> None:
        """Let seconds pass with a slow main loop."""
        for _ in range(tenths):
            self.pass_time(self.now_us + 100_000)

    @rule(age_ms=st.sampled_from([298, 299, 300, 301, 1000, 1001]), counter=SMALL)
    def send_and_wait_for_an_edge(self, age_ms: int, counter: int) -> None:
        """Send a sample, then let time pass to where a rule of the firmware changes its mind."""
        sample = VISION_SPEED_ESTIMATE(self.now_us, 1.0, 2.0, 3.0, reset_counter=counter)
        self.deliver(0, Codec(255, 190).encode(sample))
        self.pass_time(self.now_us + age_ms * 1000)

    @precondition(lambda self: self.now_us < 3 * WRAP_US)
    @rule(before_ms=st.integers(0, 1500))
    def jump_to_the_wrap(self, before_ms: int) -> None:
        """Go on just before the 32-bit millisecond clock wraps, once more."""
        wrap_us = (self.now_us // WRAP_US + 1) * WRAP_US
        self.pass_time(max(self.now_us, wrap_us - before_ms * 1000))

    # What must hold

    @invariant()
    def every_byte_is_counted_once(self) -> None:
        """Frames, bad bytes and bytes that wait make up what was delivered."""
        for index, channel in enumerate(self.channels):
            bad = sum(amount for (name, _, _), amount in channel.counters.items() if name == "BAD_DATA")
            assert channel.bytes_received == self.delivered[index]
            assert self.frame_bytes[index] + bad + channel.codec.unread_bytes == self.delivered[index]

    @invariant()
    def every_frame_meets_one_verdict(self) -> None:
        """Counters are what was told in events."""
        for seen, channel in zip(self.seen, self.channels, strict=True):
            counted = {key: amount for key, amount in channel.counters.items() if key[0] != "BAD_DATA"}
            assert counted == seen
            assert channel.frames_received == seen.total()

    @invariant()
    def camera_is_healthy_for_300_ms(self) -> None:
        """Health follows the last sample, or boot."""
        recent = u32(self.now_us // 1000 - self.last_sample_ms) < 300
        enabled = self.params.get_int("VISO_TYPE") != 0
        assert self.vehicle.visual_odom.healthy() == (enabled and self.has_backend and recent)

    @invariant()
    def queues_are_limited(self) -> None:
        """Nothing that others send makes memory grow."""
        assert len(list(self.vehicle.texts.pending())) <= QUEUE_CAPACITY
        assert self.vehicle.endpoint.param_reads.waiting <= READ_QUEUE_LENGTH
        for channel in self.channels:
            assert len(channel.requested) <= len(SENDERS)

    def teardown(self) -> None:
        """Read everything that was sent and logged to its end."""
        if not hasattr(self, "vehicle"):
            return
        self.vehicle.close()
        for reader in self.readers:
            reader.read()
        with tempfile.TemporaryDirectory() as folder:
            for number, log in enumerate(self.logs, start=1):
                self.check_log(Path(folder, f"{number}.BIN"), bytes(log.data), self.written[number])

    @staticmethod
    def check_log(path: Path, data: bytes, written: Counter[str]) -> None:
        """Read a log with pymavlink and compare its records with those written."""
        path.write_bytes(data)
        reader = DFReader_binary(str(path))
        records = list(records_of(reader))
        assert sum(record.fmt.len for record in records) == len(data)
        counts = Counter(record.get_type() for record in records)
        assert {name: counts[name] for name in written} == dict(written)
        reader.filehandle.close()


def records_of(reader: Any) -> Iterator[Any]:
    """Yield the records of a log."""
    while (record := reader.recv_msg()) is not None:
        yield record


def steps(examples: int) -> settings:
    """Return settings under which every run draws the same examples."""
    return settings(
        max_examples=examples,
        stateful_step_count=40,
        deadline=None,
        derandomize=True,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )


def test_whatever_comes_the_endpoint_keeps_its_promises() -> None:
    run_state_machine_as_test(EndpointMachine, settings=steps(2))


@pytest.mark.slow
def test_whatever_comes_the_endpoint_keeps_its_promises_for_longer() -> None:
    run_state_machine_as_test(EndpointMachine, settings=steps(40))

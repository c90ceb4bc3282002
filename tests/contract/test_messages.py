# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every message keeps to on its way into the endpoint, however its bytes arrive."""

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, fields, replace
from functools import cache
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.verdict import Verdict, VerdictKind
from ap_visualodom.verdicts import CONSUMED
from mav_handlers.channel import Channel
from mav_handlers.handlers import HANDLERS, VISION_MESSAGES
from mav_handlers.verdicts import NO_HANDLER, OWN_MESSAGE, UNKNOWN_MESSAGE
from mav_handlers.wire import messages as m
from mav_handlers.wire.codec import Codec, message_id
from mav_handlers.wire.messages import COMMAND_INT, COMMAND_LONG, MESSAGES, ODOMETRY, Message
from tests.uncovered import uncovered
from tools.make_messages import definition
from viso.vehicle.vehicle import Vehicle, VehicleConfig

# A few passes of the main loop do to boot; replies need them at their real rate.
BOOT_US = (0, 3_000_000, 4_900_000, 5_000_000)
REPLIES_US = range(5_002_500, 5_150_000, 2500)
GARBAGE = (b"\x00", b"0 0 0 ", bytes(range(200)), b"\xff" * 300, b"\xfd\x09", b"\xfe\xff\x00")

every_handled = pytest.mark.parametrize("cls", HANDLERS, ids=lambda cls: cls.__name__)
# Messages that the endpoint knows and, like the firmware, does not act on when somebody else sends them.
IGNORED: frozenset[type[Message]] = frozenset(
    {
        m.AHRS,
        m.AHRS2,
        m.ATTITUDE,
        m.ATTITUDE_QUATERNION,
        m.AUTOPILOT_VERSION,
        m.AVAILABLE_MODES,
        m.AVAILABLE_MODES_MONITOR,
        m.BATTERY_STATUS,
        m.COMMAND_ACK,
        m.EKF_STATUS_REPORT,
        m.EXTENDED_SYS_STATE,
        m.GLOBAL_POSITION_INT,
        m.GPS_GLOBAL_ORIGIN,
        m.GPS_RAW_INT,
        m.GPS2_RAW,
        m.HIGHRES_IMU,
        m.HOME_POSITION,
        m.HWSTATUS,
        m.LOCAL_POSITION_NED,
        m.LOG_DATA,
        m.LOG_ENTRY,
        m.MEMINFO,
        m.MESSAGE_INTERVAL,
        m.MISSION_ACK,
        m.MISSION_CURRENT,
        m.MISSION_ITEM_REACHED,
        m.NAV_CONTROLLER_OUTPUT,
        m.PARAM_ERROR,
        m.PARAM_VALUE,
        m.POWER_STATUS,
        m.RANGEFINDER,
        m.RAW_IMU,
        m.RC_CHANNELS,
        m.RC_CHANNELS_RAW,
        m.SCALED_IMU,
        m.SCALED_IMU2,
        m.SCALED_IMU3,
        m.SCALED_PRESSURE,
        m.SCALED_PRESSURE2,
        m.SERVO_OUTPUT_RAW,
        m.SET_HOME_POSITION,
        m.SIMSTATE,
        m.SIM_STATE,
        m.SYS_STATUS,
        m.VFR_HUD,
        m.VIBRATION,
    }
)
every_ignored = pytest.mark.parametrize("cls", sorted(IGNORED, key=str), ids=lambda cls: cls.__name__)


@dataclass(frozen=True)
class Effect:
    """What a delivery did: verdicts of whole frames, what was logged at once, and what was sent in answer."""

    verdicts: tuple[Verdict, ...]
    records: tuple[str, ...]
    sent: bytes


def sample(cls: type[Message]) -> Message:
    """Return a message that does something: addressed to the vehicle, with small numbers and a parameter's name."""
    raw = definition(cls.__name__)
    kinds = dict(zip(raw.fieldnames, raw.fieldtypes, strict=True))
    lengths = dict(zip(raw.ordered_fieldnames, raw.array_lengths, strict=True))

    def value(name: str) -> Any:
        if kinds[name] == "char":
            return "VISO_TYPE"[: lengths[name]]
        return (1,) * lengths[name] if lengths[name] else 1

    message = cls(*(value(field.name) for field in fields(cls)))
    if isinstance(message, ODOMETRY):
        return replace(message, frame_id=20, child_frame_id=12)
    return replace(message, command=401) if isinstance(message, COMMAND_LONG | COMMAND_INT) else message


def booted() -> tuple[Vehicle, Channel]:
    """Return a vehicle that has booted, with its link."""
    with uncovered():
        vehicle = Vehicle(VehicleConfig(defaults={"VISO_TYPE": 1}))
        channel = vehicle.endpoint.open_channel("link")
        for now_us in BOOT_US:
            vehicle.advance(range(now_us, now_us + 1))
        channel.take_output()
    return vehicle, channel


@cache
def effect_of(*chunks: bytes) -> Effect:
    """Deliver chunks of bytes at one moment to a vehicle of their own."""
    vehicle, channel = booted()
    records: list[str] = []

    def remember(structure: LogStructure, values: Sequence[LogValue]) -> None:
        records.append(f"{structure.name} {values!r}")

    vehicle.logger.on_write = remember
    for chunk in chunks:
        vehicle.receive_bytes(channel, chunk)
    logged = tuple(records)
    verdicts = []
    while (event := vehicle.endpoint.next_event()) is not None:
        if event.header is not None:
            verdicts.append(event.verdict)
    for now_us in REPLIES_US:
        vehicle.advance(range(now_us, now_us + 1))
    return Effect(tuple(verdicts), logged, channel.take_output())


def encoded(cls: type[Message]) -> bytes:
    return Codec(255, 190).encode(sample(cls))


def test_every_message_is_either_handled_or_ignored() -> None:
    listed = {cls.__name__ for cls in (*HANDLERS, *IGNORED)}
    assert listed == set(MESSAGES), "each message has a row in HANDLERS, or its name in IGNORED here"
    assert set(HANDLERS).isdisjoint(IGNORED)


def test_vision_messages_are_handled() -> None:
    assert set(HANDLERS) > VISION_MESSAGES


class TestMessage:
    """The contract."""

    @every_handled
    def test_it_gets_one_verdict_that_is_not_about_its_kind(self, cls: type[Message]) -> None:
        [verdict] = effect_of(encoded(cls)).verdicts
        assert verdict not in (NO_HANDLER, UNKNOWN_MESSAGE)

    @every_handled
    def test_byte_by_byte_has_the_same_effect(self, cls: type[Message]) -> None:
        frame = encoded(cls)
        assert effect_of(*(bytes([byte]) for byte in frame)) == effect_of(frame)

    @every_handled
    def test_garbage_around_it_makes_no_difference(self, cls: type[Message]) -> None:
        assert effect_of(GARBAGE[2] + encoded(cls) + GARBAGE[2]) == effect_of(encoded(cls))

    @pytest.mark.parametrize("garbage", GARBAGE, ids=len)
    def test_garbage_behind_it_makes_no_difference(self, garbage: bytes) -> None:
        assert effect_of(encoded(COMMAND_LONG) + garbage) == effect_of(encoded(COMMAND_LONG))

    @pytest.mark.parametrize("garbage", GARBAGE[:4], ids=len)
    def test_garbage_before_it_makes_no_difference(self, garbage: bytes) -> None:
        assert effect_of(garbage + encoded(COMMAND_LONG)) == effect_of(encoded(COMMAND_LONG))

    @every_handled
    def test_damage_takes_all_its_effect_away(self, cls: type[Message]) -> None:
        frame = bytearray(encoded(cls))
        frame[-3] ^= 0x40
        assert effect_of(bytes(frame)) == effect_of()

    @every_handled
    def test_own_ids_take_all_its_effect_away(self, cls: type[Message]) -> None:
        effect = effect_of(Codec(1, 1).encode(sample(cls)))
        assert effect.verdicts == (OWN_MESSAGE,)
        assert effect.records == ()

    @every_handled
    def test_mavlink_1_and_2_have_the_same_effect(self, cls: type[Message]) -> None:
        if message_id(cls.__name__) > 255:
            return
        message = sample(cls)
        # What MAVLink 1 cannot carry reads as zero.
        every = fields(cls)
        defaults = {field.name: field.default for field in every if field.default is not MISSING}
        bare = replace(message, **defaults)
        assert effect_of(Codec(255, 190, 1).encode(message)) == effect_of(Codec(255, 190).encode(bare))

    @pytest.mark.parametrize("cls", sorted(VISION_MESSAGES, key=str), ids=lambda cls: cls.__name__)
    def test_external_navigation_is_consumed_and_logged(self, cls: type[Message]) -> None:
        effect = effect_of(encoded(cls))
        assert effect.verdicts == (CONSUMED,)
        assert [record[:4] for record in effect.records] == {
            "ODOMETRY": ["VISP", "VISV"],
            "VISION_SPEED_ESTIMATE": ["VISV"],
            "VISION_POSITION_DELTA": ["VISO"],
        }.get(cls.__name__, ["VISP"])

    @every_ignored
    def test_ignored_message_has_no_effect_but_its_verdict(self, cls: type[Message]) -> None:
        effect, silence = effect_of(encoded(cls)), effect_of()
        assert effect == replace(silence, verdicts=(NO_HANDLER,))

    @given(chunks=st.lists(st.integers(1, 40), max_size=12), garbage=st.binary(max_size=20))
    def test_any_cut_of_a_stream_has_the_same_effect(self, chunks: list[int], garbage: bytes) -> None:
        codec = Codec(255, 190)
        stream = garbage.translate(None, b"\xfd\xfe") + b"".join(codec.encode(sample(cls)) for cls in VISION_MESSAGES)
        cuts = [0, *(sum(chunks[: number + 1]) for number in range(len(chunks))), len(stream)]
        pieces = [stream[start:end] for start, end in pairwise(cuts) if start < end]
        assert effect_of(*pieces) == effect_of(stream)
        assert {verdict.kind for verdict in effect_of(*pieces).verdicts} == {VerdictKind.ACCEPTED}

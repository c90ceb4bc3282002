# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""DataFlash logs become streams again: of logs of our own, of the firmware's, and of damaged ones."""

import lzma
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ap_core.dataflash import DataFlashWriter
from ap_core.log_structure import FMT, FMTU, MSG, MULT, PARM, UNIT, LogStructure
from ap_visualodom.log_structure import VISO, VISP, VISV
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import (
    PARAM_SET,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from tests.dfreader import read_log
from tests.places import RECORDED
from tests.unit.viso.conftest import odometry
from viso.errors import InputError
from viso.firmware.flown import FlownVersion
from viso.logs.logger import MemoryLog
from viso.logs.recorded import read_recorded_states
from viso.replay.feed import Replay
from viso.streams.heard import firmware_of_recording
from viso.streams.stream_kinds import Stream, StreamMessage, read_stream
from viso.vehicle.vehicle import Vehicle, VehicleConfig

LOGS = RECORDED / "logs"
LAYOUTS = {layout.name: layout for layout in (VISP, VISV, VISO)}
START_US = 3_000_000
EXACT = ("TimeUS", "RTimeUS", "PX", "PY", "PZ", "PErr", "AErr", "VX", "VY", "VZ", "VErr", "Rst", "Ign", "Q")
LINEAR = ("PX", "PY", "PZ", "VX", "VY", "VZ")
Row = dict[str, Any]


def messages_of(stream: Stream) -> list[Any]:
    codec = Codec(1, 1)
    codec.feed(b"".join(message.frame for message in stream.messages))
    received = iter(codec.next_received, None)
    return [one.message for one in received if isinstance(one, Received)]


def fly(sent: Sequence[Message], folder: Path, *, period_us: int = 40_000, **params: float) -> Path:
    """Return the log of a vehicle that has got these messages."""
    file = MemoryLog()
    camera = Codec(1, 197)
    frames = tuple(
        StreamMessage(START_US + number * period_us, camera.encode(message)) for number, message in enumerate(sent)
    )
    config = VehicleConfig(defaults={"VISO_TYPE": 1, "LOG_DISARMED": 1, **params}, open_log=lambda: file)
    vehicle = Vehicle(config)
    list(Replay(vehicle, Stream("flight", frames), None).run())
    vehicle.close()
    path = folder / "flight.BIN"
    path.write_bytes(file.data)
    return path


def records_of(path: Path) -> dict[str, list[Row]]:
    rows: dict[str, list[Row]] = {name: [] for name in LAYOUTS}

    def collect(log: Any) -> None:
        while (record := log.recv_match(type=list(LAYOUTS))) is not None:
            rows[record.get_type()].append({name: getattr(record, name) for name in record._fieldnames})

    read_log(path, collect)
    return rows


def replayed(stream: Stream, states: Path | None = None) -> dict[str, list[Row]]:
    """Return the records of a replay; with a log of attitudes by these."""
    config = VehicleConfig(defaults=stream.params, firmware=firmware_of_recording(stream).firmware)
    if states is not None:
        recorded = read_recorded_states(states)

        def follow(vehicle: Vehicle) -> AhrsBase:
            return RecordedAhrs(vehicle.clock, vehicle.sources, vehicle.replay_log, recorded)

        config = replace(config, make_ahrs=follow)
    rows: dict[str, list[Row]] = {name: [] for name in LAYOUTS}
    for message in Replay(Vehicle(config), stream, stream.baud).run():
        for name, values in message.records:
            rows[name].append(dict(zip(LAYOUTS[name].fields, map(float, values), strict=True)))
    return rows


def largest_difference(theirs: list[Row], ours: list[Row], label: str) -> float:
    pairs = ((before[label], after[label]) for before, after in zip(theirs, ours, strict=True))
    circle = 360.0 if label in "RPY" else math.inf
    return max(abs(math.remainder(before - after, circle)) if before != after else 0.0 for before, after in pairs)


def written(folder: Path, *records: tuple[LogStructure, tuple[Any, ...]], name: str = "made.BIN") -> Path:
    """Return a log that holds these records."""
    kinds = {layout.name: layout for layout, _ in records}
    kinds |= {layout.name: layout for layout in (FMT, UNIT, FMTU, MULT, PARM, MSG) if layout.name not in kinds}
    writer = DataFlashWriter([FMT, *(layout for layout in kinds.values() if layout is not FMT)])
    start = b"".join(writer.start_up([("VISO_TYPE", 1.0, 0.0)], time_us=1000))
    path = folder / name
    path.write_bytes(start + b"".join(writer.record(layout, values) for layout, values in records))
    return path


def visp(time_us: int, *, remote_us: int = 7, quality: int = 0) -> tuple[LogStructure, tuple[Any, ...]]:
    return VISP, (time_us, remote_us, time_us // 1000, 1.0, 2.0, 3.0, 0.0, 0.0, 90.0, 0.5, 0.3, 4, 0, quality)


def visv(time_us: int, *, remote_us: int = 7, quality: int = 0) -> tuple[LogStructure, tuple[Any, ...]]:
    return VISV, (time_us, remote_us, time_us // 1000, 1.0, 2.0, 3.0, 0.1, 4, 0, quality)


def kinds_of(stream: Stream) -> list[str]:
    return [type(message).__name__ for message in messages_of(stream)]


# Logs of our own

VARIANCES = (0.04, *(0.0,) * 5, 0.05, *(0.0,) * 4, 0.06, *(0.0,) * 3, 0.2, 0.0, 0.0, 0.3, 0.0, 0.4)
SENT: list[Message] = [
    odometry(1000, x=1.25, y=-2.5, z=3.0, vx=0.5, quality=80),
    odometry(2000, x=1.5, q=(0.5, 0.5, 0.5, 0.5), vy=2.0, quality=-1, reset_counter=255),
    odometry(3000, x=math.nan, quality=1, pose_covariance=VARIANCES),
    VISION_POSITION_ESTIMATE(4000, 0.1, 0.2, 0.3, 0.1, -0.2, 3.0, VARIANCES, 3),
    VISION_SPEED_ESTIMATE(5000, 1.0, -2.0, 0.5, reset_counter=3),
    VISION_POSITION_DELTA(6000, 40_000, (0.01, 0.02, 0.03), (0.1, 0.2, 0.3), 75.0),
]


@pytest.mark.parametrize("scale", [1.0, 1.1])
def test_log_of_a_stream_gives_a_stream_with_the_same_records(tmp_path: Path, scale: float) -> None:
    log = fly(SENT, tmp_path, VISO_SCALE=scale, VISO_QUAL_MIN=0, VISO_POS_M_NSE=0.25)
    stream = read_stream(log, 0)
    assert kinds_of(stream) == [type(message).__name__ for message in SENT]
    assert [message.arrival_us for message in stream.messages] == [START_US + 40_000 * n for n in range(len(SENT))]
    theirs, ours = records_of(log), replayed(stream)
    assert [len(rows) for rows in theirs.values()] == [4, 4, 1]
    for name, rows in theirs.items():
        for label in LAYOUTS[name].fields:
            limit = {"R": 3e-5, "P": 3e-5, "Y": 3e-5, "CTimeMS": 2}.get(label, 1e-6 if label in LINEAR else 0)
            clean = [number for number, row in enumerate(rows) if math.isfinite(row[label])]
            pairs = [rows[number] for number in clean], [ours[name][number] for number in clean]
            assert largest_difference(*pairs, label) <= limit, f"{name}.{label}"


def test_parameters_are_those_of_the_log(tmp_path: Path) -> None:
    stream = read_stream(fly(SENT[:1], tmp_path, VISO_DELAY_MS=77), 0)
    assert (stream.params["VISO_DELAY_MS"], stream.params["VISO_TYPE"]) == (77, 1)
    assert stream.name == "flight"


def test_parameter_that_changed_is_set_at_its_time(tmp_path: Path) -> None:
    change = PARAM_SET(1, 1, "VISO_SCALE", 2.0, 9)
    pose = VISION_POSITION_ESTIMATE(4000, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
    log = fly([pose, change, pose, pose], tmp_path)
    stream = read_stream(log, 0)
    assert stream.params["VISO_SCALE"] == 1
    first, changed, *others = messages_of(stream)
    assert (changed.param_id, changed.param_value) == ("VISO_SCALE", 2.0)
    assert [message.x for message in (first, *others)] == [1, 1, 1]
    assert [row["PX"] for row in replayed(stream)["VISP"]] == [1, 2, 2]


# Logs of the firmware


@pytest.mark.slow
@pytest.mark.parametrize("name", [
    "bench_no_yaw_source",
    *(pytest.param(name, marks=pytest.mark.slow) for name in (
        "bench_glitch_radius_0", "bench_odometry", "bench_pose_baro", "bench_pose_velocity",
        "bench_steps", "bench_velocity_only", "bench_vertical_velocity_100hz", "dropout", "flight_mav_extyaw",
        "flight_t265", "flight_voxl_reset", "prearm", "t265", "voxl",
    )),
])  # fmt: skip
def test_replay_of_a_log_leaves_the_firmwares_records(name: str) -> None:
    log = LOGS / f"{name}.BIN.xz"
    stream = read_stream(log, 0)
    theirs, ours = records_of(log), replayed(stream, log)
    aligned = stream.params["VISO_TYPE"] != 1
    assert sum(map(len, theirs.values())) > 50
    for kind, rows in theirs.items():
        assert len(ours[kind]) == len(rows)
        for label in LAYOUTS[kind].fields if rows else ():
            # Where a log begins, the correction of times has been running for a while.
            limit = 100.0 if label == "CTimeMS" and name.startswith("bench") else 4.0
            if label in LINEAR:
                limit = 5e-4 if aligned else 0.0  # aligned again, by attitudes of 10 Hz
            elif label in "RPY":
                limit = 5e-3 if aligned else 4e-5
            elif label != "CTimeMS":
                limit = 0.0
            clean = [number for number, row in enumerate(rows) if math.isfinite(row[label])]
            pairs = [rows[number] for number in clean], [ours[kind][number] for number in clean]
            assert largest_difference(*pairs, label) <= limit, f"{kind}.{label}"


@pytest.mark.slow
def test_rate_of_the_uart_is_found_out() -> None:
    assert read_stream(LOGS / "bench_velocity_only.BIN.xz", 0).baud == 115200


def test_packed_log_is_read_as_the_plain_one(tmp_path: Path) -> None:
    plain = written(tmp_path, visp(START_US))
    packed = tmp_path / "made.BIN.xz"
    packed.write_bytes(lzma.compress(plain.read_bytes()))
    assert read_stream(packed, 0).messages == read_stream(plain, 0).messages


# Which message it was


def test_pose_and_velocity_of_one_moment_are_an_odometry(tmp_path: Path) -> None:
    stream = read_stream(written(tmp_path, visp(START_US), visv(START_US + 300)), 0)
    assert kinds_of(stream) == ["ODOMETRY"]


@pytest.mark.parametrize("other", [visv(START_US, remote_us=8), visv(START_US, quality=5)])
def test_velocity_with_another_stamp_or_quality_is_a_message_of_its_own(
    tmp_path: Path, other: tuple[LogStructure, tuple[Any, ...]]
) -> None:
    stream = read_stream(written(tmp_path, visp(START_US), other), 0)
    assert kinds_of(stream) == ["VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE"]


def test_one_pair_that_came_apart_shows_that_all_are_two_messages(tmp_path: Path) -> None:
    later = START_US + 40_000
    log = written(tmp_path, visp(START_US), visv(START_US), visp(later), visv(later + 2500))
    stream = read_stream(log, 0)
    assert kinds_of(stream) == ["VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE"] * 2
    assert any("came apart" in note for note in stream.notes)


def test_quality_shows_that_it_was_odometry(tmp_path: Path) -> None:
    later = START_US + 40_000
    log = written(
        tmp_path, visp(START_US, quality=9), visv(START_US, quality=9), visp(later), visv(later + 2500), visp(later)
    )
    expected = ["ODOMETRY", "VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE", "VISION_POSITION_ESTIMATE"]
    assert kinds_of(read_stream(log, 0)) == expected


OLD_VISP = LogStructure(
    168,
    "VISP",
    "QQIffffffffBB",
    "TimeUS,RTimeUS,CTimeMS,PX,PY,PZ,Roll,Pitch,Yaw,PErr,AErr,Rst,Ign",
    "sssmmmddhmd--",
    "FFC00000000--",
)
OLDEST_VISP = LogStructure(
    168,
    "VISP",
    "QQIffffffffB",
    "TimeUS,RTimeUS,CTimeMS,PX,PY,PZ,Roll,Pitch,Yaw,PErr,AErr,RstCnt",
    "sssmmmddhmd-",
    "FFC00000000-",
)


VISP_OF_4_0 = LogStructure(
    168,
    "VISP",
    "QQIffffffb",
    "TimeUS,RemTimeUS,CTimeMS,PX,PY,PZ,Roll,Pitch,Yaw,ResetCnt",
    "sssmmmddh-",
    "FFC000000-",
)
VISP_OF_3_6 = LogStructure(168, "VISP", "QQffffff", "TimeUS,RemTimeUS,PX,PY,PZ,Roll,Pitch,Yaw", "ssmmmrrr", "FF000000")


def test_records_of_4_0_have_no_errors(tmp_path: Path) -> None:
    values = (START_US, 7, 2999, 1.0, 2.0, 3.0, 0.0, 0.0, 90.0, 4)
    (message,) = messages_of(read_stream(written(tmp_path, (VISP_OF_4_0, values)), 0))
    assert (message.usec, message.yaw, message.reset_counter) == (7, pytest.approx(math.pi / 2), 4)
    assert math.isnan(message.covariance[0])


def test_records_of_3_6_are_in_rad(tmp_path: Path) -> None:
    values = (START_US, 7, 1.0, 2.0, 3.0, 0.0, 0.1, 0.5)
    (message,) = messages_of(read_stream(written(tmp_path, (VISP_OF_3_6, values)), 0))
    assert (message.x, message.pitch, message.yaw) == (1.0, pytest.approx(0.1), pytest.approx(0.5))


@pytest.mark.parametrize("layout", [OLD_VISP, OLDEST_VISP])
def test_records_of_earlier_firmware_are_read(tmp_path: Path, layout: LogStructure) -> None:
    values = (START_US, 7, 2999, 1.0, 2.0, 3.0, 0.0, 0.0, 90.0, 0.5, 0.3, 4, 0)[: len(layout.fields)]
    log = written(tmp_path, (MSG, (1000, "ArduCopter V4.4.4 (f7d6b2a1)")), (layout, values))
    stream = read_stream(log, 0)
    (message,) = messages_of(stream)
    assert (message.x, message.yaw, message.reset_counter) == (1.0, pytest.approx(math.pi / 2), 4)
    assert stream.flown == FlownVersion("ArduCopter V4.4.4 (f7d6b2a1)", "Copter", 4, 4, "f7d6b2a1")


def test_version_record_does_where_no_text_is(tmp_path: Path) -> None:
    layout = LogStructure(200, "VER", "QZ", "TimeUS,FWS", "s-", "F-")
    log = written(tmp_path, (layout, (1000, "ArduSub V4.5.6 (11223344)")), visp(START_US))
    flown = read_stream(log, 0).flown
    assert flown is not None
    assert (flown.vehicle, flown.major, flown.minor) == ("Sub", 4, 5)


def test_notes_tell_what_is_not_known(tmp_path: Path) -> None:
    log = written(tmp_path, visp(START_US))
    notes = read_stream(log, 0).notes
    assert all(note.startswith(f"{log}: ") and "\n" not in note for note in notes)
    assert "ATT_POS_MOCAP" in " ".join(notes)
    assert "covariances" in " ".join(notes)


# What cannot be read


def test_time_that_runs_backwards_counts_as_the_one_before(tmp_path: Path) -> None:
    stream = read_stream(written(tmp_path, visp(START_US), visp(START_US - 5000)), 0)
    assert [message.arrival_us for message in stream.messages] == [START_US, START_US]


@pytest.mark.parametrize(("records", "error"), [
    ([], "no VISP, VISV or VISO records: VISO_TYPE was 0, or no external navigation came"),
    ([visp(START_US), visp(10**12)], "VISP record 2: VISP.TimeUS is more than a day after the one before"),
])  # fmt: skip
def test_log_that_cannot_be_replayed_is_one_line(tmp_path: Path, records: list[Any], error: str) -> None:
    path = written(tmp_path, *records)
    with pytest.raises(InputError) as raised:
        read_stream(path, 0)
    assert str(raised.value) == f"{path}: {error}"


def test_record_that_lacks_a_field_is_named(tmp_path: Path) -> None:
    short = LogStructure(168, "VISP", "QQI", "TimeUS,RTimeUS,CTimeMS", "sss", "FFC")
    path = written(tmp_path, (short, (1, 2, 3)))
    with pytest.raises(InputError) as raised:
        read_stream(path, 0)
    assert str(raised.value) == f"{path}: VISP record 1: VISP lacks a number in PX or PY or PZ"


def test_record_out_of_range_is_named(tmp_path: Path) -> None:
    wide = LogStructure(169, "VISV", "QQIffffHBb", VISV.labels, VISV.units, VISV.multipliers)
    good = (START_US, 7, 3000, 1.0, 2.0, 3.0, 0.1, 4, 0, 50)
    path = written(tmp_path, (wide, good), (wide, (*good[:7], 300, *good[8:])))
    with pytest.raises(InputError) as raised:
        read_stream(path, 0)
    assert str(raised.value) == f"{path}: VISV record 2: VISV.Rst is 300"


def test_file_that_is_no_log_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "flight.BIN"
    path.write_bytes(b"no log")
    with pytest.raises(InputError, match="not a DataFlash log"):
        read_stream(path, 0)


def test_missing_log_is_one_line() -> None:
    with pytest.raises(InputError, match=r"^none\.BIN: No such file"):
        read_stream(Path("none.BIN"), 0)


def test_bytes_lost_to_damage_are_counted_in_a_note(tmp_path: Path) -> None:
    log = fly([odometry(START_US + number * 40_000) for number in range(5)], tmp_path)
    sound = read_stream(log, 0)
    assert not any("damaged" in note for note in sound.notes)
    log.write_bytes(log.read_bytes() + b"nonsense")
    damaged = read_stream(log, 0)
    assert damaged.notes[0] == f"{log}: damaged: 8 bytes in 1 places are in no record (no record begins here)"
    assert damaged.messages == sound.messages

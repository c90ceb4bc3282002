# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Replay records are the firmware's, byte for byte and in its order, given what the firmware's estimator was given."""

import lzma
import struct
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from typing import Any, Final

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import FMT, LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import InertialDelta
from ekf_stub.inputs.sensors import Sensors
from ekf_stub.log.ext_nav_log import VisualOdomFrame
from ekf_stub.log.replay_log import ReplayLog, SensorSet, VehicleFrame
from ekf_stub.log.replay_log_structure import LOG_STRUCTURE_OF_FRAMES, RBOH, REPH, REVH, RVOH
from tests.places import PARITY
from viso.compare.tolerances import log_name
from viso.firmware.releases import JULY_2025, PROFILES, Firmware

WITHOUT_CAMERA: Final = "flow_take_off"
"""This vehicle has a flow sensor and a range finder instead, which ours has not."""
FILTER_ALONE: Final = "stamps"
"""A log for the filter; its barometer does not read what that of the other recordings does."""
NAMES = sorted(
    f"{path.parts[-3]}/{log_name(path)}"
    for path in PARITY.glob("20*/logs/*.BIN.xz")
    if log_name(path) not in (WITHOUT_CAMERA, FILTER_ALONE)
)
LATER: Final = "2026-02/t265"
"""A log of another release: its folder, and its name there."""

STRUCTURES: Final = {structure.name: structure for structure in (*LOG_STRUCTURE_OF_FRAMES, RVOH, REPH, REVH, RBOH)}
REDUCED: Final = {"RISI", "RBRI", "RMGI"}  # to the first instance, their last field
INITIALISED: Final = b"EKF3 IMU0 initialised"
FITTED: Final = SensorSet(compass_offsets=(5.0, 13.0, -18.0))
FRAMES_OF_10_S: Final = 4000

Row = tuple[str, bytes]


def rows_of(data: bytes) -> Iterator[Row]:
    """Yield name and bytes of each record of a log, FMT records excepted."""
    kinds = {FMT.msg_type: ("FMT", FMT.length)}
    at = 0
    while at < len(data):
        name, length = kinds[data[at + 2]]
        row = data[at : at + length]
        at += length
        if name == "FMT":
            kinds[row[3]] = row[5:9].rstrip(b"\0").decode(), row[4]
        else:
            yield name, row


def frames_of(rows: Sequence[Row]) -> list[Sequence[Row]]:
    """Return the records from each RFRH to the next; the last frame of a log is cut off somewhere."""
    starts = [index for index, (name, _) in enumerate(rows) if name == "RFRH"]
    return [rows[start:end] for start, end in pairwise(starts)]


class Estimator:
    """Gives a log what an estimator of the firmware was given, by its own replay records."""

    def __init__(self, firmware: Firmware = JULY_2025) -> None:
        self.rows: list[Row] = []
        self.log = ReplayLog(
            self,
            lambda: True,
            FITTED,
            event_order=firmware.event_order,
            fills_odometry=firmware.log.fills_odometry,
        )
        self._given: dict[str, Any] = {}
        self._mag: tuple[int, Any] | None = None
        self._initialised = False

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        self.rows.append((structure.name, structure.pack(values)))

    def run(self, frame: Sequence[Row]) -> None:
        inputs = {name: _decoded(name, row) for name, row in frame if name in STRUCTURES}
        self._given.update(inputs)
        if "RMGI" in inputs:
            self._mag = inputs["RMGI"][0], np.array(inputs["RMGI"][4:7])
        assert self.log.start_frame(*inputs["RFRH"])
        self._give_inputs()
        self.log.note_run(was_initialised=self._initialised)
        self._initialised |= any(name == "MSG" and INITIALISED in row for name, row in frame)
        for name, row in frame:
            self._give_call(name, row)

    def _give_inputs(self) -> None:
        lat, lng, alt_cm, eas2tas, _, *trim, _, ekf_type, flags = self._given["RFRN"]
        home = Location(_signed(lat), lng, alt_cm) if lat else None
        armed, takeoff, touchdown, flow = (bool(flags & 1 << bit) for bit in (0, 6, 7, 4))
        self.log.vehicle(
            VehicleFrame(armed, takeoff, touchdown, flow, home, eas2tas, (trim[0], trim[1], trim[2]), ekf_type)
        )
        risi, rbri = self._given["RISI"], self._given["RBRI"]
        delta = InertialDelta(np.array(risi[:3]), np.array(risi[3:6]), risi[6], risi[7])
        self.log.sensors(Sensors(delta, rbri[:2], self._mag, self._given["RMGH"][0]))
        *offset, delay_ms, healthy, enabled = self._given["RVOH"]
        self.log.frame(VisualOdomFrame(Vector3f(*offset), delay_ms, bool(healthy), bool(enabled)))

    def _give_call(self, name: str, row: bytes) -> None:
        values = _decoded(name, row) if name in STRUCTURES else ()
        if name == "XKF4":
            self.log.note_logged()
        elif name == "REPH":
            pos, quat, errors, (time_ms, reset_ms, delay_ms) = values[:3], values[3:7], values[7:9], values[9:]
            self.log.pose(Vector3f(*pos), Quaternion(*quat), _floats(errors), time_ms, delay_ms, reset_ms)
        elif name == "REVH":
            self.log.velocity(Vector3f(*values[:3]), np.float32(values[3]), values[4], values[5])
        elif name == "RBOH":
            quality, *moved, interval_s, time_ms = values[:9]
            deltas = Vector3f(*moved[:3]), Vector3f(*moved[3:])
            *offset, delay_ms = values[9:]
            place = Vector3f(*offset)
            self.log.body_odometry(np.float32(quality), *deltas, np.float32(interval_s), time_ms, delay_ms, place)
        elif name == "REV3":
            self.log.event(values[0])
        elif name == "RSO3":
            self.log.origin(Location(_signed(values[0]), values[1], values[2]))


def _decoded(name: str, row: bytes) -> tuple[Any, ...]:
    return struct.unpack("<" + STRUCTURES[name].format, row[3:])


def _signed(value: int) -> int:
    return value - (1 << 32) if value >= 1 << 31 else value


def _floats(values: Sequence[float]) -> tuple[np.float32, np.float32]:
    return np.float32(values[0]), np.float32(values[1])


def replay_rows(rows: Sequence[Row]) -> list[Row]:
    """Return the replay records, of redundant sensors those of the first as in the reduced logs."""
    return [(name, row) for name, row in rows if name in STRUCTURES and not (name in REDUCED and row[-1])]


@pytest.fixture(scope="module")
def frames() -> Callable[[str], list[Sequence[Row]]]:
    @cache
    def read(name: str) -> list[Sequence[Row]]:
        release, _, stem = name.partition("/")
        return frames_of(list(rows_of(lzma.decompress((PARITY / release / "logs" / f"{stem}.BIN.xz").read_bytes()))))

    return read


def recorded_and_ours(frames: list[Sequence[Row]], firmware: Firmware = JULY_2025) -> tuple[list[Row], list[Row]]:
    estimator = Estimator(firmware)
    for frame in frames:
        estimator.run(frame)
    assert len(frames) > FRAMES_OF_10_S
    return replay_rows([row for frame in frames for row in frame]), replay_rows(estimator.rows)


def firmware_of(name: str) -> Firmware:
    return PROFILES[name.partition("/")[0]]


USUAL: Final = {"2025-07/bench_odometry"}
"""The usual run takes this one: odometry with an origin."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in USUAL else pytest.mark.slow) for name in NAMES]
)
def test_records_and_their_order_are_the_firmwares(name: str, frames: Callable[[str], list[Sequence[Row]]]) -> None:
    recorded, ours = recorded_and_ours(frames(name), firmware_of(name))
    # The RFRF of the last frame waits for another.
    assert ours == recorded[: len(ours)]
    assert [name for name, _ in recorded[len(ours) :]] in ([], ["RFRF"])


@pytest.mark.slow
def test_another_release_logs_events_in_another_order(frames: Callable[[str], list[Sequence[Row]]]) -> None:
    recorded, ours = recorded_and_ours(frames(LATER))
    different = {name for (name, before), (_, after) in zip(recorded, ours, strict=False) if before != after}
    assert different == {"REV2", "REV3"}

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Log records: which value goes into which field."""

from collections.abc import Sequence
from typing import Protocol

import pytest

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom_logging import AP_VisualOdom_Logging
from ap_visualodom.log_structure import VISO, VISP, VISV

NOW_US = 5_000_123


class Writer(Protocol):
    def __call__(self, logging: AP_VisualOdom_Logging, *, ignored: bool) -> None: ...


class Log:
    def __init__(self) -> None:
        self.written: list[tuple[LogStructure, Sequence[LogValue]]] = []

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        self.written.append((structure, values))

    def only(self) -> tuple[LogStructure, dict[str, LogValue]]:
        [(structure, values)] = self.written
        return structure, dict(zip(structure.fields, values, strict=True))


@pytest.fixture
def log() -> Log:
    return Log()


@pytest.fixture
def logging(log: Log) -> AP_VisualOdom_Logging:
    return AP_VisualOdom_Logging(log, VirtualClock(NOW_US))


def write_position(logging: AP_VisualOdom_Logging, *, ignored: bool) -> None:
    euler_deg = f32(4), f32(5), f32(6)
    logging.Write_VisualPosition(77, 4990, Vector3f(1, 2, 3), euler_deg, f32(7), f32(8), 9, ignored, -1)


def write_velocity(logging: AP_VisualOdom_Logging, *, ignored: bool) -> None:
    logging.Write_VisualVelocity(77, 4990, Vector3f(1, 2, 3), f32(4), 9, ignored, 55)


def test_delta_record(log: Log, logging: AP_VisualOdom_Logging) -> None:
    logging.Write_VisualOdom(f32(0.5), Vector3f(1, 2, 3), Vector3f(4, 5, 6), f32(70))
    structure, fields = log.only()
    assert structure is VISO
    assert fields == {
        "TimeUS": NOW_US,
        "dt": 0.5,
        "conf": 70,
        "AngDX": 1,
        "AngDY": 2,
        "AngDZ": 3,
        "PosDX": 4,
        "PosDY": 5,
        "PosDZ": 6,
    }


def test_position_record(log: Log, logging: AP_VisualOdom_Logging) -> None:
    write_position(logging, ignored=False)
    structure, fields = log.only()
    assert structure is VISP
    assert fields == {
        "TimeUS": NOW_US,
        "RTimeUS": 77,
        "CTimeMS": 4990,
        "PX": 1,
        "PY": 2,
        "PZ": 3,
        "R": 4,
        "P": 5,
        "Y": 6,
        "PErr": 7,
        "AErr": 8,
        "Rst": 9,
        "Ign": 0,
        "Q": -1,
    }


def test_velocity_record(log: Log, logging: AP_VisualOdom_Logging) -> None:
    write_velocity(logging, ignored=False)
    structure, fields = log.only()
    assert structure is VISV
    assert fields == {
        "TimeUS": NOW_US,
        "RTimeUS": 77,
        "CTimeMS": 4990,
        "VX": 1,
        "VY": 2,
        "VZ": 3,
        "VErr": 4,
        "Rst": 9,
        "Ign": 0,
        "Q": 55,
    }


@pytest.mark.parametrize("write", [write_position, write_velocity])
def test_ignored_sample_is_marked_with_one(log: Log, logging: AP_VisualOdom_Logging, write: Writer) -> None:
    write(logging, ignored=True)
    ignored = log.only()[1]["Ign"]
    assert (ignored, type(ignored)) == (1, int)


@pytest.mark.parametrize("write", [write_position, write_velocity])
def test_record_fits_its_layout(log: Log, logging: AP_VisualOdom_Logging, write: Writer) -> None:
    write(logging, ignored=False)
    structure, values = log.written[0]
    assert len(structure.pack(values)) == structure.length


def test_record_is_stamped_when_it_is_written(log: Log) -> None:
    clock = VirtualClock(1)
    logging = AP_VisualOdom_Logging(log, clock)
    clock.set_us(2)
    write_velocity(logging, ignored=False)
    assert log.only()[1]["TimeUS"] == 2

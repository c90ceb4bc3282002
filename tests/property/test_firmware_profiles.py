# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All firmware makes the same of a stream without covariance, motion capture and switching of sources."""

from functools import cache
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ap_core.log_field import LogValue
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    GLOBAL_VISION_POSITION_ESTIMATE,
    ODOMETRY,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.files.float_bits import json_value
from viso.firmware.releases import JULY_2025, PROFILES
from viso.logs.logger import MemoryLog
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ap_core.log_structure import LogStructure

# Zeros of either sign aside: one release makes the negative one positive.
FLOATS = st.floats(width=32).filter(lambda value: value != 0) | st.just(0.0)
STAMPS = st.integers(0, 10_000_000)
COUNTERS = st.integers(0, 3)
NO_COVARIANCE = st.sampled_from([(0.0,) * 21, (float("nan"),) + (0.0,) * 20])
EULER_POSE = (STAMPS, *[FLOATS] * 6, NO_COVARIANCE)


def unit_and_other_quaternions() -> st.SearchStrategy[tuple[float, ...]]:
    return st.tuples(*[FLOATS] * 4)


MESSAGES = st.one_of(
    st.builds(VISION_POSITION_ESTIMATE, *EULER_POSE, COUNTERS),
    st.builds(GLOBAL_VISION_POSITION_ESTIMATE, *EULER_POSE, COUNTERS),
    st.builds(VICON_POSITION_ESTIMATE, *EULER_POSE),
    st.builds(VISION_SPEED_ESTIMATE, STAMPS, *[FLOATS] * 3, st.tuples(*[FLOATS] * 9), COUNTERS),
    st.builds(VISION_POSITION_DELTA, STAMPS, STAMPS, st.tuples(*[FLOATS] * 3), st.tuples(*[FLOATS] * 3), FLOATS),
    st.builds(
        ODOMETRY,
        STAMPS,
        st.sampled_from([20, 1]),
        st.just(12),
        *[FLOATS] * 3,
        unit_and_other_quaternions(),
        *[FLOATS] * 6,
        NO_COVARIANCE,
        st.tuples(*[FLOATS] * 21),
        COUNTERS,
        st.just(2),
        st.integers(-1, 100),
    ),
)


class Recorded:
    """A vehicle that has booted, and the records that it makes of external navigation."""

    def __init__(self, firmware: str, kind: int) -> None:
        defaults = {"VISO_TYPE": kind, "VISO_QUAL_MIN": 10, "LOG_REPLAY": 1}
        self.vehicle = Vehicle(VehicleConfig(defaults=defaults, open_log=MemoryLog, firmware=PROFILES[firmware]))
        self.channel = self.vehicle.endpoint.open_channel("companion", baud=115200)
        self.scheduler = Scheduler(self.vehicle)
        self.scheduler.run_until(5_000_000)
        self.records: list[list[object]] = []
        self.vehicle.logger.on_write = self._take

    def _take(self, structure: "LogStructure", values: "Sequence[LogValue]") -> None:
        if structure.name in {"VISO", "VISP", "VISV", "REPH", "REVH", "RBOH"}:
            self.records.append([structure.name, *map(json_value, values)])

    def feed(self, messages: list[Message]) -> list[list[object]]:
        self.records.clear()
        codec = Codec(1, 197)
        for message in messages:
            self.scheduler.run_until(self.scheduler.now_us + 10_000)
            self.scheduler.deliver(self.channel, codec.encode(message))
        return list(self.records)


@cache
def vehicles(kind: int) -> list[Recorded]:
    # Later ones log where the camera is with each body odometry.
    return [Recorded(name, kind) for name, firmware in PROFILES.items() if not firmware.log.fills_odometry]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [1, 2, 3])
@settings(suppress_health_check=[HealthCheck.too_slow])
@given(messages=st.lists(MESSAGES, min_size=1, max_size=6))
def test_records_are_the_same_in_all_firmware_before_4_7(kind: int, messages: list[Message]) -> None:
    # The vehicles live on from example to example: all have had the same stream, however long it is.
    first, *others = (one.feed(messages) for one in vehicles(kind))
    assert all(records == first for records in others)


@pytest.mark.parametrize("kind", [1, 2, 3])
def test_records_are_there_to_be_compared(kind: int) -> None:
    pose = ODOMETRY(1, 20, 12, 1, 2, 3, (1, 0, 0, 0), 0, 0, 0, 0, 0, 0, (0.0,) * 21, (0.0,) * 21, 0, 2, 50)
    records = Recorded(JULY_2025.name, kind).feed([pose])
    assert {"REPH", "VISP", "REVH", "VISV"} <= {name for name, *_ in records}

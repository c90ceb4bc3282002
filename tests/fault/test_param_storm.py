# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Three clients set, read and list parameters as fast as they can: every answer is right, and memory stays."""

import math
import random
import struct
from collections import Counter
from typing import TYPE_CHECKING

import pytest

from mav_handlers.wire.messages import PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET, PARAM_VALUE, Message

if TYPE_CHECKING:
    from tests.fault.conftest import Bench, MakeBench, Memory

LINKS = 3
STEP_MS = 50
BURST = 12
ALLOWED_GROWTH_BYTES = 150_000
# These decide who may speak, and to whom: they would end the storm.
DOORS = ("MAV_SYSID", "MAV_GCS_SYSID", "MAV_OPTIONS", "MAV_TELEM_DELAY", *(f"MAV{n}_OPTIONS" for n in (1, 2, 3)))
STRANGE_VALUES = (0.0, -1.0, 1e9, -3e38, 1e-40, math.nan, math.inf, -math.inf)


class Storm:
    """Draws requests for parameters, from a seed."""

    def __init__(self, bench: "Bench", seed: int) -> None:
        self._source = random.Random(seed)
        self._names = [param.name for param in bench.vehicle.params if param.name not in DOORS]

    def _value(self) -> float:
        if self._source.random() < 0.2:
            return self._source.choice(STRANGE_VALUES)
        if self._source.random() < 0.2:
            return float(struct.unpack("<f", self._source.randbytes(4))[0])
        return float(self._source.randrange(-2, 200))

    def _name(self) -> str:
        if self._source.random() < 0.1:
            return "".join(chr(self._source.randrange(32, 127)) for _ in range(self._source.randrange(17)))
        return self._source.choice(self._names)

    def request(self) -> Message:
        """Return one request."""
        draw = self._source.random()
        if draw < 0.5:
            return PARAM_SET(1, 1, self._name(), self._value(), self._source.randrange(256))
        if draw < 0.75:
            return PARAM_REQUEST_READ(1, 1, self._name(), -1)
        if draw < 0.995:
            return PARAM_REQUEST_READ(1, 1, "", self._source.randrange(-1, 400))
        return PARAM_REQUEST_LIST(1, 1)


def rage(bench: "Bench", storm: Storm, duration_ms: int) -> None:
    """Let all clients send a burst of requests again and again."""
    for _ in range(duration_ms // STEP_MS):
        for link in range(LINKS):
            bench.send(link, *(storm.request() for _ in range(BURST)))
        bench.run_ms(STEP_MS)
        bench.read_all()


def check_list(bench: "Bench") -> None:
    """A list that is asked for after the storm has each parameter once, with the value that it has."""
    bench.run_ms(3000)
    bench.read_all()
    bench.send(1, PARAM_REQUEST_LIST(1, 1))
    bench.run_ms(3000)
    values = [message for message in bench.read(1) if isinstance(message, PARAM_VALUE)]
    wanted = {param.name: float(param.value) for param in bench.vehicle.params}
    assert {value.param_id: value.param_value for value in values} == pytest.approx(wanted, rel=1e-7)
    assert Counter(value.param_index for value in values) == Counter(range(len(wanted)))


@pytest.mark.slow
def test_storm_of_parameter_requests_leaves_legal_values_and_whole_files(make_bench: "MakeBench") -> None:
    bench = make_bench(links=LINKS)
    rage(bench, Storm(bench, 7), 500)
    check_list(bench)
    bench.check_everything()


@pytest.mark.slow
def test_long_storm_of_parameter_requests_takes_no_memory(make_bench: "MakeBench", memory: "Memory") -> None:
    bench = make_bench(links=LINKS)
    storm = Storm(bench, 9)
    rage(bench, storm, 2_000)
    memory.begin()
    rage(bench, storm, 5_000)
    assert memory.growth() < ALLOWED_GROWTH_BYTES
    check_list(bench)
    bench.check_everything()


def test_value_that_survives_a_storm_survives_a_restart(make_bench: "MakeBench") -> None:
    bench = make_bench(links=LINKS)
    rage(bench, Storm(bench, 8), 500)
    bench.run_ms(1500)
    bench.vehicle.close()
    values = bench.vehicle.params.stored_values()
    assert len(values) > 50
    restarted = make_bench(links=LINKS).vehicle.params.stored_values()
    assert {**restarted, "STAT_BOOTCNT": 0} == {**values, "STAT_BOOTCNT": 0}

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The barometers of the firmware's simulator, and what is wrong with them (AP_Baro/AP_Baro_SITL.cpp)."""

from collections import deque
from typing import Final

import numpy as np

from ap_core.param import ParamTable
from ap_core.param_group import ParamGroup
from ekf_stub.inputs.measurements import BaroReading

PREFIXES: Final = ("SIM_BARO_", "SIM_BAR2_")
TIMEOUT_MS: Final = 500
HISTORY: Final = 6
"""Readings, 100 ms apart; the longest delay is 500 ms."""

_RANDOM: Final = 3  # after the sequences of other sensors


class SimulatedBarometer:
    """A barometer, set to zero by its first reading.

    FIRMWARE PARITY: a late height is interpolated between readings, 100 ms apart; the firmware's is the nearest of
    samples 10 ms apart. Heights are not made of pressures, and do not depend on temperature.

    Args:
        params: SIM_BARO_ or SIM_BAR2_.
        seed, number: of the random errors.
    """

    def __init__(self, params: ParamGroup, seed: int, number: int) -> None:
        self._params = params
        self._random = np.random.default_rng([seed, _RANDOM, number])
        self._history: deque[tuple[int, float]] = deque(maxlen=HISTORY)
        self._drift_m = self._measured_m = 0.0
        self._read_ms = 0
        self._zero_m: float | None = None
        self._last = BaroReading(-1, 0.0, is_healthy=False)

    def read(self, time_ms: int, height_m: float) -> BaroReading:
        """Return the reading at a time since boot, later than the last one, and at a true height."""
        if self._params.get_int("DISABLE"):
            has_just_read = self._last.time_ms >= 0 and time_ms - self._last.time_ms < TIMEOUT_MS
            return self._last._replace(is_healthy=has_just_read)
        self._drift_m += self._number("DRIFT") * 1e-3 * (time_ms - self._read_ms)
        self._read_ms = time_ms
        noise_m = self._number("RND") * self._random.uniform(-1.0, 1.0)
        if self._params.get_int("FREEZE") != 1:
            self._measured_m = height_m + self._drift_m + noise_m + self._number("GLITCH")
        self._history.append((time_ms, self._measured_m))
        times_ms, heights_m = np.array(self._history).T
        late_m = float(np.interp(time_ms - self._params.get_int("DELAY"), times_ms, heights_m))
        if self._zero_m is None:
            self._zero_m = late_m
        self._last = BaroReading(time_ms, float(np.float32(late_m - self._zero_m)))
        return self._last

    def _number(self, name: str) -> float:
        return float(self._params.get_float(name))


def simulated_barometers(params: ParamTable, seed: int) -> list[SimulatedBarometer]:
    """Return as many barometers as SIM_BARO_COUNT says now."""
    prefixes = PREFIXES[: max(params.get_int("SIM_BARO_COUNT"), 0)]
    return [SimulatedBarometer(params.group(prefix), seed, number) for number, prefix in enumerate(prefixes)]

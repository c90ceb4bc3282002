# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes parked vehicles with a filter; each lasts no longer than its test."""

import math
from collections.abc import Callable

import pytest

from tests.unit.ekf_stub.bench_rig import BenchRig
from viso.firmware.releases import DEFAULT, Firmware
from viso.vehicle.sensors.errors import NO_ERRORS, SensorErrors
from viso.vehicle.sensors.source import ImuOptions


@pytest.fixture(scope="session")
def make_bench() -> Callable[..., BenchRig]:
    """Return a function that makes a vehicle from its sources and parameters, on sensors without errors by default.

    It boots, or has run for as long as is said.
    """

    def make(
        sources: str = "66666",
        *,
        has_compass: bool = False,
        heading_deg: float = 0.0,
        errors: SensorErrors = NO_ERRORS,
        run_s: float = 0.0,
        firmware: Firmware = DEFAULT,
        **params: float,
    ) -> BenchRig:
        options = ImuOptions(heading_rad=math.radians(heading_deg), errors=errors)
        rig = BenchRig(sources, has_compass=has_compass, options=options, params=params, firmware=firmware)
        if run_s:
            rig.run_to(run_s)
        return rig

    return make

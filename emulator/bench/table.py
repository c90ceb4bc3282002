# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The benches: one row each."""

from collections.abc import Mapping
from typing import Final

from emulator.bench import codec, ekf_step, endpoint, full_vehicle, port, vio
from emulator.bench.measure import Bench

BENCHES: Final[Mapping[str, Bench]] = {
    "loop": Bench(
        "virtual time of a vehicle: filter, log, 30 Hz ODOMETRY, no telemetry", "s simulated", full_vehicle.prepare
    ),
    "endpoint": Bench("frames through the endpoint", "frames", endpoint.prepare),
    "port": Bench("poses through the ported library", "poses", port.prepare),
    "ekf_step": Bench("the filter in a pass of the main loop", "passes", ekf_step.prepare),
    "vio": Bench("frames through the baseline strategy", "frames", vio.prepare),
    "codec": Bench("messages through the codec", "messages", codec.prepare),
}

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The benches: one row each."""

from collections.abc import Mapping
from typing import Final

from viso.bench import (
    codec,
    ekf_step,
    endpoint,
    full_vehicle,
    growth,
    log_columns,
    port,
    startup,
    versus_pymavlink,
    vio,
)
from viso.bench.measure import Bench

BENCHES: Final[Mapping[str, Bench]] = {
    "loop": Bench(
        "virtual time of a vehicle: filter, log, 30 Hz ODOMETRY, no telemetry", "s simulated", full_vehicle.prepare
    ),
    "endpoint": Bench("frames through the endpoint", "frames", endpoint.prepare),
    "message": Bench(
        "a message from its bytes to its log records, without a filter's step",
        "messages",
        versus_pymavlink.prepare,
        beside="pymavlink's parse of the same bytes",
    ),
    "growth": Bench(
        "the same, of more and more messages", "messages", growth.prepare, beside="as many times the 100 messages"
    ),
    "port": Bench("poses through the ported library", "poses", port.prepare),
    "log": Bench(
        "records of a log as columns, every value",
        "records",
        log_columns.prepare,
        beside="record by record: DFReader's recv_msg",
    ),
    "ekf_step": Bench("the filter in a pass of the main loop", "passes", ekf_step.prepare),
    "vio": Bench("frames through the baseline strategy", "frames", vio.prepare),
    "codec": Bench("messages through the codec", "messages", codec.prepare),
    "startup": Bench("processes from their start, by the wall clock", "starts", startup.prepare, waits=True),
}

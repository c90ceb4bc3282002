# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every bench runs, and measures what it says."""

import math
import time
from pathlib import Path

import pytest

from ap_core.verdict import Outcome
from ekf_stub.inputs.ingest_rules import FUSED
from mav_handlers.handlers.vision import odometry_frames_accepted
from viso.bench import ekf_step, growth, startup, versus_pymavlink
from viso.bench.full_vehicle import WARM_UP_MESSAGES, FullVehicle
from viso.bench.log_columns import log_of, read_all
from viso.bench.logging_vehicle import LoggingVehicle
from viso.bench.measure import measure
from viso.bench.odometry import PERIOD_US, odometry_at
from viso.bench.table import BENCHES
from viso.bench.vio_flight import FlownStrategy
from viso.companion.vio.types import VioState
from viso.companion.world.ground import generate_texture
from viso.logs.files import LogStore

PARTS = {
    "loop": {"yaw of the camera", "yaw of the compass"},
    "endpoint": {"ATTITUDE, not acted on", "TIMESYNC, answered", "ODOMETRY with covariance"},
    "message": set(versus_pymavlink.MESSAGES),
    "growth": {growth.name_of(times) for times in growth.TIMES},
    "port": {"MAV", "IntelT265"},
    "log": {"read", "read, 10 times as many"},
    "ekf_step": {ekf_step.NO_STEP, ekf_step.STEP, ekf_step.FUSING_STEP},
    "vio": {"640x480", "5472x3648, BGR"},
    "codec": {"ODOMETRY to bytes", "bytes to ODOMETRY"},
    "startup": {*startup.HELP, startup.FIRST_ACCEPTED},
}
SLOW = {"startup", "growth"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in BENCHES]
)
def test_bench_gives_a_figure_for_each_of_its_parts(name: str) -> None:
    figures = measure(BENCHES[name], 0.0, time.perf_counter)
    assert {figure.name for figure in figures} == PARTS[name]
    for figure in figures:
        assert 0 < figure.cost_us <= figure.typical_cost_us < math.inf
        assert figure.per_second == pytest.approx(1e6 / figure.cost_us)
        assert 0 < figure.turns < math.inf
        assert figure.unit == BENCHES[name].unit
        assert (figure.ratio is not None) == bool(BENCHES[name].beside)


@pytest.mark.parametrize("yaw_source", [1, 6])
def test_vehicle_fuses_what_it_is_sent_and_logs(tmp_path: Path, yaw_source: int) -> None:
    run = FullVehicle(yaw_source, tmp_path)
    run.run(WARM_UP_MESSAGES, lambda: 0.0)
    counts = run.vehicle.ahrs.ext_nav_counts
    before = {kind: counts[kind, FUSED.code] for kind in ("pose", "velocity", "yaw")}
    part = run.run(30, lambda: 0.0)
    run.vehicle.close()
    fused = {kind: counts[kind, FUSED.code] - before[kind] for kind in before}
    # What is on its way to the horizon comes with the next messages.
    assert fused["pose"] == pytest.approx(30, abs=2)
    assert fused["velocity"] == pytest.approx(30, abs=2)
    assert (fused["yaw"] > 0) == (yaw_source == 6)
    assert part.amount == pytest.approx(30 * PERIOD_US * 1e-6)
    assert LogStore(tmp_path).log_numbers() == [1]


def test_filter_at_rest_fuses_each_sample() -> None:
    rig = ekf_step.FilterAtRest()
    for _ in range(ekf_step.WARM_UP_FRAMES):
        rig.run_frame(lambda: 0.0)
    kinds = [rig.run_frame(lambda: 0.0)[0] for _ in range(13 * 30)]
    assert kinds.count(ekf_step.FUSING_STEP) == pytest.approx(30, abs=1)
    assert kinds.count(ekf_step.FUSING_STEP) + kinds.count(ekf_step.STEP) == pytest.approx(13 * 30 / 5, abs=1)


def test_messages_that_are_compared_with_pymavlink_are_logged_and_parsed() -> None:
    vehicle = LoggingVehicle()
    for make in versus_pymavlink.MESSAGES.values():
        frames = vehicle.frames(make, 3)
        records, size = vehicle.vehicle.logger.records, vehicle.log.size
        vehicle.take(frames, lambda: 0.0)
        assert vehicle.vehicle.logger.records >= records + 3
        assert vehicle.log.size > size
        accepted = [event.verdict.outcome for event in iter(vehicle.vehicle.endpoint.next_event, None)]
        assert accepted == [Outcome.ACCEPTED] * 3


def test_odometry_is_what_the_autopilot_takes() -> None:
    message = odometry_at(1_000_000)
    assert odometry_frames_accepted(message)
    assert not math.isnan(message.pose_covariance[0])


@pytest.mark.parametrize("enlargement", [1, 2])
def test_strategy_of_the_bench_tracks(enlargement: int) -> None:
    flown = FlownStrategy(generate_texture(), 320, 240, enlargement)
    for _ in range(5):
        flown.run(lambda: 0.0)
    health = flown.strategy.health_snapshot()
    assert (health.state, health.consecutive_lost) == (VioState.TRACKING, 0)


def test_log_of_the_bench_is_read() -> None:
    assert read_all(log_of(400)) > 400

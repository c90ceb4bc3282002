# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every bench runs, and measures what it says."""

import json
import math
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pyperf
import pytest

from ap_core.verdict import Outcome
from ekf_stub.inputs.ingest_rules import FUSED
from mav_handlers.handlers.vision import odometry_frames_accepted
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ODOMETRY
from tests.places import ROOT
from tools.bench import memory, startup
from tools.bench.logs import log_of, read_all
from tools.bench.messages import BOOTED_US, Frames, LoggingVehicle, parse
from tools.bench.odometry import odometry_at
from tools.bench.table import BENCHES
from tools.bench.vehicles import WARM_UP_MESSAGES, FullVehicle
from tools.bench.vio_flight import FlownStrategy
from viso.companion.vio.types import VioState
from viso.companion.world.ground import generate_texture
from viso.errors import InputError
from viso.logs.files import LogStore

QUICK = {"filter", "message", "parse", "log", "dfreader"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in BENCHES]
)
def test_round_of_a_bench_takes_time(name: str) -> None:
    with ExitStack() as stack:
        do_round = BENCHES[name].prepare(stack)
        assert 0 < do_round() < math.inf


def test_what_benches_are_compared_with_is_a_bench_in_the_same_unit() -> None:
    assert all(BENCHES[row.beside].unit == row.unit for row in BENCHES.values() if row.beside)


@pytest.mark.slow
def test_benches_that_are_named_are_written_to_a_file(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tools.bench", "parse", "log", "--debug-single-value", "-o", "speed.json"]
    command[-1] = str(tmp_path / command[-1])
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, timeout=120)
    suite = pyperf.BenchmarkSuite.load(command[-1])
    assert suite.get_benchmark_names() == ["parse", "log"]
    assert {"commit", "packages", "cpu_count", "python_version"} <= suite.get_metadata().keys()


@pytest.mark.slow
def test_bench_that_does_not_exist_is_told() -> None:
    command = [sys.executable, "-m", "tools.bench", "nosuch"]
    done = subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert "no such bench: nosuch" in done.stderr


@pytest.mark.slow
def test_vehicle_fuses_what_it_is_sent_and_logs(tmp_path: Path) -> None:
    run = FullVehicle(tmp_path)
    run.run(WARM_UP_MESSAGES)
    counts = run.vehicle.ahrs.ext_nav_counts
    before = {kind: counts[kind, FUSED.code] for kind in ("pose", "velocity", "yaw")}
    run.run(30)
    run.vehicle.close()
    fused = {kind: counts[kind, FUSED.code] - before[kind] for kind in before}
    # What is on its way to the horizon comes with the next messages.
    assert fused["pose"] == pytest.approx(30, abs=2)
    assert fused["velocity"] == pytest.approx(30, abs=2)
    assert fused["yaw"] > 0
    assert LogStore(tmp_path).log_numbers() == [1]


def test_messages_are_accepted_and_logged() -> None:
    vehicle = LoggingVehicle()
    records, size = vehicle.vehicle.logger.records, vehicle.log.size
    vehicle.take(3)
    assert vehicle.vehicle.logger.records >= records + 3
    assert vehicle.log.size > size
    accepted = [event.verdict.outcome for event in iter(vehicle.vehicle.endpoint.next_event, None)]
    assert accepted == [Outcome.ACCEPTED] * 3


def test_what_pymavlink_parses_is_the_same_messages() -> None:
    frames, receiver = Frames(BOOTED_US).next(2), Codec(1, 1)
    assert parse(frames) > 0
    receiver.feed(b"".join(frame for _, frame in frames))
    received = [one.message for one in iter(receiver.next_received, None) if isinstance(one, Received)]
    assert [type(message) for message in received] == [ODOMETRY, ODOMETRY]


def test_odometry_is_what_the_autopilot_takes() -> None:
    message = odometry_at(1_000_000)
    assert odometry_frames_accepted(message)
    assert not math.isnan(message.pose_covariance[0])


@pytest.mark.slow
@pytest.mark.parametrize("enlargement", [1, 2])
def test_strategy_of_the_bench_tracks(enlargement: int) -> None:
    flown = FlownStrategy(generate_texture(), 320, 240, enlargement)
    for _ in range(5):
        flown.run()
    health = flown.strategy.health.snapshot()
    assert (health.state, health.consecutive_lost) == (VioState.TRACKING, 0)


def test_log_of_the_bench_is_read() -> None:
    assert read_all(log_of(400)) > 400


@pytest.mark.slow
def test_time_counts_until_a_message_is_accepted(tmp_path: Path) -> None:
    assert startup.serve_until_accepted(tmp_path) > 0
    assert (tmp_path / "storage.parm").exists()


@pytest.mark.slow
def test_autopilot_that_does_not_start_is_told() -> None:
    with pytest.raises(InputError, match="viso serve has ended before it connected"):
        startup.serve_until_accepted(Path("/dev/null/logs"))


@pytest.mark.slow
def test_memory_is_told_of_each_minute(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(memory, "MINUTE_S", 5)
    memory.main(["2"])
    first, second = json.loads(capsys.readouterr().out)
    assert (first["minute"], second["minute"]) == (1, 2)
    assert first["blocks"] > 0
    assert first["rss_mib"] > 0
    assert second["log_mib"] > first["log_mib"]

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a running vehicle says."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs, RecordedStates
from ekf_stub.inputs.ingest_rules import FilterOutcome
from mav_handlers.endpoint import MessageEvent
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE
from tests.unit.viso.conftest import BOOTED_US, Bench
from viso.running.virtual_time import Scheduler
from viso.terminal.console import out
from viso.terminal.live_report import LiveReport
from viso.vehicle.vehicle import Vehicle, VehicleConfig


def at(after_boot_s: float) -> str:
    """Return how a line of that time begins."""
    return f"{BOOTED_US / 1e6 + after_boot_s:9.3f} s  "


@pytest.mark.slow
def test_first_verdict_of_each_kind_is_told(
    make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]
) -> None:
    bench = make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50, EK3_SRC1_YAW=6)
    bench.see(0.2)
    LiveReport(out).watch(bench.vehicle)
    bench.run_for(1.0)
    capsys.readouterr()
    bench.see(0.2)
    bench.see(0.2, quality=5)
    lines = [line for line in capsys.readouterr().out.splitlines() if "filter: " not in line]
    assert lines == [f"{at(1.4)}first ODOMETRY ignored: quality is below VISO_QUAL_MIN"]


def test_texts_are_told_with_time_and_severity(
    make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]
) -> None:
    bench = make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50)
    LiveReport(out).watch(bench.vehicle)
    bench.vehicle.texts.send_text(2, "Hello")
    assert capsys.readouterr().out == f"{at(0.0)}(2) Hello\n"


def test_listeners_are_told_of_every_message_with_its_link(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50)
    heard: list[tuple[str, MessageEvent]] = []
    LiveReport(out, [lambda link, event: heard.append((link, event))] * 2).watch(bench.vehicle)
    bench.see(0.1)
    assert [(link, event.name) for link, event in heard] == [("client", "ODOMETRY")] * 4


def test_restart_is_told(make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]) -> None:
    report = LiveReport(out)
    report.watch(make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50).vehicle)
    report.watch(make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50).vehicle)
    assert capsys.readouterr().out == f"{at(0.0)}restart\n"


# Samples in the filter


def test_first_outcome_of_each_kind_that_is_not_use_is_told(
    make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]
) -> None:
    bench = make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50)
    LiveReport(out).watch(bench.vehicle)
    bench.see(0.2)
    why = "refused: no source set named external navigation at boot (exact)"
    assert capsys.readouterr().out.splitlines() == [
        f"{at(0)}filter: first {kind} {why}" for kind in ("pose", "yaw", "velocity")
    ]


def test_start_of_the_filter_is_one_line(make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]) -> None:
    bench = make_bench(VISO_TYPE=1, EK3_SRC1_POSXY=6, EK3_SRC1_VELXY=6, EK3_SRC1_YAW=6, GPS1_TYPE=0)
    LiveReport(out).watch(bench.vehicle)
    bench.see(2.5)  # the filter's cores are there before they have a state
    (told,) = [line for line in capsys.readouterr().out.splitlines() if "filter:" in line]
    assert told.endswith(" s  filter: starting; until it is aligned, some 6 s after boot, it uses no sample")


def test_camera_may_send_before_the_filter_has_a_state(capsys: pytest.CaptureFixture[str]) -> None:
    vehicle = Vehicle(VehicleConfig(defaults={"VISO_TYPE": 1, "EK3_SRC1_POSXY": 6, "GPS1_TYPE": 0}))
    channel, scheduler, codec = vehicle.endpoint.open_channel("camera"), Scheduler(vehicle), Codec(1, 197)
    LiveReport(out).watch(vehicle)
    while vehicle.ahrs.get_filter_status() is None or scheduler.now_us < 4_600_000:
        scheduler.run_until(scheduler.now_us + 100_000)
        scheduler.deliver(channel, codec.encode(VISION_POSITION_ESTIMATE(scheduler.now_us, 0, 0, 0, 0, 0, 0)))
    (told,) = [line for line in capsys.readouterr().out.splitlines() if "filter:" in line]
    assert "filter: starting" in told


@pytest.mark.slow
def test_sample_that_stays_unused_is_told_once_the_filter_has_started(
    make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]
) -> None:
    bench = make_bench(VISO_TYPE=1, EK3_SRC2_POSXY=6)
    LiveReport(out).watch(bench.vehicle)
    bench.see(9.0)
    told = [line for line in capsys.readouterr().out.splitlines() if "filter: first" in line]
    assert any("first pose unused" in line for line in told)


@pytest.mark.slow
def test_rejected_sample_is_told_as_a_models_opinion(
    make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]
) -> None:
    bench = make_bench(VISO_TYPE=1, EK3_SRC1_POSXY=6, EK3_SRC1_VELXY=6, EK3_SRC1_YAW=6, GPS1_TYPE=0)
    bench.see(2.0)
    LiveReport(out).watch(bench.vehicle)
    bench.see(0.5, x=30.0)
    (line,) = capsys.readouterr().out.splitlines()
    assert "filter: first pose rejected: horizontal position gate, ratio " in line
    assert line.endswith(" (a model's)")


def test_filter_listeners_are_told_of_every_outcome_with_its_time(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50)
    heard: list[tuple[int, FilterOutcome]] = []
    LiveReport(out, [], [lambda now_us, outcome: heard.append((now_us, outcome))] * 2).watch(bench.vehicle)
    bench.see(0.05)
    assert [(now_us, outcome.kind) for now_us, outcome in heard] == [
        (BOOTED_US, kind) for kind in ("pose", "pose", "yaw", "yaw", "velocity", "velocity")
    ]


def test_vehicle_without_a_filter_is_reported_on_as_well(
    make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]
) -> None:
    at_rest = RecordedStates(np.zeros(1), np.zeros((1, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), math.inf)
    bench = make_bench(
        make_ahrs=lambda vehicle: RecordedAhrs(vehicle.clock, vehicle.sources, vehicle.replay_log, at_rest), VISO_TYPE=1
    )
    LiveReport(out).watch(bench.vehicle)
    bench.see(0.2)
    assert capsys.readouterr().out == ""

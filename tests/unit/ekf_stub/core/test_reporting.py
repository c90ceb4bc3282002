# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a core says of itself."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.location import Location
from ekf_stub.core.reporting import report_of, run_report_of, three
from ekf_stub.filter.inertial import GRAVITY_MSS
from ekf_stub.reports.core_report import CoreReport

if TYPE_CHECKING:
    from tests.unit.ekf_stub.core_rig import CoreRig

MakeCore = Callable[..., "CoreRig"]

HOME = Location(-353632610, 1491652300, 58400)


@pytest.fixture(scope="module")
def rig(make_core: MakeCore) -> "CoreRig":
    """Return a core that navigates a vehicle at (1, 2, -0.5) that is tilted a little and heads east."""
    rig = make_core(run_s=0.0)
    tilt = math.radians(3)
    rig.accel = (GRAVITY_MSS * math.sin(tilt), 0.0, -GRAVITY_MSS * math.cos(tilt))
    rig.run_for(3.0)
    rig.stream(2.0, lambda: rig.pose(1, 2, -0.5, yaw=math.pi / 2), rig.speed)
    return rig


@pytest.fixture
def report(rig: "CoreRig") -> CoreReport:
    return report_of(rig.core, rig.now_ms)


def test_attitude_is_that_of_the_outputs(rig: "CoreRig", report: CoreReport) -> None:
    assert [math.degrees(angle) for angle in report.rpy_rad] == pytest.approx([0, 3, 90], abs=0.3)
    quat = rig.core.output.now.quat
    assert report.quat_wxyz == (quat.w, quat.x, quat.y, quat.z)
    assert math.hypot(*report.quat_wxyz) == pytest.approx(1)


def test_position_and_velocity_are_those_of_the_outputs(rig: "CoreRig", report: CoreReport) -> None:
    assert report.pos_ned == pytest.approx((1, 2, -0.5), abs=0.05)
    assert report.pos_ned == tuple(rig.core.output.now.pos)
    assert report.vel_ned == pytest.approx((0, 0, 0), abs=0.05)
    assert report.height_rate == rig.core.output.height_rate


def test_biases_are_rates(rig: "CoreRig", report: CoreReport) -> None:
    assert report.gyro_bias == pytest.approx(rig.core.state.gyro_bias / rig.core.dt_ekf_avg)
    assert report.accel_bias == pytest.approx(rig.core.state.accel_bias / rig.core.dt_ekf_avg)


def test_innovations_and_ratios_are_those_of_the_last_tests(rig: "CoreRig", report: CoreReport) -> None:
    innovations = rig.core.fusion.innovations
    assert report.vel_innovation == tuple(innovations.vel)
    assert report.pos_innovation == tuple(innovations.pos)
    ratios = innovations.vel_ratio, innovations.pos_ratio, innovations.height_ratio
    assert (report.vel_ratio, report.pos_ratio, report.height_ratio) == ratios
    assert (report.yaw_innovation, report.yaw_ratio) == (rig.core.yaw.innovation, rig.core.yaw.ratio)


def test_reset_of_position_is_told_by_how_far_it_went(report: CoreReport) -> None:
    assert report.moved_ne == pytest.approx((1, 2), abs=0.05)


def test_state_of_the_core_is_told(report: CoreReport) -> None:
    assert (report.flags, report.timeouts, report.faults) == (0x1233F, 48, 0)
    assert report.source_set == 0
    assert (report.odometry, report.origin_alt_cm) == (None, 0)
    assert report.stillness is not None


def test_variances_are_of_the_firmwares_24_states(rig: "CoreRig", report: CoreReport) -> None:
    assert len(report.variances) == 24
    assert report.variances[:16] == tuple(rig.core.state.cov.diagonal()[:16])
    assert report.variances[22:] == (0, 0)


def test_error_of_tilt_is_an_angle(rig: "CoreRig", report: CoreReport) -> None:
    assert report.tilt_error_rad == pytest.approx(math.sqrt(rig.core.state.predicted_tilt_variance))
    assert 0 < report.tilt_error_rad < math.radians(5)


def test_errors_of_the_outputs_are_told(rig: "CoreRig", report: CoreReport) -> None:
    output = rig.core.output
    assert (report.angle_error, report.vel_error, report.pos_error) == (
        output.angle_error,
        output.vel_error,
        output.pos_error,
    )


def test_report_of_a_running_core_is_part_of_the_whole(rig: "CoreRig", report: CoreReport) -> None:
    running = run_report_of(rig.core)
    assert (running.tilt_error_rad, running.stillness) == (report.tilt_error_rad, report.stillness)


def test_height_of_the_origin_is_told(make_core: MakeCore) -> None:
    rig = make_core()
    rig.core.set_origin(HOME)
    assert report_of(rig.core, rig.now_ms).origin_alt_cm == 58400


def test_test_for_stillness_that_rests_is_not_told(make_core: MakeCore) -> None:
    rig = make_core()
    rig.frame["armed"] = True
    rig.run_for(0.01)
    assert report_of(rig.core, rig.now_ms).stillness is None


def test_vector_becomes_plain_numbers() -> None:
    x, y, z = three(np.array([1.0, 2.0, 3.0]))
    assert (x, y, z) == (1, 2, 3)
    assert {type(x), type(y), type(z)} == {float}

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What keeps a parked vehicle from arming."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.unit.ekf_stub.bench_rig import BenchRig

MakeBench = Callable[..., "BenchRig"]


@pytest.mark.parametrize(("time_s", "failure"), [
    (3.0, "EKF3 not started"),
    (4.456, "EKF3 not started"),
    (4.46, "EKF3 still initialising"),
    (5.45, "EKF3 still initialising"),
    (5.46, None),
])  # fmt: skip
def test_estimator_must_run_before_arming(make_bench: MakeBench, time_s: float, failure: str | None) -> None:
    bench = make_bench()
    bench.run_to(time_s)
    assert bench.ahrs.pre_arm_failure(requires_position=True) == failure
    assert bench.ahrs.healthy() is (failure is None)


def test_simple_estimate_will_not_do_with_a_compass(make_bench: MakeBench) -> None:
    bench = make_bench(has_compass=True)
    bench.run_to(4)
    assert bench.ahrs.pre_arm_failure(requires_position=True) == "not using configured AHRS type"


def test_gps_is_told_of_while_the_estimator_is_young(make_bench: MakeBench) -> None:
    bench = make_bench("30101", has_compass=True)
    bench.run_to(4.9)
    bench.fix(fix_type=1)
    bench.run_to(5)
    assert bench.ahrs.pre_arm_failure(requires_position=True) == "Waiting for 3D fix"


def test_sources_are_checked_before_arming(make_bench: MakeBench) -> None:
    bench = make_bench("50000")
    bench.run_to(6)
    assert bench.ahrs.pre_arm_failure(requires_position=False) is None
    assert bench.ahrs.pre_arm_failure(requires_position=True) == "Check EK3_SRC1_POSXY"


def test_sensors_are_checked_before_arming(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.has_camera = False
    bench.run_to(6)
    assert bench.ahrs.pre_arm_failure(requires_position=False) == "EK3 sources require VisualOdom"


@pytest.mark.parametrize(("mag_cal", "yaw", "failure"), [
    (5, 1, "EK3_MAG_CAL and EK3_SRC1_YAW inconsistent"),
    (6, 6, "EK3_MAG_CAL and EK3_SRC1_YAW inconsistent"),
    (6, 2, None),
    (4, 1, None),
])  # fmt: skip
def test_old_way_of_external_yaw_is_refused(make_bench: MakeBench, mag_cal: int, yaw: int, failure: str | None) -> None:
    bench = make_bench(f"0000{yaw}", EK3_MAG_CAL=mag_cal)
    bench.run_to(6)
    assert bench.ahrs.pre_arm_failure(requires_position=False) == failure

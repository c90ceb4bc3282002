# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""AHRS_EKF_TYPE: which estimator the vehicle uses, as simulators of 4.6.3, of July 2025 and of 4.7 did.

Each was set up for a camera alone, booted with a value, sent ODOMETRY and an origin, and asked to arm.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from mav_handlers.wire.messages import EKF_STATUS_REPORT, LOCAL_POSITION_NED, SET_GPS_GLOBAL_ORIGIN
from viso.firmware.releases import PROFILES
from viso.vehicle.vehicle import LOOP_PERIOD_US

if TYPE_CHECKING:
    from tests.unit.viso.conftest import Bench

MakeBench = Callable[..., "Bench"]

CAMERA = {
    "VISO_TYPE": 1,
    "GPS1_TYPE": 0,
    **dict.fromkeys(("EK3_SRC1_POSXY", "EK3_SRC1_VELXY", "EK3_SRC1_POSZ", "EK3_SRC1_VELZ", "EK3_SRC1_YAW"), 6),
}
ARM, SET_MODE, SET_MESSAGE_INTERVAL = 400, 176, 511
LOCAL_POSITION, STATUS_REPORT = 32, 193
ACCEPTED, FAILED = 0, 4
STABILIZE, ALT_HOLD, GUIDED = 0, 2, 4
ATTITUDE_BAD, ALT, HOME = "Arm: EKF attitude is bad", "Arm: Need Alt Estimate", "Arm: AHRS: waiting for home"
ANOTHER_TYPE = "Arm: AHRS: not using configured AHRS type"
SETTLED_S = 23.0
SETTLING_PERIOD_US = 10_000
TRUTH_FLAGS = 895


def settled(make_bench: MakeBench, value: int, release: str = "2025-07") -> "Bench":
    """Return a vehicle that has seen its camera until everything has settled, and has been sent an origin."""
    bench = make_bench(boot=False, firmware=PROFILES[release], AHRS_EKF_TYPE=value, **CAMERA)
    bench.scheduler.period_us = SETTLING_PERIOD_US
    bench.run_to(SETTLED_S - 2.0)
    bench.scheduler.period_us = LOOP_PERIOD_US
    bench.see(2.0, x=1.0, y=2.0, z=-0.5)
    bench.send(SET_GPS_GLOBAL_ORIGIN(1, -353632610, 1491652300, 584000))
    bench.see(0.3, x=1.0, y=2.0, z=-0.5)
    for number in (LOCAL_POSITION, STATUS_REPORT):
        assert bench.command(SET_MESSAGE_INTERVAL, number, 100_000) == ACCEPTED
    return bench


def armed_in(bench: "Bench", mode: int) -> tuple[int, list[str]]:
    """Return the result of arming in a mode, and why it failed; the vehicle is disarmed then."""
    assert bench.command(SET_MODE, 1, mode) == ACCEPTED
    bench.see(0.3, x=1.0, y=2.0, z=-0.5)
    bench.texts.clear()
    result = bench.command(ARM, 1)
    said = [text for _, _, text in bench.texts if text.startswith("Arm: ")]
    bench.command(ARM, 0)
    return result, said


def of_estimators(bench: "Bench") -> list[str]:
    return [text for _, _, text in bench.texts if text.startswith("AHRS: ") and text.endswith(" active")]


@pytest.mark.parametrize(("value", "release", "announced", "failure"), [
    (0, "4.6", [], ANOTHER_TYPE),  # it counts as running on DCM from the start
    (0, "2025-07", [], ANOTHER_TYPE),
    (0, "4.7", [], ANOTHER_TYPE),
    (5, "2025-07", ["AHRS: DCM active"], ANOTHER_TYPE),
    (11, "2025-07", [], "Arm: AHRS: ExternalAHRS: Invalid backend"),
])  # fmt: skip
def test_vehicle_without_its_estimator_has_no_position_and_does_not_arm(
    make_bench: MakeBench, value: int, release: str, announced: list[str], failure: str
) -> None:
    bench = settled(make_bench, value, release)
    assert of_estimators(bench) == announced
    assert "EKF3 IMU0 is using external nav data" in [text for _, _, text in bench.texts]
    assert armed_in(bench, STABILIZE) == (FAILED, [ATTITUDE_BAD, failure])
    assert armed_in(bench, ALT_HOLD) == (FAILED, [ALT, ATTITUDE_BAD, failure])
    assert armed_in(bench, GUIDED) == (FAILED, [ALT, ATTITUDE_BAD, HOME])
    bench.received()
    bench.see(1.0)
    kinds = {type(message) for message in bench.received()}
    assert not kinds & {LOCAL_POSITION_NED, EKF_STATUS_REPORT}


def test_truth_is_that_of_the_simulator(make_bench: MakeBench) -> None:
    bench = settled(make_bench, 10)
    assert of_estimators(bench) == []
    for mode in (STABILIZE, ALT_HOLD, GUIDED):
        assert armed_in(bench, mode) == (ACCEPTED, [])
    bench.received()
    bench.see(1.0, x=1.0, y=2.0, z=-0.5)
    sent = bench.received()
    (place, *_) = (message for message in sent if isinstance(message, LOCAL_POSITION_NED))
    assert (place.x, place.y, place.z) == (0.0, 0.0, 0.0)  # whatever the camera says
    (report, *_) = (message for message in sent if isinstance(message, EKF_STATUS_REPORT))
    assert (report.flags, report.velocity_variance, report.compass_variance) == (TRUTH_FLAGS, 0.0, 0.0)


def test_ekf2_gives_way_to_ekf3_at_boot(make_bench: MakeBench) -> None:
    bench = settled(make_bench, 2)
    assert bench.vehicle.params.get_int("AHRS_EKF_TYPE") == 3
    assert of_estimators(bench) == ["AHRS: DCM active", "AHRS: EKF3 active"]
    assert armed_in(bench, GUIDED) == (ACCEPTED, [])


@pytest.mark.parametrize(("value", "text"), [(0, "DCM"), (2, "DCM"), (10, "SIM"), (11, "External")])
def test_change_on_the_way_is_announced(make_bench: MakeBench, value: int, text: str) -> None:
    bench = make_bench(firmware=PROFILES["2025-07"], **CAMERA)
    bench.set("AHRS_EKF_TYPE", value)
    bench.run_for(0.1)
    assert of_estimators(bench) == [f"AHRS: {text} active"]
    bench.texts.clear()
    bench.set("AHRS_EKF_TYPE", 3)
    bench.run_for(0.1)
    assert of_estimators(bench) == ["AHRS: EKF3 active"]

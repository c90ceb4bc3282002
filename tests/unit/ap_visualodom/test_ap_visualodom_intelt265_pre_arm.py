# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The arming check of the T265 and VOXL backend: its texts, their order and their limits."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.internal_error import InternalError
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom_intelt265 import AP_VisualOdom_IntelT265

if TYPE_CHECKING:
    from tests.conftest import MakeRig, Rig

Yawed = Callable[[float], Quaternion]

BUFFER = 50  # characters that the firmware's buffer holds


def attitude(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Quaternion:
    return Quaternion.from_euler(*(f32(math.radians(angle)) for angle in (roll_deg, pitch_deg, yaw_deg)))


@pytest.fixture(params=[2, 3], ids=["T265", "VOXL"])
def rig(make_rig: "MakeRig", request: pytest.FixtureRequest) -> "Rig":
    """A vehicle that stands level and looks north, whose camera agrees."""
    rig = make_rig(TYPE=request.param)
    rig.ahrs.quat = Quaternion()
    rig.pose()
    return rig


@pytest.fixture
def check(rig: "Rig") -> Callable[[], str | None]:
    return rig.visual_odom.pre_arm_check


Check = Callable[[], str | None]


def test_agreement_passes(check: Check) -> None:
    assert check() is None


def test_silence_comes_first(rig: "Rig", check: Check) -> None:
    rig.ahrs.quat = None
    rig.at_ms(10_300)
    assert check() == "not healthy"


def test_backend_itself_asks_for_health(rig: "Rig") -> None:
    backend = AP_VisualOdom_IntelT265(rig.visual_odom)
    assert backend.pre_arm_check() == "not healthy"


def test_orientation_error_comes_second(rig: "Rig") -> None:
    # Nothing in the firmware ever sets it.
    rig.ahrs.quat = None
    rig.at_ms(0)
    backend = AP_VisualOdom_IntelT265(rig.visual_odom)
    backend._error_orientation = True
    assert backend.pre_arm_check() == "check VISO_ORIENT parameter"


def test_missing_attitude_of_the_ahrs_comes_third(rig: "Rig", check: Check) -> None:
    rig.pose(attitude=attitude(90, 0, 90))
    rig.ahrs.quat = None
    assert check() == "waiting for AHRS attitude"


def test_tilt_comes_before_yaw(rig: "Rig", check: Check) -> None:
    rig.pose(attitude=attitude(20, 0, 90))
    text = check()
    assert text is not None
    assert text.startswith("roll/pitch diff")


@pytest.mark.parametrize(
    ("angles", "text"),
    [
        ((20, 0, 0), "roll/pitch diff 20.0 deg (>10)"),
        ((0, -20, 0), "roll/pitch diff 20.0 deg (>10)"),
        ((10.06, 0, 0), "roll/pitch diff 10.1 deg (>10)"),
        ((10.002, 0, 0), "roll/pitch diff 10.0 deg (>10)"),
        ((120, 0, 0), "roll/pitch diff 120.0 deg (>10)"),
        ((0, 0, 20), "yaw diff 20.0 deg (>10)"),
        ((0, 0, -20), "yaw diff 20.0 deg (>10)"),
        ((0, 0, 10.06), "yaw diff 10.1 deg (>10)"),
        ((0, 0, 200), "yaw diff 160.0 deg (>10)"),
    ],
)
def test_difference_is_told_with_one_decimal(
    rig: "Rig", check: Check, angles: tuple[float, float, float], text: str
) -> None:
    rig.pose(attitude=attitude(*angles))
    assert check() == text


@pytest.mark.parametrize("angles", [(9.99, 0, 0), (0, 9.99, 0), (0, 0, 9.99), (0, 0, -9.99), (9, 0, 9)])
def test_difference_up_to_ten_degrees_passes(rig: "Rig", check: Check, angles: tuple[float, float, float]) -> None:
    rig.pose(attitude=attitude(*angles))
    assert check() is None


def test_attitude_of_the_ahrs_is_the_reference(rig: "Rig", check: Check) -> None:
    rig.ahrs.quat = attitude(30, 10, 120)
    rig.pose(attitude=attitude(30, 10, 125))
    assert check() is None


def test_corrected_attitude_is_compared(rig: "Rig", check: Check, yawed: Yawed) -> None:
    rig.align_ready(1.5)
    rig.ahrs.quat = yawed(1.5)
    rig.pose()
    assert check() is None


def test_withheld_pose_is_compared_too(rig: "Rig", check: Check) -> None:
    rig.set(QUAL_MIN=50)
    rig.pose(attitude=attitude(0, 0, 20), quality=0)
    assert check() == "yaw diff 20.0 deg (>10)"


def test_speed_keeps_the_check_alive_on_an_old_attitude(rig: "Rig", check: Check) -> None:
    rig.at_ms(20_000)
    rig.speed()
    assert check() is None


@pytest.mark.parametrize(("yaw_deg", "text"), [(5, None), (20, "yaw diff 20.0 deg (>10)")])
def test_without_any_pose_a_level_camera_looking_north_is_assumed(
    make_rig: "MakeRig", yaw_deg: float, text: str | None
) -> None:
    rig = make_rig(TYPE=2)
    rig.ahrs.quat = attitude(0, 0, yaw_deg)
    rig.at_ms(299)
    assert rig.visual_odom.pre_arm_check() == text


def test_attitude_that_is_nan_fails_as_sixty_degrees_of_tilt(rig: "Rig", check: Check) -> None:
    rig.pose(attitude=Quaternion(math.nan, 0, 0, 0))
    assert check() == "roll/pitch diff 60.0 deg (>10)"
    assert rig.errors.last is InternalError.CONSTRAINING_NAN


def test_check_changes_nothing(rig: "Rig", check: Check) -> None:
    rig.pose(Vector3f(1, 2, 3), attitude(20, 0, 0))
    calls, records, texts = list(rig.ahrs.calls), list(rig.records), list(rig.texts)
    assert check() == check()
    assert (rig.ahrs.calls, rig.records, rig.texts) == (calls, records, texts)


@pytest.mark.parametrize("angles", [(179, 0, 0), (0, 0, 179)])
def test_longest_text_fits_the_firmwares_buffer(rig: "Rig", check: Check, angles: tuple[float, float, float]) -> None:
    rig.pose(attitude=attitude(*angles))
    text = check()
    assert text is not None
    assert len(text) <= BUFFER

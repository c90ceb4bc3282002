# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What all backends share: health, the time of a reset, deltas, and no checks of their own."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.internal_error import InternalError
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from ap_visualodom.ap_visualodom_backend import NO_ERR, AP_VisualOdom_Backend
from ap_visualodom.verdicts import CONSUMED

if TYPE_CHECKING:
    from tests.conftest import MakeRig, Rig

WRAP_MS = 1 << 32


class Bare(AP_VisualOdom_Backend):
    """A backend with nothing of its own."""

    def handle_pose_estimate(
        self,
        remote_time_us: int,
        time_ms: int,
        pos: Vector3f,
        attitude: Quaternion,
        posErr: np.float32,
        angErr: np.float32,
        reset_counter: int,
        quality: int,
    ) -> Verdict:
        return CONSUMED

    def handle_vision_speed_estimate(
        self,
        remote_time_us: int,
        time_ms: int,
        vel: Vector3f,
        reset_counter: int,
        quality: int,
        vel_err: np.float32 = NO_ERR,
    ) -> Verdict:
        return CONSUMED


@pytest.fixture
def rig(make_rig: "MakeRig") -> "Rig":
    return make_rig(TYPE=1)


@pytest.fixture
def backend(rig: "Rig") -> Bare:
    return Bare(rig.visual_odom)


def send_delta(backend: Bare, delta_us: int = 20_000, confidence: float = 70) -> Verdict:
    return backend.handle_vision_position_delta_msg(
        delta_us, Vector3f(0.1, 0.2, 0.3), Vector3f(1, 2, 3), f32(confidence)
    )


# Health


@pytest.mark.parametrize(("time_ms", "healthy"), [(0, True), (299, True), (300, False)])
def test_backend_is_healthy_for_300_ms_after_boot_without_a_message(
    rig: "Rig", backend: Bare, time_ms: int, healthy: bool
) -> None:
    rig.at_ms(time_ms)
    assert backend.healthy() is healthy


@pytest.mark.parametrize(("age_ms", "healthy"), [(0, True), (299, True), (300, False), (301, False)])
def test_backend_is_healthy_for_300_ms_after_a_message(rig: "Rig", backend: Bare, age_ms: int, healthy: bool) -> None:
    send_delta(backend)
    rig.at_ms(10_000 + age_ms)
    assert backend.healthy() is healthy


@pytest.mark.parametrize(("age_ms", "healthy"), [(299, True), (300, False)])
def test_health_is_judged_across_the_wrap_of_milliseconds(
    rig: "Rig", backend: Bare, age_ms: int, healthy: bool
) -> None:
    sent_ms = WRAP_MS - 100
    rig.at_ms(sent_ms)
    send_delta(backend)
    rig.at_ms(sent_ms + age_ms)
    assert backend.healthy() is healthy


def test_silent_backend_looks_healthy_again_when_milliseconds_wrap(rig: "Rig", backend: Bare) -> None:
    rig.at_ms(WRAP_MS + 299)
    assert backend.healthy()


def test_health_has_the_resolution_of_milliseconds(rig: "Rig", backend: Bare) -> None:
    rig.clock.set_us(10_000_999)
    send_delta(backend)
    rig.clock.set_us(10_299_999)
    assert backend.healthy()
    rig.clock.set_us(10_300_000)
    assert not backend.healthy()


# Time of the last reset


def test_reset_time_is_zero_while_the_counter_is_zero(backend: Bare) -> None:
    assert backend.get_reset_timestamp_ms(0) == 0


def test_reset_time_is_now_when_the_first_counter_is_not_zero(backend: Bare) -> None:
    assert backend.get_reset_timestamp_ms(5) == 10_000


def test_reset_time_is_remembered_while_the_counter_stays(rig: "Rig", backend: Bare) -> None:
    backend.get_reset_timestamp_ms(5)
    rig.at_ms(11_000)
    assert backend.get_reset_timestamp_ms(5) == 10_000


@pytest.mark.parametrize("counter", [6, 4, 0, 255])
def test_reset_time_is_now_whenever_the_counter_differs(rig: "Rig", backend: Bare, counter: int) -> None:
    backend.get_reset_timestamp_ms(5)
    rig.at_ms(11_000)
    assert backend.get_reset_timestamp_ms(counter) == 11_000


def test_reset_time_wraps_with_milliseconds(rig: "Rig", backend: Bare) -> None:
    rig.at_ms(WRAP_MS + 7)
    assert backend.get_reset_timestamp_ms(1) == 7


# VISION_POSITION_DELTA


def test_delta_is_always_consumed(backend: Bare) -> None:
    assert send_delta(backend) is CONSUMED


def test_delta_is_handed_to_the_ahrs(rig: "Rig", backend: Bare) -> None:
    rig.set(DELAY_MS=35, POS=Vector3f(0.1, 0.2, 0.3))
    send_delta(backend)
    [call] = rig.odom
    assert (call.delAng, call.delPos) == (Vector3f(0.1, 0.2, 0.3), Vector3f(1, 2, 3))
    assert (float(call.quality), call.timeStamp_ms, call.delay_ms) == (70, 10_000, 35)
    assert call.posOffset == Vector3f(0.1, 0.2, 0.3)


@pytest.mark.parametrize("delta_us", [0, 1, 20_000, 16_777_217, (1 << 63) + (1 << 39) + 1, (1 << 64) - 1])
def test_duration_is_rounded_to_float32_and_then_multiplied(rig: "Rig", backend: Bare, delta_us: int) -> None:
    send_delta(backend, delta_us)
    expected = np.float32(np.uint64(delta_us)) * np.float32(1e-6)
    assert rig.odom[0].delTime == expected
    assert type(rig.odom[0].delTime) is np.float32


def test_delta_is_turned_by_the_orientation(rig: "Rig", backend: Bare) -> None:
    rig.set(ORIENT=2)
    send_delta(backend)
    [call] = rig.odom
    assert (call.delAng, call.delPos) == (Vector3f(-0.2, 0.1, 0.3), Vector3f(-2, 1, 3))


def test_camera_offset_is_not_turned(rig: "Rig", backend: Bare) -> None:
    rig.set(ORIENT=2, POS=Vector3f(1, 2, 3))
    send_delta(backend)
    assert rig.odom[0].posOffset == Vector3f(1, 2, 3)


def test_delta_is_not_scaled(rig: "Rig", backend: Bare) -> None:
    rig.set(SCALE=2)
    send_delta(backend)
    assert rig.odom[0].delPos == Vector3f(1, 2, 3)


@pytest.mark.parametrize("orientation", [44, 100, -1])
def test_delta_of_an_unknown_orientation_is_left_with_two_internal_errors(
    rig: "Rig", backend: Bare, orientation: int
) -> None:
    rig.set(ORIENT=orientation)
    send_delta(backend)
    assert rig.odom[0].delPos == Vector3f(1, 2, 3)
    assert (rig.errors.count, rig.errors.last) == (2, InternalError.BAD_ROTATION)


@pytest.mark.parametrize("confidence", [-5, 0, 100, 1e9])
def test_no_gate_applies_to_a_delta(rig: "Rig", backend: Bare, confidence: float) -> None:
    rig.set(QUAL_MIN=100)
    assert send_delta(backend, confidence=confidence) is CONSUMED
    assert rig.odom[0].quality == f32(confidence)


def test_delta_leaves_the_quality(backend: Bare) -> None:
    backend._quality = 42
    send_delta(backend)
    assert backend.quality() == 42


def test_delta_is_logged_as_it_was_handed_over(rig: "Rig", backend: Bare) -> None:
    rig.set(ORIENT=2)
    send_delta(backend)
    [fields] = rig.logged("VISO")
    [call] = rig.odom
    assert (fields["TimeUS"], fields["dt"], fields["conf"]) == (10_000_000, call.delTime, 70)
    assert (fields["AngDX"], fields["AngDY"], fields["AngDZ"]) == call.delAng.to_tuple()
    assert (fields["PosDX"], fields["PosDY"], fields["PosDZ"]) == call.delPos.to_tuple()


# Defaults that a backend may replace


def test_quality_is_unknown_at_first(backend: Bare) -> None:
    assert backend.quality() == 0


def test_there_is_no_arming_check_by_default(backend: Bare) -> None:
    assert backend.pre_arm_check() is None


def test_requests_do_nothing_by_default(rig: "Rig", backend: Bare) -> None:
    backend.request_align_yaw_to_ahrs()
    backend.align_position_to_ahrs(True, True)
    assert (rig.ahrs.calls, rig.texts, rig.records) == ([], [], [])


def test_type_is_read_from_the_parameter_at_each_use(rig: "Rig", backend: Bare) -> None:
    rig.set(TYPE=3)
    assert backend.get_type() == 3

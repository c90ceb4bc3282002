# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frontend: choice of a backend, refusal without one, and parameters as they are read."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.internal_error import InternalError
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from ap_visualodom.ap_visualodom import BACKENDS
from ap_visualodom.ap_visualodom_backend import AP_VisualOdom_Backend
from ap_visualodom.ap_visualodom_intelt265 import AP_VisualOdom_IntelT265
from ap_visualodom.ap_visualodom_mav import AP_VisualOdom_MAV
from ap_visualodom.var_info import VisualOdom_Type
from ap_visualodom.verdicts import CONSUMED, DISABLED, NO_BACKEND

if TYPE_CHECKING:
    from tests.conftest import MakeRig, Rig

Send = Callable[["Rig"], Verdict]

NAN_VECTOR = Vector3f(math.nan, math.nan, math.nan)
HUGE_VECTOR = Vector3f(3e38, -3e38, math.inf)


def pose_euler(rig: "Rig", euler_rad: Vector3f | None = None) -> Verdict:
    euler_rad = euler_rad if euler_rad is not None else Vector3f()
    return rig.visual_odom.handle_pose_estimate_euler(1, 2, Vector3f(), euler_rad, f32(0.5), f32(0.5), 0, 50)


SENDERS: dict[str, Send] = {
    "pose": lambda rig: rig.pose(),
    "pose_euler": pose_euler,
    "speed": lambda rig: rig.speed(),
    "delta": lambda rig: rig.delta(),
}
senders = pytest.mark.parametrize("send", SENDERS.values(), ids=SENDERS.keys())
every_type = pytest.mark.parametrize("number", [1, 2, 3])


@pytest.mark.parametrize(
    ("kind", "backend"),
    [
        (VisualOdom_Type.MAV, AP_VisualOdom_MAV),
        (VisualOdom_Type.IntelT265, AP_VisualOdom_IntelT265),
        (VisualOdom_Type.VOXL, AP_VisualOdom_IntelT265),
    ],
)
def test_backend_of_each_type(kind: VisualOdom_Type, backend: type[AP_VisualOdom_Backend]) -> None:
    assert BACKENDS[kind] is backend


def test_every_type_but_none_has_a_backend() -> None:
    assert set(BACKENDS) == set(VisualOdom_Type) - {VisualOdom_Type.NONE}


# No type


@senders
def test_without_a_type_samples_are_dropped_as_disabled(make_rig: "MakeRig", send: Send) -> None:
    rig = make_rig(TYPE=0)
    assert send(rig) is DISABLED
    assert (rig.ahrs.calls, rig.records, rig.texts) == ([], [], [])


def test_without_a_type_nothing_is_enabled_or_healthy(make_rig: "MakeRig") -> None:
    visual_odom = make_rig(TYPE=0).visual_odom
    assert (visual_odom.enabled(), visual_odom.healthy(), visual_odom.quality()) == (False, False, 0)


def test_without_a_type_arming_is_not_hindered(make_rig: "MakeRig") -> None:
    assert make_rig(TYPE=0).visual_odom.pre_arm_check() is None


def test_without_a_type_requests_are_ignored(make_rig: "MakeRig") -> None:
    rig = make_rig(TYPE=0)
    rig.visual_odom.request_align_yaw_to_ahrs()
    rig.visual_odom.align_position_to_ahrs(True, True)
    assert (rig.ahrs.calls, rig.records, rig.texts) == ([], [], [])


# A type without a backend


@senders
@pytest.mark.parametrize("number", [99, 4, -1, 127, -128])
def test_type_that_names_no_backend_drops_samples(make_rig: "MakeRig", number: int, send: Send) -> None:
    rig = make_rig(TYPE=number)
    assert send(rig) is NO_BACKEND
    assert (rig.ahrs.calls, rig.records) == ([], [])


@pytest.mark.parametrize("number", [99, 4, -1])
def test_type_that_names_no_backend_is_enabled_but_not_healthy(make_rig: "MakeRig", number: int) -> None:
    visual_odom = make_rig(TYPE=number).visual_odom
    assert (visual_odom.enabled(), visual_odom.healthy(), visual_odom.quality()) == (True, False, 0)


@pytest.mark.parametrize("number", [99, 4, -1])
def test_type_that_names_no_backend_fails_arming_as_out_of_memory(make_rig: "MakeRig", number: int) -> None:
    assert make_rig(TYPE=number).visual_odom.pre_arm_check() == "out of memory"


@senders
def test_type_set_after_boot_drops_samples_until_reboot(make_rig: "MakeRig", send: Send) -> None:
    rig = make_rig(TYPE=0)
    rig.set(TYPE=1)
    assert send(rig) is NO_BACKEND


def test_type_set_after_boot_fails_arming_as_out_of_memory(make_rig: "MakeRig") -> None:
    rig = make_rig(TYPE=0)
    rig.set(TYPE=1)
    assert rig.visual_odom.pre_arm_check() == "out of memory"


def test_requests_without_a_backend_are_ignored(make_rig: "MakeRig") -> None:
    rig = make_rig(TYPE=99)
    rig.visual_odom.request_align_yaw_to_ahrs()
    rig.visual_odom.align_position_to_ahrs(True, True)
    assert rig.texts == []


def test_before_init_there_is_no_backend(make_rig: "MakeRig") -> None:
    rig = make_rig(TYPE=0)
    rig.set(TYPE=1)
    assert not rig.visual_odom.healthy()
    rig.visual_odom.init()
    assert rig.pose() is CONSUMED


# A type cleared in flight


@every_type
def test_clearing_the_type_disables_at_once(make_rig: "MakeRig", number: int) -> None:
    rig = make_rig(TYPE=number)
    rig.pose()
    rig.set(TYPE=0)
    assert rig.pose() is DISABLED
    assert not rig.visual_odom.healthy()
    assert rig.visual_odom.pre_arm_check() is None


@every_type
def test_clearing_the_type_leaves_the_backends_quality(make_rig: "MakeRig", number: int) -> None:
    rig = make_rig(TYPE=number)
    rig.pose(quality=33)
    rig.set(TYPE=0)
    assert rig.visual_odom.quality() == 33


# With a backend


@senders
@every_type
def test_sample_is_consumed_by_every_backend(make_rig: "MakeRig", number: int, send: Send) -> None:
    rig = make_rig(TYPE=number)
    assert send(rig) is CONSUMED
    assert len(rig.ahrs.calls) == 1


@every_type
def test_euler_angles_are_converted_to_the_attitude(make_rig: "MakeRig", number: int) -> None:
    rig = make_rig(TYPE=number)
    pose_euler(rig, Vector3f(0.1, -0.2, 0.3))
    assert rig.extnav[0].quat == Quaternion.from_euler(f32(0.1), f32(-0.2), f32(0.3))


@every_type
def test_attitude_is_neither_normalised_nor_checked(make_rig: "MakeRig", number: int) -> None:
    rig = make_rig(TYPE=number)
    rig.pose(attitude=Quaternion(2, 0, 0, 0))
    rig.pose(attitude=Quaternion(0, 0, 0, 0))
    assert [call.quat for call in rig.extnav] == [Quaternion(2, 0, 0, 0), Quaternion(0, 0, 0, 0)]


@every_type
@pytest.mark.parametrize("vector", [NAN_VECTOR, HUGE_VECTOR])
def test_data_that_is_not_finite_never_raises(make_rig: "MakeRig", number: int, vector: Vector3f) -> None:
    rig = make_rig(TYPE=number, SCALE=1e30, ORIENT=38)
    rig.align_ready(math.nan)
    rig.ahrs.pos, rig.ahrs.quat = vector, Quaternion(math.nan, math.inf, 0, 0)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(vector, Quaternion(math.inf, 3e38, -3e38, math.nan), pos_err=math.inf, ang_err=math.nan, counter=1)
    rig.visual_odom.handle_pose_estimate_euler(0, 0, vector, vector, f32(math.nan), f32(-math.inf), 2, -128)
    rig.speed(vector)
    rig.delta(vector, vector, confidence=math.nan)
    rig.visual_odom.pre_arm_check()


@every_type
def test_quality_is_the_backends(make_rig: "MakeRig", number: int) -> None:
    rig = make_rig(TYPE=number)
    assert rig.visual_odom.quality() == 0
    rig.speed(quality=-1)
    assert rig.visual_odom.quality() == -1


@every_type
def test_silence_of_300_ms_fails_arming(make_rig: "MakeRig", number: int) -> None:
    rig = make_rig(TYPE=number)
    rig.pose()
    rig.at_ms(10_300)
    assert rig.visual_odom.pre_arm_check() == "not healthy"


# Parameters


@pytest.mark.parametrize(("stored", "read"), [(10, 10), (0, 0), (-1, 0), (-32768, 0), (32767, 32767)])
def test_negative_delay_reads_as_zero(make_rig: "MakeRig", stored: int, read: int) -> None:
    assert make_rig(TYPE=1, DELAY_MS=stored).visual_odom.get_delay_ms() == read


def test_delay_goes_with_every_kind_of_sample(make_rig: "MakeRig") -> None:
    rig = make_rig(TYPE=1, DELAY_MS=-5)
    rig.pose()
    rig.speed()
    rig.delta()
    assert [call.delay_ms for call in rig.ahrs.calls] == [0, 0, 0]


@pytest.mark.parametrize(("stored", "read"), [(0, 0), (25, 25), (-1, 255), (-128, 128)])
def test_negative_orientation_reads_as_its_unsigned_byte(make_rig: "MakeRig", stored: int, read: int) -> None:
    assert make_rig(TYPE=1, ORIENT=stored).visual_odom.get_orientation() == read


def test_negative_orientation_is_a_bad_rotation(make_rig: "MakeRig") -> None:
    rig = make_rig(TYPE=1, ORIENT=-1)
    rig.delta(Vector3f(1, 2, 3), Vector3f(4, 5, 6))
    assert (rig.errors.count, rig.errors.last) == (2, InternalError.BAD_ROTATION)


def test_parameters_are_read_at_each_use(make_rig: "MakeRig") -> None:
    rig = make_rig(TYPE=1, SCALE=1)
    rig.pose(Vector3f(1, 2, 3))
    rig.set(SCALE=2)
    rig.pose(Vector3f(1, 2, 3))
    assert [call.pos for call in rig.extnav] == [Vector3f(1, 2, 3), Vector3f(2, 4, 6)]


def test_parameters_answer_under_the_firmwares_names(make_rig: "MakeRig") -> None:
    offset = Vector3f(0.1, 0.2, 0.3)
    settings = {"SCALE": 1.5, "VEL_M_NSE": 2, "POS_M_NSE": 3, "YAW_M_NSE": 4}
    visual_odom = make_rig(TYPE=2, POS=offset, QUAL_MIN=-1, **settings).visual_odom
    assert visual_odom.get_type() == VisualOdom_Type.IntelT265
    assert visual_odom.get_pos_offset() == offset
    assert visual_odom.get_quality_min() == -1
    assert visual_odom.get_pos_scale() == 1.5
    noises = visual_odom.get_vel_noise(), visual_odom.get_pos_noise(), visual_odom.get_yaw_noise()
    assert [float(noise) for noise in noises] == [2, 3, 4]

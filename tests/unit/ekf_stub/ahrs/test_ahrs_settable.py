# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The settable AHRS answers what it was told and remembers what it was given."""

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ports import Ahrs
from ekf_stub.ahrs.ahrs_settable import BodyFrameOdom, ExtNav, ExtNavVel, SettableAhrs

V, Q = Vector3f(1, 2, 3), Quaternion(1, 2, 3, 4)


def answers(ahrs: Ahrs) -> tuple[object, ...]:
    return (
        ahrs.initialised(),
        ahrs.dcm_yaw_initialised(),
        ahrs.using_extnav_for_yaw(),
        float(ahrs.get_yaw_rad()),
        ahrs.get_quaternion(),
        ahrs.get_relative_position_NED_origin_float(),
    )


def test_fresh_ahrs_knows_nothing() -> None:
    assert answers(SettableAhrs()) == (False, False, False, 0, None, None)


def test_ahrs_answers_what_it_was_told() -> None:
    ahrs = SettableAhrs(
        is_initialised=True,
        is_dcm_yaw_initialised=True,
        is_using_extnav_for_yaw=True,
        yaw=f32(0.5),
        quat=Q,
        pos=V,
    )
    assert answers(ahrs) == (True, True, True, 0.5, Q, V)


def test_answers_are_told_apart() -> None:
    assert answers(SettableAhrs(is_initialised=True))[:3] == (True, False, False)
    assert answers(SettableAhrs(is_dcm_yaw_initialised=True))[:3] == (False, True, False)
    assert answers(SettableAhrs(is_using_extnav_for_yaw=True))[:3] == (False, False, True)


def test_calls_are_remembered_in_order() -> None:
    ahrs = SettableAhrs()
    ahrs.writeExtNavData(V, Q, f32(1), f32(2), 3, 4, 5)
    ahrs.writeExtNavVelData(V, f32(1), 2, 3)
    ahrs.writeBodyFrameOdom(f32(1), V, V, f32(2), 3, 4, V)
    assert ahrs.calls == [
        ExtNav(V, Q, f32(1), f32(2), 3, 4, 5),
        ExtNavVel(V, f32(1), 2, 3),
        BodyFrameOdom(f32(1), V, V, f32(2), 3, 4, V),
    ]


def test_vehicles_do_not_share_calls() -> None:
    first, second = SettableAhrs(), SettableAhrs()
    first.writeExtNavVelData(V, f32(1), 2, 3)
    assert second.calls == []

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of checks, and checks that the corpus does not reach."""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

import numpy as np
import pytest

from mav_handlers.verdicts import NOT_ADDRESSED
from mav_handlers.wire.messages import SET_GPS_GLOBAL_ORIGIN, Message
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.corpus import CORPUS
from tests.unit.viso.doctor.evidences import (
    START_US,
    changed,
    evidence_of,
    findings_of,
    pose,
    seen,
    speed,
    stream_of,
)
from viso.doctor import CHECKS, Check, Finding, Severity, checks
from viso.doctor.checks import FAMILIES
from viso.doctor.evidence.set_up import Assumed
from viso.doctor.evidence.vehicle_data import AttitudeSeries, HeightSeries, ParamChange, VehicleData
from viso.firmware.flown import JudgedBy, profile_for, version_in
from viso.firmware.releases import PROFILES
from viso.geometry.rotation import quats_from_euler
from viso.streams.stream_kinds import Aspect

HERE = {
    *("XN1-07", "XN2-03", "XN2-07", "XN2-08", "XN4-02", "XN4-07", "XN5-04", "XN5-08", "XN5-10"),
    *("XN6-10", "XN6-11", "XN6-12", "XN7-05", "XN7-06", "XN7-11", "XN7-13", "XN7-14", "XN7-15", "XN7-16"),
    *("XN5-31", "XN5-32", "XN5-33"),
    *("XN8-01", "XN8-02", "XN8-05", "XN8-06", "XN8-07", "XN8-08", "XN9-01", "XN9-05", "XN9-06", "XN9-07"),
    *("XN2-09", "XN2-12", "XN2-13", "XN3-13", "XN5-18", "XN5-19", "XN7-17", "XN7-18", "XN7-19", "XN7-20"),
    *(f"XNF-{number:02}" for number in range(1, 17)),
    *(f"XNR-{number:02}" for number in range(1, 11)),
    *("XN9-10", "XN9-11", "XN9-12", "XN9-13", "XN9-14", "XN9-15", "XN9-16", "XN9-17", "XN9-18"),
    *("XN7-21", "XN7-22", "XN7-23", "XN7-31", "XN7-32", "XN7-33", "XN9-31", "XN9-32", "XN9-33"),
}
"""Codes that tests of this folder show beside the corpus."""


def still(count: int = 100, **fields: Any) -> list[Message]:
    return [odometry(1_000_000 + number * 40_000, **fields) for number in range(count)]


def test_codes_are_unique_and_in_order() -> None:
    codes = [check.code for check in CHECKS]
    assert codes == sorted(set(codes))
    assert all(re.fullmatch(r"XN[1-9FR]-\d\d", code) for code in codes)
    assert {check.family for check in CHECKS} == set(FAMILIES)


def test_every_check_is_listed() -> None:
    names = [module.name for module in iter_modules(checks.__path__, f"{checks.__name__}.")]
    declared = [value for name in names for value in vars(import_module(name)).values() if isinstance(value, Check)]
    assert {check.code for check in declared} == {check.code for check in CHECKS}


def test_checks_say_what_happens_where_and_what_to_do() -> None:
    assert [check.code for check in CHECKS if not (check.firmware.endswith(".") and check.fix.endswith("."))] == []
    assert [check.code for check in CHECKS if check.title.endswith(".")] == []
    assert [check.code for check in CHECKS if ".cpp" not in check.source and "helpers.h" not in check.source] == []


def test_every_check_has_a_stream_that_shows_it() -> None:
    shown = HERE | {code for case in CORPUS for code in case.expected}
    assert {check.code for check in CHECKS} - shown == set()


def test_stream_in_order_gives_notes_at_most() -> None:
    found = findings_of(evidence_of(stream_of(still())))
    assert all(finding.severity is Severity.NOTE for finding in found.values())


def test_origin_for_another_system_is_told() -> None:
    origin = seen(101, START_US + 4_000_000, SET_GPS_GLOBAL_ORIGIN(5, 1, 1, 1), NOT_ADDRESSED)
    finding = findings_of(evidence_of([*stream_of(still()), origin]))["XN1-07"]
    assert finding.message_numbers == (101,)
    assert "addressed to system 5; the autopilot is 1" in finding.evidence


def flying(count: int = 200, yaw_rad: float = 0.6, **fields: float) -> list[Message]:
    """Go round a circle with the nose in one direction; the velocity is given in the local frame."""
    made: list[Message] = []
    for number in range(count):
        time_s = 0.04 * number
        angle = 0.8 * time_s
        here = {"x": 2 * math.cos(angle), "y": 2 * math.sin(angle), "z": -0.2 * time_s}
        there = {"vx": -1.6 * math.sin(angle), "vy": 1.6 * math.cos(angle), "vz": -0.2}
        q = tuple(quats_from_euler(np.array([[0.0, 0.0, yaw_rad]]))[0])
        made.append(odometry(1_000_000 + int(time_s * 1e6), q=q, **{**here, **there, **fields}))
    return made


def test_odometry_with_a_velocity_in_the_local_frame_is_told() -> None:
    found = findings_of(evidence_of(stream_of(flying(yaw_rad=1.0))))
    assert "only if it is in local axes" in found["XN2-03"].evidence
    assert not {"XN2-04", "XN2-05"} & set(found)


def swaying(count: int, turn: np.ndarray | None = None) -> tuple[list[Message], AttitudeSeries]:
    """Sway about all axes; the stream's attitude is the vehicle's, in a world turned by a quaternion."""
    time_s = 0.04 * np.arange(count)
    euler = np.column_stack((0.2 * np.sin(2 * time_s), 0.15 * np.sin(1.3 * time_s + 1), 0.5 * np.sin(0.9 * time_s)))
    quats = quats_from_euler(euler)
    if turn is not None:
        w, axis = turn[0], turn[1:]
        real, rest = quats[:, :1], quats[:, 1:]
        quats = np.column_stack(
            (
                w * real - rest @ axis[:, None],
                w * rest + real * axis + np.cross(np.broadcast_to(axis, rest.shape), rest),
            )
        )
    messages: list[Message] = [odometry(int(at * 1e6) + 1, q=tuple(q)) for at, q in zip(time_s, quats, strict=True)]
    series = AttitudeSeries((START_US + time_s * 1e6).astype(np.int64), euler)
    return messages, series


def test_world_with_z_up_is_told_from_attitudes() -> None:
    messages, series = swaying(300, np.array([0.0, 1.0, 0.0, 0.0]))
    assert "XN2-07" in findings_of(evidence_of(stream_of(messages), attitude=series))


def test_attitude_like_the_vehicles_is_in_order() -> None:
    messages, series = swaying(300)
    found = findings_of(evidence_of(stream_of(messages), attitude=series))
    assert not {"XN2-02", "XN2-06", "XN2-07", "XN3-11", "XN8-04", "XN8-05"} & set(found)


def test_tilted_attitude_is_told() -> None:
    messages, series = swaying(300, np.array([math.cos(0.2), math.sin(0.2), 0.0, 0.0]))
    finding = findings_of(evidence_of(stream_of(messages), {"VISO_TYPE": 2}, attitude=series))["XN8-05"]
    assert finding.severity is Severity.ERROR
    assert "23 deg" in finding.evidence


@pytest.mark.parametrize(("turned", "is_found"), [(range(150, 300), True), (range(150, 160), False)])
def test_yaw_that_leaves_the_vehicles_once_aligned_is_told(turned: range, is_found: bool) -> None:
    straight, series = swaying(300)
    aside, _ = swaying(300, quats_from_euler([[0.0, 0.0, 0.4]])[0])
    messages = [aside[number] if number in turned else straight[number] for number in range(300)]
    text = (START_US + 50 * 40_000, 6, "VisOdom: yaw shifted 20 to 30 deg")
    found = findings_of(evidence_of(stream_of(messages), {"VISO_TYPE": 2}, attitude=series, texts=(text,)))
    assert ("XN8-08" in found) == is_found
    if is_found:
        assert found["XN8-08"].message_numbers == tuple(number + 1 for number in turned)
        assert "by up to 23 deg" in found["XN8-08"].evidence


@pytest.mark.slow
def test_short_disagreement_of_roll_and_pitch_is_let_pass() -> None:
    straight, series = swaying(300)
    tilted, _ = swaying(300, np.array([math.cos(0.2), math.sin(0.2), 0.0, 0.0]))
    for last, is_found in ((120, False), (140, True)):
        messages = [*straight[:100], *tilted[100:last], *straight[last:]]
        found = findings_of(evidence_of(stream_of(messages), {"VISO_TYPE": 2}, attitude=series))
        assert ("XN8-05" in found) == is_found


def test_check_says_nothing_of_what_the_recording_does_not_hold() -> None:
    stamps_back = [odometry(1 + 40_000 * number - 900_000 * (number >= 50)) for number in range(100)]
    made = evidence_of(stream_of([replace(one, reset_counter=number % 2) for number, one in enumerate(stamps_back)]))
    assert "XN6-04" in findings_of(made)
    assert "XN6-04" not in findings_of(changed(made, lacks=frozenset({Aspect.RESETS})))
    assert "XN3-03" in findings_of(changed(made, lacks=frozenset(Aspect)))


def test_height_that_grows_downwards_is_told() -> None:
    climb = [odometry(1 + number * 40_000, z=0.02 * number) for number in range(100)]
    times = START_US + np.arange(0, 4_000_000, 100_000)
    height = HeightSeries(times, np.asarray(-0.5e-6 * (times - START_US)))
    assert "XN2-08" in findings_of(evidence_of(stream_of(climb), height=height))
    right = HeightSeries(times, np.asarray(0.5e-6 * (times - START_US)))
    assert "XN2-08" not in findings_of(evidence_of(stream_of(climb), height=right))


def test_pose_by_two_messages_is_told() -> None:
    both = [make(1 + number * 40_000) for number in range(100) for make in (odometry, pose)]
    found = findings_of(evidence_of(stream_of(both, 20_000)))
    assert "both carry the pose" in found["XN4-07"].evidence


def test_two_poses_apart_are_told() -> None:
    both = [
        message
        for number in range(100)
        for message in (odometry(1 + number * 40_000), pose(1 + number * 40_000, x=3.0))
    ]
    assert "3.0 m apart" in findings_of(evidence_of(stream_of(both, 20_000)))["XN6-11"].evidence


def test_infinity_is_told() -> None:
    messages = [*still(50), odometry(3_100_000, x=math.inf), odometry(3_140_000, vx=math.inf)]
    assert "XN5-04" in findings_of(evidence_of(stream_of(messages)))


@pytest.mark.parametrize(
    ("north_m", "severity"), [(5.4e6, Severity.ERROR), (6e5, Severity.WARNING), (2e5, None), (math.inf, None)]
)
def test_positions_that_binary32_resolves_coarsely_are_told(north_m: float, severity: Severity | None) -> None:
    found = findings_of(evidence_of(stream_of(still(x=north_m)))).get("XN5-19")
    assert (found and found.severity) == severity
    assert found is None or north_m < 1e6 or "steps of 0.5 m" in found.evidence


def test_steps_between_rests_are_jumps_and_no_frozen_pose() -> None:
    stepping = [odometry(1 + number * 40_000, x=4.0 * (number // 50)) for number in range(150)]
    found = findings_of(evidence_of(stream_of(stepping)))
    assert "XN5-13" not in found
    assert found["XN6-01"].message_numbers == (51, 101)


@pytest.mark.parametrize("yaw_rate", [0.0, 2.0])
def test_stream_that_begins_in_motion_has_no_jump(yaw_rate: float) -> None:
    """A car at 14 m/s whose recording begins on the road."""
    fields = [{"x": 1.4 * n, "q": quats_from_euler([[0, 0, yaw_rate * n / 10]])[0]} for n in range(60)]
    messages = [odometry(1 + n * 100_000, **one) for n, one in enumerate(fields)]
    assert not {"XN6-01", "XN6-02"} & set(findings_of(evidence_of(stream_of(messages, 100_000))))


def _turning(euler_deg: list[list[float]]) -> Mapping[str, Finding]:
    quats = quats_from_euler(np.radians(euler_deg))
    messages = [odometry(1 + n * 100_000, q=quat) for n, quat in enumerate(quats)]
    return findings_of(evidence_of(stream_of(messages, 100_000)))


def test_shaking_by_hand_is_no_jump_of_yaw_and_a_jump_meanwhile_is() -> None:
    """Ten poses per second, while yaw swings by 25 deg to either side 1.9 times per second: up to 300 deg/s."""
    shaken = [25 * math.sin(2 * math.pi * 1.9 * n / 10) for n in range(60)]
    assert "XN6-02" not in _turning([[0, 0, yaw] for yaw in shaken])
    jumping = [[0, 0, yaw + 150 * (n >= 30)] for n, yaw in enumerate(shaken)]
    assert _turning(jumping)["XN6-02"].message_numbers == (31,)


def test_yaw_that_jumps_there_and_back_is_told_twice() -> None:
    assert _turning([[0, 0, 40 * (n == 30)] for n in range(60)])["XN6-02"].message_numbers == (31, 32)


def test_camera_that_looks_down_jumps_in_yaw_only_if_it_rotates() -> None:
    """The first poses of an odometry are level until it knows where down is; near 90 deg of pitch yaw says little."""
    assert _turning([[0, -74, 170] if n >= 3 else [0, 0, 0] for n in range(60)])["XN6-02"].message_numbers == (4,)
    assert "XN6-02" not in _turning([[-40 * (n >= 30), -88, 40 * (n >= 30)] for n in range(60)])


@pytest.mark.parametrize(("start", "end"), [(50, 80), (0, 80), (50, 150)])
def test_pose_that_freezes_or_thaws_in_motion_is_told(start: int, end: int) -> None:
    held = [start if start <= number < end else number for number in range(150)]
    messages = [odometry(1 + number * 40_000, x=0.1 * place) for number, place in enumerate(held)]
    assert "XN5-13" in findings_of(evidence_of(stream_of(messages)))


def test_last_pose_may_be_repeated_while_tracking_failed() -> None:
    held = [(50, -1) if 50 < number < 80 else (number, 90) for number in range(150)]
    messages = [odometry(1 + n * 40_000, x=0.1 * place, vx=2.5, quality=q) for n, (place, q) in enumerate(held)]
    found = findings_of(evidence_of(stream_of(messages)))
    assert not {"XN5-13", "XN5-16"} & set(found)


def test_missing_covariance_is_told_with_the_floors() -> None:
    finding = findings_of(evidence_of(stream_of(still())))["XN5-08"]
    assert "0.2 m and 0.2 rad" in finding.evidence
    assert finding.severity is Severity.NOTE


def test_nan_inside_a_covariance_is_told_and_nan_at_its_head_is_not() -> None:
    inside = (0.1, *(math.nan,) * 20)
    assert "XN5-10" in findings_of(evidence_of(stream_of(still(pose_covariance=inside))))
    assert "XN5-10" not in findings_of(evidence_of(stream_of(still(pose_covariance=(math.nan,) * 21))))


def test_quality_that_is_never_set_is_told() -> None:
    assert "XN6-10" in findings_of(evidence_of(stream_of(still(quality=0))))


@pytest.mark.parametrize("shift", [-2, -1, 1, 2])
def test_counter_that_changes_beside_the_jump_is_told_as_that(shift: int) -> None:
    messages = [
        odometry(1 + number * 40_000, x=5.0 * (number >= 50), reset_counter=int(number >= 50 + shift))
        for number in range(100)
    ]
    found = findings_of(evidence_of(stream_of(messages)))
    assert found["XN6-12"].message_numbers == (51 + shift,)
    assert not {"XN6-01", "XN6-03"} & set(found)


def test_counter_that_changes_with_the_jump_is_in_order() -> None:
    messages = [
        odometry(1 + number * 40_000, x=5.0 * (number >= 50), reset_counter=int(number >= 50)) for number in range(100)
    ]
    assert not {"XN6-01", "XN6-03", "XN6-12"} & set(findings_of(evidence_of(stream_of(messages))))


def test_jump_where_the_autopilot_aligned_is_its_own() -> None:
    messages = [odometry(1 + number * 40_000, x=5.0 * (number >= 50)) for number in range(100)]
    text = (START_US + 50 * 40_000, 6, "VisOdom: yaw shifted 20 to 30 deg")
    found = findings_of(evidence_of(stream_of(messages), texts=(text,)))
    assert "XN6-01" not in found
    assert "yaw shifted 20 to 30 deg" in found["XN8-01"].evidence


@pytest.mark.parametrize("aids", [True, False])
def test_velocities_that_never_come_do_not_contradict_that_it_navigates(aids: bool) -> None:
    messages = [pose(1 + number * 40_000) for number in range(100)]
    fields: dict[str, Any] = {} if aids else {"aiding": ()}
    found = findings_of(evidence_of(stream_of(messages), **fields))
    assert ("XN9-01" in found) == aids
    assert found["XN7-03"].severity is Severity.WARNING
    assert found["XN7-03"].evidence.endswith("carries no velocities: it navigates by poses alone") == aids
    assert "does not start aiding by position" in found["XN7-03"].firmware


def test_source_of_another_set_is_told() -> None:
    params = dict.fromkeys((f"EK3_SRC1_{name}" for name in ("POSXY", "VELXY", "VELZ")), 3.0) | {
        "EK3_SRC1_YAW": 1,
        "EK3_SRC2_POSXY": 6,
    }
    found = findings_of(evidence_of(stream_of(still()), params))
    assert "XN7-05" in found
    assert "XN7-04" not in found


def test_velocities_that_nobody_uses_are_told() -> None:
    found = findings_of(evidence_of(stream_of(still()), {"EK3_SRC1_VELXY": 0, "EK3_SRC1_VELZ": 0}))
    assert found["XN7-06"].severity is Severity.NOTE


def test_height_from_a_flat_stream_is_told() -> None:
    flat = [pose(1 + number * 40_000, x=0.01 * number) for number in range(100)]
    assert "XN7-11" in findings_of(evidence_of(stream_of(flat), {"EK3_SRC1_POSZ": 6}))
    assert "XN7-11" not in findings_of(evidence_of(stream_of(flat)))


def test_parameters_that_changed_without_a_reboot_are_told() -> None:
    changes = (ParamChange(START_US, "VISO_TYPE", 0.0, 1.0), ParamChange(START_US, "VISO_DELAY_MS", 10.0, 20.0))
    finding = findings_of(evidence_of(stream_of(still()), changes=changes))["XN7-13"]
    assert finding.evidence.startswith("VISO_TYPE changed from 0 to 1")


def test_orientation_without_effect_is_told() -> None:
    assert "XN7-14" in findings_of(evidence_of(stream_of(still()), {"VISO_ORIENT": 4}))
    assert "XN7-14" not in findings_of(evidence_of(stream_of(still()), {"VISO_ORIENT": 4, "VISO_TYPE": 2}))


@pytest.mark.parametrize(
    ("name", "value"), [("VISO_DELAY_MS", 900), ("VISO_QUAL_MIN", 120), ("VISO_SCALE", 0), ("VISO_POS_M_NSE", 200)]
)
def test_values_that_make_no_sense_are_told(name: str, value: float) -> None:
    assert name in findings_of(evidence_of(stream_of(still()), {name: value}))["XN7-15"].evidence


def test_assumptions_are_told() -> None:
    assumed = (Assumed("VISO_TYPE", 1, "because"),)
    assert "VISO_TYPE 1 (because)" in findings_of(evidence_of(stream_of(still()), assumed=assumed))["XN7-16"].evidence


def test_alignment_that_is_refused_or_comes_too_late_is_told() -> None:
    assert "XN8-02" in findings_of(evidence_of(stream_of(still()), {"VISO_TYPE": 2}))
    assert "XN8-06" in findings_of(evidence_of(stream_of(still()), {"VISO_TYPE": 3, "EK3_SRC1_YAW": 1}))


@pytest.mark.parametrize(("firmware", "is_found"), [("4.6", False), ("2025-07", False), ("2026-02", True)])
def test_switch_of_sources_jumps_in_the_release_that_aligns_no_position(firmware: str, is_found: bool) -> None:
    params = {"VISO_TYPE": 2, "EK3_SRC1_POSXY": 3, "EK3_SRC2_POSXY": 6}
    found = findings_of(evidence_of(stream_of(still()), params, judged_by=JudgedBy(PROFILES[firmware], "")))
    assert ("XN8-07" in found) == is_found


def test_texts_of_the_autopilot_itself_are_told() -> None:
    texts = (
        (START_US, 2, "PreArm: VisOdom: not healthy"),
        (START_US + 1, 2, "PreArm: VisOdom: not healthy"),
        (START_US + 2, 6, "EKF3 IMU0 is using external nav data"),
        (START_US + 3, 2, "Crash: Disarming"),
    )
    finding = findings_of(evidence_of(stream_of(still()), vehicle=VehicleData(texts=texts)))["XN9-06"]
    assert finding.evidence.endswith('your autopilot said "PreArm: VisOdom: not healthy", 2 times')


def test_velocity_that_lags_the_path_by_clock_is_left_alone() -> None:
    # Velocities on another clock than the poses cannot be compared.
    messages = [
        message
        for number in range(100)
        for message in (pose(1 + number * 40_000, x=0.1 * number), speed(99_000_000 + number * 40_000, x=-2.5))
    ]
    assert evidence_of(stream_of(messages, 20_000)).stream.motions == ()


def test_messages_of_two_ids_that_share_sequence_numbers_are_not_lost() -> None:
    messages = stream_of(still(60))
    every_other = [replace(one, sequence=2 * one.number % 256) for one in messages]
    assert "XN1-03" not in findings_of(evidence_of(every_other))


def test_before_4_1_ekf2_is_the_one_that_takes_external_navigation() -> None:
    old = profile_for(version_in("ArduCopter V4.0.7"), ())
    messages = stream_of(still())
    assert "XN7-12" not in findings_of(evidence_of(messages, known={"AHRS_EKF_TYPE": 2.0}, judged_by=old))
    found = findings_of(evidence_of(messages, known={"AHRS_EKF_TYPE": 3.0}, judged_by=old))["XN7-12"]
    assert "before 4.1 no other estimator than EKF2" in found.evidence
    assert "AHRS_EKF_TYPE 2" in found.fix

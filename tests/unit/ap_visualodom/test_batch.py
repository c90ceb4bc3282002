# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples in columns: what the batch port adds to the scalar one. That their bits agree is shown in tests/parity."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ap_visualodom.batch import SHORT_ROWS, BatchVisualOdom
from ap_visualodom.batch_samples import VERDICT_NUMBER, Poses, Velocities
from ap_visualodom.log_structure import VISP, VISV
from ap_visualodom.verdicts import CONSUMED, DISABLED, NO_BACKEND, QUALITY_BELOW_MIN, RESET_SETTLING
from ekf_stub.ahrs.ahrs_settable import BodyFrameOdom, ExtNav, ExtNavVel, SettableAhrs

PERIOD_US = 50_000
FEW, MANY = SHORT_ROWS - 1, 3 * SHORT_ROWS


class BatchRig:
    """A library with settable surroundings, ten seconds after boot."""

    def __init__(self, **params: float) -> None:
        self.clock = VirtualClock(10_000_000)
        self.ahrs = SettableAhrs(is_initialised=True, is_dcm_yaw_initialised=True, yaw=f32(0.5))
        self.errors = InternalErrors()
        self.texts: list[tuple[int, str]] = []
        self.records: list[str] = []
        self.params = make_params()
        for name, value in params.items():
            self.params.set(f"_{name}", value)
        self.batch = BatchVisualOdom(
            self.params, ahrs=self.ahrs, gcs=self, logger=self, clock=self.clock, errors=self.errors
        )
        self.batch.visual_odom.init()

    def send_text(self, _severity: int, text: str) -> None:
        self.texts.append((self.clock.micros64(), text))

    def write(self, structure: LogStructure, _values: Sequence[LogValue]) -> None:
        self.records.append(structure.name)


def poses(count: int, **columns: Any) -> Poses:
    """Return level poses from 10 s on, ``PERIOD_US`` apart."""
    time_us = np.arange(count, dtype=np.uint64) * np.uint64(PERIOD_US) + np.uint64(10_000_000)
    quat = np.zeros((4, count), f32)
    quat[0] = 1
    made = Poses(
        *(np.arange(count), time_us, time_us, (time_us // np.uint64(1000)).astype(np.uint32)),
        *(np.ones((3, count), f32), quat, np.full(count, 0.5, f32), np.full(count, 0.5, f32)),
        *(np.zeros(count, np.uint8), np.full(count, 50, np.int8)),
    )
    return replace(made, **columns)


def velocities(count: int, first_place: int = 0) -> Velocities:
    one = poses(count)
    place = one.place + first_place
    return Velocities(place, one.time_us, one.remote_us, one.time_ms, one.pos, one.reset_counter, one.quality)


def verdicts(column: Any) -> list[Any]:
    return [verdict for number in column.tolist() for verdict, place in VERDICT_NUMBER.items() if place == number]


@pytest.mark.parametrize("count", [0, 1, FEW, MANY])
def test_each_pose_has_a_verdict(count: int) -> None:
    made, none = BatchRig(TYPE=1).batch.handle(poses(count), velocities(0))
    assert verdicts(made.verdict) == [CONSUMED] * count
    assert len(none) == 0


def test_low_quality_is_told_apart_from_a_reset() -> None:
    quality, counter = np.full(MANY, 50, np.int8), np.zeros(MANY, np.uint8)
    quality[3], counter[30:] = 10, 1
    made, _ = BatchRig(TYPE=2, QUAL_MIN=20).batch.handle(
        poses(MANY, quality=quality, reset_counter=counter), velocities(0)
    )
    settling = 1000 * 1000 // PERIOD_US + 1
    expected = [CONSUMED] * 3 + [QUALITY_BELOW_MIN] + [CONSUMED] * 26
    expected += [RESET_SETTLING] * min(settling, MANY - 30)
    assert verdicts(made.verdict)[: len(expected)] == expected


def test_reset_settles_for_a_second() -> None:
    counter = np.zeros(MANY, np.uint8)
    counter[5:] = 1
    slow_us = np.arange(MANY, dtype=np.uint64) * np.uint64(4 * PERIOD_US) + np.uint64(10_000_000)
    made, _ = BatchRig(TYPE=2).batch.handle(poses(MANY, reset_counter=counter, time_us=slow_us), velocities(0))
    # The sixth after the reset is 1 s old, and must be older.
    assert verdicts(made.verdict) == [CONSUMED] * 5 + [RESET_SETTLING] * 6 + [CONSUMED] * (MANY - 11)


@pytest.mark.parametrize("kind", [2, 3])
def test_every_pose_may_reset(kind: int) -> None:
    made, _ = BatchRig(TYPE=kind).batch.handle(
        poses(MANY, reset_counter=np.arange(1, MANY + 1, dtype=np.uint8)), velocities(0)
    )
    assert verdicts(made.verdict) == [RESET_SETTLING if kind == 2 else CONSUMED] * MANY


@pytest.mark.parametrize("kind", [1, 2, 3])
def test_velocities_are_the_same_one_by_one_and_in_columns(kind: int) -> None:
    few, many = (BatchRig(TYPE=kind, QUAL_MIN=60) for _ in range(2))
    quality = np.where(np.arange(MANY) % 3, 50, 70).astype(np.int8)
    given = replace(velocities(MANY), quality=quality)
    _, made = many.batch.handle(poses(0), given)
    _, made_of_few = few.batch.handle(poses(0), given.rows(0, FEW))
    assert verdicts(made.verdict) == [CONSUMED if one >= 60 else QUALITY_BELOW_MIN for one in quality]
    for name in ("verdict", "vel", "err", "delay_ms", "was_healthy"):
        assert getattr(made_of_few, name).tolist() == getattr(made.rows(0, FEW), name).tolist()
    assert many.ahrs.calls == few.ahrs.calls == []


@pytest.mark.parametrize(("kind", "verdict"), [(0, DISABLED), (9, NO_BACKEND)])
def test_without_a_backend_all_samples_are_dropped(kind: int, verdict: object) -> None:
    rig = BatchRig(TYPE=kind)
    made, made_velocities = rig.batch.handle(poses(MANY), velocities(2, MANY), [(0, lambda: None)])
    assert verdicts(made.verdict) == [verdict] * MANY
    assert verdicts(made_velocities.verdict) == [verdict] * 2


@pytest.mark.parametrize(("gap_ms", "unhealthy"), [(299, [0]), (300, [0, 5])])
@pytest.mark.parametrize("count", [FEW, MANY])
@pytest.mark.parametrize("kind", [1, 2])
def test_health_as_a_sample_comes_tells_of_the_gap_before_it(
    kind: int, count: int, gap_ms: int, unhealthy: list[int]
) -> None:
    rig = BatchRig(TYPE=kind)
    time_us = poses(count).time_us.copy()
    time_us[5:] += np.uint64(1000 * gap_ms - PERIOD_US)
    made, _ = rig.batch.handle(poses(count, time_us=time_us), velocities(0))
    # Ten seconds after boot nothing has come yet.
    assert np.flatnonzero(~made.was_healthy).tolist() == unhealthy
    assert rig.batch.visual_odom.healthy()


@pytest.mark.parametrize(("answers", "expected"), [({"is_using_extnav_for_yaw": True}, 0), ({}, 1)])
def test_poses_at_which_an_alignment_is_refused_stay_in_columns(
    answers: dict[str, bool], expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = BatchRig(TYPE=2)
    for name, answer in answers.items():
        setattr(rig.ahrs, name, answer)
    library = rig.batch.visual_odom
    handle, one_by_one = library.handle_pose_estimate, []

    def noted(*args: Any) -> object:
        one_by_one.append(args)
        return handle(*args)

    monkeypatch.setattr(library, "handle_pose_estimate", noted)
    rig.batch.handle(poses(MANY), velocities(0))
    assert len(one_by_one) == expected


def test_state_is_that_after_the_last_sample() -> None:
    rig = BatchRig(TYPE=1)
    quality = np.arange(MANY).astype(np.int8)
    rig.batch.handle(poses(MANY, quality=quality), velocities(0))
    assert rig.batch.visual_odom.quality() == MANY - 1
    assert rig.clock.micros64() == 10_000_000 + (MANY - 1) * PERIOD_US
    rig.clock.advance_us(299_000)
    assert rig.batch.visual_odom.healthy()
    rig.clock.advance_us(1_000)
    assert not rig.batch.visual_odom.healthy()


def test_event_happens_before_the_sample_of_its_place() -> None:
    rig = BatchRig(TYPE=1)
    made, _ = rig.batch.handle(
        poses(MANY),
        velocities(0),
        [(20, lambda: rig.params.set("_SCALE", 2.0)), (40, lambda: rig.params.set("_SCALE", 3.0))],
    )
    assert made.pos[0].tolist() == [1.0] * 20 + [2.0] * 20 + [3.0] * (MANY - 40)


def test_event_after_the_last_sample_happens() -> None:
    rig = BatchRig(TYPE=1)
    rig.batch.handle(poses(MANY), velocities(0), [(MANY, lambda: rig.params.set("_SCALE", 2.0))])
    assert rig.params.get_float("_SCALE") == 2.0


def test_camera_is_aligned_as_soon_as_the_attitude_is_known() -> None:
    rig = BatchRig(TYPE=2)
    rig.ahrs.is_initialised = False

    def initialise() -> None:
        rig.ahrs.is_initialised = True

    made, _ = rig.batch.handle(poses(MANY), velocities(0), [(25, initialise)])
    assert rig.texts == [(10_000_000 + 25 * PERIOD_US, "VisOdom: yaw shifted 28 to 28 deg")]
    assert made.euler_deg[2, :25].tolist() == [0.0] * 25
    assert made.euler_deg[2, 25:].tolist() == pytest.approx([28.65] * (MANY - 25), abs=0.01)


def test_camera_is_shifted_as_soon_as_the_position_is_known() -> None:
    rig = BatchRig(TYPE=2)
    rig.batch.visual_odom.align_position_to_ahrs(True, False)

    def know() -> None:
        rig.ahrs.pos = Vector3f(5, 6, 7)

    made, _ = rig.batch.handle(poses(MANY), velocities(0), [(25, know)])
    turned = made.pos[:, 24]
    assert made.pos[:, :25].T.tolist() == [turned.tolist()] * 25
    assert made.pos[:, 25:].T.tolist() == [[5.0, 6.0, float(turned[2])]] * (MANY - 25)


def test_error_that_is_nan_is_the_middle_and_an_internal_error() -> None:
    rig = BatchRig(TYPE=1)
    pos_err = np.full(MANY, 0.5, f32)
    pos_err[7] = np.nan
    made, _ = rig.batch.handle(poses(MANY, pos_err=pos_err), velocities(0))
    assert made.pos_err.tolist()[6:9] == [0.5, pytest.approx(50.1), 0.5]
    assert (rig.errors.count, rig.errors.last_line) == (1, 33)


def test_samples_in_columns_go_to_nobody_else() -> None:
    rig = BatchRig(TYPE=2)
    rig.batch.handle(poses(FEW), velocities(MANY, FEW))
    assert rig.ahrs.calls == []
    assert rig.records == []


def test_deltas_and_single_samples_go_where_they_always_go() -> None:
    rig = BatchRig(TYPE=1)
    library = rig.batch.visual_odom
    library.handle_vision_position_delta_msg(20_000, Vector3f(), Vector3f(1, 2, 3), f32(50))
    library.handle_vision_speed_estimate(1, 2, Vector3f(1, 2, 3), 0, 50)
    library.handle_pose_estimate(1, 2, Vector3f(1, 2, 3), Quaternion(), f32(1), f32(1), 0, 50)
    assert [type(call) for call in rig.ahrs.calls] == [BodyFrameOdom, ExtNavVel, ExtNav]
    assert rig.records == ["VISO", "VISV", "VISP"]


def test_records_are_those_of_the_log() -> None:
    rig = BatchRig(TYPE=1, QUAL_MIN=60)
    given, given_velocities = poses(MANY), velocities(2, MANY)
    made, made_velocities = rig.batch.handle(given, given_velocities)
    visp, visv = made.visp(given), made_velocities.visv(given_velocities)
    assert visp[["TimeUS", "PX", "Ign", "Q"]].tolist()[1] == (10_050_000, 1.0, 1, 50)
    assert visv[["TimeUS", "VX", "Ign", "Q"]].tolist()[1] == (10_050_000, 1.0, 1, 50)
    assert visp[:1].tobytes()[:3] == bytes((0xA3, 0x95, VISP.msg_type))
    assert visp.dtype.itemsize == VISP.length
    assert visv.dtype.itemsize == VISV.length


@pytest.mark.parametrize(
    ("pose_places", "velocity_places"), [([0, 2], []), ([1, 0], []), ([0, 1], [1]), ([-1, 0], [1]), ([], [1])]
)
def test_places_that_leave_a_gap_or_come_twice_are_refused(pose_places: list[int], velocity_places: list[int]) -> None:
    given = poses(len(pose_places), place=np.array(pose_places, np.int64))
    given_velocities = replace(velocities(len(velocity_places)), place=np.array(velocity_places, np.int64))
    with pytest.raises(ValueError, match="places"):
        BatchRig(TYPE=1).batch.handle(given, given_velocities)

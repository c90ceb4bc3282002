# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When the estimator starts and settles, and what follows from its sources."""

from collections.abc import Sequence

import pytest

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.ahrs.sources import SourceYaw
from ekf_stub.core.params import EkfSources
from ekf_stub.log.ext_nav_log import ExtNavLog, VisualOdomFrame

START_US = 1_000_000
ORIGIN = Location(-353632610, 1491652300, 58400)
CAMERA = VisualOdomFrame(Vector3f(), 10, True, False)


class Rig:
    """An AHRS that starts one second after boot; its records and its one source parameter."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.yaw_source = SourceYaw.COMPASS
        self.records: list[tuple[str, tuple[LogValue, ...]]] = []
        self.log = ExtNavLog(self, lambda: True)
        self.sources = EkfSources(lambda name: self.yaw_source if name.endswith("YAW") else 0)
        self.ahrs = AhrsBase(self.clock, self.sources, self.log, start_us=START_US)

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        self.records.append((structure.name, tuple(values)))

    def at_ms(self, time_ms: int) -> AhrsBase:
        self.clock.set_us(time_ms * 1000)
        return self.ahrs


@pytest.fixture
def rig() -> Rig:
    return Rig()


@pytest.mark.parametrize(("time_ms", "started"), [(0, False), (999, False), (1000, True)])
def test_ahrs_starts_at_its_time(rig: Rig, time_ms: int, started: bool) -> None:
    assert rig.at_ms(time_ms).started() is started


@pytest.mark.parametrize(("time_ms", "started"), [(1000, False), (1999, False), (2000, True)])
def test_estimator_starts_a_second_after_the_ahrs(rig: Rig, time_ms: int, started: bool) -> None:
    assert rig.at_ms(time_ms).estimator_started() is started


@pytest.mark.parametrize(("time_ms", "initialised"), [(0, False), (2000, False), (21_000, False), (21_001, True)])
def test_initialised_more_than_20_s_after_the_ahrs_starts(rig: Rig, time_ms: int, initialised: bool) -> None:
    assert rig.at_ms(time_ms).initialised() is initialised


def test_initialised_across_the_wrap_of_milliseconds(rig: Rig) -> None:
    assert rig.at_ms((1 << 32) + 500_000).initialised()


def test_reference_settles_when_the_recordings_say() -> None:
    clock = VirtualClock(22_454_000)
    rig = Rig()
    ahrs = AhrsBase(clock, EkfSources(lambda _name: 0), rig.log)
    assert AHRS_START_US == 2_455_000
    assert not ahrs.initialised()
    clock.set_us(22_456_000)
    assert ahrs.initialised()


def test_yaw_comes_from_external_navigation_by_the_active_source(rig: Rig) -> None:
    ahrs = rig.at_ms(2000)
    assert not ahrs.using_extnav_for_yaw()
    rig.yaw_source = SourceYaw.EXTNAV
    rig.sources.forget()
    assert ahrs.using_extnav_for_yaw()


def test_yaw_does_not_come_from_external_navigation_before_the_estimator_starts(rig: Rig) -> None:
    rig.yaw_source = SourceYaw.EXTNAV
    assert not rig.at_ms(1999).using_extnav_for_yaw()


def test_origin_is_set_once(rig: Rig) -> None:
    ahrs = rig.at_ms(2000)
    assert ahrs.origin() is None
    assert ahrs.set_origin(ORIGIN)
    assert not ahrs.set_origin(Location(0, 0, 0))
    assert ahrs.origin() == ORIGIN


def test_origin_is_refused_before_the_estimator_starts(rig: Rig) -> None:
    ahrs = rig.at_ms(1999)
    assert not ahrs.set_origin(ORIGIN)
    assert ahrs.origin() is None


def begin_frames(rig: Rig) -> None:
    rig.log.frame(CAMERA)


@pytest.mark.parametrize(("time_ms", "logged"), [(1999, []), (2000, ["RVOH"])])
def test_camera_is_logged_once_the_estimator_runs(rig: Rig, time_ms: int, logged: list[str]) -> None:
    ahrs = rig.at_ms(time_ms)
    ahrs.state.camera = VisualOdomFrame(Vector3f(), 10, True, True)
    ahrs.update()
    assert [name for name, _ in rig.records] == logged


def test_pose_is_logged(rig: Rig) -> None:
    begin_frames(rig)
    quat = Quaternion(f32(1), f32(2), f32(3), f32(4))
    rig.ahrs.writeExtNavData(Vector3f(5, 6, 7), quat, f32(8), f32(9), 10, 11, 12)
    assert rig.records == [("REPH", (5, 6, 7, 1, 2, 3, 4, 8, 9, 10, 12, 11))]


def test_velocity_is_logged(rig: Rig) -> None:
    begin_frames(rig)
    rig.ahrs.writeExtNavVelData(Vector3f(1, 2, 3), f32(4), 5, 6)
    assert rig.records == [("REVH", (1, 2, 3, 4, 5, 6))]


def test_body_odometry_is_logged_without_offset_and_delay(rig: Rig) -> None:
    begin_frames(rig)
    rig.ahrs.writeBodyFrameOdom(f32(1), Vector3f(2, 3, 4), Vector3f(5, 6, 7), f32(8), 9, 10, Vector3f(11, 12, 13))
    assert rig.records == [("RBOH", (1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 0, 0, 0))]


def test_estimator_that_does_not_run_vouches_for_nothing(rig: Rig) -> None:
    ahrs = rig.at_ms(1999)
    assert not ahrs.healthy()
    assert ahrs.pre_arm_failure(requires_position=True) == "EKF3 not started"


def test_plain_estimator_runs_well_but_knows_nothing(rig: Rig) -> None:
    ahrs = rig.at_ms(2000)
    ahrs.set_origin(ORIGIN)
    ahrs.state.camera = CAMERA
    ahrs.update()
    ahrs.log_estimates()
    assert ahrs.healthy()
    assert ahrs.pre_arm_failure(requires_position=True) is None
    assert (ahrs.get_gyro(), ahrs.get_gyro_drift()) == (Vector3f(), Vector3f())
    assert [ahrs.get_velocity_NED(), ahrs.get_location(), ahrs.get_filter_status()] == [None] * 3
    assert not ahrs.reset_height_datum()
    assert not ahrs.handle_external_position_estimate(ORIGIN, f32(1), 2000)
    assert ahrs.ext_nav_counts == {}

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Replay records are written when they differ, once the estimator has frames, if LOG_REPLAY wants them."""

from collections.abc import Sequence

import pytest

from ap_core.fmath import f32
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.log.ext_nav_log import ExtNavLog, VisualOdomFrame


class Rig:
    """A log of replay records, LOG_REPLAY set."""

    def __init__(self, *, fills_odometry: bool = False) -> None:
        self.enabled = True
        self.records: list[tuple[str, tuple[LogValue, ...]]] = []
        self.log = ExtNavLog(self, lambda: self.enabled, fills_odometry=fills_odometry)

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        self.records.append((structure.name, tuple(values)))

    def frame(self, *, healthy: bool = True, enabled: bool = True, delay_ms: int = 10) -> None:
        self.log.frame(VisualOdomFrame(Vector3f(1, 2, 3), delay_ms, healthy, enabled))

    def pose(self, time_ms: int = 100, delay_ms: int = 10) -> None:
        self.log.pose(Vector3f(), Quaternion(), (f32(0.2), f32(0.2)), time_ms, delay_ms, 0)

    def velocity(self, time_ms: int = 100, delay_ms: int = 10) -> None:
        self.log.velocity(Vector3f(), f32(0.1), time_ms, delay_ms)

    def odometry(self, time_ms: int = 100) -> None:
        self.log.body_odometry(f32(50), Vector3f(), Vector3f(), f32(0.02), time_ms, 15, Vector3f(1, 2, 3))

    def names(self) -> list[str]:
        names = [name for name, _ in self.records]
        self.records.clear()
        return names


@pytest.fixture
def rig() -> Rig:
    """Return a log whose first frame has been."""
    rig = Rig()
    rig.frame()
    rig.records.clear()
    return rig


@pytest.mark.parametrize(("fills", "camera"), [(False, (0, 0, 0, 0)), (True, (1, 2, 3, 15))])
def test_odometry_has_the_cameras_place_and_delay_where_the_release_fills_them_in(
    fills: bool, camera: tuple[int, ...]
) -> None:
    rig = Rig(fills_odometry=fills)
    rig.frame()
    rig.odometry()
    name, values = rig.records[-1]
    assert (name, values[-4:]) == ("RBOH", camera)


def test_first_frame_logs_the_camera() -> None:
    rig = Rig()
    rig.frame()
    assert rig.records == [("RVOH", (1, 2, 3, 10, 1, 1))]


def test_nothing_is_logged_before_the_first_frame() -> None:
    rig = Rig()
    rig.pose()
    rig.velocity()
    rig.odometry()
    assert rig.names() == []


def test_unchanged_camera_is_not_logged_again(rig: Rig) -> None:
    rig.frame()
    assert rig.names() == []


@pytest.mark.parametrize(("healthy", "enabled", "delay_ms"), [(False, True, 10), (True, False, 10), (True, True, 11)])
def test_changed_camera_is_logged(rig: Rig, healthy: bool, enabled: bool, delay_ms: int) -> None:
    rig.frame(healthy=healthy, enabled=enabled, delay_ms=delay_ms)
    assert rig.records == [("RVOH", (1, 2, 3, delay_ms, healthy, enabled))]


def test_camera_that_is_off_in_the_first_frame_is_never_logged() -> None:
    rig = Rig()
    rig.frame(enabled=False)
    rig.frame(enabled=True)
    assert rig.names() == []


def test_camera_that_is_off_does_not_keep_samples_from_the_log() -> None:
    rig = Rig()
    rig.frame(enabled=False)
    rig.pose()
    assert rig.names() == ["REPH"]


def test_each_sample_is_logged_when_it_differs(rig: Rig) -> None:
    for time_ms in (100, 100, 133):
        rig.pose(time_ms)
        rig.velocity(time_ms)
        rig.odometry(time_ms)
    assert rig.names() == ["REPH", "REVH", "RBOH"] * 2


def test_a_sample_is_compared_with_the_one_before_only(rig: Rig) -> None:
    for time_ms in (100, 133, 100):
        rig.pose(time_ms)
    assert rig.names() == ["REPH"] * 3


def test_types_are_compared_each_for_itself(rig: Rig) -> None:
    rig.pose()
    rig.velocity()
    rig.pose()
    assert rig.names() == ["REPH", "REVH"]


def test_delay_is_cut_to_16_bits(rig: Rig) -> None:
    rig.pose(delay_ms=0x1_0005)
    rig.velocity(delay_ms=0x1_0005)
    assert [values[-1] for _, values in rig.records] == [5, 5]


def test_nothing_is_logged_without_log_replay(rig: Rig) -> None:
    rig.enabled = False
    rig.pose()
    rig.frame(healthy=False)
    assert rig.names() == []


def test_samples_passed_over_without_log_replay_count_as_seen(rig: Rig) -> None:
    rig.enabled = False
    rig.pose()
    rig.enabled = True
    rig.pose()
    assert rig.names() == []


def test_new_log_begins_with_the_camera_in_the_next_frame(rig: Rig) -> None:
    rig.log.new_log()
    rig.pose()
    assert rig.names() == []
    rig.frame()
    rig.pose(133)
    assert rig.names() == ["RVOH", "REPH"]

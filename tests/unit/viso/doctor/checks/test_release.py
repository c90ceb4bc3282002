# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings about what becomes of a covariance in which release."""

import math
from collections.abc import Mapping
from typing import Any

import pytest

from mav_handlers.wire.messages import ATT_POS_MOCAP, Message
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.evidences import evidence_of, findings_of, pose, stream_of
from viso.doctor import Finding
from viso.firmware.flown import JudgedBy
from viso.firmware.releases import PROFILES

DIAGONAL = (0, 6, 11, 15, 18, 20)
EARLIER = ("4.6", "2025-07")
SINCE_FEBRUARY = ("2026-02", "4.7", "2026-04")
LATER = SINCE_FEBRUARY[0]
every_firmware = pytest.mark.parametrize("firmware", PROFILES)


def covariance(position: float, attitude: float = 0.0) -> tuple[float, ...]:
    """Return the upper triangle with equal variances of positions (m^2) and of angles (rad^2)."""
    variances = dict(zip(DIAGONAL, (position,) * 3 + (attitude,) * 3, strict=True))
    return tuple(variances.get(index, 0.0) for index in range(21))


def found(messages: list[Message], firmware: str, **params: float) -> Mapping[str, Finding]:
    return findings_of(evidence_of(stream_of(messages), params, judged_by=JudgedBy(PROFILES[firmware], "")))


def poses(count: int = 10, **fields: Any) -> list[Message]:
    return [pose(1_000_000 + number * 40_000, **fields) for number in range(count)]


def mocap(values: tuple[float, ...], count: int = 10) -> list[Message]:
    attitude = (1.0, 0.0, 0.0, 0.0)
    return [ATT_POS_MOCAP(1_000_000 + number * 40_000, attitude, 0.0, 0.0, 0.0, values) for number in range(count)]


@every_firmware
def test_errors_that_differ_between_releases_are_named_with_both(firmware: str) -> None:
    finding = found(poses(covariance=covariance(1.0, 0.1)), firmware)["XN5-31"]
    # sqrt(3 * 1), sqrt(3 * 0.1); cbrt(3 * 1^2), cbrt(3 * 0.1^2)
    both = {"root": "1.73 m, 0.548 rad", "cube": "1.44 m, 0.311 rad"}
    ours, theirs = ("root", "cube") if firmware in SINCE_FEBRUARY else ("cube", "root")
    assert finding.evidence.startswith("10 of 10 (100 %) VISION_POSITION_ESTIMATE")
    assert f"{both[ours]} here ({firmware})" in finding.evidence
    assert f"{both[theirs]} in " in finding.evidence


def test_odometry_counts_with_its_pose_covariance() -> None:
    messages: list[Message] = [
        odometry(1_000_000 + number * 40_000, pose_covariance=covariance(1.0)) for number in range(10)
    ]
    assert "ODOMETRY" in found(messages, LATER)["XN5-31"].evidence


@pytest.mark.parametrize(
    "values", [(0.0,) * 21, (math.nan,) * 21, covariance(1e-4, 1e-4)], ids=["zero", "none", "below the floors"]
)
def test_errors_that_no_release_tells_apart_are_no_finding(values: tuple[float, ...]) -> None:
    assert "XN5-31" not in found(poses(covariance=values), LATER)


@every_firmware
def test_covariance_of_motion_capture_that_is_not_read_is_named(firmware: str) -> None:
    findings = found(mocap(covariance(4.0)), firmware)
    assert ("XN5-32" in findings) == (firmware in EARLIER)
    if firmware in EARLIER:
        assert "which 2026-02 would read: 3.46 m, 0.2 rad of the first" in findings["XN5-32"].evidence


@pytest.mark.parametrize("values", [(0.0,) * 21, (math.nan,) * 21])
def test_motion_capture_without_covariance_is_no_finding(values: tuple[float, ...]) -> None:
    assert "XN5-32" not in found(mocap(values), "2025-07")


@every_firmware
def test_negative_sum_is_an_error_where_its_root_is_taken(firmware: str) -> None:
    findings = found(poses(covariance=covariance(-1.0)), firmware)
    assert ("XN5-33" in findings) == (firmware in SINCE_FEBRUARY)


def test_nan_inside_is_another_finding() -> None:
    values = (1.0, *[0.0] * 5, math.nan, *[0.0] * 14)
    findings = found(poses(covariance=values), LATER)
    assert "XN5-33" not in findings
    assert "XN5-10" in findings


@every_firmware
def test_what_a_noise_floor_hides_is_told_by_the_formula_of_the_release(firmware: str) -> None:
    finding = found(poses(covariance=covariance(0.01, 1.0)), firmware, VISO_POS_M_NSE=0.2)["XN5-09"]
    # sqrt(3 * 0.01); cbrt(3 * 0.01^2)
    taken = "0.17" if firmware in SINCE_FEBRUARY else "0.067"
    assert f"say 0.1 m (largest sigma), of which the firmware makes {taken} and raises it" in finding.evidence


@every_firmware
@pytest.mark.parametrize(
    ("values", "code"),
    [(covariance(400.0), "XN5-11"), ((1.0, *[0.0] * 5, math.nan, *[0.0] * 14), "XN5-10"), (covariance(1e-4), "XN5-09")],
    ids=["huge", "nan inside", "below the floor"],
)
def test_covariance_of_motion_capture_is_judged_where_it_is_read(
    firmware: str, values: tuple[float, ...], code: str
) -> None:
    findings = found(mocap(values), firmware)
    assert (code in findings) == (firmware in SINCE_FEBRUARY)
    assert ("XN5-08" in findings) == (firmware in EARLIER)

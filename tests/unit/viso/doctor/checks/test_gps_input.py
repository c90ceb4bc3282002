# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Companions that act as a GPS: a velocity that is left out counts as 0, and a GPS of another type takes nothing."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import pytest

from mav_handlers.wire.messages import GPS_INPUT
from tests.unit.viso.doctor.vehicles import GPS_ALONE, Said, beats, listed, recorded
from viso.doctor import CHECKS, Finding, Severity, diagnose, gather

COMPANION: Final = 197
BY_MAVLINK: Final = {**GPS_ALONE, "GPS1_TYPE": 14}


def fixes(**changes: Any) -> Said:
    """Return what a companion sends of a vehicle that moves north."""
    fields = {"ignore_flags": 0, "gps_id": 0, "fix_type": 3, "vn": 1.0, "ve": 0.0, "vd": 0.0, **changes}
    return [
        (COMPANION, GPS_INPUT(number, fields["gps_id"], fields["ignore_flags"], 200 * number, 2300, fields["fix_type"],
                              473_000_000 + 18 * number, 85_000_000, 500.0, 1.0, 1.0, fields["vn"], fields["ve"],
                              fields["vd"], 0.3, 0.5, 1.0, 12))
        for number in range(40)
    ]  # fmt: skip


def found_in(folder: Path, said: Said, params: Mapping[str, float]) -> dict[str, Finding]:
    """Return the findings about GPS_INPUT, and about messages that do not come."""
    findings = diagnose(gather(recorded(folder, beats(), listed(params), said)), CHECKS)
    return {one.code: one for one in findings if one.code in ("XN1-01", "XN7-21", "XN7-22", "XN7-23")}


@pytest.mark.parametrize("changes", [{"ignore_flags": 8 | 16 | 32}, {"vn": 0.0}])
def test_velocity_that_is_left_out_is_fused_as_rest(tmp_path: Path, changes: dict[str, Any]) -> None:
    found = found_in(tmp_path, fixes(**changes), BY_MAVLINK)
    assert found.keys() == {"XN7-21"}
    assert "EK3_SRC1_VELXY is 3" in found["XN7-21"].evidence


@pytest.mark.parametrize(
    ("changes", "params"),
    [
        ({}, BY_MAVLINK),
        ({"ignore_flags": 8}, {**BY_MAVLINK, "EK3_SRC1_VELXY": 0}),
        ({"gps_id": 1}, {**GPS_ALONE, "GPS1_TYPE": 1, "GPS2_TYPE": 14}),
    ],
)
def test_input_in_order_gives_no_finding(tmp_path: Path, changes: dict[str, Any], params: Mapping[str, float]) -> None:
    assert not found_in(tmp_path, fixes(**changes), params)


def test_gps_of_another_type_takes_nothing(tmp_path: Path) -> None:
    found = found_in(tmp_path, fixes(), {**GPS_ALONE, "GPS_TYPE": 1})
    assert "GPS_TYPE is 1" in found["XN7-22"].evidence
    assert "XN7-22" in found_in(tmp_path, fixes(gps_id=1), {**BY_MAVLINK, "GPS2_TYPE": 0})


def test_type_that_is_not_known_is_said_to_be_so(tmp_path: Path) -> None:
    for gps_id, params, name in ((0, {}, "GPS1_TYPE"), (1, {**GPS_ALONE, "GPS1_TYPE": 1}, "GPS2_TYPE")):
        found = found_in(tmp_path, fixes(gps_id=gps_id), params)["XN7-22"]
        assert found.severity is Severity.NOTE
        assert f"does not tell {name}" in found.evidence


def test_input_without_a_fix_is_named(tmp_path: Path) -> None:
    assert found_in(tmp_path, fixes(fix_type=1), BY_MAVLINK).keys() == {"XN7-23"}

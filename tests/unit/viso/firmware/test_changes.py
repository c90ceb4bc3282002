# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever a release changes has a row, and every row a change of the firmware."""

import re
from dataclasses import fields, is_dataclass
from itertools import pairwise

import pytest

from viso.compare.outputs import release_lines
from viso.firmware.changes import DIFFERENCES, ERROR_FORMULA, Difference, differences_between
from viso.firmware.releases import APRIL_2026, FEBRUARY_2026, JULY_2025, PROFILES, STABLE_4_6, STABLE_4_7, Firmware

ABOUT_ITSELF = {"name", "date", "version_text", "source_hash", "major", "minor", "patch", "release_type"}
ONE_ROW = {
    "params.early": "endpoint.params",
    "params.early_links": "endpoint.params",
    "params.second_table": "endpoint.params",
    "params.late_links": "endpoint.params",
    "params.port_options": "endpoint.params",
    "params.arming": "params.arming_check",
    "params.enabled_checks": "params.arming_check",
    "params.more_stat": "params.more_ahrs",
    "params.flow_limit": "ekf.flow_limit",
    "params.flow": "params.more_ahrs",
    "params.vicon": "params.more_ahrs",
    "params.simulated_gps": "params.more_ahrs",
    "params.second_simulated_gps": "params.more_ahrs",
    "params.simulated_gps_prefix": "params.more_ahrs",
    "params.range_finder": "params.range_unit",
    "params.failsafe": "reports_ekf_failure",
    "log.message_head": "log.message",
    "log.layouts": "params.range_unit",
}
"""Fields whose row is that of another one."""


def fields_that_differ() -> set[str]:
    """Return the fields of releases, and of their tables, whose values differ."""
    found = set()
    for field in fields(Firmware):
        values = [getattr(one, field.name) for one in PROFILES.values()]
        if field.name in ABOUT_ITSELF:
            continue
        if is_dataclass(values[0]):
            parts = [part.name for part in fields(values[0])]
            found |= {f"{field.name}.{part}" for part in parts if differ([getattr(one, part) for one in values])}
        elif differ(values):
            found.add(field.name)
    return found


def differ(values: list[object]) -> bool:
    return any(one != other for one, other in pairwise(values))


def test_whatever_differs_has_a_row() -> None:
    rows = {row.field for row in DIFFERENCES}
    assert {ONE_ROW.get(name, name) for name in fields_that_differ()} == rows


@pytest.mark.parametrize("row", DIFFERENCES, ids=lambda row: row.what)
def test_row_names_what_differs_and_a_change(row: Difference) -> None:
    assert len({row.of(one) for one in PROFILES.values()}) > 1
    assert row.upstream
    dates = [change.date for change in row.upstream]
    assert dates == sorted(dates)
    assert all(re.fullmatch(r"[0-9a-f]{10}", change.revision) for change in row.upstream)
    assert all(re.fullmatch(r"20\d\d-\d\d-\d\d", date) for date in dates)


@pytest.mark.parametrize(("before", "after"), [(JULY_2025, FEBRUARY_2026), (FEBRUARY_2026, APRIL_2026)])
def test_change_is_of_between_the_masters_that_differ(before: Firmware, after: Firmware) -> None:
    for row in DIFFERENCES:
        between = [change for change in row.upstream if before.date < change.date and change.date[:7] <= after.date]
        assert bool(between) or row.of(before) == row.of(after), row.what


def test_what_releases_call_otherwise_is_no_difference_in_what_they_do() -> None:
    topics = {row.topic for row in differences_between(STABLE_4_6, APRIL_2026)}
    assert topics == {"AP_VisualOdom", "MAVLink", "AP_OpticalFlow", "EKF3", "Copter"}
    assert differences_between(STABLE_4_7, STABLE_4_7) == ()
    assert [*release_lines(STABLE_4_7, STABLE_4_7)] == [
        "known to differ between 4.7 and 4.7: nothing but names and logs"
    ]
    assert ERROR_FORMULA in differences_between(STABLE_4_6, STABLE_4_7)


def test_row_for_machines_has_both_releases_and_the_change() -> None:
    found = ERROR_FORMULA.as_dict(STABLE_4_6, STABLE_4_7)
    assert (found["topic"], found["what"]) == ("MAVLink", "error from a covariance")
    assert found["before"] != found["after"]
    assert found["by"] == [{"revision": "0122854151", "date": "2026-02-05"}]
    assert ERROR_FORMULA.source == "0122854151, 2026-02-05"

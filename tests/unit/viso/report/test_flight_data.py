# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is taken out of a log."""

from pathlib import Path

import numpy as np
import pytest

from tests.unit.viso.report.log_maker import LogMaker, material_of
from viso.estimators.series import overlap_s, spans_of
from viso.report.flight_data import Material, position_moves


@pytest.fixture
def maker() -> LogMaker:
    return LogMaker()


def test_records_become_columns_over_time(material: Material) -> None:
    assert material.counts["VISP"] == len(material.visp) == 209
    assert material.visp.time_s[:2].tolist() == pytest.approx([1.0, 1.05])
    assert material.visp["PX"][0] == pytest.approx(0.475)
    assert len(material.viso) == 0


def test_texts_modes_and_arming_are_told_in_order(material: Material) -> None:
    told = [(one.time_s, one.kind, one.text) for one in material.happenings[2:]]
    expected = [(1.0, "mode", "STABILIZE"), (3.0, "arming", "armed"), (3.0, "mode", "GUIDED")]
    assert told == [*expected, (9.0, "text", "VisOdom: reset")]


def test_core_that_flies_is_shown(maker: LogMaker, tmp_path: Path) -> None:
    for number in range(10):
        for core in (0, 1):
            maker.add("XKF4", number, C=core, PI=int(number >= 5))
            maker.add("XKF1", number, C=core, PN=10 * core + number)
    found = material_of(maker, tmp_path / "a.BIN")
    assert found.xkf1["PN"].tolist() == [0, 1, 2, 3, 4, 15, 16, 17, 18, 19]
    assert (found.cores_shown, found.unseen_primary_s) == ((0, 1), 0.0)


def test_first_core_stands_in_for_one_that_is_not_logged(maker: LogMaker, tmp_path: Path) -> None:
    for number in range(10):
        maker.add("XKF4", number, C=0, PI=int(number >= 6))
        maker.add("XKF1", number, C=0, PN=number)
    found = material_of(maker, tmp_path / "a.BIN")
    assert len(found.xkf1) == 10
    assert (found.cores_shown, found.unseen_primary_s) == ((0,), 3.0)


def test_records_of_an_impossible_time_are_left_out(maker: LogMaker, tmp_path: Path) -> None:
    for time_s in (1.0, 2.0, 9e8, 3.0):
        maker.add("VISP", time_s)
    found = material_of(maker, tmp_path / "a.BIN")
    assert (found.visp.time_s.tolist(), found.left_out) == ([1.0, 2.0, 3.0], 1)


def test_older_firmware_has_fewer_fields_under_other_names(maker: LogMaker, tmp_path: Path) -> None:
    old = maker.define("VISP", "TimeUS,RTimeUS,CTimeMS,PX,PY,PZ,Roll,Pitch,Yaw", "QQIffffff")
    maker.add_to(old, 1.0, PX=3.0, Yaw=90.0)
    found = material_of(maker, tmp_path / "a.BIN").visp
    assert (found["PX"].tolist(), found["Y"].tolist()) == ([3.0], [90.0])
    assert not found.has("Q")
    assert np.isnan(found["Ign"]).all()


def test_change_of_core_is_no_move(maker: LogMaker, tmp_path: Path) -> None:
    for core, east_m in ((0, 0.0), (0, 2.0), (1, 5.0), (1, 5.0)):
        maker.add("XKF4", 1.0 + core + east_m, C=core, PI=core, OFE=east_m)
    times_s, moved_m = position_moves(material_of(maker, tmp_path / "a.BIN").xkf4)
    assert (times_s.tolist(), moved_m.tolist()) == ([3.0], [[0.0, 2.0]])


def test_errors_that_end_are_no_trouble(maker: LogMaker, tmp_path: Path) -> None:
    for subsystem, code in ((16, 2), (16, 0), (24, 0), (99, 3)):
        maker.add("ERR", 1.0, Subsys=subsystem, ECode=code)
    told = [(one.text, one.is_trouble) for one in material_of(maker, tmp_path / "a.BIN").happenings]
    assert told == [
        ("EKF check: bad variance", True),
        ("EKF check: variance cleared", False),
        ("EKF primary core: 0", True),
        ("subsystem 99: error 3", True),
    ]


def test_stretches_end_with_the_first_record_that_is_otherwise() -> None:
    times = np.arange(6.0)
    spans = spans_of(times, np.array([True, True, False, False, True, True]))
    assert spans == [(0.0, 2.0), (4.0, 5.0)]
    assert overlap_s(spans, [(1.0, 4.5)]) == 1.5

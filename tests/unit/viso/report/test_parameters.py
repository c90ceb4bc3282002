# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters a report tells of."""

import math
from pathlib import Path

import pytest

from tests.unit.viso.report.log_maker import LogMaker, material_of
from viso.firmware.releases import PROFILES
from viso.report.parameters import ChangedParameter, ParameterFacts, parameter_facts


@pytest.fixture
def found(tmp_path: Path) -> ParameterFacts:
    maker = LogMaker()
    maker.parameter("VISO_DELAY_MS", 30, 30)  # a file of defaults made it so
    maker.parameter("VISO_TYPE", 2)
    maker.parameter("VISO_QUAL_MIN", 0, 0)
    maker.parameter("VISO_QUAL_MIN", 20, time_s=5.0)
    maker.parameter("VISO_QUAL_MIN", 0, time_s=6.0)
    maker.parameter("VISO_POS_M_NSE", 0.2, 0.2)
    maker.parameter("WPNAV_RADIUS", 500, 1000)
    maker.parameter("NO_SUCH", 3)
    maker.parameter("STAT_RUNTIME", 61)
    return parameter_facts(material_of(maker, tmp_path / "a.BIN"))


def test_what_differs_or_changes_is_told(found: ParameterFacts) -> None:
    delay, quality, kind, speed = found.changed
    assert delay == ChangedParameter("VISO_DELAY_MS", 30, 30, 10, ())
    assert quality == ChangedParameter("VISO_QUAL_MIN", 0, 0, 0, ((5.0, 20.0), (6.0, 0.0)))
    assert (kind.name, kind.value, kind.firmware_default) == ("VISO_TYPE", 2, 0)
    assert math.isnan(kind.log_default)
    assert (speed.name, speed.value, speed.log_default) == ("WPNAV_RADIUS", 500, 1000)
    assert math.isnan(speed.firmware_default)


def test_those_without_a_default_are_counted(found: ParameterFacts) -> None:
    assert (found.known, found.without_default) == (7, 1)


def test_what_is_about_vision_is_told_apart(found: ParameterFacts) -> None:
    assert [one.name for one in found.changed if not one.about_vision] == ["WPNAV_RADIUS"]


@pytest.mark.parametrize(("name", "firmware_default"), [("4.6", 1.0), ("2025-07", math.nan), ("2026-02", math.nan)])
def test_defaults_are_those_of_the_release(tmp_path: Path, name: str, firmware_default: float) -> None:
    maker = LogMaker()
    maker.parameter("SYSID_THISMAV", 3, 2)
    (only,) = parameter_facts(material_of(maker, tmp_path / "a.BIN"), PROFILES[name]).changed
    assert only.firmware_default == pytest.approx(firmware_default, nan_ok=True)

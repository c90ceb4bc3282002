# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso explain` prints the entry of a text or of a code."""

import pytest

from tests.unit.viso.command_line import Viso


@pytest.mark.parametrize("words", [["EKF variance"], ["EKF", "variance"], ["ekf  VARIANCE"]])
def test_text_is_explained(viso: Viso, words: list[str]) -> None:
    outcome = viso("explain", *words)
    assert outcome.code == 0
    assert outcome.out.startswith("EKF variance  (in flight)\n    cause: two of the filter's test ratios")
    assert "\n    check: " in outcome.out
    assert "\n    fix: " in outcome.out
    assert "XN9-13" in outcome.out


@pytest.mark.parametrize("code", ["XN8-10", "xn8-10"])
def test_code_is_explained(viso: Viso, code: str) -> None:
    outcome = viso("explain", code)
    assert outcome.out.startswith("XN8-10  The yaw does not follow the vehicle's  (error)\n")
    assert "docs/doctor-codes.md#xn8-10" in outcome.out
    assert "    fix: " in outcome.out


def test_unknown_text_names_near_ones(viso: Viso) -> None:
    outcome = viso("explain", "AHRS: Chek EK3_SRC1_POSZ")
    assert outcome.code == 2
    assert "the nearest: 'AHRS: Check EK3_SRC1_POSXY'" in outcome.err
    assert viso("explain", "PreArm:").code == 2

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter says, in words."""

import pytest

from ekf_stub.core import events
from ekf_stub.reports import cores_of_mask, words_of


@pytest.mark.parametrize(("mask", "cores"), [(0, ()), (1, (0,)), (2, (1,)), (3, (0, 1)), (7, (0, 1)), (-1, (0, 1))])
def test_each_bit_of_the_mask_is_a_core_as_far_as_there_are_imus(mask: int, cores: tuple[int, ...]) -> None:
    assert cores_of_mask(mask) == cores


@pytest.mark.parametrize(("code", "values", "severity", "words"), [
    (events.TILT_ALIGNED, (), 6, "tilt alignment complete"),
    (events.FORCED_RESET, (), 4, "forced reset"),
    (events.STOPPED_AIDING, (), 4, "stopped aiding"),
    (events.INITIAL_POS, (0.989, -0.04, 3.0), 6, "initial pos NED = 0.9,-0.0,3.0 (m)"),
    (events.INITIAL_VEL, (1.0, 2.0, 3.0), 6, "initial vel NED = 1.0,2.0,3.0 (m/s)"),
    (events.SWITCHING_COMPASS, (2.0, 0.0, 0.0), 6, "switching to compass 2"),
    (events.MAG_INITIAL, (1.0, 0.0, 0.0), 6, "MAG1 initial yaw alignment complete"),
    (events.MAG_ANOMALY, (0.0, 0.0, 0.0), 4, "MAG0 ground mag anomaly, yaw re-aligned"),
    (events.EMERGENCY_YAW_RESET, (), 4, "emergency yaw reset"),
    (events.LANE_SWITCH, (1.0, 0.0, 0.0), 2, "EKF3 lane switch 1"),
    (events.ORIGIN_ALREADY_SET, (), 4, "EKF3: origin already set"),
])  # fmt: skip
def test_text_is_in_the_firmwares_words(code: int, values: tuple[float, ...], severity: int, words: str) -> None:
    assert words_of(code, values) == (severity, words)

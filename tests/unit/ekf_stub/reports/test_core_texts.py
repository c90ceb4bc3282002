# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every core says the same."""

import pytest

from ekf_stub.reports.core_texts import CoreTexts, cores_of_mask


class Sink:
    """Remembers texts."""

    def __init__(self) -> None:
        self.texts: list[tuple[int, str]] = []

    def send_text(self, severity: int, text: str) -> None:
        self.texts.append((severity, text))


@pytest.mark.parametrize(("mask", "cores"), [(0, ()), (1, (0,)), (2, (1,)), (3, (0, 1)), (7, (0, 1)), (-1, (0, 1))])
def test_each_bit_of_the_mask_is_a_core_as_far_as_there_are_imus(mask: int, cores: tuple[int, ...]) -> None:
    assert cores_of_mask(mask) == cores


def test_lines_of_a_frame_are_kept_together_by_core() -> None:
    sink = Sink()
    texts = CoreTexts(sink, (0, 1))
    texts.add("one")
    texts.add("two", 4)
    assert sink.texts == []
    texts.flush()
    assert sink.texts == [(6, "EKF3 IMU0 one"), (4, "EKF3 IMU0 two"), (6, "EKF3 IMU1 one"), (4, "EKF3 IMU1 two")]


def test_lines_are_sent_once() -> None:
    sink = Sink()
    texts = CoreTexts(sink, (1,))
    texts.add("one")
    texts.flush()
    texts.flush()
    assert sink.texts == [(6, "EKF3 IMU1 one")]

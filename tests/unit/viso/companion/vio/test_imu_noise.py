# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Densities of an IMU's noise."""

import dataclasses
import math

import pytest

from viso.companion.vio.config import ImuNoise

FIELDS = [field.name for field in dataclasses.fields(ImuNoise)]


def test_defaults_are_those_of_a_cheap_imu() -> None:
    assert dataclasses.astuple(ImuNoise()) == (1.7e-3, 2e-2, 2e-5, 1e-3)


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("bad", [0.0, -1e-3, math.nan, math.inf])
def test_density_that_is_none_is_refused_by_its_name(name: str, bad: float) -> None:
    with pytest.raises(ValueError, match=f"^{name}: "):
        ImuNoise(**{name: bad})

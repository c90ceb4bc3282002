# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The two errors that the firmware makes of a pose covariance."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.covariance import no_errors, pose_errors, root_of_sum

POSITION = (0, 6, 11)
ATTITUDE = (15, 18, 20)
VARIANCES = st.floats(0, 1e6, width=32)


def covariance(values: dict[int, float], others: float = 0.0) -> list[float]:
    return [values.get(index, others) for index in range(21)]


def errors(values: dict[int, float]) -> tuple[float, float]:
    pos_err, ang_err = pose_errors(covariance(values))
    return float(pos_err), float(ang_err)


def test_position_error_of_3_4_12() -> None:
    assert pose_errors(covariance({0: 3, 6: 4, 11: 12}))[0] == pytest.approx(5.52877, abs=5e-6)


def test_attitude_error_of_half_quarter_three_quarters() -> None:
    assert pose_errors(covariance({15: 0.5, 18: 0.25, 20: 0.75}))[1] == pytest.approx(0.95647, abs=5e-6)


def test_all_zero_gives_zero() -> None:
    assert errors({}) == (0, 0)


def test_first_element_nan_means_no_covariance() -> None:
    assert errors({0: math.nan, 6: 5, 15: 5}) == (0, 0)


@pytest.mark.parametrize("index", [6, 11])
def test_another_position_element_nan_makes_that_error_nan(index: int) -> None:
    pos_err, ang_err = pose_errors(covariance({index: math.nan}))
    assert np.isnan(pos_err)
    assert ang_err == 0


@pytest.mark.parametrize("index", ATTITUDE)
def test_attitude_element_nan_makes_that_error_nan(index: int) -> None:
    pos_err, ang_err = pose_errors(covariance({index: math.nan}))
    assert pos_err == 0
    assert np.isnan(ang_err)


def test_elements_off_the_diagonal_do_not_matter() -> None:
    diagonal = dict.fromkeys((*POSITION, *ATTITUDE), 2.0)
    assert pose_errors(covariance(diagonal, others=math.nan)) == pose_errors(covariance(diagonal))


def test_infinite_variance_gives_an_infinite_error() -> None:
    assert pose_errors(covariance({0: math.inf}))[0] == math.inf


def test_sign_of_a_variance_does_not_matter() -> None:
    assert pose_errors(covariance({0: -3, 6: -4, 11: -12})) == pose_errors(covariance({0: 3, 6: 4, 11: 12}))


@given(a=VARIANCES, b=VARIANCES, c=VARIANCES)
def test_error_is_the_cube_root_of_the_sum_of_squares(a: float, b: float, c: float) -> None:
    wanted = math.cbrt(a * a + b * b + c * c)
    both = pose_errors(covariance(dict(zip((*POSITION, *ATTITUDE), (a, b, c) * 2, strict=True))))
    assert both == pytest.approx((wanted, wanted), rel=1e-6, abs=1e-12)


@given(a=VARIANCES, b=VARIANCES, c=VARIANCES)
def test_errors_are_float32(a: float, b: float, c: float) -> None:
    assert {type(error) for error in pose_errors(covariance({0: a, 6: b, 20: c}))} == {np.float32}


# The formula of the master of February 2026


def later_errors(values: dict[int, float]) -> tuple[float, float]:
    pos_err, ang_err = pose_errors(covariance(values), root_of_sum)
    return float(pos_err), float(ang_err)


def test_later_error_is_the_standard_deviation_of_the_distance() -> None:
    assert later_errors({0: 3, 6: 4, 11: 9, 15: 0.25, 18: 0.75, 20: 8}) == (4, 3)


def test_later_error_of_no_covariance_is_zero() -> None:
    assert later_errors({0: math.nan, 6: 4, 15: 9}) == (0, 0)


@pytest.mark.parametrize("index", [6, 11])
def test_later_error_of_a_negative_sum_is_nan(index: int) -> None:
    pos_err, ang_err = later_errors({0: 1, index: -2, 15: 4})
    assert math.isnan(pos_err)
    assert ang_err == 2


def test_later_error_is_summed_from_left_to_right_in_float32() -> None:
    # The small one is lost beside the large one, which the last then takes away.
    assert later_errors({0: 1, 6: 2**25, 11: -(2**25)})[0] == 0
    assert later_errors({0: 2**25, 6: -(2**25), 11: 1})[0] == 1


def test_message_without_errors_has_none_whatever_its_covariance() -> None:
    assert [float(error) for error in no_errors(covariance({0: 3, 15: 4}), root_of_sum)] == [0.0, 0.0]

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vision and EKF are compared at the same instant and place."""

from pathlib import Path

import numpy as np
import pytest

from tests.unit.viso.report.log_maker import LogMaker, material_of
from viso.estimators.series import Series, wrapped_deg
from viso.report.agreement import Poses, interpolated, lag_ms, vision_less_ekf
from viso.report.flight_data import Material

NO_MOVES = np.zeros(0)


def poses(*times_s: float, yaw_deg: float = 0.0) -> Poses:
    """Return poses that move by 10 m/s north and turn by ``yaw_deg`` each."""
    times = np.array(times_s)
    rpy = np.column_stack([0 * times, 0 * times, yaw_deg * np.arange(len(times))])
    return Poses(times, np.outer(times, [10.0, 0, 0]), rpy, np.zeros((len(times), 3)))


def test_vision_agrees_when_its_delay_is_taken_off(material: Material) -> None:
    found = vision_less_ekf(material)
    calm = (found.time_s > 1.1) & (found.time_s < 8.9)
    # PX is of 50 ms before the record: 20 ms of lag and 30 ms of VISO_DELAY_MS.
    assert np.abs(found.pos_ned[calm]).max() < 1e-3
    assert np.abs(found.yaw_deg[calm]).max() < 1e-9
    assert np.nanmax(found.pos_ned[:, 1]) == 2.0


def test_camera_is_compared_where_it_is(tmp_path: Path) -> None:
    maker = LogMaker()
    maker.parameter("VISO_POS_X", 0.5)
    for time_s in (1.0, 1.1, 1.2):
        maker.add("VISP", time_s, PY=0.5, Y=90.0)
        maker.add("XKF1", time_s, Yaw=90.0)
    found = vision_less_ekf(material_of(maker, tmp_path / "a.BIN"))
    assert np.abs(found.pos_ned[1:]).max() < 1e-6


def test_nothing_is_interpolated_over_a_gap_or_a_jump_or_beyond_the_ends() -> None:
    known = poses(0.0, 0.2, 1.0, 1.2)
    at = np.array([-0.1, 0.1, 0.5, 1.1, 1.3])
    north = interpolated(known, at, NO_MOVES).pos_ned[:, 0]
    assert np.isnan(north).tolist() == [True, False, True, False, True]
    assert north[[1, 3]] == pytest.approx([1.0, 11.0])
    assert np.isnan(interpolated(known, at, np.array([0.2])).pos_ned[:, 0]).tolist() == [True, True, True, False, True]


def test_yaw_is_interpolated_the_short_way() -> None:
    known = poses(0.0, 0.1, yaw_deg=20.0)
    turned = Poses(known.time_s, known.pos_ned, (known.rpy_deg + np.array([0, 0, 350])) % 360, known.vel_ned)
    yaw = interpolated(turned, np.array([0.05]), NO_MOVES).rpy_deg[0, 2]
    assert wrapped_deg(yaw) == pytest.approx(0.0)


def test_lag_survives_the_wrap_of_milliseconds() -> None:
    late = Series(np.array([(2**32 + 15) * 1e-3]), {"CTimeMS": np.array([2.0**32 - 10])})
    early = Series(np.array([1.0]), {"CTimeMS": np.array([1005.0])})
    assert (lag_ms(late)[0], lag_ms(early)[0]) == (pytest.approx(25.0), pytest.approx(-5.0))

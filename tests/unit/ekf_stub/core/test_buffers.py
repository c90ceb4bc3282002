# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the estimator's buffers become."""

import pytest

from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.inputs.obs_ring import RingSizes
from ekf_stub.inputs.sources import EkfSources

DELAYS = {"EK3_HGT_DELAY": 60, "EK3_FLOW_DELAY": 10, "EK3_BCN_DELAY": 50, "VISO_DELAY_MS": 10}


def sources(value: int) -> EkfSources:
    return EkfSources(lambda name: value if name == "SRC1_POSXY" else 0)


@pytest.mark.parametrize(("params", "source", "has_camera", "sizes"), [
    ({}, 6, True, RingSizes(6, 5, 2)),
    ({"VISO_DELAY_MS": 250}, 6, True, RingSizes(21, 19, 8)),
    ({"VISO_DELAY_MS": 250}, 6, False, RingSizes(6, 5, 2)),
    ({"VISO_DELAY_MS": 9000}, 6, True, RingSizes(21, 19, 8)),
    ({}, 3, True, RingSizes(17, 16, 7)),
    ({"EK3_HGT_DELAY": 120}, 0, False, RingSizes(11, 10, 4)),
    ({"EK3_HGT_DELAY": 0, "EK3_BCN_DELAY": 0}, 0, False, RingSizes(6, 5, 2)),
])  # fmt: skip
def test_buffers_are_as_long_as_the_longest_delay_takes(
    params: dict[str, int], source: int, has_camera: bool, sizes: RingSizes
) -> None:
    values = {**DELAYS, **params}
    assert buffer_sizes(values.__getitem__, sources(source), has_camera=has_camera) == sizes


@pytest.mark.parametrize(("lag_s", "imu_steps"), [(0.0, 6), (0.1, 9), (0.12, 11), (0.22, 19), (0.3, 21)])
def test_receivers_lag_counts_only_where_gps_is_a_source(lag_s: float, imu_steps: int) -> None:
    assert buffer_sizes(DELAYS.__getitem__, sources(3), has_camera=False, gps_lag_s=lag_s).imu == imu_steps
    assert buffer_sizes(DELAYS.__getitem__, sources(6), has_camera=False, gps_lag_s=lag_s).imu == 6


def test_flow_waits_where_there_is_a_sensor_and_ranges_wait_for_two_of_them() -> None:
    sizes = buffer_sizes(DELAYS.__getitem__, sources(6), has_camera=True, has_flow=True)
    assert sizes == RingSizes(6, 5, 2, flow=5)
    assert (sizes.ranges, RingSizes(3, 3, 2).ranges) == (4, 3)

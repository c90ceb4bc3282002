# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator finds around it unless told otherwise, and how long its buffers become."""

import contextlib
from collections.abc import Callable

import pytest

from ap_core.param import ParamTable
from ap_core.vector3 import Vector3f
from ekf_stub.core.surroundings import Surroundings
from ekf_stub.inputs.obs_ring import RingSizes
from ekf_stub.inputs.sources import EkfSources
from viso.parameters.ekf3 import ekf3_var_info, make_ekf3_group

DELAYS = {"EK3_HGT_DELAY": 60, "EK3_FLOW_DELAY": 10, "EK3_BCN_DELAY": 50, "VISO_DELAY_MS": 10}


def sources(value: int) -> EkfSources:
    return EkfSources(lambda name: value if name == "SRC1_POSXY" else 0)


def around(**params: int) -> Surroundings:
    values = {"EK3_ENABLE": 1, "EK3_IMU_MASK": 3, **DELAYS, **params}
    return Surroundings(get_int=values.__getitem__)


def test_vehicle_is_parked_and_has_everything_but_gps_reception_by_default() -> None:
    default = Surroundings()
    assert not default.is_armed()
    assert default.is_fitted("VisualOdom")
    assert (default.gps(), default.home(), default.flying_ms()) == (None, None, 0)
    assert default.imu_pos() == Vector3f()


def test_numbers_are_the_defaults_of_the_vehicles_parameters() -> None:
    default, params = Surroundings(), ParamTable([make_ekf3_group()])
    known = {}
    for row in ekf3_var_info():
        with contextlib.suppress(KeyError):
            known[row.name] = default.ekf3_number(row.name)
    assert known.keys() >= {"POS_I_GATE", "GLITCH_RAD", "ALT_M_NSE", "GYRO_P_NSE", "TAU_OUTPUT"}
    assert known == {name: pytest.approx(params.get_number(f"EK3_{name}")) for name in known}


@pytest.mark.parametrize(("params", "mask"), [({}, 3), ({"EK3_IMU_MASK": 1}, 1), ({"EK3_ENABLE": 0}, 0)])
def test_disabled_filter_has_no_cores(params: dict[str, int], mask: int) -> None:
    assert around(**params).imu_mask() == mask


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
    assert around(**params).buffer_sizes(sources(source), has_camera=has_camera) == sizes


def test_listener_for_yaw_may_be_left_out() -> None:
    listener: Callable[[], None] = Surroundings().on_yaw_reset
    listener()

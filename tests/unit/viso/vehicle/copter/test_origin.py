# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's origin in a release that keeps it: what is logged and announced, kept, and taken again."""

from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.inputs.measurements import GpsSample
from mav_handlers.wire.messages import GPS_GLOBAL_ORIGIN, PARAM_VALUE, SET_GPS_GLOBAL_ORIGIN
from tests.unit.viso.conftest import Bench
from viso.firmware.releases import JULY_2025, STABLE_4_7, Firmware
from viso.vehicle.config import bench

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

PLACE = Location(-353_632_610, 1_491_652_300, 58_400)
KEPT = {"AHRS_ORIGIN_LAT": -35.363261, "AHRS_ORIGIN_LON": 149.16523, "AHRS_ORIGIN_ALT": 584.0}
BY_CAMERA = {"VISO_TYPE": 1.0, "EK3_SRC1_POSXY": 6.0, "EK3_SRC1_POSZ": 1.0}
KEEP, USE_KEPT = 8.0, 16.0


def by_gps(vehicle: "Vehicle") -> AhrsBase:
    """Make an AHRS whose GPS says all the time that it stands at a place."""
    ahrs = bench()(vehicle)
    ahrs.source.gps = lambda: GpsSample(  # type: ignore[method-assign]
        vehicle.clock.millis(), 3, PLACE, Vector3f(), num_sats=10, hdop=100
    )
    return ahrs


def origins(rig: Bench) -> list[int]:
    return [record["Type"] for record in rig.written("ORGN")]


def set_origin(rig: Bench) -> None:
    rig.send(SET_GPS_GLOBAL_ORIGIN(1, PLACE.lat, PLACE.lng, PLACE.alt_cm * 10))
    rig.run_for(0.1)


@pytest.mark.parametrize(("firmware", "logged"), [(JULY_2025, [0, 1]), (STABLE_4_7, [0, 0, 1])])
def test_origin_of_a_gps_is_logged_before_home(firmware: Firmware, logged: list[int]) -> None:
    rig = Bench({}, by_gps, None, firmware)
    rig.boot()
    rig.run_to(25.0)
    assert origins(rig) == logged


def test_origin_of_a_client_is_logged_once_and_kept() -> None:
    rig = Bench({**BY_CAMERA, "AHRS_OPTIONS": KEEP}, bench(), None, STABLE_4_7)
    rig.boot()
    set_origin(rig)
    assert origins(rig)[0] == 0
    assert origins(rig).count(1) == origins(rig).count(0) - 1
    echoed = {message.param_id: message.param_value for message in rig.received() if isinstance(message, PARAM_VALUE)}
    assert echoed == pytest.approx(KEPT)
    assert KEPT.keys() <= rig.vehicle.params.stored_values().keys()


def test_origin_is_not_kept_unless_that_is_wanted() -> None:
    rig = Bench(BY_CAMERA, bench(), None, STABLE_4_7)
    rig.boot()
    set_origin(rig)
    assert not KEPT.keys() & rig.vehicle.params.stored_values().keys()


def test_kept_origin_is_used_without_a_gps() -> None:
    rig = Bench({**BY_CAMERA, **KEPT, "AHRS_OPTIONS": USE_KEPT}, bench(), None, STABLE_4_7)
    rig.run_to(8.0)
    texts = [text for _, _, text in rig.texts]
    used = texts.index("AHRS: using recorded origin:-35.36326,149.1652,584.0")  # as recorded
    assert texts.index("AHRS: EKF3 active") < texts.index("EKF3 IMU0 origin set") < used
    origin = rig.vehicle.ahrs.origin()
    assert origin is not None
    assert (origin.lat, origin.lng) == pytest.approx((PLACE.lat, PLACE.lng), abs=100)  # in single precision
    assert origin.alt_cm == PLACE.alt_cm
    assert any(isinstance(message, GPS_GLOBAL_ORIGIN) for message in rig.received())


@pytest.mark.parametrize("name", KEPT)
def test_kept_origin_may_be_any_number(name: str) -> None:
    rig = Bench({**BY_CAMERA, **KEPT, "AHRS_OPTIONS": USE_KEPT, name: -3e38}, bench(), None, STABLE_4_7)
    rig.run_to(8.0)
    assert any(text.startswith("AHRS: using recorded origin:") for _, _, text in rig.texts)


@pytest.mark.parametrize(
    "params",
    [
        {"AHRS_OPTIONS": 0.0},
        {"EK3_SRC1_POSXY": 3.0},
        {"EK3_SRC1_POSZ": 3.0},
        dict.fromkeys(KEPT, 0.0),
    ],
    ids=["unwanted", "gps", "height by gps", "none"],
)
def test_kept_origin_is_not_used(params: dict[str, float]) -> None:
    rig = Bench({**BY_CAMERA, **KEPT, "AHRS_OPTIONS": USE_KEPT, **params}, bench(), None, STABLE_4_7)
    rig.run_to(8.0)
    assert rig.vehicle.ahrs.origin() is None


def test_releases_before_keep_none() -> None:
    rig = Bench({**BY_CAMERA, "AHRS_OPTIONS": KEEP + USE_KEPT}, bench(), None, JULY_2025)
    rig.boot()
    set_origin(rig)
    assert rig.vehicle.ahrs.origin() is not None
    assert not [name for name in rig.vehicle.params.stored_values() if "ORIGIN" in name]

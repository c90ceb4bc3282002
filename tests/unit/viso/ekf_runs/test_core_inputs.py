# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which sensors a core uses: its own, those of its number, and what stands in for them."""

from typing import Any

import pytest

from ekf_stub.filter.inertial import Array
from viso.ekf_runs.core_inputs import CoreInputs
from viso.ekf_runs.inputs import ReplayInputs
from viso.logs.record_fields import RecordError

GPS, BARO, COMPASS = 1, 2, 4
GOOD, NO_ACCEL = 15, 14


class Record:
    """A record of a log."""

    def __init__(self, kind: str, **fields: float) -> None:
        self._kind = kind
        self.__dict__.update(fields)

    def get_type(self) -> str:
        return self._kind


class Rig:
    """The inputs of the second of two cores."""

    def __init__(self) -> None:
        self.inputs, self.affinity = ReplayInputs(), 0
        self.core = CoreInputs(self.inputs, 1, 1, lambda: self.affinity)
        self.take("RFRH", TimeUS=1000, TF=0)
        self.take("RISH", PG=0, PA=0, AC=2, LD=0.0025)
        self.take("RMGH", Dec=0.2, Avail=1, NumInst=2, C=1, FUsable=0)
        for i in range(2):
            self.imu(i)
            self.baro(i)
            self.mag(i)

    def take(self, kind: str, **fields: Any) -> None:
        self.inputs.take(Record(kind, **fields))

    def imu(self, i: int, flags: int = GOOD) -> None:
        deltas = dict.fromkeys(("DVX", "DVY", "DVZ", "DAX", "DAY", "DAZ"), 0.001 * (i + 1))
        self.take("RISI", **deltas, DVDT=0.0025, DADT=0.0025, Flags=flags, I=i)

    def baro(self, i: int, healthy: int = 1) -> None:
        self.take("RBRI", LastUpdate=900, Alt=float(i), H=healthy, I=i)

    def mag(self, i: int, healthy: int = 1) -> None:
        self.take("RMGI", LU=900, FX=float(i), FY=0.0, FZ=400.0, OX=0.0, OY=0.0, OZ=0.0, UFY=1, H=healthy, I=i)

    def gps(self, i: int, fix: int = 3) -> None:
        self.take("RGPI", OX=0.0, OY=0.0, OZ=0.0, Lg=0.2, Flags=0, Stat=fix, NSats=10, I=i)
        values = {"TS": 900, "Lat": 0, "Lon": 0, "Alt": i, "HD": 80, "VX": 0.0, "VY": 0.0, "VZ": 0.0}
        self.take("RGPJ", **values, SA=0.1, HA=0.1, VA=0.1, Y=0.0, I=i)


@pytest.fixture
def rig() -> Rig:
    return Rig()


def first(vector: Array) -> float:
    return float(vector[0])


def test_core_uses_its_own_imu(rig: Rig) -> None:
    delta = rig.core.delta()
    assert (first(delta.del_vel), first(delta.del_ang)) == (0.002, 0.002)
    assert delta is rig.inputs.imus.readings[1].delta


def test_sensor_that_fails_is_replaced_by_the_first(rig: Rig) -> None:
    rig.imu(1, NO_ACCEL)
    delta = rig.core.delta()
    assert (rig.core.accel, first(delta.del_ang), first(delta.del_vel)) == (0, 0.002, 0.001)


@pytest.mark.parametrize("first", [2, 255])
def test_sensor_that_fails_has_no_substitute_without_data(rig: Rig, first: int) -> None:
    rig.imu(1, NO_ACCEL)
    rig.take("RISH", PG=0, PA=first, AC=2, LD=0.0025)
    with pytest.raises(RecordError, match=rf"\Ano RISI record of IMU {first}, "):
        rig.core.delta()


def test_rates_are_filtered_once_a_frame(rig: Rig) -> None:
    rig.inputs.filter_rates()
    rates = rig.core.imu_rates()
    assert rates is not None
    gyro = rates.gyros[1]
    assert gyro is not None
    rig.inputs.filter_rates()
    assert rates.gyros[1] == gyro


def test_imu_that_is_not_there_has_no_data(rig: Rig) -> None:
    rig.imu(2)
    assert list(rig.inputs.imus.readings) == [0, 1]


def test_other_sensors_are_the_primary_ones_without_affinity(rig: Rig) -> None:
    rig.take("RGPH", NumInst=2, Primary=0)
    for i in range(2):
        rig.gps(i)
    assert rig.core.baro() == (900, 0.0)
    assert rig.core.compasses() is rig.inputs.compasses
    assert rig.core.gps() is rig.inputs.gps is not None


def test_other_sensors_are_those_of_the_cores_number_with_affinity(rig: Rig) -> None:
    rig.affinity = GPS | BARO | COMPASS
    rig.take("RGPH", NumInst=2, Primary=0)
    for i in range(2):
        rig.gps(i)
    compasses, gps = rig.core.compasses(), rig.core.gps()
    assert gps is not None
    assert (rig.core.baro(), compasses.own, len(compasses.readings), gps.location.alt_cm) == ((900, 1.0), 1, 2, 1)
    assert rig.core.compasses() is compasses
    assert rig.core.gps() is gps


def test_affinity_ends_where_the_sensor_is_not_good(rig: Rig) -> None:
    rig.affinity = GPS | BARO | COMPASS
    rig.take("RGPH", NumInst=2, Primary=0)
    rig.gps(0)
    rig.gps(1, fix=2)
    rig.baro(1, healthy=0)
    assert rig.core.gps() is rig.inputs.gps
    assert rig.core.baro() == (900, 0.0)
    third = CoreInputs(rig.inputs, 2, 0, lambda: rig.affinity)
    assert (third.baro(), third.gps()) == ((900, 0.0), rig.inputs.gps)

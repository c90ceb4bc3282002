# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which sensors a core uses: its own, those of its number, and what stands in for them."""

from typing import Any

import pytest

from viso.replay.ekf.inputs import CoreInputs, ReplayInputs

GPS, BARO, COMPASS = 1, 2, 4


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
        self.core = CoreInputs(self.inputs, 1)
        self.take("RMGH", Dec=0.2, Avail=1, NumInst=2, AutoDec=1, C=1, FUsable=0)
        for i in range(2):
            self.baro(i)
            self.mag(i)

    def take(self, kind: str, **fields: Any) -> None:
        self.inputs.take(Record(kind, **fields))

    def baro(self, i: int, healthy: int = 1) -> None:
        self.take("RBRI", LastUpdate=900, Alt=float(i), H=healthy, I=i)

    def mag(self, i: int, healthy: int = 1) -> None:
        self.take("RMGI", LU=900, FX=float(i), FY=0.0, FZ=400.0, OX=0.0, OY=0.0, OZ=0.0, UFY=1, H=healthy, HSF=1, I=i)

    def gps(self, i: int, fix: int = 3) -> None:
        self.take("RGPI", OX=0.0, OY=0.0, OZ=0.0, Lg=0.2, Flags=0, Stat=fix, NSats=10, I=i)
        values = {"TS": 900, "Lat": 0, "Lon": 0, "Alt": i, "HD": 80, "VX": 0.0, "VY": 0.0, "VZ": 0.0}
        self.take("RGPJ", **values, SA=0.1, HA=0.1, VA=0.1, Y=0.0, I=i)


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_other_sensors_are_the_primary_ones_without_affinity(rig: Rig) -> None:
    rig.take("RGPH", NumInst=2, Primary=0)
    for i in range(2):
        rig.gps(i)
    assert rig.core.baro(rig.affinity) == (900, 0.0)
    assert rig.core.compasses(rig.affinity) is rig.inputs.compasses
    assert rig.core.gps(rig.affinity) is rig.inputs.gps is not None


def test_other_sensors_are_those_of_the_cores_number_with_affinity(rig: Rig) -> None:
    rig.affinity = GPS | BARO | COMPASS
    rig.take("RGPH", NumInst=2, Primary=0)
    for i in range(2):
        rig.gps(i)
    compasses, gps = rig.core.compasses(rig.affinity), rig.core.gps(rig.affinity)
    assert gps is not None
    assert (rig.core.baro(rig.affinity), compasses.own, len(compasses.readings), gps.location.alt_cm) == (
        (900, 1.0),
        1,
        2,
        1,
    )
    assert rig.core.compasses(rig.affinity) is compasses
    assert rig.core.gps(rig.affinity) is gps


def test_affinity_ends_where_the_sensor_is_not_good(rig: Rig) -> None:
    rig.affinity = GPS | BARO | COMPASS
    rig.take("RGPH", NumInst=2, Primary=0)
    rig.gps(0)
    rig.gps(1, fix=2)
    rig.baro(1, healthy=0)
    assert rig.core.gps(rig.affinity) is rig.inputs.gps
    assert rig.core.baro(rig.affinity) == (900, 0.0)
    third = CoreInputs(rig.inputs, 2)
    assert (third.baro(rig.affinity), third.gps(rig.affinity)) == ((900, 0.0), rig.inputs.gps)

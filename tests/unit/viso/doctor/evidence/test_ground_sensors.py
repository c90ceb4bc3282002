# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a log has of flow and ranges."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from ap_core.dataflash_columns import LogColumns
from ekf_stub.inputs.measurements import RangeStatus
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import DISTANCE_SENSOR
from tests.unit.viso.report.log_maker import LogMaker
from viso.doctor.evidence.ground_sensors import GroundListener, GroundSensors, ground_sensors_in

OF = "TimeUS,Qual,flowX,flowY,bodyX,bodyY", "QBffff"
ROFH = "FX,FY,GX,GY,Tms,PX,PY,PZ,HgtOvr,Qual", "ffffIffffB"
RFND = "TimeUS,Instance,Dist,Stat,Orient,Quality", "QBfBBb"
OLD_RFND = "TimeUS,Dist1,Orient1,Dist2,Orient2", "QCBCB"
IMU = "TimeUS,I,GyrX,GyrY,GyrZ", "QBfff"
XKF5 = "TimeUS,C,NI,FIX,FIY,AFI,HAGL,offset,RI,rng,Herr,eAng,eVel,ePos", "QBBhhhcccCCfff"


def told(maker: LogMaker) -> GroundSensors:
    return ground_sensors_in(LogColumns(maker.data))


def logged(kind: str, layout: tuple[str, str], *rows: Mapping[str, float]) -> GroundSensors:
    """Return what a log has that holds records of one kind, of 2 s, and XKF1 of two cores."""
    maker = LogMaker()
    structure = maker.define(kind, *layout)
    for fields in rows:
        maker.add_to(structure, 2.0, **fields)
    for core in (0, 1):
        maker.add("XKF1", 2.0, C=core, VN=1.5 + core, VE=-0.5)
    return told(maker)


def test_flow_is_what_its_driver_logged() -> None:
    found = logged("OF", OF, {"Qual": 51, "flowX": 0.5, "flowY": -0.25, "bodyX": 0.125, "bodyY": 1.0})
    (flow,) = found.flows
    assert (flow.origin, flow.time_us.tolist(), flow.quality.tolist()) == ("OF", [2_000_000], [51])
    assert (flow.rate.tolist(), flow.body.tolist()) == ([[0.5, -0.25]], [[0.125, 1.0]])


def test_motion_is_of_the_first_imu_and_core() -> None:
    found = logged("IMU", IMU, {"GyrX": 0.5, "GyrY": 0.25, "GyrZ": -1.0}, {"I": 1, "GyrX": 9.0})
    assert found.turning.tolist() == [[2e6, 0.5, 0.25, -1.0]]
    assert found.velocity.tolist() == [[2e6, 1.5, -0.5]]


def test_ratio_and_height_are_in_ones_and_metres() -> None:
    found = logged("XKF5", XKF5, {"NI": 250, "HAGL": 3.5})
    assert found.check == pytest.approx(np.array([[2e6, 2.5, 3.5]]))


def test_a_stream_beside_a_log_has_the_sensors_of_both() -> None:
    stream, log = logged("OF", OF, {"Qual": 1}), logged("IMU", IMU, {"GyrX": 0.5})
    both = stream.beside(log)
    assert (both.flows, both.turning.tolist()) == (stream.flows, log.turning.tolist())
    alone = stream.beside(GroundSensors())
    assert (alone.flows, alone.ranges, alone.turning is stream.turning) == (stream.flows, stream.ranges, True)


def test_flow_is_what_was_handed_over_where_the_driver_logged_none() -> None:
    maker = LogMaker()
    maker.add_to(maker.define("ROFH", *ROFH), 0.0, FX=0.5, FY=1.0, GX=0.25, GY=2.0, Tms=3000, Qual=80)
    (flow,) = told(maker).flows
    assert (flow.origin, flow.time_us.tolist(), flow.quality.tolist()) == ("ROFH", [3_000_000], [80])
    assert (flow.rate.tolist(), flow.body.tolist()) == ([[0.5, 1.0]], [[0.25, 2.0]])


def test_ranges_are_told_apart_by_instance() -> None:
    maker = LogMaker()
    layout = maker.define("RFND", *RFND)
    for instance, status, orient in (
        (0, RangeStatus.GOOD, 25),
        (1, RangeStatus.TOO_NEAR, 0),
        (0, RangeStatus.TOO_FAR, 25),
    ):
        maker.add_to(layout, 2.0, Instance=instance, Dist=1.5, Stat=int(status), Orient=orient)
    down, ahead = told(maker).ranges
    assert (down.status.tolist(), down.dist_m.tolist(), down.looks_down) == ([4, 3], [1.5, 1.5], True)
    assert (ahead.instance, bool(ahead.is_good.any()), ahead.looks_down) == (1, False, False)


def test_a_distance_of_an_older_log_is_good_if_there_is_one() -> None:
    maker = LogMaker()
    layout = maker.define("RFND", *OLD_RFND)
    for number, dist_m in enumerate((0.0, 2.5)):
        maker.add_to(layout, 2.0 + number, Dist1=dist_m, Orient1=25)
    (down,) = told(maker).ranges
    assert (down.dist_m.tolist(), down.is_good.tolist(), down.looks_down) == ([0.0, 2.5], [False, True], True)


@pytest.mark.parametrize(
    ("orient", "most_m"), [(25, 20.0), (0, 1.0), (24, 30.0)], ids=["second", "first", "taken by none"]
)
def test_limits_are_of_the_finder_that_takes_the_orientation(orient: int, most_m: float) -> None:
    first = {"RNGFND1_TYPE": 10, "RNGFND1_ORIENT": 0, "RNGFND1_MAX": 1.0}
    second = {
        "RNGFND2_TYPE": 10,
        "RNGFND2_MAX_CM": 2000.0,
        "RNGFND3_TYPE": 1,
        "RNGFND3_ORIENT": 24,
        "RNGFND3_MAX": 5.0,
        "RNGFND4_TYPE": math.nan,
    }
    codec, listener = Codec(1, 198), GroundListener()
    codec.feed(codec.encode(DISTANCE_SENSOR(0, 5, 3000, 300, 0, 1, orient, 0)))
    received = codec.next_received()
    assert isinstance(received, Received)
    listener.take(0, 1, received.header, received.message)
    (one,) = listener.sensors(1, {**first, **second}, reads_flow_rates=False).ranges
    assert (one.low_m.tolist(), one.high_m.tolist()) == ([0.05], [most_m])


def test_log_without_any_has_none() -> None:
    maker = LogMaker()
    maker.parameter("FLOW_TYPE", 10)
    found = told(maker)
    assert (found.flows, found.ranges, len(found.turning), len(found.check)) == ((), (), 0, 0)

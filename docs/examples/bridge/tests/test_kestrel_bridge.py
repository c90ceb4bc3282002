# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the autopilot makes of what the bridge sends."""

import math
from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from kestrel_bridge import Bridge, CameraPose, UdpPort

from viso.testing import Autopilot, UdpAutopilot

FACING_NORTH = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))  # a quarter turn to the left of east
FACING_EAST = (0.0, 0.0, 0.0, 1.0)


def pose(time_us: int = 0, **fields: Any) -> CameraPose:
    """Return a pose at the origin, facing north, unless told otherwise."""
    values = {
        "position_enu": (0.0, 0.0, 0.0),
        "velocity_enu": (0.0, 0.0, 0.0),
        "quat_xyzw": FACING_NORTH,
        "confidence": 3,
        "map_id": 1,
    }
    return CameraPose(time_us, **{**values, **fields})


def flight(duration_s: float, rate_hz: int = 40, **fields: Any) -> Iterator[CameraPose]:
    """Yield the poses of a flight to the north at 1 m/s; the camera's clock began long before the autopilot's."""
    for count in range(round(duration_s * rate_hz)):
        time_s = count / rate_hz
        there = {"position_enu": (0.0, time_s, 0.0), "velocity_enu": (0.0, 1.0, 0.0)}
        yield pose(3_600_000_000 + round(time_s * 1e6), **{**there, **fields})


def fly(autopilot: Autopilot, bridge: Bridge, poses: Iterable[CameraPose], rate_hz: int = 40) -> None:
    """Give poses to the bridge at a rate, in the autopilot's time."""
    for one in poses:
        bridge.take(one)
        autopilot.advance(s=1 / rate_hz)


def test_flight_is_used_by_the_estimator(autopilot: Autopilot, bridge: Bridge) -> None:
    fly(autopilot, bridge, flight(0.8))
    autopilot.assert_accepted()
    autopilot.assert_fused("pose")
    autopilot.assert_fused("velocity")
    autopilot.assert_healthy()
    autopilot.assert_text("is using external nav data")


def test_position_and_velocity_are_turned_to_north_east_down(autopilot: Autopilot, bridge: Bridge) -> None:
    bridge.take(pose(position_enu=(1.0, 2.0, 3.0), velocity_enu=(0.1, 0.2, 0.3), quat_xyzw=FACING_EAST))
    [position], [velocity] = autopilot.records_of("VISP"), autopilot.records_of("VISV")
    assert [position[axis] for axis in ("PX", "PY", "PZ")] == pytest.approx([2.0, 1.0, -3.0])
    assert [position[axis] for axis in "RPY"] == pytest.approx([0.0, 0.0, 90.0])
    assert [velocity[axis] for axis in ("VX", "VY", "VZ")] == pytest.approx([0.2, 0.1, -0.3])


def test_fast_camera_is_thinned_out(autopilot: Autopilot, bridge: Bridge) -> None:
    fly(autopilot, bridge, flight(0.2, rate_hz=200), rate_hz=200)
    autopilot.assert_accepted(count=8, message="ODOMETRY")


@pytest.mark.extnav_autopilot(params={"VISO_QUAL_MIN": 50})
def test_poses_of_low_confidence_are_withheld(autopilot: Autopilot, bridge: Bridge) -> None:
    fly(autopilot, bridge, [pose(0, confidence=3), pose(25_000, confidence=1), pose(50_000, confidence=0)])
    autopilot.assert_accepted(count=1)
    autopilot.assert_ignored(reason="quality_below_min", count=2)


@pytest.mark.extnav_autopilot(preset="voxl")
def test_new_map_is_told_as_a_reset(autopilot: Autopilot, bridge: Bridge) -> None:
    fly(autopilot, bridge, [pose(0), pose(25_000), pose(30_000, map_id=2, position_enu=(50.0, 0.0, 0.0))])
    autopilot.assert_text("VisOdom: reset")
    assert [record["Rst"] for record in autopilot.records_of("VISP")] == [0, 0, 1]


def test_silence_is_noticed(autopilot: Autopilot, bridge: Bridge) -> None:
    bridge.take(pose())
    autopilot.assert_healthy()
    autopilot.advance(ms=300)
    with pytest.raises(AssertionError, match="VisOdom: not healthy"):
        autopilot.assert_healthy()


def test_log_of_a_flight_is_as_it_was(autopilot: Autopilot, bridge: Bridge) -> None:
    fly(autopilot, bridge, flight(0.25))
    autopilot.assert_golden("flight")


def test_nothing_is_sent_to_nobody(autopilot: Autopilot, unconnected: Bridge) -> None:
    unconnected.take(pose())
    assert autopilot.verdicts == []


def test_bridge_waits_for_the_autopilot(extnav_autopilot_udp: UdpAutopilot) -> None:
    with UdpPort(extnav_autopilot_udp.address, timeout_s=0.05) as port, extnav_autopilot_udp.running(speedup=20):
        bridge = Bridge(port)
        bridge.wait_for_autopilot()
        bridge.take(pose())
    extnav_autopilot_udp.assert_accepted(count=1)

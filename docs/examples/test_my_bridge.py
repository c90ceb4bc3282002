# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Test a companion's messages against the autopilot: in process, in virtual time, without a socket."""

from dataclasses import replace

from emulator.scheduler import Scheduler
from emulator.vehicle import Vehicle, VehicleConfig
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ODOMETRY

POSE = ODOMETRY(
    time_usec=1_000_000,
    frame_id=20,
    child_frame_id=12,
    x=1.0,
    y=2.0,
    z=-3.0,
    q=(1.0, 0.0, 0.0, 0.0),
    vx=0.0,
    vy=0.0,
    vz=0.0,
    rollspeed=0.0,
    pitchspeed=0.0,
    yawspeed=0.0,
    pose_covariance=(0.0,) * 21,
    velocity_covariance=(0.0,) * 21,
    quality=90,
)


def verdict_of(message: ODOMETRY) -> str:
    """Send one message to a fresh autopilot three seconds after boot, and return the rule that decided about it."""
    vehicle = Vehicle(VehicleConfig(defaults={"VISO_TYPE": 1, "VISO_QUAL_MIN": 50}))
    wire = vehicle.endpoint.open_channel("test")
    time = Scheduler(vehicle)
    time.run_until(3_000_000)
    time.deliver(wire, Codec(system_id=1, component_id=197).encode(message))
    event = vehicle.endpoint.next_event()
    assert event is not None
    return event.verdict.rule.code


def test_good_pose_reaches_the_ekf() -> None:
    assert verdict_of(POSE) == "consumed"


def test_ned_frames_are_dropped() -> None:
    assert verdict_of(replace(POSE, frame_id=1, child_frame_id=8)) == "odometry_frames"


def test_low_quality_is_withheld() -> None:
    assert verdict_of(replace(POSE, quality=10)) == "quality_below_min"

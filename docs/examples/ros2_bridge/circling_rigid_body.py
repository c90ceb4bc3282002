# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stands in for the ROS 2 node of a motion capture: a body that circles, as geometry_msgs/PoseStamped.

Usage: circling_rigid_body.py TOPIC [SECONDS], for example: circling_rigid_body.py /mocap/drone/pose 60

It needs no ROS, only cyclonedds: a type of ROS 2 is a class with its name in DDS and its members in their order.
"""

import math
import os
import sys
import time
from dataclasses import dataclass

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic

RATE_HZ = 50
RADIUS_M, PERIOD_S = 2.0, 20.0


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


def pose_at(time_s: float) -> Pose:
    """Return the body on its circle, x forward along it; the world has x east, y north, z up."""
    angle = 2 * math.pi * time_s / PERIOD_S
    yaw = angle + math.pi / 2
    position = Point(RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), 1.0)
    return Pose(position, Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))


def main() -> None:
    """Publish until the time is up."""
    topic = sys.argv[1]
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else math.inf
    participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", "0")))
    writer = DataWriter(participant, Topic(participant, f"rt{topic}", PoseStamped))
    start_s = time.time()
    number = 0
    while (time_s := number / RATE_HZ) < seconds:
        time.sleep(max(0.0, start_s + time_s - time.time()))
        sec, nanosec = divmod(time.time_ns(), 10**9)
        writer.write(PoseStamped(Header(Time(sec, nanosec), "map"), pose_at(time_s)))
        number += 1


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A publisher of transforms and `viso serve --dds`, two processes that meet over DDS on loopback, in real time."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink.DFReader import DFReader_binary

from mav_handlers.dds import Transform
from mav_handlers.wire.codec import Codec
from tests.figure_of_eight import Pose, figure_of_eight
from tests.interop.programs import LOOPBACK
from viso.dds import messages as ros
from viso.dds.graph import DEFAULT, LATCHED, SENSOR_DATA, Participant, Reader, Writer
from viso.logs.logger import MemoryLog
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig

pytestmark = pytest.mark.interop

SERVE = (sys.executable, "-c", "from viso.cli import main; main()", "serve")
PARAMS = {
    "VISO_TYPE": 1,
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "EK3_SRC1_POSZ": 6,
    "EK3_SRC1_YAW": 6,
    "GPS1_TYPE": 0,
}
DOMAIN = 1 + os.getpid() % 100
RATE_HZ = 20
REST_S = 8
FLIGHT_S = 12
DURATION_S = REST_S + FLIGHT_S + 8
LIMIT_S = 90.0
WAIT_S = 30.0
TOPICS: dict[str, type[Any]] = {
    "/ap/time": ros.Time,
    "/ap/pose/filtered": ros.PoseStamped,
    "/ap/twist/filtered": ros.TwistStamped,
    "/ap/imu/experimental/data": ros.Imu,
    "/ap/geopose/filtered": ros.GeoPoseStamped,
    "/ap/gps_global_origin/filtered": ros.GeoPointStamped,
}
REPEATS = 5
FAST = 100
UNIX_S = 1_760_000_000


def message_of(*transforms: Transform) -> ros.TFMessage:
    return ros.TFMessage(
        [
            ros.TransformStamped(
                ros.Header(ros.Time(one.sec, one.nanosec), one.frame_id),
                one.child_frame_id,
                ros.Transform(ros.Vector3(*one.translation), ros.Quaternion(*one.rotation_xyzw)),
            )
            for one in transforms
        ]
    )


class Companion:
    """Who has odometry: it goes by the autopilot's clock."""

    def __init__(self, graph: Participant) -> None:
        self._graph = graph
        self._tf: Writer[ros.TFMessage] = graph.writer("/ap/tf", ros.TFMessage, DEFAULT)
        self._clock = graph.reader("/ap/clock", ros.Clock, SENSOR_DATA)
        self._others: dict[str, Reader[Any]] = {
            name: graph.reader(name, kind, SENSOR_DATA) for name, kind in TOPICS.items()
        }
        self._static = graph.reader("/ap/tf_static", ros.TFMessage, LATCHED)
        self._status = graph.reader("/ap/status", ros.Status, LATCHED)
        self.heard: dict[str, list[Any]] = {name: [] for name in (*TOPICS, "/ap/tf_static", "/ap/status")}
        self.sent: list[tuple[int, Pose]] = []

    def wait_until(self, time_us: int) -> int:
        """Wait for that time of the autopilot's; return the middle of the millisecond that it is then."""
        while True:
            assert self._clock.wait(WAIT_S)
            for name, reader in (*self._others.items(), ("/ap/tf_static", self._static), ("/ap/status", self._status)):
                self.heard[name] += reader.take()
            for told in self._clock.take():
                now_us = int(told.clock.sec * 1_000_000 + told.clock.nanosec // 1000)
                if now_us >= time_us:
                    return now_us // 1000 * 1000 + 500

    def send(self, *transforms: Transform) -> None:
        assert self._tf.write(message_of(*transforms))

    def fly(self) -> None:
        start_us = REST_S * 1_000_000
        for step, pose in enumerate(figure_of_eight(RATE_HZ, FLIGHT_S)):
            now_us = self.wait_until(start_us + step * 1_000_000 // RATE_HZ)
            self.send(pose.transform(now_us))
            self.sent.append((now_us, pose))

    def err(self) -> None:
        """Do what publishers do wrong, and end with all numbers NaN."""
        pose = self.sent[-1][1]
        now_us = self.wait_until(0)
        for _ in range(REPEATS):
            self.send(pose.transform(now_us, frame_id="map"))
            now_us = self.wait_until(now_us + 100_000)  # what waits is 5 messages at most
            self.send(pose.transform(UNIX_S * 1_000_000 + now_us))
            now_us = self.wait_until(now_us + 100_000)
            self.send()
            now_us = self.wait_until(now_us + 100_000)
        for _ in range(FAST // 5):  # 200 Hz and more
            now_us = self.wait_until(0)
            for _ in range(5):
                self.send(pose.transform(now_us))
            self.wait_until(now_us + 20_000)
        odd = pose.transform(self.wait_until(0))._replace(translation=(math.nan,) * 3, rotation_xyzw=(math.nan,) * 4)
        self.send(odd)

    def ask(self) -> list[Any]:
        """Ask whether the vehicle may be armed, and for a mode, as a client on rmw_cyclonedds does."""
        return [
            self._call("/ap/prearm_check", ros.TriggerRequest(ros.RequestId(77, 1)), ros.TriggerResponse),
            self._call("/ap/mode_switch", ros.ModeSwitchRequest(ros.RequestId(77, 2), 2), ros.ModeSwitchResponse),
            self._call("/ap/arm_motors", ros.ArmMotorsRequest(ros.RequestId(77, 3), False), ros.ArmMotorsResponse),
        ]

    def _call(self, service: str, request: Any, reply: type[Any]) -> Any:
        writer, reader = self._graph.client(service, type(request), reply)
        until_us = self.wait_until(0) + round(WAIT_S * 1e6)
        while not (writer.readers and reader.writers):
            assert self.wait_until(0) < until_us
        writer.write(request)
        assert reader.wait(WAIT_S)
        [answer] = reader.take()
        return answer


@dataclass(frozen=True)
class Flight:
    """What came of it: what the autopilot said in the end, its log, what was sent and heard."""

    said: dict[str, Any]
    folder: Path
    sent: list[tuple[int, Pose]]
    heard: dict[str, list[Any]]
    answers: list[Any]

    def count(self, rule: str) -> int:
        return sum(row["count"] for row in self.said["verdicts"] if row["rule"] == rule)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    folder = tmp_path_factory.mktemp("ros2")
    command = [*SERVE, "--dds", str(DOMAIN), "--master", "tcpin:127.0.0.1:0", "--imu", "follow", "--json"]
    command += ["--log-dir", str(folder), "--duration", str(DURATION_S)]
    for name, value in PARAMS.items():
        command += ["--param", f"{name}={value}"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CYCLONEDDS_URI", LOOPBACK)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as autopilot:
            try:
                with Participant(DOMAIN) as graph:
                    companion = Companion(graph)
                    companion.fly()
                    answers = companion.ask()
                    companion.err()
                out, _ = autopilot.communicate(timeout=LIMIT_S)
            finally:
                autopilot.kill()
        assert autopilot.returncode == 0
        yield Flight(json.loads(out), folder, companion.sent, companion.heard, answers)


def records(path: Path, *names: str) -> list[dict[str, Any]]:
    found = []
    with DFReader_binary(str(path)) as log:
        while (record := log.recv_match(type=list(names))) is not None:
            found.append(record.to_dict())
    return found


def poses(path: Path) -> list[dict[str, Any]]:
    """Return what is logged of poses but the times at which they arrived."""
    return [{name: value for name, value in pose.items() if name != "TimeUS"} for pose in records(path, "VISP")]


def test_log_is_that_of_the_same_poses_by_mavlink(flight: Flight, tmp_path: Path) -> None:
    log = MemoryLog()
    vehicle = Vehicle(VehicleConfig(defaults=PARAMS, open_log=lambda: log))
    scheduler, codec = Scheduler(vehicle), Codec(255, 190)
    channel = vehicle.endpoint.open_channel("companion")
    scheduler.run_until(3_000_000)  # logging begins once booting is over
    for time_us, pose in flight.sent:
        scheduler.pass_over(time_us)
        scheduler.deliver(channel, codec.encode(pose.message(time_us)))
    vehicle.close()
    (tmp_path / "mavlink.BIN").write_bytes(log.data)
    expected = poses(tmp_path / "mavlink.BIN")
    assert len(expected) == RATE_HZ * FLIGHT_S
    assert poses(flight.folder / "00000001.BIN")[: len(expected)] == expected


def test_filter_aligns_to_it_and_is_aided_by_it(flight: Flight) -> None:
    texts = [record["Message"] for record in records(flight.folder / "00000001.BIN", "MSG")]
    assert "EKF3 IMU0 yaw aligned" in texts
    assert "EKF3 IMU0 is using external nav data" in texts
    fused = sum(row["count"] for row in flight.said["filter"] if row["kind"] == "pose" and row["outcome"] == "fused")
    assert fused > RATE_HZ * FLIGHT_S * 0.9
    time_us, pose = flight.sent[-1]
    estimates = records(flight.folder / "00000001.BIN", "XKF1")
    told = next(record for record in estimates if record["TimeUS"] >= time_us and record["C"] == 0)
    assert math.dist((told["PN"], told["PE"], told["PD"]), pose.place_ned_m) < 0.5


def test_what_publishers_do_wrong_has_verdicts(flight: Flight) -> None:
    assert flight.count("tf_frames") == REPEATS
    assert flight.count("tf_empty") == REPEATS
    assert flight.count("consumed") >= len(flight.sent) + REPEATS + FAST // 5 + 1
    assert flight.count("consumed") <= len(flight.sent) + REPEATS + FAST + 1


def test_all_topics_are_told(flight: Flight) -> None:
    assert [name for name, heard in flight.heard.items() if not heard] == []
    assert flight.heard["/ap/status"][0].vehicle_type == 2
    assert flight.heard["/ap/imu/experimental/data"][-1].header.frame_id == "base_link_ned"


def test_services_answer_who_asked(flight: Flight) -> None:
    checked, switched, disarmed = flight.answers
    assert [answer.id for answer in flight.answers] == [ros.RequestId(77, number) for number in (1, 2, 3)]
    assert checked.message == ("Vehicle is Armable" if checked.success else "Vehicle is Not Armable")
    assert (switched.status, switched.curr_mode) == (True, 2)
    assert not disarmed.result

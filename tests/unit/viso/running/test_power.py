# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Restarting the vehicle in the process: what it forgets, and what it keeps."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ap_core.location import Location
from ap_core.verdict import VerdictKind
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import (
    COMMAND_ACK,
    COMMAND_LONG,
    HEARTBEAT,
    PARAM_SET,
    VISION_POSITION_ESTIMATE,
    Message,
)
from viso.logs.files import LogStore
from viso.parameters.store import MemoryParamStore
from viso.running.power import Port, PoweredVehicle
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.vehicle import Vehicle, VehicleConfig

REBOOT = 246
ALIVE = HEARTBEAT(6, 8, 0, 0, 4, 3)
POSE = VISION_POSITION_ESTIMATE(usec=1, x=1.0, y=2.0, z=3.0, roll=0.0, pitch=0.0, yaw=0.0)


class Rig:
    """A vehicle on two ports, a client on the first."""

    def __init__(self, config: VehicleConfig) -> None:
        self.booted: list[Vehicle] = []
        self.powered = PoweredVehicle(config, [Port("telemetry"), Port("radio", 57600)], on_boot=self.booted.append)
        self.codec = Codec(255, 190)
        self.scheduler = Scheduler(self.powered.vehicle)

    def run(self, seconds: float) -> None:
        self.scheduler.run_until(self.scheduler.now_us + round(seconds * 1e6))

    def tell(self, *messages: Message) -> None:
        for message in messages:
            self.scheduler.deliver(self.powered.channels[0], self.codec.encode(message))
            self.run(0.01)

    def acks(self) -> list[COMMAND_ACK]:
        codec = Codec(255, 190)
        codec.feed(self.powered.channels[0].take_output())
        frames = iter(codec.next_received, None)
        return [
            frame.message for frame in frames if isinstance(frame, Received) and isinstance(frame.message, COMMAND_ACK)
        ]

    def reboot(self) -> bool:
        self.tell(COMMAND_LONG(1, 1, REBOOT, 0, 1, 0, 0, 0, 0, 0, 0))
        restarted = self.powered.restart_if_asked()
        self.scheduler = Scheduler(self.powered.vehicle)
        self.run(2.5)
        return restarted

    def value(self, name: str) -> float:
        param = self.powered.vehicle.params.find(name)
        assert param is not None
        return float(param.value)


@pytest.fixture
def make() -> Iterator[Callable[..., Rig]]:
    rigs: list[Rig] = []

    def build(**config: object) -> Rig:
        rigs.append(Rig(VehicleConfig(links=2, **config)))  # type: ignore[arg-type]
        rigs[-1].run(2.5)
        rigs[-1].tell(ALIVE)
        return rigs[-1]

    yield build
    for rig in rigs:
        rig.powered.close()


def test_nothing_restarts_unasked(make: Callable[..., Rig]) -> None:
    rig = make()
    vehicle = rig.powered.vehicle
    assert not rig.powered.restart_if_asked()
    assert rig.powered.vehicle is vehicle


def test_answer_to_the_reboot_command_leaves_before_the_restart(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.acks()
    rig.tell(COMMAND_LONG(1, 1, REBOOT, 0, 1, 0, 0, 0, 0, 0, 0))
    assert [(ack.command, ack.result) for ack in rig.acks()] == [(REBOOT, 0)]
    assert rig.powered.restart_if_asked()


STARTED_S = 4.0
"""When the filter has a state, without which it refuses an origin."""


def test_restart_makes_a_vehicle_that_has_heard_of_nobody(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.run(STARTED_S)
    assert rig.powered.vehicle.set_origin(Location(1, 2, 3))
    assert rig.reboot()
    rig.run(STARTED_S)
    assert rig.booted[-1] is rig.powered.vehicle is not rig.booted[0]
    assert rig.powered.vehicle.ahrs.origin() is None
    assert not any(channel.active for channel in rig.powered.channels)
    assert rig.powered.vehicle.set_origin(Location(4, 5, 6))


def test_ports_stay(make: Callable[..., Rig]) -> None:
    rig = make()
    before = [(channel.name, channel.baud) for channel in rig.powered.channels]
    assert rig.reboot()
    assert [(channel.name, channel.baud) for channel in rig.powered.channels] == before


def test_camera_keeps_its_port_when_further_clients_are_there_at_the_restart(make: Callable[..., Rig]) -> None:
    rig = make(make_ahrs=by_ekf3(FlyingSource, ImuOptions()), vicon=True)
    rig.powered.add_client("telemetry#2", 0)
    assert rig.reboot()
    rig.run(2.5)
    ports = {channel.name: channel.port for channel in rig.powered.vehicle.endpoint.channels}
    assert ports == {"telemetry": 0, "radio": 1, "telemetry#2": 0, "vicon": 2}


def test_parameter_that_needs_a_reboot_works_after_it(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.tell(PARAM_SET(1, 1, "VISO_TYPE", 1.0, 2), POSE)
    assert rig.powered.vehicle.visual_odom.enabled()
    assert not rig.powered.vehicle.visual_odom.healthy()
    rig.reboot()
    rig.tell(ALIVE, POSE)
    assert rig.powered.vehicle.visual_odom.healthy()


def test_stored_parameter_is_there_after_the_restart(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.tell(PARAM_SET(1, 1, "VISO_DELAY_MS", 77.0, 4))
    rig.reboot()
    assert rig.value("VISO_DELAY_MS") == 77


def test_stream_rates_asked_for_are_forgotten(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.powered.vehicle.params.set("MAV1_EXTRA1", 4)
    rig.reboot()
    assert rig.value("MAV1_EXTRA1") == 0


def test_override_holds_over_a_restart(make: Callable[..., Rig]) -> None:
    rig = make(overrides={"VISO_POS_M_NSE": 0.3})
    rig.reboot()
    assert rig.value("VISO_POS_M_NSE") == pytest.approx(0.3)


@pytest.mark.parametrize("to", [0.0, 2.0])
def test_what_a_client_sets_wins_over_an_override_from_then_on(make: Callable[..., Rig], to: float) -> None:
    rig = make(overrides={"VISO_TYPE": 1})
    rig.tell(PARAM_SET(1, 1, "VISO_TYPE", to, 2))
    rig.reboot()
    assert rig.value("VISO_TYPE") == to
    rig.reboot()
    assert rig.value("VISO_TYPE") == to


def test_restart_begins_a_new_log(make: Callable[..., Rig], tmp_path: Path) -> None:
    rig = make(log_store=LogStore(tmp_path))
    rig.reboot()
    rig.powered.close()
    assert sorted(path.name for path in tmp_path.glob("*.BIN")) == ["00000001.BIN", "00000002.BIN"]


def test_verdicts_are_counted_over_restarts(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.tell(POSE)
    rig.reboot()
    rig.tell(POSE)
    dropped = {key: n for key, n in rig.powered.verdict_counts().items() if key[0] == "VISION_POSITION_ESTIMATE"}
    assert list(dropped.values()) == [2]
    assert all(key[1] is not VerdictKind.ACCEPTED for key in dropped)


def test_losses_of_the_log_are_counted_over_restarts(make: Callable[..., Rig], tmp_path: Path) -> None:
    rig = make(log_store=LogStore(tmp_path))
    lost: list[int] = []
    for _ in range(2):
        (log,) = tmp_path.glob("*.BIN")
        log.unlink()
        rig.run(0.5)
        rig.reboot()
        lost.append(rig.powered.log_losses()[f"{log}: deleted while it was written"])
    assert 0 < lost[0] < lost[1]
    assert rig.powered.log_losses().total() == lost[1]


@pytest.mark.parametrize(("boot_utc_us", "known"), [(0, False), (1_700_000_000_000_000, True)])
def test_clock_that_was_right_at_boot_runs_on(make: Callable[..., Rig], boot_utc_us: int, known: bool) -> None:
    rig = make(boot_utc_us=boot_utc_us)
    before_us = rig.powered.vehicle.rtc.utc_us()
    rig.reboot()
    assert (rig.powered.vehicle.rtc.utc_us() > before_us) is known
    assert (rig.powered.vehicle.rtc.utc_us() != 0) is known


def test_memory_store_tells_whether_anything_was_new() -> None:
    store = MemoryParamStore()
    assert store.save_if_changed({"A": 1})
    assert not store.save_if_changed({"A": 1})


def test_outcomes_in_the_filter_are_counted_over_restarts(make: Callable[..., Rig]) -> None:
    rig = make(overrides={"VISO_TYPE": 1, "EK3_SRC1_YAW": 6})
    rig.tell(POSE)
    before = dict(rig.powered.filter_counts())
    assert before
    rig.reboot()
    assert rig.powered.filter_counts() == before
    rig.tell(POSE)
    assert sum(rig.powered.filter_counts().values()) == 2 * sum(before.values())

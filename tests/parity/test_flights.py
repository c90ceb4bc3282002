# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that flies does what the firmware's did in recorded flights, when it is told the same at the same times.

Modes, events, errors and texts are compared, and times that constants of the firmware fix. Its camera is its own, and
so are its trajectories.
"""

import gzip
import json
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Final

import pytest

from mav_handlers.wire.codec import Codec, Received, message_id
from mav_handlers.wire.messages import COMMAND_ACK, EXTENDED_SYS_STATE, HEARTBEAT, Message
from tests.places import DATA, RECORDED
from viso.firmware.releases import JULY_2025
from viso.logs.filter_records import rows_of
from viso.logs.logger import MemoryLog
from viso.logs.recorded import read_columns
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import VehicleConfig, by_ekf3
from viso.vehicle.sensors.inertial_sources import read_source
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle

pytestmark = pytest.mark.slow

STEP_S: Final = 0.003
STRIDE_US: Final = 100_000
END_US: Final = 85_000_000
KINDS: Final = {
    "MODE": ("ModeNum", "Rsn"),
    "ARM": ("ArmState", "ArmChecks", "Forced", "Method"),
    "EV": ("Id",),
    "ERR": ("Subsys", "ECode"),
}
VISION: Final = ("ODOMETRY", "VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE")
COVERS: Final = ("SIM_GPS1_ENABLE", "LOG_REPLAY")
"""Parameters of the firmware's simulator, and one that would only make the log longer."""

Record = tuple[str, tuple[int, ...]]

GUIDED: Final = 4
LAND: Final = 9
TO_GUIDED: Final[Record] = "MODE", (GUIDED, 2)
TO_LAND: Final[Record] = "MODE", (LAND, 2)
ARMED: Final[Record] = "EV", (10,)
AUTO_ARMED: Final[Record] = "EV", (15,)
PERHAPS_LANDED: Final[Record] = "EV", (17,)
LIFTED: Final[Record] = "EV", (28,)
TURNING: Final[Record] = "EV", (57,)


@dataclass(frozen=True)
class Events:
    """What a log tells from GUIDED or arming on: records and texts, each with its time in s."""

    records: list[tuple[float, Record]]
    texts: list[tuple[float, str]]

    def time_of(self, *wanted: Record) -> list[float]:
        """Return when records were written first."""
        return [next(time_s for time_s, record in self.records if record == one) for one in wanted]

    def commands_s(self) -> list[float]:
        """Return when the firmware obeyed: a mode, arming, a take-off, and a mode again unless it was in that."""
        wanted = TO_GUIDED, ARMED, AUTO_ARMED, TO_LAND
        return self.time_of(*(one for one in wanted if any(record == one for _, record in self.records)))


def events_in(path: Path) -> Events:
    """Return what a log has."""
    log = read_columns(path)
    found: list[tuple[float, Record]] = []
    for kind, labels in KINDS.items():
        found += [(time_us * 1e-6, (kind, tuple(map(int, row)))) for time_us, *row in rows_of(log, kind, *labels)]
    found.sort(key=lambda one: one[0])
    start_s = next(time_s for time_s, record in found if record in (TO_GUIDED, ARMED))
    texts = [(time_us * 1e-6, str(text)) for time_us, text in rows_of(log, "MSG", "Message")]
    return Events([one for one in found if one[0] >= start_s], [one for one in texts if one[0] >= start_s])


@dataclass(frozen=True)
class Flight:
    """A flight of the firmware, and the same of ours; and what ours sent."""

    firmware: Events
    ours: Events
    acks: list[tuple[int, int]]
    recorded_acks: list[tuple[int, int]]
    sent: list[Message]


def fly(name: str, folder: Path, vicon_mask: int, fails_s: float | None = None) -> Flight:
    """Fly as in a recording, with a camera that sends what ``vicon_mask`` says, until it fails."""
    with gzip.open(RECORDED / "captures" / f"{name}.jsonl.gz", "rt") as lines:
        head, *rows = map(json.loads, lines)
    firmware = events_in(RECORDED / "logs" / f"{name}.BIN.xz")
    obeyed_s = iter(firmware.commands_s())
    params = {key: value for key, value in head["params"].items() if key not in COVERS}
    log = MemoryLog()
    config = VehicleConfig(
        by_ekf3(read_source("fly"), ImuOptions()),
        defaults={**params, "SIM_VICON_TMASK": vicon_mask},
        firmware=JULY_2025,
        open_log=lambda: log,
        vicon=True,
        message_intervals={0: {message_id(kind.__name__): 200 for kind in (EXTENDED_SYS_STATE, HEARTBEAT)}},
    )
    vehicle = Vehicle(config)
    scheduler, channel, ear = Scheduler(vehicle), vehicle.endpoint.open_channel("test"), Codec(0, 0)
    received: list[Message] = []

    def run_until(time_us: int) -> None:
        while scheduler.now_us < time_us:
            scheduler.run_until(min(time_us, scheduler.now_us + STRIDE_US))
            ear.feed(vehicle.endpoint.bytes_to_send(channel))
            while (one := ear.next_received()) is not None:
                if isinstance(one, Received) and isinstance(one.message, COMMAND_ACK | EXTENDED_SYS_STATE | HEARTBEAT):
                    received.append(one.message)

    for row in rows:
        if row["arrival_us"] is None or row["type"] in VISION:
            continue
        time_us = row["arrival_us"]
        if row["type"] == "COMMAND_LONG":
            time_us = round(next(obeyed_s, 1e-6 * time_us) * 1e6)
        if fails_s is not None and time_us > fails_s * 1e6:
            run_until(round(fails_s * 1e6))
            vehicle.params.set("SIM_VICON_FAIL", 1)
            fails_s = None
        run_until(-(-time_us // LOOP_PERIOD_US) * LOOP_PERIOD_US)
        scheduler.deliver(channel, bytes.fromhex(row["msg"]))
    run_until(END_US)
    path = folder / "ours.BIN"
    path.write_bytes(bytes(log.data))
    vehicle.close()
    acks = [(one.command, one.result) for one in received if isinstance(one, COMMAND_ACK)]
    recorded = [(command, result) for command, result in head["command_ack"] if command != 511]
    return Flight(firmware, events_in(path), acks, recorded, received)


@pytest.fixture(scope="module")
def by_compass(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """Return a flight with a compass and ODOMETRY."""
    return fly("flight_t265", tmp_path_factory.mktemp("compass"), 16)


@pytest.fixture(scope="module")
def by_camera_yaw(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """Return a flight with the camera's yaw, by VISION_POSITION_ESTIMATE and VISION_SPEED_ESTIMATE."""
    return fly("flight_mav_extyaw", tmp_path_factory.mktemp("yaw"), 3)


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """Return a flight whose camera fails when the firmware's began to disagree with the estimator."""
    return fly("flight_voxl_reset", tmp_path_factory.mktemp("failing"), 16, 61.55)


@pytest.fixture(scope="module")
def landing() -> Events:
    """Return a flight of the firmware whose log goes on until it has disarmed."""
    return events_in(DATA / "ordinary" / "lane_switch.BIN.xz")


def until_landing(events: Events) -> list[Record]:
    """Return records up to the last mode change."""
    last_s = max(time_s for time_s, record in events.records if record[0] == "MODE")
    return [record for time_s, record in events.records if time_s <= last_s]


FLIGHTS: Final = ("by_compass", "by_camera_yaw")


@pytest.fixture(params=FLIGHTS)
def flight(request: pytest.FixtureRequest) -> Flight:
    """Return each flight of which nothing fails."""
    found = request.getfixturevalue(request.param)
    assert isinstance(found, Flight)
    return found


def test_records_are_those_of_the_firmware_in_their_order(flight: Flight) -> None:
    assert until_landing(flight.ours) == until_landing(flight.firmware)


def test_motors_turn_and_lift_when_the_firmwares_did(flight: Flight) -> None:
    events = AUTO_ARMED, TURNING, LIFTED
    assert flight.ours.time_of(*events) == pytest.approx(flight.firmware.time_of(*events), abs=STEP_S)


def test_vehicle_says_what_the_firmware_said(flight: Flight) -> None:
    theirs = [text for _, text in flight.firmware.texts if not text.startswith("SIM ")]
    assert sorted(text for _, text in flight.ours.texts if text != "Disarming motors") == sorted(theirs)


def test_commands_are_answered_as_the_firmware_did(flight: Flight) -> None:
    assert flight.acks == flight.recorded_acks


def test_landing_ends_as_the_firmwares(flight: Flight, landing: Events) -> None:
    ours, theirs = (
        [(time_s - from_s, record) for time_s, record in events.records if time_s >= from_s]
        for events in (flight.ours, landing)
        for from_s in events.time_of(PERHAPS_LANDED)
    )
    assert [record for _, record in ours] == [record for _, record in theirs]
    assert [time_s for time_s, _ in ours] == pytest.approx([time_s for time_s, _ in theirs], abs=STEP_S)
    for events in (flight.ours, landing):
        (said_s,) = (time_s for time_s, text in events.texts if text == "Disarming motors")
        assert said_s == events.time_of(("EV", (11,)))[0]


def test_messages_tell_of_modes_and_of_ground_and_air(flight: Flight) -> None:
    landed = [one.landed_state for one in flight.sent if isinstance(one, EXTENDED_SYS_STATE)]
    assert [state for state, _ in groupby(landed)] == [1, 3, 2, 4, 1]
    beats = [one for one in flight.sent if isinstance(one, HEARTBEAT) and one.type == 2]
    modes = groupby((one.custom_mode, bool(one.base_mode & 128), one.system_status) for one in beats)
    booting, on_ground, in_air = 1, 3, 4
    assert [mode for mode, _ in modes] == [
        (0, False, booting),
        (0, False, on_ground),
        (GUIDED, False, on_ground),
        (GUIDED, True, on_ground),
        (GUIDED, True, in_air),
        (LAND, True, in_air),
        (LAND, True, on_ground),
        (LAND, False, on_ground),
    ]


def test_failsafe_acts_and_says_what_the_firmwares_did(failing: Flight) -> None:
    ours, theirs = (
        [
            record
            for _, record in events.records
            if record[0] == "MODE" or record in (("ERR", (16, 2)), ("ERR", (17, 1)))
        ]
        for events in (failing.ours, failing.firmware)
    )
    assert ours == theirs
    assert ("MODE", (LAND, 6)) in ours
    said = [
        [text for _, text in events.texts if text.startswith(("EKF variance", "EKF Failsafe"))]
        for events in (failing.ours, failing.firmware)
    ]
    assert said[0] == said[1]

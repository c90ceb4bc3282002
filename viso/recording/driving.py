# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers of a recorder: on a link in real time, or with a viso vehicle in virtual time."""

import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Final

from mav_handlers.links import open_link, wait_readable
from mav_handlers.links.base import Link
from viso.errors import InputError
from viso.firmware.releases import DEFAULT, Firmware
from viso.logs.files import LogStore
from viso.recording.recorder import Recorder, Recording
from viso.recording.scenario import Scenario
from viso.running.playing import LONGEST_WAIT_S
from viso.running.power import Port, PoweredVehicle
from viso.running.virtual_time import Scheduler
from viso.terminal.options import firmware_of
from viso.vehicle.vehicle import LOOP_PERIOD_US, VehicleConfig

VISO: Final = "viso"
MASTER_HELP: Final = (
    "Link to the autopilot, as of viso serve; viso or viso:FIRMWARE is a vehicle of this program's own in virtual time."
)
SIMULATOR_BAUD: Final = 115_200
"""Of the UART whose transport time the firmware's simulator models on its first port."""


class RealDriver:
    """Drives a fresh recorder over a link, by the wall clock; a simulator that runs faster is followed.

    ``stop`` says how often somebody has asked to end. ``speedup`` is how many seconds of the autopilot pass in one of
    the wall clock; None takes it from the autopilot's clock. ``now_s`` is a monotonic clock.
    """

    def __init__(
        self,
        recorder: Recorder,
        link: Link,
        stop: Callable[[], int],
        *,
        speedup: float | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._recorder = recorder
        self._link = link
        self._stop = stop
        self._stops = 0
        self._wants_rate = speedup is None
        self._rate = speedup or 1.0
        self._now_s = now_s
        self._since_s = now_s()
        self._since_us = 0

    def run(self) -> None:
        """Drive the recorder until it is over."""
        recorder, link = self._recorder, self._link
        while not recorder.is_over:
            data = recorder.advance(self._now_us())
            if data:
                link.send(data)
            if recorder.is_over:
                break
            wait_s = (recorder.next_due_us - self._now_us()) * 1e-6 / self._rate
            if wait_s > 0:
                wait_readable([link], min(wait_s, LONGEST_WAIT_S))
            while received := link.receive():
                now_us = self._now_us()
                late = recorder.advance(now_us)
                if late:
                    link.send(late)
                recorder.receive(now_us, received)
            if self._wants_rate and (rate := recorder.clock.take_rate()) is not None:
                self._wants_rate = False
                self._since_us, self._since_s, self._rate = self._now_us(), self._now_s(), rate * self._rate
            if self._stop() > self._stops:
                self._stops = self._stop()
                recorder.stop("interrupted")

    def _now_us(self) -> int:
        return self._since_us + int((self._now_s() - self._since_s) * 1e6 * self._rate)


def record_viso(recorder: Recorder, firmware: Firmware, stop: Callable[[], int] = lambda: 0) -> None:
    """Drive a fresh recorder with a vehicle of viso in virtual time: it stands level, heading north."""
    with tempfile.TemporaryDirectory(prefix="viso-record-") as folder:
        config = VehicleConfig(log_store=LogStore(Path(folder)), firmware=firmware)
        with closing(PoweredVehicle(config, [Port("viso", SIMULATOR_BAUD)])) as powered:
            _run_virtual(recorder, powered, stop)


def _run_virtual(recorder: Recorder, powered: PoweredVehicle, stop: Callable[[], int]) -> None:
    booted_us, stops = 0, 0
    scheduler = Scheduler(powered.vehicle)
    while not recorder.is_over:
        now_us = booted_us + scheduler.now_us
        [channel] = powered.channels
        while data := recorder.advance(now_us):
            scheduler.deliver(channel, data)
            recorder.receive(now_us, powered.vehicle.endpoint.bytes_to_send(channel))
        # Up to the next pass at which something is to be done; those before bring nothing.
        due_us = 0 if powered.vehicle.reboot_requested else powered.vehicle.next_due_us()
        pass_us = max(scheduler.now_us // LOOP_PERIOD_US + 1, -(-due_us // LOOP_PERIOD_US)) * LOOP_PERIOD_US
        scheduler.run_until(min(max(recorder.next_due_us - booted_us, scheduler.now_us), pass_us))
        sent = powered.vehicle.endpoint.bytes_to_send(channel)
        if scheduler.now_us == pass_us and powered.restart_if_asked():
            booted_us += scheduler.now_us
            scheduler = Scheduler(powered.vehicle)
        if sent:
            recorder.receive(booted_us + scheduler.now_us, sent)
        if stop() > stops:
            stops = stop()
            recorder.stop("interrupted")


def record_at(
    master: str,
    scenario: Scenario,
    stops: Callable[[], int],
    *,
    on_progress: Callable[[str], None],
    allow_armed: bool = False,
    speedup: float | None = None,
) -> Recording:
    """Play a scenario to what is at a link, as ``--master`` has it; return what was recorded, complete or not.

    ``stops`` returns how often the user has asked to stop: once ends the steps, twice the download of the log.
    ``speedup`` is as of ``RealDriver``. Raises InputError if nobody answers, or ``master`` names no release; LinkError
    if the link cannot be opened.
    """
    scheme, colon, name = master.partition(":")
    firmware = None if scheme != VISO else firmware_of(name, "--master viso:") if colon else DEFAULT
    recorder = Recorder(scenario, allow_armed=allow_armed, on_progress=on_progress)
    if firmware is not None:
        record_viso(recorder, firmware, stops)
    else:
        with closing(open_link(master)) as link:
            RealDriver(recorder, link, stops, speedup=speedup).run()
            if (why := link.stats.unreached) and recorder.recording.problems:
                recorder.recording.problems[0] += f" ({why})"
    recording = recorder.recording
    if recording.version is None:
        raise InputError(f"--master {master}: {recording.problems[0]}")
    return recording

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of the firmware with our filter beside them, and vehicles in virtual time."""

import math
from collections.abc import Callable

import pytest

from ap_core.location import Location
from tests.parity.behaviours.logs import Recordings, recordings_of_run
from tests.parity.behaviours.parked import Parked, source_set
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.script.script_file import parse_script
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.standing import BenchSource

MakeParked = Callable[..., Parked]


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    """Return the recordings by their names."""
    return recordings_of_run(tmp_path_factory)


@pytest.fixture(scope="session")
def make_parked(tmp_path_factory: pytest.TempPathFactory) -> MakeParked:
    """Return a function that makes a vehicle at rest from the values of its first source set, and other parameters.

    There is a compass only if it is said so; it measures the field at a home, if there is one.
    """

    def make(sources: str = "66666", *, compass: bool = False, home: Location | None = None, **params: float) -> Parked:
        values = {"COMPASS_ENABLE": float(compass), **source_set(1, sources), **params}
        return Parked(by_ekf3(BenchSource, ImuOptions(home=home)), values, tmp_path_factory.mktemp("parked"))

    return make


class Scripted(Parked):
    """A vehicle that moves as a script says, seen by a camera that makes no errors but those asked for."""

    source: ScriptSource

    def stream_truth(self, until_s: float, *, yaw_deg: float = 0.0) -> None:
        """Send poses and velocities for a while, as of when they are said to be observed; yaw may be off."""
        delay_us = 1000 * self.vehicle.params.get_int("VISO_DELAY_MS")

        def pose() -> None:
            truth = self.source.truth(self.now_us - delay_us)
            self.pose(*truth.pos_ned, yaw_deg=math.degrees(self.source.yaw_rad()) + yaw_deg)

        def velocity() -> None:
            self.velocity(*self.source.truth(self.now_us - delay_us).vel_ned)

        self.stream(until_s, pose, velocity)


MakeScripted = Callable[..., Scripted]


@pytest.fixture(scope="session")
def make_scripted(tmp_path_factory: pytest.TempPathFactory) -> MakeScripted:
    """Return a function that makes a vehicle from a script and parameters; all is external navigation."""

    def make(script: str, **params: float) -> Scripted:
        sources: list[ScriptSource] = []

        def make_source(options: ImuOptions) -> ScriptSource:
            sources.append(ScriptSource(options, parse_script(script, "test")))
            return sources[0]

        values = {"COMPASS_ENABLE": 0.0, **source_set(1, "66666"), **params}
        made = Scripted(by_ekf3(make_source, ImuOptions()), values, tmp_path_factory.mktemp("scripted"))
        made.source = sources[0]
        return made

    return make

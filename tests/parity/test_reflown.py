# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that flies a recorded flight again says what the firmware said, when it said it, and is where it was.

Its loop runs at times of its own, 2.5 ms apart, so that a step of the filter may come a little sooner or later; and its
camera's poses are those that the firmware had aligned already.
"""

import re
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from tests.places import DATA
from viso.firmware.releases import JULY_2025
from viso.logs.files import single_log
from viso.logs.filter_records import rows_of
from viso.logs.recorded import read_columns
from viso.replay.run import ReplaySetup, run_replay
from viso.streams.heard import params_of_recording
from viso.streams.stream_kinds import TrajectoryOptions, read_stream
from viso.terminal.settings import load_settings
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.inertial_sources import read_source
from viso.vehicle.sensors.source import ImuOptions

Array = npt.NDArray[np.float64]

STEP_S: Final = 0.02
NEAR_M: Final = 0.02
PLACE: Final = ("PN", "PE", "PD")
MOVED: Final = ("OFN", "OFE")
_ARMED_S: Final = 32.0
_YAW_RESET: Final = 62

pytestmark = pytest.mark.slow


class Flight(NamedTuple):
    """Texts and events, each with its time in s, and records of the filter by type and core."""

    texts: list[tuple[float, str]]
    events: list[tuple[float, int]]
    records: dict[tuple[str, int], Array]


FIELDS: Final = {"XKF1": ("TimeUS", *PLACE), "XKF4": ("TimeUS", *MOVED, "SS", "PI")}


def flight_in(path: Path) -> Flight:
    """Return what a log has."""
    log = read_columns(path)
    texts = [(time_us * 1e-6, str(text)) for time_us, text in rows_of(log, "MSG", "Message")]
    events = [(time_us * 1e-6, int(what)) for time_us, what in rows_of(log, "EV", "Id")]
    records = {}
    for kind, labels in FIELDS.items():
        columns = log.columns(kind, [*labels, "C"])
        table = np.column_stack([columns[label].astype(float) for label in labels])
        records.update({(kind, core): table[columns["C"] == core] for core in (0, 1)})
    return Flight(texts, events, records)


class Pair(NamedTuple):
    """A flight as it was recorded, and as it was flown again."""

    firmware: Flight
    ours: Flight

    def said(self, since_s: float, only: str = "") -> list[list[tuple[float, str]]]:
        """Return what both estimators said from a time on, of it what begins so."""
        return [
            [(time_s, text) for time_s, text in flight.texts if time_s > since_s and text.startswith(only or "EKF")]
            for flight in self
        ]

    def apart(self, core: int) -> Array:
        """Return how far the estimates of a core are apart, m NED, at the times of the log's once it is armed."""
        theirs, ours = self.firmware.records["XKF1", core], self.ours.records["XKF1", core]
        theirs = theirs[(theirs[:, 0] > _ARMED_S * 1e6) & (theirs[:, 0] < ours[-1, 0])]
        at = partial(np.interp, theirs[:, 0], ours[:, 0])
        return np.column_stack([at(ours[:, axis]) - theirs[:, axis] for axis in (1, 2, 3)])


def same_flags(both: Pair, core: int) -> float:
    """Return in which share of a core's recorded flags ours, logged 50 ms before, are the same."""
    theirs, ours = (flight.records["XKF4", core] for flight in both)
    newest = np.searchsorted(ours[:, 0], theirs[:, 0]) - 1
    flags = len(MOVED) + 1
    return float((theirs[:, flags] == ours[newest, flags]).mean())


def pair(name: str, folder: Path) -> Pair:
    """Return a recorded flight, and the same flown again."""
    recording, log = DATA / "reflown" / f"{name}.BIN.xz", folder / "ours.BIN"
    stream = read_stream(recording, 0, TrajectoryOptions())
    settings = {**params_of_recording(stream), **load_settings([], [], links=1)}
    make_ahrs = by_ekf3(read_source(f"log:{recording}"), ImuOptions())
    with single_log(log) as open_log:
        run_replay(stream, settings, ReplaySetup(make_ahrs, stream.baud, True, firmware=JULY_2025), open_log=open_log)
    return Pair(flight_in(recording), flight_in(log))


@pytest.fixture(scope="module")
def by_lanes(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    """Return a flight with two IMUs of which the first gets a bias."""
    return pair("lane_acc_bias", tmp_path_factory.mktemp("lanes"))


@pytest.fixture(scope="module")
def by_gps(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    """Return a flight by GPS, by external navigation for 10 s, and by GPS again."""
    return pair("gps_extnav_t265", tmp_path_factory.mktemp("gps"))


def check_times(theirs: list[tuple[float, str]], ours: list[tuple[float, str]]) -> None:
    """Check that both said the same in the same order, and at nearly the same times."""
    assert [text for _, text in ours] == [text for _, text in theirs]
    assert [time_s for time_s, _ in ours] == pytest.approx([time_s for time_s, _ in theirs], abs=STEP_S)


def test_lanes_are_switched_as_the_firmware_did(by_lanes: Pair) -> None:
    theirs, ours = by_lanes.said(_ARMED_S)
    assert [text for _, text in theirs[-2:]] == ["EKF3 lane switch 1", "EKF primary changed:1"]
    check_times(theirs, ours)
    for flight in by_lanes:
        ((time_s, what),) = (event for event in flight.events if event[0] > 50.0)
        assert time_s == pytest.approx(51.65, abs=0.01)
        assert what == _YAW_RESET


def test_each_core_says_what_it_said_before(by_lanes: Pair) -> None:
    for imu in (0, 1):
        theirs, ours = by_lanes.said(0.0, f"EKF3 IMU{imu}")
        assert sorted(re.sub(r"-0\.0", "0.0", text) for _, text in ours) == sorted(
            re.sub(r"-0\.0", "0.0", text) for _, text in theirs
        )


@pytest.mark.parametrize("core", [0, 1])
def test_each_core_is_where_it_was(by_lanes: Pair, core: int) -> None:
    apart = by_lanes.apart(core)
    assert np.sqrt((apart**2).mean(axis=0)).max() < NEAR_M


def test_sources_are_switched_as_the_firmware_did(by_gps: Pair) -> None:
    check_times(*by_gps.said(0.0, "EKF3 IMU0"))
    theirs, ours = ([event for event in flight.events if event[1] in (_YAW_RESET, 85, 86)] for flight in by_gps)
    assert [what for _, what in ours] == [what for _, what in theirs] == [_YAW_RESET, _YAW_RESET, 86, 85]
    assert [time_s for time_s, _ in ours] == pytest.approx([time_s for time_s, _ in theirs], abs=STEP_S)


@pytest.mark.parametrize("core", [0, 1])
def test_flags_are_those_of_the_firmware(by_lanes: Pair, by_gps: Pair, core: int) -> None:
    assert same_flags(by_lanes, core) > 0.99
    assert same_flags(by_gps, core) > 0.99


@pytest.mark.parametrize("time_s", [50.0, 60.0, 68.5])
def test_position_is_reset_by_as_much(by_gps: Pair, time_s: float) -> None:
    theirs, ours = (flight.records["XKF4", 0] for flight in by_gps)
    rows = [table[np.searchsorted(table[:, 0], time_s * 1e6)] for table in (theirs, ours)]
    assert rows[1][1:3] == pytest.approx(rows[0][1:3], abs=NEAR_M)


def test_vehicle_is_where_it_was_by_either_source(by_gps: Pair) -> None:
    apart = by_gps.apart(0)
    assert np.sqrt((apart**2).mean(axis=0)).max() < 2 * NEAR_M

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Source sets that lack something, change, or make no sense: behaviours 23, 24, 31 to 33 and 39."""

from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from mav_handlers.wire.messages import GPS_INPUT
from tests.parity.behaviours.logs import Recordings
from tests.parity.behaviours.parked import SOURCES, Parked, source_set
from tests.parity.behaviours.status import (
    AIDING,
    EV_SOURCE_SET_1,
    EV_SOURCE_SET_2,
    EV_YAW_RESET,
    FUSED_AFTER_S,
    HEIGHT_TIMEOUT,
    LOG_S,
    NOT_AIDED_TS,
    PARKED_SS,
    STOPPED,
)

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked

pytestmark = pytest.mark.slow

EKF_RESET = ("forced reset", "initialised", "tilt alignment complete")
SET_SOURCE_SET, PREARM_CHECKS, ACCEPTED = 42007, 401, 0
REV3_SOURCE_SET_1, REV3_SOURCE_SET_2 = 13, 14
TO_EXT_NAV_S, TO_GPS_S, END_S = 46.0, 49.0, 51.0
MODES = STABILIZE, GUIDED = 0, 4
PREARM_AHRS = "PreArm: AHRS: "
CHECK_INS_ONLY = 16


def test_23_velocity_alone_never_aids_and_resets_the_filter_again_and_again(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_velocity_only")
    assert {sample.VX for sample in recording.recorded.rows("REVH")} == {1.0}
    resets_s = [recording.when(lambda log: log.when("forced reset"))]
    resets_s += [recording.when(lambda log: log.when("forced reset", 12.0))]
    assert resets_s == pytest.approx([11.66, 18.86], abs=0.01)
    for log in recording.both:
        assert log.said() == [*EKF_RESET[1:], *EKF_RESET, *EKF_RESET]
        # Unhealthy for 5 s, each time.
        for reset_s in resets_s:
            unhealthy = log.between("XKF4", reset_s - 4.9, reset_s - LOG_S)
            assert {row.SS for row in unhealthy} == {0}
            assert min(log.values("XKF3", "IPN", reset_s - 4.9, reset_s - LOG_S)) > 1.0
        assert set(log.values("XKF4", "TS", 5.1)) == {NOT_AIDED_TS}


def test_24_without_a_yaw_source_every_sample_starts_and_stops_aiding(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_no_yaw_source")
    ready_s = recording.when(lambda log: log.when("tilt alignment complete"))
    samples_s = [sample.t for sample in recording.recorded.rows("REPH") if sample.t > ready_s]
    for log in recording.both:
        told = [text for text in log.said(ready_s + LOG_S) if not text.startswith("initial")]
        assert told == [AIDING, STOPPED] * len(samples_s)
        assert len(samples_s) > 30
        for number, name in enumerate((AIDING, STOPPED)):
            times_s = [time_s for time_s, said in log.texts if time_s > ready_s and said == f"EKF3 IMU0 {name}"]
            delays_s = [said_s - sample_s for said_s, sample_s in zip(times_s, samples_s, strict=True)]
            assert all(0.03 < delay_s - 0.0125 * number < 0.12 for delay_s in delays_s)


class GpsAndPose:
    """A vehicle with a GPS, at its origin, and poses of a frame that is shifted and turned."""

    PLACE = Location(473977418, 85455938, 10_000)
    POSE = (10.0, -5.0, -2.0)
    YAW_DEG = 20.0

    def __init__(self, parked: Parked) -> None:
        self.parked = parked
        self._sent = 0

    def fix(self) -> None:
        """Send a fix, with the sixth of all calls."""
        self._sent += 1
        if self._sent % 6 == 1:
            time_ms = self.parked.now_us // 1000
            place, accuracies = (self.PLACE.lat, self.PLACE.lng, 1e-2 * self.PLACE.alt_cm), (0.25, 0.5, 1.0)
            self.parked.send(
                GPS_INPUT(self.parked.now_us, 0, 0, time_ms, 2300, 3, *place, 0.5, 0.75, 0.0, 0.0, 0.0, *accuracies, 12)
            )

    def run_to(self, until_s: float, *, poses: bool = True) -> None:
        """Send both, or the GPS' alone, for a while."""
        send = (self.fix, lambda: self.parked.pose(*self.POSE, yaw_deg=self.YAW_DEG), self.parked.velocity)
        self.parked.stream(until_s, *(send if poses else send[:1]))


@pytest.fixture(scope="module")
def switched(make_parked: "MakeParked") -> Parked:
    """Return a vehicle that navigates by GPS, then by external navigation, then by GPS again."""
    parked = make_parked("33131", compass=True, home=GpsAndPose.PLACE, GPS1_TYPE=14, **source_set(2, "66666"))
    both = GpsAndPose(parked)
    parked.run_to(3.0)
    both.run_to(TO_EXT_NAV_S - 2.0, poses=False)
    both.run_to(TO_EXT_NAV_S)
    assert parked.command(SET_SOURCE_SET, 2) == ACCEPTED
    both.run_to(TO_GPS_S)
    assert parked.command(SET_SOURCE_SET, 1) == ACCEPTED
    both.run_to(END_S)
    return parked


def test_31_source_set_of_external_navigation_steps_the_position_and_aligns_yaw(switched: Parked) -> None:
    log = switched.log()
    assert log.when("is using GPS") < TO_EXT_NAV_S - 2.0
    assert log.said(TO_EXT_NAV_S - 2.0, TO_GPS_S) == ["yaw aligned"]
    assert log.when("yaw aligned") - TO_EXT_NAV_S < FUSED_AFTER_S
    events = [row.Id for row in log.rows("EV") if TO_EXT_NAV_S <= row.t < TO_GPS_S]
    assert events == [EV_SOURCE_SET_2, EV_YAW_RESET]
    assert [row.Event for row in log.rows("REV3") if TO_EXT_NAV_S <= row.t < TO_GPS_S] == [REV3_SOURCE_SET_2]
    sets = [set(log.values("XKFS", "SS", *times)) for times in ((30.0, TO_EXT_NAV_S), (TO_EXT_NAV_S + LOG_S, TO_GPS_S))]
    assert sets == [{0}, {1}]
    before, after = (log.at("XKF1", TO_EXT_NAV_S + wait_s) for wait_s in (-LOG_S, FUSED_AFTER_S))
    moved = (after.PN - before.PN, after.PE - before.PE, after.PD - before.PD)
    assert moved == pytest.approx(GpsAndPose.POSE, abs=0.1)
    assert (log.value("XKF4", "OFN", after.t), log.value("XKF4", "OFE", after.t)) == pytest.approx(
        (10.0, -5.0), abs=0.05
    )
    assert after.Yaw == pytest.approx(GpsAndPose.YAW_DEG, abs=0.5)


def test_32_source_set_of_gps_steps_the_position_back_and_leaves_the_height(switched: Parked) -> None:
    log = switched.log()
    events = [row.Id for row in log.rows("EV") if row.t >= TO_GPS_S]
    assert events[0] == EV_SOURCE_SET_1
    assert [row.Event for row in log.rows("REV3") if row.t >= TO_GPS_S] == [REV3_SOURCE_SET_1]
    assert set(log.values("XKFS", "SS", TO_GPS_S + LOG_S)) == {0}
    before, after = (log.at("XKF1", TO_GPS_S + wait_s) for wait_s in (-LOG_S, 0.5))
    moved = (before.PN - after.PN, before.PE - after.PE)
    assert moved == pytest.approx((10.0, -5.0), abs=0.1)
    heights = log.values("XKF1", "PD", TO_GPS_S - LOG_S)
    assert heights == [pytest.approx(before.PD, abs=0.1)] * len(heights)
    assert not [text for text in log.said(TO_GPS_S) if text.startswith(("is using", STOPPED))]


def test_33_external_navigation_that_no_set_named_at_boot_is_logged_but_not_used(make_parked: "MakeParked") -> None:
    parked = make_parked("00101", compass=True)
    parked.run_to(8.0)
    for name in SOURCES:
        parked.set(f"EK3_SRC1_{name}", 6)
    parked.stream(14.0, parked.pose)
    log = parked.log()
    assert len(log.rows("REPH")) == 180
    assert log.said(8.0) == []
    lost_s = log.first("XKF4", lambda row: row.TS & HEIGHT_TIMEOUT, 8.0)
    assert lost_s - 8.0 == pytest.approx(5.0, abs=2 * LOG_S)
    assert {(row.TS, row.SS) for row in log.between("XKF4", 8.0, lost_s - LOG_S)} == {(NOT_AIDED_TS, PARKED_SS)}
    assert {(row.TS, row.SS) for row in log.between("XKF4", lost_s)} == {(NOT_AIDED_TS | HEIGHT_TIMEOUT, 0x10083)}


@pytest.fixture(scope="module")
def idle(make_parked: "MakeParked") -> dict[int, Parked]:
    """Return a vehicle for each mode: one that needs no position, one that does."""
    made = {mode: make_parked(INITIAL_MODE=mode, ARMING_CHECK=CHECK_INS_ONLY, GPS1_TYPE=0) for mode in MODES}
    for parked in made.values():
        parked.run_to(7.0)
    return made


def told_before_arming(parked: Parked) -> list[str]:
    """Return what the vehicle has against arming, as far as its AHRS is concerned."""
    parked.received.clear()
    assert parked.command(PREARM_CHECKS) == ACCEPTED
    parked.run_for(0.1)
    failures = [said for _, said in parked.texts() if said.startswith(PREARM_AHRS)]
    return [failure.removeprefix(PREARM_AHRS) for failure in failures]


@pytest.mark.parametrize(("mode", "params", "text"), [
    (GUIDED, {"EK3_SRC1_POSXY": 5}, "Check EK3_SRC1_POSXY"),
    (GUIDED, {"EK3_SRC2_POSXY": 5}, "Check EK3_SRC2_POSXY"),
    (STABILIZE, {"EK3_SRC2_POSXY": 5}, None),
    (GUIDED, {"EK3_SRC2_VELXY": 4}, "Check EK3_SRC2_VELXY"),
    (GUIDED, {"EK3_SRC3_POSZ": 5}, "Check EK3_SRC3_POSZ"),
    (GUIDED, {"EK3_SRC3_VELZ": 4}, "Check EK3_SRC3_VELZ"),
    (STABILIZE, {"EK3_SRC3_YAW": 4}, "Check EK3_SRC3_YAW"),
    (GUIDED, {"EK3_SRC2_POSXY": 5, "EK3_SRC3_YAW": 4}, "Check EK3_SRC2_POSXY"),
    (GUIDED, {"EK3_SRC2_POSXY": 3}, "EK3 sources require GPS"),
    (GUIDED, {"EK3_SRC2_POSXY": 4}, "EK3 sources require Beacon"),
    (GUIDED, {"EK3_SRC2_VELXY": 5}, "EK3 sources require OpticalFlow"),
    (GUIDED, {"EK3_SRC2_VELXY": 7}, "EK3 sources require WheelEncoder"),
    (GUIDED, {"EK3_SRC2_POSZ": 2}, "EK3 sources require RangeFinder"),
    (STABILIZE, {"EK3_SRC3_YAW": 3}, "EK3 sources require Compass"),
    (GUIDED, {"EK3_SRC2_POSXY": 4, "EK3_SRC2_VELXY": 3}, "EK3 sources require Beacon"),
    (STABILIZE, {"EK3_MAG_CAL": 5}, "EK3_MAG_CAL and EK3_SRC1_YAW inconsistent"),
    (STABILIZE, {}, None),
])  # fmt: skip
def test_39_source_sets_that_make_no_sense_are_told_before_arming_active_or_not(
    idle: dict[int, Parked], mode: int, params: dict[str, float], text: str | None
) -> None:
    parked = idle[mode]
    before = {name: parked.vehicle.params.get_int(name) for name in params}
    for name, value in params.items():
        parked.set(name, value)
    told = told_before_arming(parked)
    for name, old in before.items():
        parked.set(name, old)
    assert told == ([] if text is None else [text])


def test_39_missing_camera_is_told_before_arming(make_parked: "MakeParked") -> None:
    parked = make_parked(VISO_TYPE=0, ARMING_CHECK=CHECK_INS_ONLY, GPS1_TYPE=0)
    parked.run_to(7.0)
    assert told_before_arming(parked) == ["EK3 sources require VisualOdom"]


@pytest.mark.parametrize(("params", "run_s", "text"), [
    ({"EK3_ENABLE": 0}, 7.0, "EKF3 not started"),
    ({"COMPASS_ENABLE": 1}, 3.0, "not using configured AHRS type"),
    ({}, 5.0, "EKF3 still initialising"),
])  # fmt: skip
def test_39_filter_that_is_not_ready_is_told_before_arming(
    make_parked: "MakeParked", params: dict[str, float], run_s: float, text: str
) -> None:
    parked = make_parked(ARMING_CHECK=CHECK_INS_ONLY, GPS1_TYPE=0, **params)
    parked.run_to(run_s)
    assert told_before_arming(parked) == [text]

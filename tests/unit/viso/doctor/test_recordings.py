# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Defects that survive in trajectories and bags are found there, and what such files cannot show is not reported."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mav_handlers.wire.codec import Codec, Received
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.doctor.corpus import CLIMB, ODOMETRY, POSE, SPEED, Case
from tests.unit.viso.doctor.recordings import WRITERS, as_ros, rows_of
from tests.unit.viso.doctor.streams import LEAD_US, codes, examine
from viso.doctor import CHECKS, Severity
from viso.errors import InputError
from viso.streams.stream_kinds import MAX_GAP_US, Aspect, Stream, TrajectoryOptions, read_whole_stream

pytest.importorskip("rosbags", reason="rosbags is not installed")

_OWN = TrajectoryOptions(axes="ned_frd")
_POSES = "messages: VISION_POSITION_ESTIMATE"
_SPEEDS = "messages: VISION_SPEED_ESTIMATE"


@dataclass(frozen=True, slots=True)
class File:
    """A file of a format with what is wrong with it, and the codes that have to say so."""

    format: str
    what: str
    base: str
    faults: str
    expected: frozenset[str]
    sees_vehicle: bool = False

    @property
    def case(self) -> Case:
        return Case(self.what, self.base, self.faults, self.expected, knows_attitude=self.sees_vehicle)


def _file(form: str, what: str, base: str, faults: str, *expected: str, sees_vehicle: bool = False) -> File:
    return File(form, what, base, faults, frozenset(expected), sees_vehicle)


FILES = (
    _file(
        *("tum", "NaN, jump, gap", ODOMETRY),
        "{kind: nan, fields: [x], start_s: 2, end_s: 3}, {kind: reset, x_m: 4, count: 0, at_s: 6}, "
        "{kind: fail, start_s: 8, end_s: 10}",
        *("XN5-01", "XN6-01", "XN4-04"),
    ),
    _file(
        *("tum", "frozen, yaw jumps", ODOMETRY),
        "{kind: frozen, start_s: 4, end_s: 6}, {kind: yawerr, yaw_deg: 40, start_s: 8}",
        *("XN5-13", "XN6-02"),
    ),
    _file("tum", "stamps constant", ODOMETRY, "{kind: stamp_constant, stamp_us: 12345678}", "XN3-01"),
    _file(
        *("tum", "clock back, attitude too short", ODOMETRY),
        "{kind: clock_step, step_ms: -400, at_s: 6}, {kind: quat_norm, norm: 0.8}",
        *("XN3-03", "XN5-05"),
    ),
    _file("tum", "w first, which is to be last", ODOMETRY, "{kind: quat_xyzw}", "XN2-10", sees_vehicle=True),
    _file("tum", "times in ms", ODOMETRY, "{kind: stamp_unit, unit: ns}", "XN3-02"),
    _file("tum", "millimetres", POSE, "{kind: scale, factor: 1000}", "XN5-07"),
    _file("tum", "three a second", ODOMETRY, "{kind: rate, rate_hz: 3}", "XN4-01"),
    _file(
        *("euroc", "NaN in the velocity, gap", SPEED),
        f"{{kind: nan, {_SPEEDS}, probability: 0.1}}, {{kind: fail, start_s: 2, end_s: 10}}",
        *("XN5-03", "XN4-05"),
    ),
    _file("euroc", "scale of 1.3", SPEED, f"{{kind: scale, factor: 1.3, {_POSES}}}", "XN5-12"),
    _file("euroc", "yaw off by 25 deg", ODOMETRY, "{kind: yawerr, yaw_deg: 25}", "XN2-05"),
    _file("euroc", "z up", CLIMB, f"{{kind: axes, world_axes: NEU, of: vectors, {_POSES}}}", "XN2-04"),
    _file("euroc", "velocity of zero", SPEED, f"{{kind: scale, factor: 0, {_SPEEDS}}}", "XN5-14"),
    _file("euroc", "position drifts", SPEED, "{kind: drift, x_m_s: 0.4}", "XN5-17"),
    _file(
        *("euroc", "ROS axes", SPEED, "{kind: axes, world_axes: ENU, body_axes: FLU, of: attitude}", "XN2-02"),
        sees_vehicle=True,
    ),
    _file(
        *("tum", "camera looks left", SPEED, "{kind: axes, body_axes: LFD, of: attitude}", "XN2-06"),
        sees_vehicle=True,
    ),
    _file(
        *("bag", "jitter, huge covariance", ODOMETRY),
        "{kind: jitter, jitter_ms: 150}, {kind: covariance, variance: 900}",
        *("XN3-06", "XN5-11"),
    ),
    _file(
        *("db3", "some 0.8 s late, NaN", ODOMETRY),
        "{kind: delay, delay_ms: 800, at_s: 5}, {kind: nan, fields: [q], start_s: 8, end_s: 9}",
        *("XN3-07", "XN5-02"),
    ),
    _file(
        *("mcap", "bunches, covariance below the floor", ODOMETRY),
        "{kind: bunch, period_ms: 250}, {kind: covariance, variance: 0.01}",
        *("XN3-08", "XN5-09"),
    ),
    _file("bag", "slow clock", ODOMETRY, "{kind: clock_drift, drift_ppm: -6000}", "XN3-05"),
    _file("db3", "delay grows by 80 ms", ODOMETRY, "{kind: delay, delay_ms: 80, start_s: 6}", "XN3-10"),
    _file("mcap", "clock back by 2 s", ODOMETRY, "{kind: clock_step, step_ms: -2000, at_s: 6}", "XN3-03"),
    _file("bag", "stamps in ms", ODOMETRY, "{kind: stamp_unit, unit: ms}", "XN3-02"),
    _file("mcap", "stamps of zero", ODOMETRY, "{kind: stamp_constant}", "XN3-01"),
    _file("db3", "eight a second", ODOMETRY, "{kind: rate, rate_hz: 8}", "XN4-08"),
)  # fmt: skip
NEVER_FROM_FILES = {check.code for check in CHECKS if not check.needs.isdisjoint({Aspect.LINK, Aspect.RESETS})}
ON_ARRIVAL = {check.code for check in CHECKS if Aspect.ARRIVAL in check.needs}


def _marks(file: File) -> object:
    return pytest.param(file, id=f"{file.format}: {file.what}", marks=pytest.mark.slow)


@pytest.mark.parametrize("file", [_marks(file) for file in FILES])
def test_defect_is_found_in_a_file(file: File, tmp_path: Path) -> None:
    stream = file.case.stream()
    path = WRITERS[file.format](tmp_path, rows_of(stream))
    _, findings = examine(read_whole_stream(path, LEAD_US, _OWN), file.case.vehicle())
    found = codes(findings)
    assert file.expected <= found
    assert not found & NEVER_FROM_FILES
    assert file.format in ("bag", "db3", "mcap") or not found & ON_ARRIVAL


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "base"),
    [("tum", ODOMETRY), ("tum", SPEED), ("euroc", SPEED), ("bag", ODOMETRY), ("db3", SPEED), ("mcap", ODOMETRY)],
)
def test_clean_file_gives_no_warning(form: str, base: str, tmp_path: Path) -> None:
    # Written in the axes of ROS, which are those that --axes means unless told otherwise.
    case = Case("clean", base, "", frozenset(), knows_attitude=base == SPEED)
    path = WRITERS[form](tmp_path, as_ros(rows_of(case.stream())))
    _, findings = examine(read_whole_stream(path, LEAD_US), case.vehicle())
    assert codes(findings, Severity.WARNING) == set()


@pytest.mark.slow
def test_vehicle_of_another_time_is_left_out_of_account(tmp_path: Path) -> None:
    case = Case("clean", ODOMETRY, "", frozenset(), knows_attitude=True, delay_s=5.0)
    path = WRITERS["euroc"](tmp_path, rows_of(case.stream()))
    evidence, findings = examine(read_whole_stream(path, LEAD_US, _OWN), case.vehicle())
    assert "the vehicle turns otherwise, or at other times (--lead)" in evidence.notes[-1]
    assert codes(findings, Severity.WARNING) == set()


def test_file_is_read_as_it_stands(tmp_path: Path) -> None:
    lines = ["5.0 1 2 3 0 0 0 1", "5.04 nan 2 3 0 0 0 1", "4.9 1 2 3 0 0 0 0.5", "4.94 1 2 3 0 0 0 1"]
    path = tmp_path / "bad.tum"
    path.write_text("\n".join(lines) + "\n")
    stream = read_whole_stream(path, 1000, _OWN)
    rows = [message.arrival_us for message in stream.messages]
    assert rows == [1000, 41_000, 81_000, 121_000]  # a time that is not later says nothing of when it came
    assert stream.lacks == frozenset(Aspect)
    assert stream.notes == (f"{path}: poses, no velocities; taken as ned_frd (--axes), sent as mocap (--as)",)


def first_message(path: Path, form: str) -> Any:
    codec = Codec(1, 1)
    codec.feed(read_whole_stream(path, 0, _OWN, form).messages[0].frame)
    received = codec.next_received()
    assert isinstance(received, Received)
    return received.message


def test_attitude_that_is_no_rotation_is_sent_all_the_same(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("".join(f"{seconds}000000000,1,2,3,0,0,0,0,4,5,6\n" for seconds in (1, 2)))
    odometry, vision = first_message(path, "odometry"), first_message(path, "vision")
    assert (odometry.q, odometry.vx, odometry.vy, odometry.vz) == ((0.0,) * 4, 4.0, 5.0, 6.0)
    assert np.isnan((vision.roll, vision.pitch, vision.yaw)).all()


@pytest.mark.parametrize(("step", "seconds"), [(0.04, 0.04), (40.0, 0.04), (40e-6, 0.04), (0.5, 0.5)])
def test_times_of_another_unit_let_messages_come_at_a_likely_rate(step: float, seconds: float, tmp_path: Path) -> None:
    path = tmp_path / "poses.tum"
    path.write_text("".join(f"{1 + number * step:.6f} 0 0 0 0 0 0 1\n" for number in range(20)))
    arrivals = [message.arrival_us or 0 for message in read_whole_stream(path, 0, _OWN).messages]
    assert np.diff(arrivals) == pytest.approx(seconds * 1e6, rel=0.02)


def test_times_in_milliseconds_are_told_for_what_they_are(tmp_path: Path) -> None:
    path = tmp_path / "poses.tum"
    path.write_text("".join(f"{40 * number} {0.01 * number} 0 0 0 0 0 1\n" for number in range(1, 60)))
    _, findings = examine(read_whole_stream(path, 1_000_000, _OWN))
    (finding,) = [finding for finding in findings if finding.code == "XN3-02"]
    assert "a pose every 40 s; no camera is that slow" in finding.evidence
    assert finding.fix == "Divide them by 1000: TUM's are in s, EuRoC's in ns."


def read_or_complaint(path: Path, options: TrajectoryOptions) -> Stream | str:
    try:
        return read_whole_stream(path, LEAD_US, options)
    except InputError as error:
        return str(error)


FIELD = st.one_of(
    st.floats().map(repr),
    st.sampled_from(["0", "1", "-1", "nan", "inf", "-inf", "1e300", "1e-320"]),
    st.text(max_size=3),
)
TIME = st.one_of(st.integers(0, 2**63).map(str), st.floats(0, 1e6).map(repr), st.sampled_from(["0", "1e12", "nan"]))


@pytest.mark.slow
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=st.lists(st.tuples(TIME, st.lists(FIELD, min_size=7, max_size=7)), max_size=6), axes=st.booleans())
def test_whatever_a_file_holds_becomes_messages_or_one_line(
    rows: list[tuple[str, list[str]]], axes: bool, tmp_path: Path
) -> None:
    path = tmp_path / "any.tum"
    path.write_text("".join(" ".join((time, *fields)) + "\n" for time, fields in rows), encoding="utf-8")
    read = read_or_complaint(path, _OWN if axes else TrajectoryOptions(axes="mocap_y_up"))
    if isinstance(read, str):
        assert read.startswith(str(path))
        assert len(read.splitlines()) == 1
    else:
        times = [message.arrival_us or 0 for message in read.messages]
        assert times == sorted(times)
        assert np.diff(times, prepend=LEAD_US).max() <= MAX_GAP_US


def test_bag_with_a_time_far_off_is_one_line(tmp_path: Path) -> None:
    rows = rows_of(Case("clean", ODOMETRY, "", frozenset()).stream())[:5]
    rows[3].arrival_us += 2 * MAX_GAP_US
    with pytest.raises(InputError, match=r"poses\.bag: message 5: more than a day after the one before"):
        read_whole_stream(WRITERS["bag"](tmp_path, rows), 0)


@pytest.mark.slow
def test_command_takes_a_file_in_its_axes(viso: Viso) -> None:
    case = Case("scaled", ODOMETRY, "{kind: yawerr, yaw_deg: 25}", frozenset())
    path = WRITERS["euroc"](Path(), rows_of(case.stream()))
    outcome = viso("doctor", path, "--axes", "ned_frd", "--lead", "6.5", "--fail-on", "warning", "--json")
    assert outcome.code == 1
    data = json.loads(outcome.out)
    assert "XN2-05" in {finding["code"] for finding in data["findings"]}
    assert "poses.csv: poses and velocities; taken as ned_frd (--axes), sent as odometry (--as)" in data["notes"]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--as", "delta"), "--as delta: as recorded, there are odometry, vision, vision+speed, mocap"),
        (("--as", "odometry"), "--as odometry: p.tum holds no velocities"),
        (("--axes", "up"), "--axes: 'up' is neither WORLD/BODY"),
        (("--format", "ulog"), "no format 'ulog'; there are tum"),
    ],
)
def test_option_that_does_not_fit_is_one_line(viso: Viso, arguments: tuple[str, ...], line: str) -> None:
    Path("p.tum").write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
    outcome = viso("doctor", "p.tum", *arguments)
    assert failed_with(outcome, outcome.err.removeprefix("viso: ").strip())
    assert outcome.err.startswith(f"viso: {line}")


def test_options_of_trajectories_are_refused_for_others(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="are for trajectories"):
        read_whole_stream(tmp_path / "x.tlog", 0, TrajectoryOptions(), "vision")

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories in files: what they hold, which kind they are, what is wrong with them, and what is left out."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.unit.viso.trajectories import outcome_of
from viso.geometry import trajectory_files
from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import (
    CUT_SHORT,
    EUROC,
    LARGEST,
    OKVIS,
    OPENVINS,
    TUM,
    Layout,
    Records,
    TrajectoryError,
    detect,
    kitti_records,
    table_records,
    usable,
)

S = math.sqrt(0.5)
T0 = "1403636583"

# Each has the same two records: 0.25 s apart, one metre along x, a quarter turn about z.
TUM_TEXT = f"# t x y z qx qy qz qw\n{T0}.500000001 1 2 3 0 0 0 1\n{T0}.75 2 2 3 0 0 {S} {S}\n"
EUROC_TEXT = f"""#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []
{T0}500000001,1,2,3,1,0,0,0,4,5,6,7,7,7,7,7,7
{T0}750000000,2,2,3,{S},0,0,{S},4,5,6,7,7,7,7,7,7
"""
VINS_TEXT = f"{T0}500000001,1,2,3,1,0,0,0,4,5,6,\n{T0}750000000,2,2,3,{S},0,0,{S},4,5,6,\n"
VINS_LOOP_TEXT = f"{T0}500000001,1,2,3,1,0,0,0,\n{T0}750000000,2,2,3,{S},0,0,{S},\n"
OKVIS_TEXT = f"""timestamp, p_WS_W_x, p_WS_W_y, p_WS_W_z, q_WS_x, q_WS_y, q_WS_z, q_WS_w, v_WS_W_x, v_WS_W_y, v_WS_W_z
{T0}500000001, 1e+00, 2e+00, 3e+00, 0, 0, 0, 1, 4, 5, 6, 7
{T0}750000000, 2e+00, 2e+00, 3e+00, 0, 0, {S}, {S}, 4, 5, 6, 7
"""
OPENVINS_TEXT = f"""# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12 Pt13 Pt22 Pt23 Pt33
{T0}.500000001 1 2 3 0 0 0 1 1 0.1 0 2 0 3 4 0.5 0 5 0 6
{T0}.75 2 2 3 0 0 {S} {S} 1 0.1 0 2 0 3 4 0.5 0 5 0 6
"""
KITTI_TEXT = "1 0 0 1 0 1 0 2 0 0 1 3\n0 -1 0 2 1 0 0 2 0 0 1 3\n"
KITTI_TIMES = "0.000000001e+00\n2.5e-01\n"

TABLES = [
    pytest.param(TUM_TEXT, "tum", TUM, id="tum"),
    pytest.param(TUM_TEXT.replace(" ", ", "), "tum", TUM, id="tum with commas"),
    pytest.param(EUROC_TEXT, "euroc", EUROC, id="euroc"),
    pytest.param(VINS_TEXT, "euroc", EUROC, id="vins"),
    pytest.param(VINS_LOOP_TEXT, "euroc", EUROC, id="vins with loops"),
    pytest.param(OKVIS_TEXT, "okvis", OKVIS, id="okvis"),
    pytest.param(OPENVINS_TEXT, "openvins", OPENVINS, id="openvins"),
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "flight.txt"


def read_table(path: Path, layout: Layout) -> Trajectory:
    return usable(table_records(path, layout))


def read(path: Path, text: str, layout: Layout = TUM) -> Trajectory:
    path.write_text(text)
    return read_table(path, layout)


def complaint(path: Path, text: str, layout: Layout = TUM) -> str:
    with pytest.raises(TrajectoryError) as raised:
        read(path, text, layout)
    return str(raised.value)


@pytest.mark.parametrize(("text", "name", "layout"), TABLES)
def test_table_is_read(path: Path, text: str, name: str, layout: Layout) -> None:
    trajectory = read(path, text, layout)
    assert trajectory.times_ns.tolist() == [int(f"{T0}500000001"), int(f"{T0}750000000")]
    assert trajectory.positions.tolist() == [[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]]
    np.testing.assert_allclose(trajectory.quats_wxyz, [[1.0, 0.0, 0.0, 0.0], [S, 0.0, 0.0, S]])
    assert trajectory.left_out == {}


@pytest.mark.parametrize(("text", "name", "layout"), TABLES)
def test_format_is_found_out(text: str, name: str, layout: Layout) -> None:
    assert detect(text) == name


@pytest.mark.parametrize("text", [EUROC_TEXT, VINS_TEXT, OKVIS_TEXT])
def test_velocity_is_read(path: Path, text: str) -> None:
    velocities = read(path, text, OKVIS if text == OKVIS_TEXT else EUROC).velocities
    assert velocities is not None
    assert velocities.tolist() == [[4.0, 5.0, 6.0]] * 2


def test_velocity_may_be_missing(path: Path) -> None:
    assert read(path, VINS_LOOP_TEXT, EUROC).velocities is None


def test_covariance_of_openvins_has_its_rotation_first(path: Path) -> None:
    covariance = read(path, OPENVINS_TEXT, OPENVINS).pose(0).covariance
    assert covariance is not None
    assert np.diagonal(covariance).tolist() == [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]
    assert (covariance[0, 1], covariance[3, 4], covariance[4, 3]) == (0.5, 0.1, 0.1)


def test_times_of_orb_slam_in_nanoseconds_are_told_by_their_size(path: Path) -> None:
    text = TUM_TEXT.replace(f"{T0}.500000001", f"{T0}500000001.000000").replace(f"{T0}.75", f"{T0}750000000.000000")
    assert read(path, text).times_ns.tolist() == [int(f"{T0}500000001"), int(f"{T0}750000000")]


def test_nanoseconds_of_a_simulation_may_begin_at_0(path: Path) -> None:
    trajectory = read(path, VINS_TEXT.replace(f"{T0}500000001", "0").replace(f"{T0}750000000", "50000000"), EUROC)
    assert trajectory.times_ns.tolist() == [0, 50_000_000]


def test_seconds_in_a_csv_file_with_w_first_are_seconds(path: Path) -> None:
    text = "t,x,y,z,qw,qx,qy,qz\n0.5,1,2,3,1,0,0,0\n0.75,2,2,3,1,0,0,0\n"
    assert detect(text) == "euroc"
    assert read(path, text, EUROC).times_ns.tolist() == [500_000_000, 750_000_000]


def test_lines_of_another_system_and_a_byte_order_mark_are_fine(path: Path) -> None:
    path.write_bytes(b"\xef\xbb\xbf" + TUM_TEXT.replace("\n", "\r\n").encode())
    assert len(read_table(path, TUM)) == 2


def test_kitti_is_read_with_its_times(path: Path, tmp_path: Path) -> None:
    times = tmp_path / "times.txt"
    path.write_text(KITTI_TEXT)
    times.write_text(KITTI_TIMES)
    trajectory = usable(kitti_records(path, times))
    assert trajectory.times_ns.tolist() == [1, 250_000_000]
    assert trajectory.positions.tolist() == [[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]]
    np.testing.assert_allclose(trajectory.quats_wxyz, [[1.0, 0.0, 0.0, 0.0], [S, 0.0, 0.0, S]])
    assert detect(KITTI_TEXT) == "kitti"


def test_kitti_without_times_says_what_is_missing(path: Path) -> None:
    with pytest.raises(TrajectoryError, match="KITTI's poses have no times"):
        kitti_records(path, None)


@pytest.mark.parametrize(
    ("poses", "times", "line"),
    [
        (KITTI_TEXT, "0\n1\n2\n", "{poses}: 2 poses, but 3 times in {times}"),
        (KITTI_TEXT, "0\n", "{poses}: 2 poses, but 1 times in {times}"),
        (KITTI_TEXT, "0\nx\n", "{times}:2: not a time: 'x'"),
        (KITTI_TEXT.replace(" 3\n0", "\n0"), KITTI_TIMES, "{poses}:1: 11 columns, not 12"),
        (KITTI_TEXT.replace("-1", "-9"), KITTI_TIMES, "{poses}: 1 usable records, and a trajectory needs 2; 1 with an "
         "attitude that is no rotation"),
    ],
)  # fmt: skip
def test_fault_of_kitti_is_one_line(path: Path, tmp_path: Path, poses: str, times: str, line: str) -> None:
    times_path = tmp_path / "times.txt"
    path.write_text(poses)
    times_path.write_text(times)
    with pytest.raises(TrajectoryError) as raised:
        usable(kitti_records(path, times_path))
    assert str(raised.value) == line.format(poses=path, times=times_path)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", ": no records"),
        ("# nothing\n", ": no records"),
        ("1 2 3\n", ":1: 3 columns, not 8"),
        (f"{TUM_TEXT}2 1 1\n", ":4: 3 columns, not 8"),
        (f"{TUM_TEXT}2 1 1 1 1 0 0 0 0\n", ":4: 9 columns, not 8"),
        (f"{TUM_TEXT}{T0}.8 1 2 x3 0 0 0 1\n", ":4: not a number: 'x3'"),
        (f"{TUM_TEXT}time 1 2 3 0 0 0 1\n", ":4: not a time: 'time'"),
        (f"{TUM_TEXT}nan 1 2 3 0 0 0 1\n", ":4: not a time: 'nan'"),
        (f"{TUM_TEXT}inf 1 2 3 0 0 0 1\n", ":4: not a time: 'inf'"),
        (f"{TUM_TEXT}-1 1 2 3 0 0 0 1\n", ":4: not a time: '-1'"),
        (f"{TUM_TEXT}1e999999 1 2 3 0 0 0 1\n", ":4: not a time: '1e999999'"),
        (f"{TUM_TEXT}99999999999 1 2 3 0 0 0 1\n", ":4: not a time: '99999999999'"),
    ],
)
def test_fault_of_a_table_is_one_line(path: Path, text: str, line: str) -> None:
    assert complaint(path, text) == f"{path}{line}"


def test_file_that_is_not_there_is_one_line(path: Path) -> None:
    with pytest.raises(TrajectoryError, match=r"flight\.txt: No such file or directory$"):
        read_table(path, TUM)


def test_bytes_that_are_no_text_are_one_line(path: Path) -> None:
    path.write_bytes(b"1 2 \xff\xfe")
    with pytest.raises(TrajectoryError, match=r"flight\.txt: byte 4: neither text nor a bag"):
        read_table(path, TUM)


def test_last_line_that_was_cut_short_is_counted(path: Path) -> None:
    trajectory = read(path, f"{TUM_TEXT}{T0}.9 1 2 3 0 0")
    assert len(trajectory) == 2
    assert trajectory.left_out == {CUT_SHORT: 1}


@pytest.mark.parametrize("text", ["", "hello\n", "1 2 3\n", "1,2,3\n", "# only words\n", "time,x\n"])
def test_text_of_no_format_is_none(text: str) -> None:
    assert detect(text) is None


FIELDS = st.sampled_from(
    ["0", "1", "1.5", "-1", "nan", "inf", "1e400", "1e-400", "x", "", T0, f"{T0}500000001", "_", "٣"]
)
LINES = st.lists(FIELDS, max_size=21).flatmap(
    lambda fields: st.sampled_from([" ".join(fields), ",".join(fields), "#" + ",".join(fields)])
)
DAMAGED = st.one_of(
    st.lists(LINES, max_size=6).map("\n".join),
    st.sampled_from([TUM_TEXT, EUROC_TEXT, OKVIS_TEXT, OPENVINS_TEXT, KITTI_TEXT]).flatmap(
        lambda text: st.tuples(st.integers(0, len(text)), st.text(max_size=5)).map(
            lambda damage: text[: damage[0]] + damage[1] + text[damage[0] + 2 :]
        )
    ),
)


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=DAMAGED, layout=st.sampled_from([TUM, EUROC, OKVIS, OPENVINS, None]))
def test_damage_raises_nothing_but_the_one_error(path: Path, text: str, layout: Layout | None) -> None:
    path.write_text(text, encoding="utf-8", errors="replace")
    detect(text)
    result = outcome_of(lambda: usable(kitti_records(path, path)) if layout is None else read_table(path, layout))
    if isinstance(result, str):
        assert result.startswith(str(path))
        assert len(result.splitlines()) == 1
    else:
        assert len(result) >= 2


# From records to a trajectory

COUNT = 4
NAN = float("nan")


def make(**changes: Any) -> Trajectory:
    """Make a trajectory of four good records, but for the changes: field and record to value."""
    values: dict[str, Any] = {
        "times_ns": np.arange(COUNT),
        "positions": np.outer(np.arange(COUNT), [1.0, 1.0, 1.0]),
        "quats_wxyz": np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1)),
    }
    return usable(Records("flight.tum", **{**values, **changes}))


def rows(row: int, value: list[float], other: list[float]) -> list[list[float]]:
    return [value if number == row else other for number in range(COUNT)]


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("positions", rows(1, [0, NAN, 0], [1, 2, 3]), trajectory_files.NOT_FINITE),
        ("positions", rows(1, [0, float("inf"), 0], [1, 2, 3]), trajectory_files.NOT_FINITE),
        ("positions", rows(1, [0, 0, 2 * LARGEST], [1, 2, 3]), trajectory_files.OUT_OF_RANGE),
        ("quats_wxyz", rows(1, [0, 0, 0, 0], [0, 1, 0, 0]), trajectory_files.NO_ROTATION),
        ("quats_wxyz", rows(1, [1e300, 1e300, 0, 0], [0, 1, 0, 0]), trajectory_files.NO_ROTATION),
        ("quats_wxyz", rows(1, [1, 1, 0, 0], [0, 1, 0, 0]), trajectory_files.NO_ROTATION),
        ("velocities", rows(1, [0, NAN, 0], [1, 2, 3]), trajectory_files.NOT_FINITE),
        ("times_ns", [0, 0, 1, 2], trajectory_files.NOT_LATER),
        ("times_ns", [5, 3, 6, 7], trajectory_files.NOT_LATER),
        ("times_ns", [0, 10**18, 10**18 + 1, 10**18 + 2], trajectory_files.FAR_OFF),
        ("times_ns", [0, 10**18, 1, 2], trajectory_files.FAR_OFF),
    ],
)
def test_record_that_cannot_be_used_is_counted(field: str, value: Any, reason: str) -> None:
    trajectory = make(**{field: value})
    assert len(trajectory) == COUNT - 1
    assert trajectory.left_out == {reason: 1}


def test_positions_of_utm_can_be_used_from_anywhere() -> None:
    """About 430 km east and 5400 km north; one of them is damaged."""
    utm = np.array([430_000.0, 5_400_000.0, 300.0]) + np.arange(COUNT)[:, None]
    utm[2] = [1e30, 0, 0]
    told = Records("utm.tum", np.arange(COUNT).tolist(), utm, np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1)))
    with pytest.raises(TrajectoryError, match=trajectory_files.OUT_OF_RANGE):
        usable(told)
    trajectory = usable(told, from_anywhere=True)
    assert trajectory.positions.tolist() == utm[[0, 1, 3]].tolist()
    assert trajectory.left_out == {trajectory_files.OUT_OF_RANGE: 1}


def test_record_left_out_for_another_reason_sets_no_time() -> None:
    trajectory = make(times_ns=[0, 99, 1, 2], positions=rows(1, [NAN, 0, 0], [1, 2, 3]))
    assert trajectory.times_ns.tolist() == [0, 1, 2]


def test_too_few_usable_records_are_one_line_with_the_reasons() -> None:
    with pytest.raises(TrajectoryError) as raised:
        make(times_ns=[3, 2, 1, 0])
    line = "flight.tum: 1 usable records, and a trajectory needs 2; 3 with a time not after the one before"
    assert str(raised.value) == line


@pytest.mark.parametrize("nothing", [0.0, NAN])
def test_velocities_that_say_nothing_are_unknown(nothing: float) -> None:
    assert make(velocities=np.full((COUNT, 3), nothing)).velocities is None


def test_sound_covariance_is_kept_and_zeros_are_unknown() -> None:
    trajectory = make(covariances=[np.eye(6), np.zeros((6, 6)), np.eye(6), np.eye(6)])
    assert trajectory.pose(0).covariance is not None
    assert trajectory.pose(1).covariance is None
    assert trajectory.left_out == {}


@pytest.mark.parametrize("bad", [-np.eye(6), np.full((6, 6), np.inf), np.triu(np.ones((6, 6))), np.eye(6) * 1e300])
def test_covariance_that_is_none_is_counted_and_its_pose_kept(bad: Any) -> None:
    trajectory = make(covariances=[np.eye(6), bad, np.eye(6), np.eye(6)])
    assert len(trajectory) == COUNT
    assert trajectory.pose(1).covariance is None
    assert trajectory.left_out == {trajectory_files.BAD_COVARIANCE: 1}


def test_covariances_that_are_all_unknown_are_none() -> None:
    assert make(covariances=np.zeros((COUNT, 6, 6))).covariances is None


def test_error_is_one_line() -> None:
    assert str(TrajectoryError("a\nb  c\r\n")) == "a b c"


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(0, 50), st.lists(st.floats(width=32), min_size=10, max_size=10)), max_size=8))
def test_every_record_is_kept_or_counted(given_records: list[tuple[int, list[float]]]) -> None:
    table = np.array([numbers for _, numbers in given_records]).reshape(-1, 10)
    try:
        times_ns = [time for time, _ in given_records]
        trajectory = usable(Records("x", times_ns, table[:, :3], table[:, 3:7], table[:, 7:]))
    except TrajectoryError:
        return
    assert len(trajectory) + sum(trajectory.left_out.values()) == len(given_records)

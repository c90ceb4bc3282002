# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inertial data in text files."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from viso.companion.sources.base import SourceError
from viso.companion.sources.inertial_csv import read_inertial_csv

HEAD = "t_ns,gx,gy,gz,ax,ay,az\n"
ROW = "5000000,0.1,0.2,0.3,1,2,9.8\n"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "imu.csv"
    path.write_text(text)
    return path


def test_rows_become_samples(tmp_path: Path) -> None:
    first, second = read_inertial_csv(written(tmp_path, HEAD + ROW + "10000000,0,0,0,0,0,9.81\n"))
    assert (first.t_ns, second.t_ns) == (5_000_000, 10_000_000)
    np.testing.assert_array_equal(first.gyro, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(first.accel, [1, 2, 9.8])


def test_columns_may_be_in_any_order_and_more(tmp_path: Path) -> None:
    text = "# from the logger\nax, ay, az, temp, t_s, gx, gy, gz\n\n1,2,3,21.5,0.25,4,5,6\n"
    (sample,) = read_inertial_csv(written(tmp_path, text))
    assert (sample.t_ns, sample.accel.tolist(), sample.gyro.tolist()) == (250_000_000, [1, 2, 3], [4, 5, 6])


def test_seconds_keep_their_nanoseconds(tmp_path: Path) -> None:
    (sample,) = read_inertial_csv(written(tmp_path, HEAD.replace("t_ns", "t_s") + "1700000000.123456789,0,0,0,0,0,0\n"))
    assert sample.t_ns == 1_700_000_000_123_456_789


def test_start_is_taken_off(tmp_path: Path) -> None:
    (sample,) = read_inertial_csv(written(tmp_path, HEAD + ROW), start_s=0.002)
    assert sample.t_ns == 3_000_000


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", ": no inertial data"),
        (HEAD, ": no inertial data"),
        ("t,gx,gy,ax,ay,az\n", ":1: no column t_ns or t_s, gz"),
        (HEAD + "1,2,3\n", ":2: 3 columns, not 7"),
        (HEAD + "1,2,3,x,5,6,7\n", ":2: could not convert string to float: 'x'"),
        (HEAD + "1,2,3,nan,5,6,7\n", ":2: 'nan' is not finite"),
        (HEAD + "now,2,3,4,5,6,7\n", ":2: t_ns: 'now' is no time"),
        (HEAD + "1e30,2,3,4,5,6,7\n", ":2: t_ns: '1e30' is no time"),
        (HEAD + ROW + ROW, ":3: a time not after the one before"),
    ],
)
def test_line_that_is_to_blame_is_named(tmp_path: Path, text: str, complaint: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(SourceError) as caught:
        read_inertial_csv(path)
    assert str(caught.value) == f"{path}{complaint}"


def test_file_that_is_no_text_is_told(tmp_path: Path) -> None:
    path = tmp_path / "imu.csv"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(SourceError, match="not UTF-8 text"):
        read_inertial_csv(path)


def test_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"imu\.csv: No such file or directory"):
        read_inertial_csv(tmp_path / "imu.csv")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.one_of(st.text(max_size=60), st.text("0123456789.,-+einfa\n#_tgxyz", max_size=80).map(HEAD.__add__)))
def test_whatever_a_file_holds_nothing_else_is_raised(tmp_path: Path, text: str) -> None:
    path = tmp_path / "imu.csv"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    try:
        samples = read_inertial_csv(path)
    except SourceError:
        return
    assert all(np.isfinite(sample.gyro).all() for sample in samples)

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Golden logs: what is written, what is compared, and what is told."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.log_field import LogValue
from viso.testing import Record
from viso.testing.golden import GoldenFiles, line_of


def record(time_us: int = 7, **fields: LogValue) -> Record:
    return Record(time_us, "VISP", {"TimeUS": time_us, **fields})


def test_line_is_json_with_the_digits_that_count() -> None:
    line = line_of(record(PX=np.float32(0.1), Rst=3, Text="yaw", Raw=b"\x00\xff"), ())
    assert line == '{"record": "VISP", "TimeUS": 7, "PX": 0.1, "Rst": 3, "Text": "yaw", "Raw": "\\u0000\\u00ff"}'


@given(st.floats(width=32), st.floats(width=32))
def test_lines_are_equal_if_and_only_if_floats_are(first: float, second: float) -> None:
    a, b = np.float32(first), np.float32(second)
    is_same = a.tobytes() == b.tobytes() or (np.isnan(a) and np.isnan(b))
    assert (line_of(record(PX=a), ()) == line_of(record(PX=b), ())) is bool(is_same)


def test_fields_can_be_left_out(tmp_path: Path) -> None:
    GoldenFiles(tmp_path, update=True).check("log", [record(1, PX=2.0)], ["TimeUS"])
    assert (tmp_path / "log.jsonl").read_text() == '{"record": "VISP", "PX": 2.0}\n'
    GoldenFiles(tmp_path, update=False).check("log", [record(3, PX=2.0)], ["TimeUS"])


def test_difference_is_shown_as_lines(tmp_path: Path) -> None:
    folder = tmp_path / "tests" / "golden"
    GoldenFiles(folder, update=True).check("log", [record(1, PX=2.0), record(2, PX=3.0)], ())
    with pytest.raises(AssertionError) as failure:
        GoldenFiles(folder, update=False).check("log", [record(1, PX=2.0), record(2, PX=4.0)], ())
    assert str(failure.value).splitlines() == [
        "the log differs from tests/golden/log.jsonl (-), which --update-golden would rewrite:",
        "@@ -2 +2 @@",
        '-{"record": "VISP", "TimeUS": 2, "PX": 3.0}',
        '+{"record": "VISP", "TimeUS": 2, "PX": 4.0}',
    ]


def test_long_difference_is_cut_short(tmp_path: Path) -> None:
    GoldenFiles(tmp_path, update=True).check("log", [record(number) for number in range(100)], ())
    with pytest.raises(AssertionError, match=r"\.\.\. and 180 more$"):
        GoldenFiles(tmp_path, update=False).check("log", [record(number) for number in range(100, 199)], ())


def test_update_replaces_what_was_there(tmp_path: Path) -> None:
    files = GoldenFiles(tmp_path, update=True)
    files.check("log", [record(1)], ())
    files.check("log", [record(2)], ())
    GoldenFiles(tmp_path, update=False).check("log", [record(2)], ())


@pytest.mark.parametrize("name", ["", "../log", "a/b", ".hidden", "ä", "a b"])
def test_name_that_is_no_file_name_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match="a name has letters, digits"):
        GoldenFiles(tmp_path, update=True).check(name, [record()], ())


@pytest.mark.parametrize("update", [False, True])
def test_empty_log_and_unknown_fields_are_refused(tmp_path: Path, update: bool) -> None:
    files = GoldenFiles(tmp_path, update=update)
    with pytest.raises(ValueError, match="there is no record yet"):
        files.check("log", [], ())
    with pytest.raises(ValueError, match="no record has a field RTimeMS"):
        files.check("log", [record()], ["RTimeMS", "TimeUS"])

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameter files: reading, writing, and errors that name file and line."""

import contextlib

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ap_core.parm_file import ParmFileError, parse_parm

NAMES = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_", min_size=1, max_size=16)
FLOATS = st.floats(width=32, allow_nan=False, allow_infinity=False)


def read(text: str) -> list[tuple[str, float]]:
    return [(line.name, float(line.value)) for line in parse_parm(text, "a.parm")]


class TestParse:
    @pytest.mark.parametrize(
        "text",
        [
            "VISO_TYPE 1",
            "VISO_TYPE,1",
            "VISO_TYPE=1",
            "VISO_TYPE = 1",
            "VISO_TYPE\t1\r\n",
            "  VISO_TYPE        1.000000\n",
            "\ufeffVISO_TYPE 1",
            "VISO_TYPE 1 # the MAVLink backend",
            "VISO_TYPE 1#",
            "VISO_TYPE 0x1",
            "VISO_TYPE +1.e0",
            "VISO_TYPE 1 seriously",
            "# comment\n\n   \r\nVISO_TYPE 1",
            "#NOTE: 10/22/2025 13:05:01\nVISO_TYPE,1\r\n",
            "# Vehicle-Id Component-Id Name Value Type\n1\t1\tVISO_TYPE\t1\t2\n1\t100\tCAM_MODE\t3\t2\n",
            "2\t1\tVISO_TYPE\t1.000000000000000000\t9\r\n",
        ],
    )
    def test_spellings_of_a_line(self, text: str) -> None:
        assert read(text) == [("VISO_TYPE", 1.0)]

    def test_lines_keep_their_order_and_number(self) -> None:
        lines = parse_parm("B 1\n# no\nA 2\nB 3\n", "a.parm")
        assert [(line.name, line.line_number) for line in lines] == [("B", 1), ("A", 3), ("B", 4)]

    @pytest.mark.parametrize(("text", "read_only"), [("A 1 @READONLY", True), ("A 1", False), ("A 1 @readonly", False)])
    def test_read_only_mark(self, text: str, read_only: bool) -> None:
        assert parse_parm(text, "a.parm")[0].read_only is read_only

    def test_value_is_float32(self) -> None:
        value = parse_parm("A 0.1", "a.parm")[0].value
        assert isinstance(value, np.float32)
        assert value == np.float32(0.1)

    def test_16_characters_are_a_name(self) -> None:
        assert read("A234567890123456 1") == [("A234567890123456", 1.0)]

    @pytest.mark.parametrize(
        ("line", "reason"),
        [
            ("VISO_TYPE", "missing value"),
            ("VISO_TYPE # 1", "missing value"),
            ("VISO_TYPE one", "bad number"),
            ("VISO_TYPE 1_0", "bad number"),
            ("VISO_TYPE 1.5.2", "bad number"),
            ("VISO_TYPE \u0661", "bad number"),
            ("VISO_TYPE 0x" + "f" * 33, "bad number"),
            ("A2345678901234567 1", "name longer than 16 characters"),
            ("VISO_SCALE nan", "value is not finite"),
            ("VISO_SCALE -inf", "value is not finite"),
            ("VISO_SCALE 1e39", "value is not finite"),
            ("VISO_SCALE 0x" + "f" * 32, "value is not finite"),
        ],
    )
    def test_bad_line_names_file_line_and_reason(self, line: str, reason: str) -> None:
        with pytest.raises(ParmFileError) as caught:
            parse_parm("A 1\n" + line, "dir/a.parm")
        assert (caught.value.source, caught.value.line_number) == ("dir/a.parm", 2)
        assert (caught.value.text, caught.value.reason) == (line, reason)
        assert str(caught.value) == f"dir/a.parm:2: {reason}: {line!r}"

    def test_error_is_one_line_even_for_binary_text(self) -> None:
        with pytest.raises(ParmFileError) as caught:
            parse_parm("\x00\x0b\x1b[2J" + "\u2028x" * 500, "a.parm")
        assert len(str(caught.value).splitlines()) == 1
        assert len(str(caught.value)) < 500

    @given(text=st.text())
    @example(text="A 1\x0b")
    @example(text="A 9" + "9" * 5000)
    def test_any_text_gives_lines_or_an_error_of_its_own(self, text: str) -> None:
        with contextlib.suppress(ParmFileError):
            assert all(np.isfinite(line.value) for line in parse_parm(text, "a.parm"))

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of message intervals."""

from pathlib import Path

import pytest

from viso.errors import InputError
from viso.terminal.settings import load_message_intervals


def test_each_link_has_a_file_of_its_own(tmp_path: Path) -> None:
    tmp_path.joinpath("message-intervals-chan0.txt").write_text("30 50\n\n1 1000\r\n30 100\n")
    tmp_path.joinpath("message-intervals-chan2.txt").write_text("33 0\n")
    tmp_path.joinpath("message-intervals-chan3.txt").write_text("33 10\n")
    assert load_message_intervals(tmp_path, 3) == {0: {30: 100, 1: 1000}, 2: {33: 0}}


def test_without_a_file_there_are_none(tmp_path: Path) -> None:
    assert load_message_intervals(tmp_path, 4) == {}


@pytest.mark.parametrize(
    "line",
    ["30", "30 50 7", "ATTITUDE 50", "30 fast", "-1 50", "30 50.5", "30 65536", "16777216 50", "1" * 5000 + " 1"],
)
def test_bad_line_is_named(tmp_path: Path, line: str) -> None:
    path = tmp_path / "message-intervals-chan0.txt"
    path.write_text(f"30 50\n{line}\n")
    with pytest.raises(InputError) as caught:
        load_message_intervals(tmp_path, 1)
    assert str(caught.value).startswith(f"{path}:2: ")

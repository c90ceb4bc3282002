# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of measured figures, and where they go."""

import pytest

from tools.measured_page import render, replace
from viso.errors import InputError

PAGE = "before\n<!-- measured: ekf -->\nold\n<!-- end -->\nafter\n<!-- table: cli -->\nkept\n<!-- end -->\n"


def test_table_has_a_line_for_the_head_one_below_it_and_one_for_each_row() -> None:
    assert render(("a", "b"), [("1", "2")]) == "| a | b |\n| --- | --- |\n| 1 | 2 |\n"


def test_table_is_put_into_its_place_alone() -> None:
    page = replace(PAGE, "ekf", "| new |\n")
    assert page == PAGE.replace("old\n", "\n| new |\n\n").replace("-->\n\n\n", "-->\n\n")
    assert replace(page, "ekf", "| new |\n") == page


def test_page_without_a_place_of_that_name_is_one_line() -> None:
    with pytest.raises(InputError, match="no line <!-- measured: vio --> "):
        replace(PAGE, "vio", "")

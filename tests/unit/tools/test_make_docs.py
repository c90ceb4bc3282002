# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of the documentation that are made from the code."""

import pytest

from ekf_stub.inputs import ingest_rules as rules
from tools.make_docs import TABLES, render


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split(" | ")]


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES)
def test_every_row_has_a_cell_for_each_column(name: str) -> None:
    head, _, *rows = render(name).splitlines()
    assert rows
    assert {row.replace("\\|", "").count("|") for row in rows} == {head.count("|")}


def test_outcomes_in_the_filter_are_all_but_being_let_in() -> None:
    _, _, *rows = render("filter_verdicts").splitlines()
    codes = [cells(row)[0].strip("| `") for row in rows]
    assert codes == [rule.code for rule in rules.RULES if rule is not rules.TAKEN]


def test_outcomes_in_the_filter_say_whose_opinion_they_are() -> None:
    _, _, *rows = render("filter_verdicts").splitlines()
    by_code = {cells(row)[0].strip("| `"): cells(row)[1:4] for row in rows}
    assert by_code["too_soon"] == ["refused", rules.TOO_SOON.text, "exact"]
    assert by_code["model_gate_height"] == ["rejected", "height gate", "a model's"]

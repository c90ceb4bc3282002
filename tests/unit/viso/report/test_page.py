# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The page and its figures: complete, self-contained, and safe whatever a log says."""

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from tests.unit.viso.report.log_maker import LogMaker, material_of
from viso.report import drawing
from viso.report.facts import Facts, facts_of
from viso.report.figures import FIGURES
from viso.report.flight_data import Happening, Material
from viso.report.page import make_page
from viso.report.summary import summarise
from viso.report.timeline import MOST_TEXTS, chosen

pytestmark = pytest.mark.slow

VOID = {"meta", "br", "link", "img", "hr", "input"}


class Elements(HTMLParser):
    """Lists the elements of a page, and those that were closed out of turn."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.names: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.strays: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.append(tag)
        self.ids += [value for name, value in attrs if name == "id" and value]
        self.references += [value for name, value in attrs if name in ("href", "xlink:href", "src") and value]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if self.open and self.open[-1] == tag:
            self.open.pop()
        else:
            self.strays.append(tag)

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def page_of(material: Material, facts: Facts) -> str:
    inline = {}
    with drawing.style():
        for kind in FIGURES:
            figure = kind.draw(material, facts)
            inline[kind] = None if figure is None else drawing.as_inline_svg(figure, kind.name, kind.title)
    return make_page(material, facts, summarise(material, facts), inline, "1.2.3")


@pytest.fixture(scope="module")
def page(material: Material, facts: Facts) -> str:
    return page_of(material, facts)


@pytest.fixture(scope="module")
def elements(page: str) -> Elements:
    parser = Elements()
    parser.feed(page)
    return parser


def test_page_is_well_formed(elements: Elements) -> None:
    assert (elements.open, elements.strays) == ([], [])
    assert len(set(elements.ids)) == len(elements.ids)


def test_page_refers_to_nothing_but_itself(page: str, elements: Elements) -> None:
    outside = [one for one in elements.references if not one.startswith(("#", "data:image/png;base64,"))]
    assert not outside
    assert {one[1:] for one in elements.references if one.startswith("#")} <= set(elements.ids)
    assert not re.findall(r"url\((?!#)", page)
    assert "default-src 'none'" in page


def test_markup_in_a_text_stays_text(page: str, elements: Elements) -> None:
    assert "script" not in elements.names
    assert "&lt;script&gt;alert(1)" in page
    assert any(one.startswith("</td><script>alert(1)") for one in elements.texts)


def test_first_thing_to_read_is_the_verdict(page: str) -> None:
    assert page.index('class="verdict bad"') < page.index("<svg")
    assert "External navigation brought 209 poses" in page


def test_every_figure_is_there_in_the_colours_of_the_reader(page: str, elements: Elements) -> None:
    assert elements.names.count("svg") == len(FIGURES)
    assert "var(--ink)" in page
    assert "prefers-color-scheme: dark" in page
    assert "#010203" not in page


def test_tables_tell_counts_parameters_and_texts(page: str) -> None:
    assert "<td>VISP</td><td>position and attitude</td>" in page
    assert "<td>VISO_DELAY_MS</td>" in page
    assert "<td>VisOdom: reset</td>" in page


@pytest.mark.filterwarnings("error")
def test_empty_log_makes_a_page_that_says_what_is_absent(tmp_path: Path) -> None:
    maker = LogMaker()
    maker.parameter("VISO_TYPE", 1, 1)
    material = material_of(maker, tmp_path / "a.BIN")
    text = page_of(material, facts_of(material))
    assert "<svg" not in text
    assert all(kind.absent in text for kind in FIGURES if "'" not in kind.absent)
    assert "No VISP: position and attitude of vision." in text


@pytest.mark.slow
def test_numbers_that_are_none_are_drawn_as_nothing(tmp_path: Path) -> None:
    maker = LogMaker()
    nan = float("nan")
    for time_s in (1.0, 1.1, 1.2):
        maker.add("VISP", time_s, PX=nan, PY=nan, PZ=nan, R=nan, P=nan, Y=nan)
        maker.add("XKF4", time_s, SS=0)
        maker.add("XKF1", time_s, PN=nan, PE=nan, PD=nan)
    material = material_of(maker, tmp_path / "a.BIN")
    with drawing.style():
        drawn = {kind.name: kind.draw(material, facts_of(material)) is not None for kind in FIGURES}
    assert [name for name, there in drawn.items() if not there] == ["differences"]


def test_line_is_not_drawn_over_a_jump() -> None:
    x, y = drawing.broken_at(np.array([1.0, 2.0, 3.0]), np.array([10.0, 20.0, 30.0]), np.array([2.5]))
    np.testing.assert_array_equal(y, [10.0, 20.0, np.nan, 30.0])
    assert len(x) == 4


def test_too_many_texts_leave_room_for_those_about_vision() -> None:
    chatter = [Happening(float(number), "text", f"Waypoint {number}") for number in range(100)]
    telling = [Happening(200.0, "text", "VisOdom: reset"), Happening(201.0, "error", "EKF failsafe: occurred", 17, 1)]
    kept, left_out = chosen([*chatter, *telling])
    assert (len(kept), left_out) == (MOST_TEXTS, 102 - MOST_TEXTS)
    assert kept[-2:] == telling


def test_letters_that_the_font_lacks_are_question_marks() -> None:
    assert drawing.plain("höhe 3\u2192\x07\u6f22") == "höhe 3???"

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso report``: what it writes where, its exit codes, and its one-line errors."""

import re
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.places import ROOT
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.doctor.vehicles import SOURCES, logged
from tests.unit.viso.report.log_maker import LogMaker, flight
from viso.commands import report as report_command
from viso.report import figures
from viso.web import live_view


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log without vision, which takes next to no time."""
    maker = LogMaker()
    maker.add("XKF1", 1.0, PN=1.0)
    maker.add("XKF1", 1.1, PN=2.0)
    return maker.save(tmp_path / "quiet.BIN")


def test_everything_is_written_and_told(viso: Viso, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "FIGURES", figures.FIGURES[-1:])
    path = flight().save(tmp_path / "flight.BIN")
    outcome = viso("report", path, "-o", "pages", "--svg", "svg", "--png", "png", "--tum", "f.tum", "--csv", "f.csv")
    assert (outcome.code, outcome.err) == (0, "")
    first, *lines = outcome.out.splitlines()
    assert first.startswith("TROUBLE: External navigation brought 209 poses at 19 Hz")
    assert "- The reset counter of vision changed once: at 9.0 s." in lines
    written = [line.removeprefix("written: ") for line in lines if line.startswith("written: ")]
    assert written == [
        "f_vision.tum", "f_ekf.tum", "f.csv", "png/rates.png", "svg/rates.svg", "pages/flight.html",
    ]  # fmt: skip
    assert (tmp_path / "png" / "rates.png").read_bytes().startswith(b"\x89PNG")
    assert all(b"<svg" in (tmp_path / name).read_bytes() for name in written[-2:])


@pytest.mark.slow
def test_page_may_be_a_pdf_with_the_verdict_and_the_figures(
    viso: Viso, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "FIGURES", figures.FIGURES[-1:])
    outcome = viso("report", flight().save(tmp_path / "flight.BIN"), "-o", "flight.pdf")
    assert (outcome.code, outcome.err) == (0, "")
    data = (tmp_path / "flight.pdf").read_bytes()
    assert data.startswith(b"%PDF")
    assert data.count(b"/Type /Page ") == 2


@pytest.mark.slow
def test_log_without_vision_is_no_failure(viso: Viso, log: Path, tmp_path: Path) -> None:
    outcome = viso("report", log)
    assert (outcome.code, outcome.err) == (0, "")
    said = "NO VERDICT: The log holds no external navigation: no VISP, VISV or VISO record."
    assert outcome.out.splitlines()[0] == said
    assert "No VISP: position and attitude of vision." in (tmp_path / "quiet.html").read_text(encoding="utf-8")


def test_defaults_are_those_of_the_release_that_flew(viso: Viso, tmp_path: Path) -> None:
    outcome = viso("report", logged(tmp_path, SOURCES, "ArduSub V4.5.6"), "--csv", "a.csv")
    assert outcome.code == 0
    assert "judged as 4.6: the banner says ArduSub V4.5.6, and 4.6 is the nearest that is known here" in outcome.out
    assert "ArduSub V4.5.6 is older than 4.6: before 4.6 there is no VISO_QUAL_MIN" in outcome.err
    assert "the vehicle is a Sub" in outcome.err


@pytest.mark.slow
def test_page_has_the_name_that_is_asked_for(viso: Viso, log: Path, tmp_path: Path) -> None:
    assert viso("report", log, "-o", "deep/page.HTML").code == 0
    assert (tmp_path / "deep" / "page.HTML").is_file()


def test_exports_alone_make_no_page_and_need_no_matplotlib(
    viso: Viso, log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert viso("report", log, "--csv", "out.csv").code == 0
    assert (tmp_path / "out.csv").is_file()
    assert not list(tmp_path.glob("*.html"))


def test_log_is_shown_on_the_page_of_the_live_view_and_nothing_is_written(
    viso: Viso, log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(live_view, "show_recording", lambda *given: shown.append(given))
    outcome = viso("report", log, "--web", "8080")
    assert (outcome.code, outcome.err) == (0, "")
    ((address, message, _),) = shown
    assert (address, message["type"], message["banner"]) == ("8080", "recording", "quiet.BIN")
    assert [path.name for path in tmp_path.iterdir()] == ["quiet.BIN"]


@pytest.mark.parametrize(
    ("logs", "told"),
    [((), "Missing argument 'LOG'."), (("a.BIN", "b.BIN"), "Got unexpected extra argument(s) (b.BIN)")],
)
def test_one_log_is_shown_and_no_other_number_of_them(viso: Viso, logs: tuple[str, ...], told: str) -> None:
    outcome = viso("report", *logs, "--web", "8080")
    assert (outcome.code, outcome.err.splitlines()[-1]) == (2, f"Error: {told}")


def test_without_a_trajectory_a_note_says_so(viso: Viso, tmp_path: Path) -> None:
    maker = LogMaker()
    maker.parameter("VISO_TYPE", 1, 1)
    outcome = viso("report", maker.save(tmp_path / "empty.BIN"), "--tum", "out.tum")
    assert (outcome.code, outcome.err) == (0, "note: --tum out.tum: the log has no trajectory, nothing was written\n")


@pytest.mark.parametrize(
    ("module", "option", "extra"), [("matplotlib", "-o", "plot"), ("rosbags.rosbag2", "--mcap", "bags")]
)
def test_missing_extra_is_one_line(
    viso: Viso, log: Path, monkeypatch: pytest.MonkeyPatch, module: str, option: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    outcome = viso("report", log, option, "out.mcap" if extra == "bags" else "out.html")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.count("\n") == 1
    assert f"pip install 'ardupilot-viso[{extra}]'" in outcome.err


def test_file_that_is_no_log_is_one_line(viso: Viso, tmp_path: Path) -> None:
    path = tmp_path / "text.BIN"
    path.write_text("nothing of the kind")
    assert failed_with(viso("report", path), f"{path}: not a DataFlash log")
    assert failed_with(viso("report", "gone.BIN"), "gone.BIN: No such file or directory")


@pytest.mark.parametrize("option", ["--output", "--tum", "--csv", "--mcap"])
def test_log_is_not_overwritten(viso: Viso, log: Path, option: str) -> None:
    path = log.rename(log.with_suffix(".html"))
    before = path.read_bytes()
    line = f"{option} {path}: the same file as LOG {path}, which is read"
    assert failed_with(viso("report", path, option, path), line)
    assert path.read_bytes() == before


def test_place_that_cannot_be_written_is_one_line(viso: Viso, log: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    outcome = viso("report", log, "--csv", "file/out.csv")
    assert outcome.code == 2
    assert outcome.err.startswith("viso: file/out.csv: ")
    assert outcome.err.count("\n") == 1


@pytest.mark.slow
def test_programs_of_the_documentation_print_what_it_says(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    root = ROOT
    monkeypatch.chdir(root)
    text = (root / "docs" / "report.md").read_text(encoding="utf-8")
    programs = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(programs) == 2
    for program in programs:
        exec(program, {})
        assert f"prints\n\n```\n{capsys.readouterr().out}```" in text


@pytest.mark.slow
def test_commands_of_the_documentation_name_what_is_written(viso: Viso, log: Path, tmp_path: Path) -> None:
    log.rename(tmp_path / "flight.BIN")
    text = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")
    commands = [line.split()[1:] for line in text.splitlines() if line.startswith("viso report")]
    assert len(commands) == 2
    assert [viso(*command).code for command in commands] == [0, 0]
    assert {path.name for path in tmp_path.iterdir()} == {
        "flight.BIN", "flight.html", "flight_ekf.tum", "flight.csv", "flight.mcap",
    }  # fmt: skip


def test_page_of_a_packed_log_bears_the_name_of_the_log() -> None:
    page_path = report_command._page_path
    assert page_path(Path("."), Path("a/flight.BIN.xz")) == Path("flight.html")
    assert page_path(Path("x"), Path("00000012.BIN")) == Path("x/00000012.html")

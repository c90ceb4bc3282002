# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso doctor``: exit codes, outputs, what is given and what is found out."""

import json
import re
import shlex
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mav_handlers.links import make_pair
from mav_handlers.wire.codec import Codec
from tests.places import RECORDED, ROOT
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.corpus import CORPUS
from tests.unit.viso.doctor.streams import LEAD_US, SETUP, piece
from tests.unit.viso.doctor.vehicles import GPS_ALONE, MANY, SOURCES, logged
from viso.commands import doctor as doctor_command
from viso.doctor import Evidence, gather
from viso.firmware.releases import PROFILES
from viso.streams.stream_kinds import Stream

UNTIL_US = LEAD_US + 3_000_000
PAGE = (ROOT / "docs" / "doctor.md").read_text(encoding="utf-8")


def written(name: str, *, params: bool = True) -> Path:
    """Write a piece of the corpus, or a clean one, as a capture in the working folder."""
    case = next((case for case in CORPUS if case.name == name), None)
    stream = piece("flight_t265", 40.0, 3.0) if case is None else case.stream()
    lines = [json.dumps({"name": name, "params": dict(stream.params) if params else {}})]
    kept = [one for one in stream.messages if (one.arrival_us or 0) < UNTIL_US]
    lines += [json.dumps({"arrival_us": one.arrival_us, "msg": one.frame.hex()}) for one in kept]
    path = Path(f"{name.replace(' ', '_')}.jsonl")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


_EXAMINED: dict[str, Evidence] = {}


@pytest.fixture(autouse=True)
def examined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the same stream on the same vehicle be tried once, whatever is asked about it."""

    def once(stream: Stream, *, on_progress: Callable[[int], None], **options: Any) -> Evidence:
        key = repr((stream.name, stream.params, len(stream.messages), options))
        if key not in _EXAMINED:
            _EXAMINED[key] = gather(stream, on_progress=on_progress, **options)
        return _EXAMINED[key]

    monkeypatch.setattr(doctor_command, "gather", once)


def test_clean_stream_ends_well(viso: Viso) -> None:
    outcome = viso("doctor", written("clean"), "--fail-on", "warning", "--baud", "0")
    assert outcome.code == 0
    assert "The filter (a model) would navigate by it from 6.5" in outcome.out
    assert re.search(r"^clean: \d notes$", outcome.out, re.MULTILINE)


@pytest.mark.slow
def test_release_that_is_flown_has_names_and_texts_of_its_own(viso: Viso) -> None:
    outcome = viso(
        "doctor", written("clean"), "--firmware", "4.6", "--param", "SYSID_THISMAV=3", "--json", "--baud", "0"
    )
    assert outcome.code == 0
    assert json.loads(outcome.out)["firmware"] == "4.6"


def test_error_is_told_with_its_fix_and_fails(viso: Viso) -> None:
    outcome = viso("doctor", written("LOCAL_NED and BODY_NED"), "--baud", "0")
    assert outcome.code == 1
    assert outcome.out.startswith("error XN2-01  ODOMETRY in frames that the autopilot drops\n")
    assert "\n    fix: Data can stay as they are: set frame_id 20 and child_frame_id 12." in outcome.out


@pytest.mark.slow
@pytest.mark.parametrize(("fail_on", "code"), [("error", 0), ("warning", 1), ("note", 1)])
def test_severity_that_fails_is_chosen(viso: Viso, fail_on: str, code: int) -> None:
    assert viso("doctor", written("twice"), "--baud", "0", "--fail-on", fail_on).code == code


def test_findings_for_machines(viso: Viso) -> None:
    name = written("LOCAL_NED and BODY_NED")
    outcome = viso("doctor", name, "--json", "--sarif", "out.sarif", "--junit", "out.xml", "--baud", "0")
    data = json.loads(outcome.out)
    assert outcome.code == 1
    assert data["findings"][0]["code"] == "XN2-01"
    assert data["summary"]["healthy_from_us"] is None
    sarif = json.loads(Path("out.sarif").read_text(encoding="utf-8"))
    assert sarif["runs"][0]["results"][0]["ruleId"] == "XN2-01"
    assert ET.parse("out.xml").getroot().attrib["failures"] == "1"


@pytest.mark.slow
def test_parameters_are_given(viso: Viso) -> None:
    path = written("clean")
    outcome = viso("doctor", path, "--param", "VISO_TYPE=0", "--json", "--baud", "0")
    assert outcome.code == 1
    assert "XN7-01" in {finding["code"] for finding in json.loads(outcome.out)["findings"]}


@pytest.mark.slow
def test_parameter_that_asks_for_what_is_left_out_is_noted(viso: Viso) -> None:
    outcome = viso("doctor", written("clean"), "--param", "EK3_SRC2_POSXY=4", "--baud", "0")
    assert "clean: EK3_SRC2_POSXY is 4: range beacons are not fused here" in " ".join(outcome.err.split())


def test_assumed_parameters_are_told(viso: Viso) -> None:
    data = json.loads(viso("doctor", written("clean", params=False), "--json", "--baud", "0").out)
    assert data["assumed"]["VISO_TYPE"] == 1
    assert "XN7-16" in {finding["code"] for finding in data["findings"]}


@pytest.mark.slow
def test_nothing_is_assumed_of_what_is_given(viso: Viso) -> None:
    given = [f"--param={name}={value}" for name, value in SETUP.items()]
    data = json.loads(viso("doctor", written("clean", params=False), "--json", "--baud", "0", *given).out)
    assert data["assumed"] == {}


@pytest.mark.slow
def test_attitude_comes_from_a_log(viso: Viso) -> None:
    log = RECORDED / "logs" / "flight_t265.BIN.xz"
    outcome = viso("doctor", written("clean"), "--attitude", log, "--json", "--baud", "0")
    assert outcome.code in (0, 1)
    assert outcome.err == ""


def test_log_without_external_navigation_is_diagnosed(viso: Viso, tmp_path: Path) -> None:
    log = logged(tmp_path, {**SOURCES, "AHRS_EKF_TYPE": 10}, "ArduCopter V4.5.7")
    outcome = viso("doctor", log, "--json")
    assert outcome.code == 1
    data = json.loads(outcome.out)
    assert data["firmware"] == "4.6"
    assert [finding["code"] for finding in data["findings"] if finding["severity"] == "error"] == ["XN7-01", "XN7-12"]
    # Names are those of the release that flew.
    assert viso("doctor", log, "--param", "SYSID_THISMAV=3").code == 1
    assert json.loads(viso("doctor", log, "--json", "--firmware", "2026-02").out)["firmware"] == "2026-02"


def test_log_in_which_nothing_asks_for_external_navigation_is_in_order(viso: Viso, tmp_path: Path) -> None:
    outcome = viso("doctor", logged(tmp_path, GPS_ALONE))
    assert outcome.code == 0
    assert outcome.out.startswith("note XN7-17  External navigation is not set up\n")
    assert outcome.out.endswith("\nThere is no external navigation to try.\nmade: 1 note\n")


def test_parameters_of_a_ground_station_may_be_given(viso: Viso, tmp_path: Path) -> None:
    rows = [f"1\t1\t{name}\t{value:.18f}\t9" for name, value in {**SOURCES, **MANY}.items()]
    (tmp_path / "qgc.params").write_text("# Onboard parameters\n" + "\n".join(rows) + "\n", encoding="utf-8")
    outcome = viso("doctor", logged(tmp_path, GPS_ALONE), "--defaults", "qgc.params", "--json")
    assert json.loads(outcome.out)["findings"][0]["code"] == "XN7-01"


def test_link_is_listened_to(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = make_pair(("udpin:14550", "companion"))
    codec = Codec(1, 197)
    theirs.send(b"".join(codec.encode(odometry(1 + stamp, frame_id=1)) for stamp in range(0, 400_000, 40_000)))
    monkeypatch.setattr(doctor_command, "open_link", lambda _name: ours)
    outcome = viso("doctor", "udpin:14550", "--seconds", "0.02", "--lead", "3", "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out)["findings"][0]["code"] == "XN2-01"


def test_server_that_refuses_is_one_line(viso: Viso) -> None:
    outcome = viso("doctor", "tcp:127.0.0.1:1", "--seconds", "0.05")
    assert failed_with(outcome, "tcp:127.0.0.1:1: connection refused")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("none.tlog",), "none.tlog: no such file or directory"),
        (("x.tlog", "--lead", "-1"), "--lead -1: not a time in seconds"),
        (("x.tlog", "--seconds", "0"), "--seconds 0: not between 0 and a day"),
        (("x.tlog", "--heading", "nan"), "--heading nan: not an angle in degrees"),
        (("x.tlog", "--firmware", "4.5"), f"--firmware 4.5: no such profile; there are {', '.join(PROFILES)}"),
        (("x.tlog", "--param", "VISO"), "--param 'VISO': not NAME=VALUE with a finite number"),
    ],
)
def test_what_cannot_be_used_is_one_line(viso: Viso, arguments: tuple[str, ...], line: str) -> None:
    assert failed_with(viso("doctor", *arguments), line)


def test_log_without_attitude_is_one_line(viso: Viso) -> None:
    path = written("clean")
    assert failed_with(viso("doctor", path, "--attitude", path), f"{path}: not a DataFlash log with ATT records")


def test_output_that_cannot_be_written_is_one_line(viso: Viso) -> None:
    outcome = viso("doctor", written("clean"), "--sarif", "no/such/folder.sarif", "--baud", "0")
    assert failed_with(outcome, "no/such/folder.sarif: No such file or directory")


@pytest.mark.slow
def test_page_shows_what_happens(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    example = "tests/data/parity/2025-07/captures/t265.jsonl.gz"
    assert f"viso doctor {example}" in PAGE
    monkeypatch.chdir(ROOT)
    outcome = viso("doctor", example)
    shown = re.findall(r"```\n(error.*?)```", PAGE, re.DOTALL)
    assert len(shown) == 1
    assert outcome.out.startswith(shown[0])
    assert outcome.code == 1


@pytest.mark.parametrize(
    "line",
    [pytest.param(line, marks=pytest.mark.slow) for line in re.findall(r"^viso doctor (.*)$", PAGE, re.MULTILINE)],
)
def test_command_of_the_page_works(viso: Viso, line: str) -> None:
    Path("tests").symlink_to(ROOT / "tests")
    outcome = viso("doctor", *line.split())
    assert (outcome.code == 0) == ("t265" not in line)
    assert outcome.out


@pytest.mark.slow
def test_path_of_the_readme_leads_to_its_finding(viso: Viso) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    Path("tests").symlink_to(ROOT / "tests")
    (make,) = re.findall(r"^tools/viso (faults .*mystream\.tlog.*)$", readme, re.MULTILINE)
    (ask,) = re.findall(r"^tools/viso (doctor .*)$", readme, re.MULTILINE)
    (shown,) = re.findall(r"```\n(error.*?)```", readme, re.DOTALL)
    assert viso(*shlex.split(make)).code == 0
    outcome = viso(*shlex.split(ask))
    assert outcome.code == 1
    # The page breaks lines, as a terminal does.
    assert " ".join(outcome.out.split()).startswith(" ".join(shown.split()))


@pytest.mark.slow
def test_program_of_the_page_prints_what_the_page_says(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(block, {})
    assert f"prints `{capsys.readouterr().out.strip()}`" in PAGE

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso compare``: what it finds in recordings of every kind, what it prints and writes, and its one-line errors."""

import gzip
import json
import lzma
from collections.abc import Sequence
from html.parser import HTMLParser
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from tests.places import DATA, PARITY, RECORDED
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.report.log_maker import LogMaker
from viso.firmware.releases import JULY_2025, PROFILES

MESSAGES = 12
HEAD = {"name": "short", "begins_s": 1, "camera_hz": 0, "params": {"VISO_TYPE": 1}}
PARAM = {
    "name": "a parameter",
    "send": [
        "PARAM_REQUEST_READ",
        {"target_system": 1, "target_component": 1, "param_id": "VISO_TYPE", "param_index": -1},
    ],
    "answers": [["PARAM_VALUE", {"param_id": "VISO_TYPE", "param_value": 1.0}]],
}
CALL = ["wrap_360", ["43b48000"], ["3f800000"]]

Lines = Sequence[Any]


def write(path: Path, lines: Lines) -> Path:
    path.parent.mkdir(exist_ok=True)
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def first_lines(path: Path, count: int) -> list[Any]:
    with gzip.open(path, "rt", encoding="utf-8") as file:
        return [json.loads(line) for line in islice(file, count)]


def without_texts(lines: list[Any]) -> list[Any]:
    """Return the beginning of a capture without what its header says of the whole."""
    head, *others = lines
    return [{key: head[key] for key in ("name", "firmware", "params")}, *others]


@pytest.fixture(scope="module")
def mocap() -> list[Any]:
    """Return the beginning of a capture."""
    return without_texts(first_lines(RECORDED / "captures" / "mocap.jsonl.gz", 1 + MESSAGES))


def compared(viso: Viso, *args: object) -> tuple[int, Any]:
    outcome = viso("compare", *args, "--json")
    return outcome.code, json.loads(outcome.out)


def only_difference(viso: Viso, path: Path) -> Any:
    """Return the one field of a recording that differs."""
    code, told = compared(viso, path)
    [comparison] = told["comparisons"]
    assert (code, told["passed"], comparison["differences"]) == (1, False, 1)
    [found] = comparison["fields_that_differ"]
    return found


def test_equal_capture_is_exit_code_0(viso: Viso, tmp_path: Path, mocap: list[Any]) -> None:
    code, told = compared(viso, write(tmp_path / "one.jsonl", [{**mocap[0], "complete": False}, *mocap[1:]]))
    [found] = told["comparisons"]
    assert (code, told["passed"], found["kind"], found["messages"]) == (0, True, "capture", MESSAGES)
    assert found["firmware"] == found["named"] == JULY_2025.name
    assert found["fields"] > 100
    assert found["notes"] == [
        "no 'statustext' in the first line: not compared",
        "no 'command_ack' in the first line: not compared",
        "the recording is not complete",
    ]


def test_changed_field_of_a_record_is_told_with_its_line_and_unit(viso: Viso, tmp_path: Path, mocap: list[Any]) -> None:
    lines = json.loads(json.dumps(mocap))
    pose = lines[-1]["out"][0]
    pose[4] = "41200000"
    found = only_difference(viso, write(tmp_path / "one.jsonl", lines))
    assert (found["field"], found["first"]["place"]) == ("VISP.PX", f"line {len(lines)}")
    assert (found["first"]["recorded"], found["first"]["unit"]) == ("10", "m")


@pytest.mark.parametrize(("header", "field"), [
    ({"statustext": [[4, "VisOdom: not healthy"]]}, "STATUSTEXT.text"),
    ({"command_ack": [[400, 0]]}, "COMMAND_ACK"),
])  # fmt: skip
def test_text_and_acknowledgement_of_the_recording_alone_are_told(
    viso: Viso, tmp_path: Path, mocap: list[Any], header: dict[str, Any], field: str
) -> None:
    lines = [{**mocap[0], **header}, mocap[1]]
    assert only_difference(viso, write(tmp_path / "one.jsonl", lines))["field"] == field


@pytest.mark.parametrize(("answer", "field"), [
    ({"param_id": "VISO_TYPE", "param_value": 2.0}, "PARAM_VALUE.param_value"),
    ({"param_id": "VISO_TYPE", "nosuch": 2.0}, "PARAM_VALUE.nosuch"),
    (None, "answers"),
])  # fmt: skip
def test_changed_answer_is_told(viso: Viso, tmp_path: Path, answer: dict[str, Any] | None, field: str) -> None:
    exchange = {**PARAM, "answers": [] if answer is None else [["PARAM_VALUE", answer]]}
    path = write(tmp_path / "one.jsonl", [{**HEAD, "firmware": JULY_2025.banner}, exchange])
    assert only_difference(viso, path)["field"] == field


def test_time_of_an_answer_is_not_compared(viso: Viso, tmp_path: Path) -> None:
    request = {"target_system": 1, "target_component": 1, "command": 512, "param1": 30}
    answers = [["COMMAND_ACK", {"command": 512}], ["ATTITUDE", {"time_boot_ms": 1}]]
    asked = {"name": "ask", "send": ["COMMAND_LONG", request], "answers": answers}
    path = write(tmp_path / "one.jsonl", [{**HEAD, "begins_s": 5, "firmware": JULY_2025.banner}, asked])
    code, told = compared(viso, path)
    assert (code, told["comparisons"][0]["fields"]) == (0, 3)


def test_equal_answer_is_exit_code_0(viso: Viso, tmp_path: Path) -> None:
    path = write(tmp_path / "one.jsonl", [{**HEAD, "firmware": JULY_2025.banner}, PARAM])
    code, told = compared(viso, path)
    assert (code, told["comparisons"][0]["kind"]) == (0, "conversation")


@pytest.mark.parametrize(
    ("line", "field"),
    [
        (["wrap_360", ["43b48000"], ["3f800001"]], "wrap_360"),
        (CALL[:2], "wrap_360"),
        ({"samples": [[1000, 2000]], "max_lag_ms": 500, "convergence_loops": 100}, "corrected_us"),
        ({"samples": [[1000, 2000, 7]], "max_lag_ms": 500, "convergence_loops": 100}, "corrected_us"),
        ({"params": {"TYPE": 1}, "steps": [["status", {"out": [["status", True, True, 1]]}]]}, "status.quality"),
        ({"params": {"TYPE": 1}, "steps": [["status", {"out": []}]]}, "out"),
    ],
)
def test_changed_vector_is_told(viso: Viso, tmp_path: Path, line: Any, field: str) -> None:
    found = only_difference(viso, write(tmp_path / "one.jsonl", [CALL, line]))
    assert found["field"] == field
    assert found["first"]["place"].startswith("line 2")


def test_terminal_has_a_table_of_what_differs(viso: Viso, tmp_path: Path) -> None:
    path = write(tmp_path / "one.jsonl", [CALL, [*CALL[:2], ["00000000"]]])
    outcome = viso("compare", path, "--firmware", JULY_2025.name)
    assert outcome.code == 1
    assert "one.jsonl" in outcome.out
    [row] = [line for line in outcome.out.splitlines() if "line 2" in line]
    assert [cell.strip() for cell in row.strip("│ ").split("│")][:5] == [
        "wrap_360",
        "1",
        "line 2",
        "00000000",
        "3f800000",
    ]


class Page(HTMLParser):
    """Collects the texts of a page, and the elements that fetch something."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.fetching: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.fetching += [tag] if tag in ("script", "link") or {"src", "href"} & {name for name, _ in attrs} else []

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_page_needs_nothing_else_and_quotes_what_is_recorded(viso: Viso, tmp_path: Path, mocap: list[Any]) -> None:
    lines = [{**mocap[0], "statustext": [[4, "VisOdom: <script>"]]}, mocap[1]]
    assert viso("compare", write(tmp_path / "one.jsonl", lines), "-o", tmp_path / "page.html").code == 1
    page = Page((tmp_path / "page.html").read_text())
    assert page.fetching == []
    assert {"1 of 1 comparisons differ.", "STATUSTEXT.text", "VisOdom: <script>"} <= set(page.texts)


# Which release


@pytest.mark.parametrize(
    ("told", "name"),
    [
        ("ArduCopter 4.7.0-dev SITL x86-64", "2025-07"),
        ("ArduCopter 4.7.0-dev of February 2026, SITL x86-64", "2026-02"),
        ("ArduCopter 4.8.0-dev (April 2026) SITL x86-64", "2026-04"),
        *((firmware.banner, name) for name, firmware in PROFILES.items()),
    ],
)
def test_recording_is_compared_as_the_firmware_that_it_names(viso: Viso, tmp_path: Path, told: str, name: str) -> None:
    _, found = compared(viso, write(tmp_path / "one.jsonl", [{**HEAD, "firmware": told}]))
    assert [(one["firmware"], one["named"]) for one in found["comparisons"]] == [(name, name)]


def of_4_6(path: Path) -> Path:
    """Write a recording that does not name its release, whose parameter only one release has."""
    request = {"target_system": 1, "target_component": 1, "param_id": "SYSID_THISMAV", "param_index": -1}
    answers = [["PARAM_VALUE", {"param_id": "SYSID_THISMAV"}]]
    return write(path, [HEAD, {"name": "id", "send": ["PARAM_REQUEST_READ", request], "answers": answers}])


def test_release_that_recordings_are_most_like_is_told(viso: Viso, tmp_path: Path) -> None:
    code, told = compared(viso, of_4_6(tmp_path / "one.jsonl"), "--which")
    assert (code, told["most_like"]) == (0, ["4.6"])
    assert {one["firmware"]: one["passed"] for one in told["comparisons"]} == {name: name == "4.6" for name in PROFILES}


@pytest.mark.slow
def test_recording_without_a_name_is_compared_as_what_it_is_most_like(viso: Viso, tmp_path: Path) -> None:
    path = of_4_6(tmp_path / "one.jsonl")
    code, told = compared(viso, path)
    assert (code, told["comparisons"][0]["firmware"]) == (0, "4.6")
    reason = "the recording names no release, and is most like 4.6"
    assert (told["comparisons"][0]["firmware_reason"], told["comparisons"][0]["notes"]) == (reason, [])
    assert viso("compare", path, "--which").out.endswith("most like 4.6\n")
    assert viso("compare", path, "--firmware", "2026-04").code == 1


def begun(log: Path, folder: Path) -> Path:
    """Return the first third of a log; tests/parity has the whole."""
    data = lzma.decompress(log.read_bytes())
    path = folder / log.name.removesuffix(".xz")
    path.write_bytes(data[: len(data) // 3])
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folders", "like"),
    [
        (["2025-07/captures/mocap.jsonl.gz", "2025-07/captures/voxl.jsonl.gz"], ["2025-07", "4.6"]),
        (["2026-02/captures/t265.jsonl.gz", "2026-02/vectors"], ["2026-02", "4.7"]),
        (["2026-04/captures/speedcov.jsonl.gz", "2026-04/logs/voxl.BIN.xz"], ["2026-04"]),
    ],
)
def test_releases_are_told_apart_by_their_recordings(
    viso: Viso, tmp_path: Path, folders: list[str], like: list[str]
) -> None:
    paths = [begun(PARITY / one, tmp_path) if one.endswith(".xz") else PARITY / one for one in folders]
    code, told = compared(viso, *paths, "--which")
    assert (code, told["most_like"]) == (0, like)
    differ = {one["firmware"] for one in told["comparisons"] if not one["passed"]}
    assert differ == PROFILES.keys() - set(like)


@pytest.mark.slow
def test_conversations_and_logs_agree_as_what_they_name(viso: Viso) -> None:
    logs = [RECORDED / "logs" / f"{name}.BIN.xz" for name in ("bench_no_yaw_source", "bench_velocity_only")]
    code, told = compared(viso, DATA / "conversations", *logs)
    assert (code, told["passed"]) == (0, True)
    conversations = len([*(DATA / "conversations").iterdir()])
    assert [one["kind"] for one in told["comparisons"]] == [*["conversation"] * conversations, "log", "log"]
    # The logs were reduced to one of two cores.
    assert [len(one["notes"]) for one in told["comparisons"]] == [*[0] * conversations, 1, 1]


# What cannot be compared


@pytest.mark.parametrize(("name", "lines", "complaint"), [
    ("one.jsonl", [], "one.jsonl: empty"),
    ("one.jsonl", [{"nosuch": 1}],
     "one.jsonl:1: neither a capture ('params'), a conversation ('begins_s') nor vectors"),
    ("one.jsonl", [{"params": {}}, {"type": "A", "msg": "fd", "arrival_us": 1}],
     "one.jsonl:2: 'out' is not a list of records"),
    ("one.jsonl", [{"params": {}}, 7], "one.jsonl:2: 'type' is not the name of a message"),
    ("one.jsonl", [{"params": {}}, {"type": "A", "out": [["VISX"]]}],
     "one.jsonl:2: 'out' has what is no record of VISO, VISP, VISV: ['VISX']"),
    ("one.jsonl", [{"params": {}, "statustext": [["x", 1]]}],
     "one.jsonl:1: 'statustext' is not a list of pairs of int and str"),
    ("one.jsonl", [{**HEAD, "params": 1}], "one.jsonl:1: 'params' is missing or of another kind"),
    ("one.jsonl", [{**HEAD, "camera_hz": 1e9}], "one.jsonl:1: 'camera_hz' is no number from 0 to 1000: 1000000000.0"),
    ("one.jsonl", [{**HEAD, "params": {"VISO_TYPE": None}}],
     "one.jsonl:1: 'VISO_TYPE' is no number from -3.4e+38 to 3.4e+38: None"),
    ("one.jsonl", [HEAD, {**PARAM, "send": ["PARAM_SET", {"param_id": 1}]}],
     "one.jsonl:2: 'send' does not fit PARAM_SET: 'int' object has no attribute 'encode'"),
    ("one.jsonl", [HEAD, {**PARAM, "send": ["PARAM_SET", 1]}],
     "one.jsonl:2: 'send': PARAM_SET: not a mapping of names to values: 1"),
    ("one.jsonl", [HEAD, {**PARAM, "wait_ms": "1"}], "one.jsonl:2: 'wait_ms' is no number from 0 to 3.6e+06: '1'"),
    ("one.jsonl", [HEAD, {**PARAM, "hide": 1}], "one.jsonl:2: 'hide' is missing or of another kind"),
    ("one.jsonl", [HEAD, {**PARAM, "send": ["NOSUCH", {}]}],
     "one.jsonl:2: 'send': ['NOSUCH', {}] is not [MESSAGE, {field: value}] of a message that is known here"),
    ("one.jsonl", [HEAD, {**PARAM, "send": ["HEARTBEAT", {"nosuch": 1}]}],
     "one.jsonl:2: 'send': HEARTBEAT: nosuch: no such field"),
    ("one.jsonl", [HEAD, {**PARAM, "answers": [1]}],
     "one.jsonl:2: 'answers' is not a list of pairs of a message's name and its fields"),
    ("one.jsonl", [{"params": {"TYPE": 1}, "steps": [["status"]]}],
     "one.jsonl:1: a step without a list of consequences in 'out': ['status']"),
    ("one.BIN", [CALL], "one.BIN: not a DataFlash log"),
    ("one.txt", [CALL],
     "one.txt: by its ending no recording that can be compared; there are .jsonl, .bin"),
])  # fmt: skip
def test_unusable_recording_is_one_line(viso: Viso, tmp_path: Path, name: str, lines: Lines, complaint: str) -> None:
    write(tmp_path / name, lines)
    assert failed_with(viso("compare", name, "--firmware", JULY_2025.name), complaint)


def test_folder_without_recordings_and_contradiction_are_one_line(viso: Viso, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    assert viso("compare", empty).code == 2
    complaint = "--which and --firmware: use one of the two"
    assert failed_with(viso("compare", empty, "--which", "--firmware", "4.6"), complaint)


def test_log_without_replay_records_is_passed_over_in_a_folder(viso: Viso, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    path = write(folder / "calls.jsonl", [CALL])
    maker = LogMaker()
    maker.add("XKF1", 1.0)
    log = maker.save(folder / "ordinary.BIN")
    other = write(folder / "verdicts.jsonl", [{"verdict": 1}])
    outcome = viso("compare", folder, "--json")
    assert [one["recording"] for one in json.loads(outcome.out)["comparisons"]] == [str(path)]
    notes = outcome.err.splitlines()
    assert notes[0].startswith(f"note: passed over: {log}: no replay records")
    assert notes[1].startswith(f"note: passed over: {other}:1: neither a capture")
    assert viso("compare", log).code == 2


# Recorded first


SHORT = """
name: short
about: A velocity and a pose.
parameters: {VISO_TYPE: 1, LOG_DISARMED: 1, GPS1_TYPE: 0, EK3_SRC1_POSXY: 6}
wait:
  - {clock_s: 3}
steps:
  - stream: {message: VISION_SPEED_ESTIMATE, rate_hz: 20}
  - pause: 0.3
"""


def test_autopilot_is_recorded_and_compared_at_once(viso: Viso, tmp_path: Path) -> None:
    scenario, kept = tmp_path / "short.yaml", tmp_path / "kept"
    scenario.write_text(SHORT)
    code, told = compared(viso, scenario, "--master", "viso:2026-04", "--keep", kept)
    assert code == 0
    assert [(one["firmware"], one["messages"] > 4) for one in told["comparisons"]] == [("2026-04", True)]
    assert (kept / "short" / "short.jsonl.gz").exists()


def test_folder_to_keep_needs_something_to_record(viso: Viso, tmp_path: Path) -> None:
    outcome = viso("compare", tmp_path, "--keep", tmp_path)
    assert failed_with(outcome, "--keep: only with --master is anything recorded")

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: exit codes, one-line errors, outputs, and the examples of the help texts."""

import gzip
import importlib.metadata
import inspect
import json
import lzma
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest
from typer.testing import CliRunner

from mav_handlers.links import packed
from mav_handlers.wire.codec import Codec
from tests.places import RECORDED
from tests.unit.viso.command_line import Outcome, Viso, failed_with
from tests.unit.viso.conftest import odometry
from viso import cli
from viso.cli import COMMANDS, command_function, load_command, make_app
from viso.commands import serve as serve_command
from viso.replay import feed

SHORT = 40
SIMULATED = "viso demo --camera simulated"
QUICK = "faults", "play", "vectors"
"""Commands whose example takes a moment."""


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """Return the first messages of a recorded capture."""
    path = tmp_path / "short.jsonl"
    with gzip.open(RECORDED / "captures" / "mav.jsonl.gz", "rt", encoding="utf-8") as file:
        path.write_text("".join(line for _, line in zip(range(SHORT + 1), file, strict=False)))
    return path


@pytest.fixture
def vectors(tmp_path: Path) -> Path:
    """Return three maths calls of the firmware."""
    path = tmp_path / "vectors.jsonl"
    path.write_text("".join(first_lines(RECORDED / "vectors" / "ap_math.jsonl.gz", 3)))
    return path


@pytest.fixture
def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def add_command(monkeypatch: pytest.MonkeyPatch, function: Callable[[], None]) -> None:
    """Make a function a command of its name."""
    name = function.__name__
    module = ModuleType(f"viso.commands.{name}")
    setattr(module, name, function)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(COMMANDS, name, "Help.")


def first_lines(path: Path, count: int) -> list[str]:
    with gzip.open(path, "rt", encoding="utf-8") as file:
        return [line for _, line in zip(range(count), file, strict=False)]


# Help


@pytest.mark.parametrize(("name", "flag"), [*((name, "--help") for name in COMMANDS), ("serve", "-h")])
def test_help_of_a_command_works_and_holds_an_example(viso: Viso, name: str, flag: str) -> None:
    outcome = viso(name, flag)
    assert outcome.code == 0
    assert f"viso {name}" in outcome.out.partition("Example: ")[2]


@pytest.mark.parametrize(("is_compiled", "runs"), [(True, "compiled"), (False, "interpreted")])
def test_version_is_that_of_the_distribution_and_says_how_the_filter_runs(
    viso: Viso, monkeypatch: pytest.MonkeyPatch, is_compiled: bool, runs: str
) -> None:
    monkeypatch.setattr(importlib.metadata, "version", {"ardupilot-viso": "1.2.3"}.__getitem__)
    monkeypatch.setattr("ekf_stub.core.IS_COMPILED", is_compiled)
    assert viso("--version") == Outcome(0, f"viso 1.2.3 (filter: {runs})\n", "")


def test_version_of_a_checkout_that_is_not_installed_is_unknown(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viso.extras.DISTRIBUTION", "no-such-distribution")
    assert viso("--version").out.startswith("viso unknown (filter: ")


def test_help_lists_the_commands(viso: Viso) -> None:
    outcome = viso("--help")
    assert outcome.code == 0
    assert all(f"  {name} " in outcome.out for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_in_the_list_is_the_first_line_of_the_command_s(name: str) -> None:
    assert COMMANDS[name] == (inspect.getdoc(command_function(name)) or "").partition("\n")[0] != ""


def test_nothing_given_is_a_usage_error_with_help(viso: Viso) -> None:
    outcome = viso()
    assert outcome.code == 2
    assert "Commands:" in outcome.out + outcome.err


@pytest.mark.parametrize("args", [["nosuch"], ["replay"], ["replay", "--nosuch"], ["demo", "--seed", "x"], ["vectors"]])
def test_wrong_usage_is_exit_code_2(viso: Viso, args: list[str]) -> None:
    outcome = viso(*args)
    assert (outcome.code, outcome.out) == (2, "")
    assert "Error: " in outcome.err


def example_of(name: str) -> list[str]:
    """Return the commands of the example, of which the last one is what it is an example of."""
    (example,) = re.findall(r"Example: (.*)", command_function(name).__doc__ or "")
    return str(example).split(" && ")


@pytest.fixture(scope="module")
def simulated_flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with what the demo that examples begin with leaves behind."""
    folder = tmp_path_factory.mktemp("flown")
    command = [sys.executable, "-c", "from viso.cli import main; main()", *SIMULATED.split()[1:]]
    subprocess.run([*command, "--no-plot"], cwd=folder, check=True, capture_output=True)
    return folder


@pytest.mark.parametrize("name", COMMANDS)
def test_example_of_the_help_is_understood(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    program, command, *args = shlex.split(example_of(name)[-1])
    assert (program, command) == ("viso", name)
    load_command(name).make_context(name, args)


@pytest.mark.parametrize(
    "name",
    # tests/docs/test_commands.py has the page that begins with the demo.
    [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in COMMANDS if name != "demo"],
)
def test_example_of_the_help_works(
    viso: Viso, name: str, free_port: int, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    # Not the ports that a vehicle on this machine may use.
    monkeypatch.setattr(
        serve_command, "DEFAULT_LINKS", (f"tcpin:127.0.0.1:{free_port}", f"udpout:127.0.0.1:{free_port}")
    )
    *before, command = example_of(name)
    for preparation in before:  # in an empty directory
        if preparation == SIMULATED:
            shutil.copytree(request.getfixturevalue("simulated_flight"), ".", dirs_exist_ok=True)
        else:
            subprocess.run(preparation, shell=True, check=True)
    program, *args = shlex.split(command)
    outcome = viso(*args)
    assert (program, outcome.code) == ("viso", 0)
    assert outcome.out


# Parameter files and files that cannot be read


@pytest.mark.parametrize("command", ["replay", "serve"])
@pytest.mark.parametrize(("text", "complaint"), [
    ("VISO_TYPE 1\nVISO_TPYE 1\n", ":2: unknown parameter: 'VISO_TPYE' (without --strict it is passed over)"),
    ("VISO_TYPE one\n", ":1: "),
])  # fmt: skip
def test_bad_parameter_file_is_one_line(
    viso: Viso, capture: Path, tmp_path: Path, command: str, text: str, complaint: str
) -> None:
    parm = tmp_path / "bad.parm"
    parm.write_text(text)
    stream = [capture] if command == "replay" else []
    outcome = viso(command, *stream, "--defaults", parm, "--strict")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith(f"viso: {parm}{complaint}")
    assert outcome.err.count("\n") == 1


def test_bad_number_in_a_parameter_file_is_shown(viso: Viso, capture: Path, tmp_path: Path) -> None:
    parm = tmp_path / "bad.parm"
    parm.write_text("VISO_TYPE one\n")
    assert "one" in viso("replay", capture, "--defaults", parm).err


def test_unknown_parameters_of_a_file_are_passed_over(
    viso: Viso, capture: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    capture.write_text(capture.read_text().partition("\n")[0])
    parm = tmp_path / "other.parm"
    parm.write_text("RC17_MIN 1100\nVISO_TYPE 1\n")
    assert viso("replay", capture, "--defaults", parm).code == 0
    assert caplog.messages == [f"{parm}:1: unknown parameter, passed over: RC17_MIN"]


def test_unknown_parameter_on_the_command_line_is_one_line(viso: Viso, capture: Path) -> None:
    outcome = viso("replay", capture, "--param", "VISO_TPYE=1")
    assert failed_with(outcome, "--param 'VISO_TPYE=1': unknown parameter VISO_TPYE")


@pytest.mark.parametrize("args", [
    ["replay", "none.jsonl"],
    ["replay", "none.tlog"],
    ["vectors", "none.jsonl"],
    ["compare", "none.jsonl"],
    ["replay", "{capture}", "--ahrs", "none.BIN"],
    ["replay", "{capture}", "--defaults", "none.parm"],
    ["serve", "--defaults", "none.parm"],
])  # fmt: skip
def test_missing_file_is_one_line(viso: Viso, capture: Path, args: list[str]) -> None:
    outcome = viso(*(arg.format(capture=capture) for arg in args))
    assert (outcome.code, outcome.out) == (2, "")
    assert re.fullmatch(r"viso: none\.\w+: .*No such file or directory\n", outcome.err, re.IGNORECASE)


@pytest.mark.parametrize("args", [
    ["replay", "bomb.tlog.gz"],
    ["doctor", "bomb.tlog"],
    ["replay", "bomb.jsonl.gz"],
    ["replay", "bomb.BIN.xz"],
    ["report", "bomb.BIN.xz"],
    ["ekf", "bomb.BIN.xz"],
    ["landmarks", "bomb.json"],
    ["landmarks", "bomb.tlog.gz"],
    ["vectors", "bomb.jsonl.gz"],
])  # fmt: skip
def test_packed_file_that_holds_far_too_much_is_one_line(
    viso: Viso, monkeypatch: pytest.MonkeyPatch, args: list[str]
) -> None:
    monkeypatch.setattr(packed, "ALWAYS_BYTES", 0)
    pack = lzma.compress if args[1].endswith(".xz") else gzip.compress
    Path(args[1]).write_bytes(pack(b" " * 200_000))
    outcome = viso(*args)
    assert (outcome.code, outcome.out) == (2, "")
    assert re.fullmatch(rf"viso: {args[1]}:[^\n]* holds more than [^\n]+; it is taken once unpacked\n", outcome.err)


# replay


class Replayed(NamedTuple):
    """What a replay has printed, and the files that it has written."""

    outcome: Outcome
    records: bytes
    log: bytes


_REPLAYED: dict[str, Replayed] = {}


def replayed(viso: Viso, capture: Path, records: str, *args: str) -> Replayed:
    """Replay a capture, once for all that look at it."""
    if records not in _REPLAYED:
        outcome = viso("replay", capture, "--records", records, "--log", "out.BIN", *args)
        _REPLAYED[records] = Replayed(outcome, Path(records).read_bytes(), Path("out.BIN").read_bytes())
    return _REPLAYED[records]


@pytest.fixture
def plain(viso: Viso, capture: Path) -> Replayed:
    return replayed(viso, capture, "out.jsonl")


@pytest.fixture
def packed_for_machines(viso: Viso, capture: Path) -> Replayed:
    return replayed(viso, capture, "out.jsonl.gz", "--json")


def test_broken_line_of_a_capture_is_named(viso: Viso, capture: Path) -> None:
    with capture.open("a") as file:
        file.write("{broken\n")
    line = f"{capture}:{SHORT + 2}: not JSON: Expecting property name enclosed in double quotes in column 2"
    assert failed_with(viso("replay", capture), line)


def test_unknown_kind_of_stream_is_one_line(viso: Viso) -> None:
    kinds = (
        "capture (.jsonl), telemetry log (.tlog), bytes of a link (.tlog.raw, .rlog), DataFlash log (.bin, .log), "
        "trajectory (.tum, .txt, .csv, .bag, .mcap, .db3); each also packed (.gz, .xz, .zst, .zip)"
    )
    line = f"flight.ulg: by its ending no recorded stream; there are: {kinds}"
    assert failed_with(viso("replay", "flight.ulg"), line)


def test_replay_prints_texts_and_counts(plain: Replayed) -> None:
    assert plain.outcome.code == 0
    assert "2.455 s  (6) ArduPilot Ready" in plain.outcome.out
    assert "VISION_POSITION_ESTIMATE" in plain.outcome.out
    assert "handed to the EKF" in plain.outcome.out


def test_replay_spells_out_what_a_recording_may_not_do_to_the_terminal(viso: Viso, tmp_path: Path) -> None:
    path = tmp_path / "hostile.jsonl"
    path.write_text(json.dumps({"name": "n", "params": {"A\x1b[31m\x9b": 1}}) + "\n")
    told = viso("replay", path).err
    assert told == "note: parameters of the recording without effect here: A\\x1b[31m\\x9b\n"


@pytest.mark.parametrize("name", ["\x1b]0;title\x07.tum", "\udcff\x9b.tum"])
def test_file_name_in_an_error_is_spelled_out(viso: Viso, name: str) -> None:
    assert failed_with(viso("replay", name), f"{ascii(name)[1:-1]}: No such file or directory")


def test_replay_notes_nothing_about_parameters_that_it_knows(plain: Replayed) -> None:
    assert plain.outcome.err == ""


def test_replay_for_machines(packed_for_machines: Replayed) -> None:
    outcome = json.loads(packed_for_machines.outcome.out)
    assert outcome["stream"] == "mav"
    assert sum(row["count"] for row in outcome["verdicts"]) == SHORT
    assert outcome["texts"][0] == {"time_us": 2_455_000, "severity": 6, "text": "ArduPilot Ready"}


def test_replay_writes_a_line_a_message(plain: Replayed, packed_for_machines: Replayed) -> None:
    for data in (plain.records, gzip.decompress(packed_for_machines.records)):
        lines = [json.loads(line) for line in data.splitlines()]
        assert len(lines) == SHORT
        assert set(lines[0]) == {"arrival_us", "type", "out", "verdict"}


def test_replay_writes_the_log(plain: Replayed) -> None:
    assert plain.log.startswith(bytes.fromhex("a3 95 80 80 59 46 4d 54 00"))


@pytest.mark.slow
def test_replay_twice_writes_the_same_bytes(viso: Viso, capture: Path) -> None:
    for name in ("first.BIN", "second.BIN"):
        viso("replay", capture, "--log", name, "--records", f"{name}.jsonl")
    assert Path("first.BIN").read_bytes() == Path("second.BIN").read_bytes()
    assert Path("first.BIN.jsonl").read_bytes() == Path("second.BIN.jsonl").read_bytes()


def test_parameter_on_the_command_line_wins_over_the_recording(viso: Viso, capture: Path) -> None:
    outcome = json.loads(viso("replay", capture, "--param", "VISO_TYPE=0", "--json").out)
    assert {row["rule"] for row in outcome["verdicts"]} >= {"viso_disabled"}


def first_speed_record(viso: Viso, capture: Path, *args: str) -> list[Any]:
    assert viso("replay", capture, "--records", "out.jsonl", *args).code == 0
    records = (out for line in Path("out.jsonl").read_text().splitlines() for out in json.loads(line)["out"])
    return next(out for out in records if out[0] == "VISV")


@pytest.mark.slow
def test_transport_time_may_be_switched_off(viso: Viso, capture: Path) -> None:
    modelled, without = (first_speed_record(viso, capture, *args)[3] for args in ([], ["--baud", "0"]))
    assert without - modelled >= 5


@pytest.mark.slow
@pytest.mark.parametrize("heading_deg", [45, 90])
def test_heading_counts_without_a_log_of_attitudes(viso: Viso, heading_deg: int) -> None:
    outcome = viso("replay", RECORDED / "captures" / "prearm.jsonl.gz", "--heading", str(heading_deg), "--json")
    texts = [row["text"] for row in json.loads(outcome.out)["texts"]]
    (aligned,) = (text for text in texts if text.startswith("VisOdom: yaw shifted"))
    assert float(aligned.split()[-2]) == pytest.approx(heading_deg, abs=1)


@pytest.mark.slow
def test_telemetry_log_is_replayed(viso: Viso, tmp_path: Path, capture: Path) -> None:
    frames = [json.loads(line)["msg"] for line in capture.read_text().splitlines()[1:]]
    entries = [(10**5 * number).to_bytes(8, "big") + bytes.fromhex(frame) for number, frame in enumerate(frames)]
    (tmp_path / "flight.tlog").write_bytes(b"".join(entries) + entries[0][:9])
    outcome = viso("replay", "flight.tlog", "--param", "VISO_TYPE=1", "--lead", "5", "--json")
    assert outcome.code == 0
    cut, begins, alone = outcome.err.splitlines()
    assert cut == "note: flight.tlog: the last entry is cut short"
    assert begins == "note: flight.tlog: no message has the autopilot's clock: it begins 5 s after boot here (--lead)"
    assert alone.startswith("note: flight: no autopilot is in this recording")
    assert json.loads(outcome.out)["stream"] == "flight"


@pytest.mark.parametrize("args", [["replay"], ["replay", "--ekf"], ["doctor"]])
def test_gap_in_a_recording_is_told(viso: Viso, monkeypatch: pytest.MonkeyPatch, args: list[str]) -> None:
    for name, time_us in (("LONGEST_SILENCE_US", 900_000), ("SILENCE_BEGIN_US", 400_000), ("SILENCE_END_US", 50_000)):
        monkeypatch.setattr(feed, name, time_us)
    frame = Codec(1, 197).encode(odometry(0))
    Path("hole.tlog").write_bytes(b"".join((base * 10**6).to_bytes(8, "big") + frame for base in (10**9, 10**9 + 3600)))
    outcome = viso(*args, "hole.tlog", "--lead", "0.5")
    assert outcome.code in (0, 1)
    passed = "passed over except its first 0.4 s and last 0.05 s"
    assert f"note: hole: gap of 3600 s from 0.500 s on: {passed}\n" in outcome.err


@pytest.mark.parametrize(("args", "line"), [
    (["--lead", "-1"], "--lead -1.0: not a time in seconds"),
    (["--lead", "nan"], "--lead nan: not a time in seconds"),
    (["--baud", "-5"], "--baud -5: not a rate"),
    (["--log", "none/out.BIN"], "none/out.BIN: No such file or directory"),
    (["--records", "none/out.jsonl"], "none/out.jsonl: No such file or directory"),
    (["--log", "/dev/full"], "/dev/full: No space left on device"),
    (["--records", "/dev/full"], "/dev/full: No space left on device"),
])  # fmt: skip
def test_option_that_cannot_be_used_is_one_line(viso: Viso, capture: Path, args: list[str], line: str) -> None:
    assert failed_with(viso("replay", capture, *args), line)


def test_log_that_is_there_survives_an_error(viso: Viso, capture: Path) -> None:
    Path("out.BIN").write_bytes(b"precious")
    assert viso("replay", capture, "--ahrs", "none.BIN", "--log", "out.BIN").code == 2
    assert Path("out.BIN").read_bytes() == b"precious"


# vectors


def test_vectors_are_recomputed_without_looking_at_the_outputs(viso: Viso, vectors: Path) -> None:
    expected = [json.loads(line) for line in vectors.read_text().splitlines()]
    vectors.write_text("".join(json.dumps(line[:2]) + "\n" for line in expected))
    outcome = viso("vectors", vectors)
    assert outcome.code == 0
    assert [json.loads(line) for line in outcome.out.splitlines()] == expected


@pytest.mark.parametrize("name", ["out.jsonl", "out.jsonl.gz"])
def test_vectors_are_written_to_a_file(viso: Viso, vectors: Path, name: str) -> None:
    expected = [json.loads(line) for line in vectors.read_text().splitlines()]
    assert viso("vectors", vectors, "-o", name) == Outcome(0, "", "")
    data = Path(name).read_bytes()
    text = gzip.decompress(data) if name.endswith("gz") else data
    assert [json.loads(line) for line in text.splitlines()] == expected


def test_several_files_are_written_one_after_the_other(viso: Viso, vectors: Path) -> None:
    assert len(viso("vectors", vectors, vectors).out.splitlines()) == 6


@pytest.mark.parametrize("command", ["vectors", "compare"])
@pytest.mark.parametrize(
    ("text", "complaint"), [("{", ":4: not JSON"), ('["cosh", []]', ":4: unknown function 'cosh'")]
)
def test_broken_line_of_vectors_is_named(viso: Viso, vectors: Path, text: str, complaint: str, command: str) -> None:
    with vectors.open("a") as file:
        file.write(text + "\n")
    outcome = viso(command, vectors)
    assert outcome.code == 2
    assert outcome.err.startswith(f"viso: {vectors}{complaint}")
    assert outcome.err.count("\n") == 1


# serve


def serve_args(port: int, *args: str) -> list[str]:
    return ["serve", "--master", f"udpin:127.0.0.1:{port}", "--duration", "0.02", *args]


def test_serve_tells_links_and_logs_and_ends_with_counts(viso: Viso, free_port: int) -> None:
    outcome = viso(*serve_args(free_port, "--speedup", "1000", "--duration", "5"))
    assert outcome.code == 0
    banner = f"ArduCopter V4.7.1 (dbe79216) on udpin:127.0.0.1:{free_port}; "
    profile = "firmware 4.7, --firmware 4.6, 2025-07, 2026-02 or 2026-04 for another; "
    assert outcome.out.splitlines()[0] == f"{banner}{profile}logs in logs; Ctrl-C ends"
    assert "Outcome of each message" in outcome.out
    assert Path("logs/00000001.BIN").stat().st_size > 0


def test_serve_for_machines_prints_nothing_else(viso: Viso, free_port: int) -> None:
    outcome = viso(*serve_args(free_port, "--json", "--speedup", "1000", "--duration", "5"))
    assert json.loads(outcome.out) == {"verdicts": [], "filter": []}
    assert "ArduPilot Ready" in outcome.err


def test_serve_runs_faster_when_told_to(viso: Viso, free_port: int) -> None:
    outcome = viso(*serve_args(free_port, "--speedup", "1000", "--duration", "5"))
    assert "(6) ArduPilot Ready" in outcome.out


@pytest.fixture
def taken_port() -> Iterator[int]:
    """Yield a TCP port that somebody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_port_in_use_is_one_line(viso: Viso, taken_port: int) -> None:
    name = f"tcpin:127.0.0.1:{taken_port}"
    assert failed_with(viso("serve", "--master", name), f"cannot open {name}: address already in use")


def test_udp_port_in_use_is_one_line(viso: Viso) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        name = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        assert failed_with(viso("serve", "--master", name), f"cannot open {name}: address already in use")


@pytest.mark.parametrize(("args", "line"), [
    (["--speedup", "0"], "--speedup 0.0: not between 0 and 1000"),
    (["--speedup", "nan"], "--speedup nan: not between 0 and 1000"),
    (["--baud", "0"], "--baud 0: not a rate"),
    (["--duration", "-1"], "--duration -1.0: not a time in seconds"),
    (["--duration", "nan"], "--duration nan: not a time in seconds"),
    (["--master", "udpin:0"] * 9, "--master: the autopilot has parameters for 8 links, not 9"),
    (["--log-dir", "/dev/null/logs"], "--log-dir /dev/null/logs: Not a directory"),
    (["--heading", "nan"], "--heading nan: not an angle in degrees"),
    (["--heading", "inf"], "--heading inf: not an angle in degrees"),
])  # fmt: skip
def test_option_of_serve_that_cannot_be_used_is_one_line(viso: Viso, args: list[str], line: str) -> None:
    assert failed_with(viso("serve", *args), line)


def test_bad_link_is_one_line(viso: Viso) -> None:
    outcome = viso("serve", "--master", "carrier-pigeon:5760")
    assert (outcome.code, outcome.out, outcome.err.count("\n")) == (2, "", 1)
    assert outcome.err.startswith("viso: bad connection string 'carrier-pigeon:5760'")


def test_log_that_cannot_be_written_is_told_at_the_end(
    viso: Viso, free_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_descriptor: int, _data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("viso.logs.files.os.write", refuse)
    monkeypatch.setattr("viso.logs.files.LogStore._write_lastlog", lambda *_args: None)
    outcome = viso(*serve_args(free_port, "--speedup", "1000", "--duration", "5"))
    assert outcome.code == 1
    assert re.search(
        r"^log: \d{2,} records lost: logs/00000001.BIN: No space left on device$", outcome.err, re.MULTILINE
    )
    assert "Outcome of each message" in outcome.out


# Standard output


def viso_process(*args: str | Path, **options: Any) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", "from viso.cli import main; main()", *map(str, args)]
    # As in a user's shell: output is buffered.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.run(command, timeout=60, check=False, stderr=subprocess.PIPE, env=environment, **options)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["vectors", "replay"])
def test_reader_that_leaves_is_no_error(command: str, vectors: Path, capture: Path) -> None:
    file = vectors if command == "vectors" else capture
    reader, writer = socket.socketpair()
    with writer:
        reader.close()
        result = viso_process(command, file, stdout=writer)
    assert result.returncode == 0
    assert b"Traceback" not in result.stderr


@pytest.mark.slow
def test_full_disk_behind_standard_output_is_one_line(vectors: Path) -> None:
    with open("/dev/full", "wb") as full:
        result = viso_process("vectors", vectors, stdout=full)
    assert (result.returncode, result.stderr) == (2, b"viso: No space left on device\n")


def test_what_is_left_of_the_output_goes_nowhere_when_its_reader_leaves(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def write() -> None:
        print("the beginning", flush=True)
        raise BrokenPipeError

    redirected: list[int] = []
    add_command(monkeypatch, write)
    monkeypatch.setattr("viso.cli.os.dup2", lambda _source, target: redirected.append(target))
    monkeypatch.setattr(sys, "argv", ["viso", "write"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 0
    assert redirected == [sys.stdout.fileno()]
    assert capfd.readouterr() == ("the beginning\n", "")


def test_error_of_the_system_is_one_line(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    def write() -> None:
        raise OSError(28, "No space left on device")

    add_command(monkeypatch, write)
    assert failed_with(viso("write"), "No space left on device")


# The application


def test_commands_run_through_the_application_as_well(vectors: Path) -> None:
    result = CliRunner().invoke(make_app(), ["vectors", str(vectors)])
    assert (result.exit_code, result.stdout.count("\n")) == (0, 3)


def test_application_raises_errors_of_input() -> None:
    result = CliRunner().invoke(make_app(), ["replay", "none.jsonl"])
    assert type(result.exception).__name__ == "InputError"

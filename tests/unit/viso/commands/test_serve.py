# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso serve`` and what goes with it: presets, lines of verdicts, the signing key."""

import json
import os
import sys
from io import StringIO
from pathlib import Path

import pytest

from mav_handlers.signing import SigningKey
from mav_handlers.wire.messages import HEARTBEAT, PARAM_SET, SETUP_SIGNING
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.conftest import odometry
from viso import cli
from viso.terminal.settings import PRESETS

ALIVE = HEARTBEAT(6, 8, 0, 0, 4, 3)
KEY = bytes(range(1, 33))


# Presets


@pytest.mark.parametrize("name", PRESETS)
def test_preset_is_taken_by_its_name(serve: Viso, name: str) -> None:
    outcome = serve("--preset", name, "--json", sent=(odometry(0),))
    assert outcome.code == 0
    (row,) = json.loads(outcome.out)["verdicts"]
    assert row["rule"] != "viso_disabled"


def test_parameters_of_the_user_win_over_the_preset(serve: Viso, tmp_path: Path) -> None:
    (tmp_path / "mine.parm").write_text("VISO_TYPE 1\nVISO_QUAL_MIN 95\n")
    args = ["--preset", "voxl", "--defaults", "mine.parm", "--param", "VISO_QUAL_MIN=91", "--json"]
    (row,) = json.loads(serve(*args, sent=(odometry(0, quality=92),)).out)["verdicts"]
    assert row["rule"] == "consumed"


@pytest.mark.parametrize(("mark", "rule"), [("@READONLY", "quality_below_min"), ("", "consumed")])
def test_client_cannot_set_what_a_defaults_file_marks(serve: Viso, tmp_path: Path, mark: str, rule: str) -> None:
    (tmp_path / "mine.parm").write_text(f"VISO_TYPE 1\nVISO_QUAL_MIN 95 {mark}\n")
    sent = (PARAM_SET(1, 1, "VISO_QUAL_MIN", 10.0, 9), odometry(0, quality=92))
    rows = json.loads(serve("--defaults", "mine.parm", "--json", sent=sent).out)["verdicts"]
    assert [row["rule"] for row in rows if row["message"] == "ODOMETRY"] == [rule]


def test_unknown_preset_is_one_line_that_lists_them(serve: Viso) -> None:
    assert failed_with(serve("--preset", "t256"), f"--preset t256: no such preset; there are {', '.join(PRESETS)}")


@pytest.mark.parametrize("command", ["serve", "replay"])
def test_help_lists_the_presets(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["viso", command, "--help"])
    with pytest.raises(SystemExit):
        cli.main()
    text = "".join(capsys.readouterr().out.split())  # lines may end within a name
    assert not [name for name in PRESETS if name not in text]


# Who may come


@pytest.mark.parametrize(("host", "warns"), [("0.0.0.0", True), ("127.0.0.1", False)])
def test_link_that_others_can_reach_is_warned_of(viso: Viso, host: str, warns: bool) -> None:
    link = f"udpin:{host}:0"
    told = viso("serve", "--master", link, "--speedup", "1000", "--duration", "0.02").out
    warning = f"{link} is open to the network; whoever reaches it can command the vehicle\n"
    assert (warning in told, "whoever" in told) == (warns, warns)


def test_server_that_refuses_is_told_once(viso: Viso) -> None:
    told = viso("serve", "--master", "tcp:127.0.0.1:1", "--speedup", "1000", "--duration", "0.2").out
    assert told.count("tcp:127.0.0.1:1: connection refused; attempts go on\n") == 1


# Lines of verdicts


def test_lines_for_machines_are_all_that_standard_output_holds(serve: Viso) -> None:
    outcome = serve("--verdicts", "json", "--param", "VISO_TYPE=1", sent=(ALIVE, odometry(0)))
    assert outcome.code == 0
    lines = [json.loads(line) for line in outcome.out.splitlines()]
    assert [(line["link"], line["type"], line["rule"]) for line in lines] == [
        ("pair", "HEARTBEAT", "handled"),
        (None, "FILTER", "not_started"),
        (None, "FILTER", "not_started"),
        ("pair", "ODOMETRY", "consumed"),
    ]
    assert "Outcome of each message" in outcome.err
    assert "Outcome of each sample in the filter" in outcome.err


def test_lines_for_people(serve: Viso) -> None:
    (line,) = serve("--verdicts", "text", sent=(ALIVE,)).out.splitlines()
    assert line.endswith(" s  pair  HEARTBEAT 255:190 #0  handled: processed; carries no external navigation (handled)")


def test_lines_go_to_a_file_beside_the_usual_output(serve: Viso) -> None:
    outcome = serve("--verdicts-file", "verdicts.jsonl", "--json", sent=(ALIVE, ALIVE))
    assert [json.loads(line)["seq"] for line in Path("verdicts.jsonl").read_text().splitlines()] == [0, 1]
    assert json.loads(outcome.out)["verdicts"][0]["count"] == 2


def test_both_kinds_of_lines_at_once(serve: Viso) -> None:
    outcome = serve("--verdicts", "json", "--verdicts-file", "verdicts.jsonl", sent=(ALIVE,))
    assert Path("verdicts.jsonl").read_text() == outcome.out


def test_lines_and_counts_cannot_share_standard_output(serve: Viso) -> None:
    line = "--json and --verdicts both take standard output: use --verdicts-file"
    assert failed_with(serve("--json", "--verdicts", "json"), line)


def test_file_of_lines_that_cannot_be_written_is_one_line(serve: Viso) -> None:
    assert failed_with(serve("--verdicts-file", "none/v.jsonl"), "none/v.jsonl: No such file or directory")


def test_lost_lines_are_told_at_the_end_and_the_vehicle_goes_on(serve: Viso) -> None:
    outcome = serve("--verdicts-file", "/dev/full", "--json", sent=(ALIVE, ALIVE))
    assert outcome.code == 1
    assert json.loads(outcome.out)["verdicts"][0]["count"] == 2
    assert outcome.err.endswith("/dev/full: 2 verdicts lost: No space left on device\n")


def test_reader_of_the_lines_that_leaves_ends_the_vehicle_in_peace(
    serve: Viso, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, descriptor = os.pipe()
    os.close(reader)

    class Gone(StringIO):
        def fileno(self) -> int:
            return descriptor

    monkeypatch.setattr(sys, "stdout", Gone())
    # It would run for more than an hour.
    outcome = serve("--verdicts", "json", "--duration", "4e6", sent=(ALIVE,))
    os.close(descriptor)
    assert outcome.code == 0
    assert "verdicts lost" not in outcome.err


# The signing key


def test_key_is_kept_beside_the_stored_parameters(serve: Viso) -> None:
    key = SigningKey(1000, KEY)
    # In real time: the key's stamp moves on with every minute of the vehicle's.
    serve("--log-dir", "here", "--speedup", "1", sent=(SETUP_SIGNING(1, 1, tuple(KEY), key.timestamp),))
    stored = Path("here/signing.key")
    assert SigningKey.from_bytes(stored.read_bytes()) == key
    assert stored.stat().st_mode & 0o777 == 0o600


def test_key_goes_where_the_parameters_go(serve: Viso) -> None:
    serve("--storage", "elsewhere/mine.parm", sent=(SETUP_SIGNING(1, 1, tuple(KEY), 1000),))
    assert Path("elsewhere/signing.key").exists()


def test_damaged_key_is_one_line(serve: Viso) -> None:
    Path("logs").mkdir()
    Path("logs/signing.key").write_bytes(b"damaged")
    assert failed_with(serve(), "logs/signing.key: not a signing key; without the file there is no signing")


def test_key_that_cannot_be_stored_is_told_at_the_end(serve: Viso) -> None:
    Path("logs").mkdir()
    Path("readonly").mkdir()
    Path("readonly/signing.key").symlink_to("/proc/none/signing.key")
    outcome = serve("--storage", "readonly/storage.parm", sent=(SETUP_SIGNING(1, 1, tuple(KEY), 1000),))
    assert outcome.code == 1
    assert "readonly/signing.key: the signing key cannot be stored: " in outcome.err


@pytest.mark.parametrize("args", [["--json"], ["--verdicts", "json"], ["--verdicts", "text"], []])
def test_key_is_printed_nowhere(serve: Viso, args: list[str]) -> None:
    outcome = serve(*args, sent=(SETUP_SIGNING(1, 1, tuple(KEY), 1000),))
    shown = outcome.out + outcome.err
    assert not [form for form in (KEY.hex(), repr(KEY)[2:-1], str(list(KEY))[1:-1]) if form in shown]

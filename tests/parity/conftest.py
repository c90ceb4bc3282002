# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Replays of recorded streams, each done once a session through the command line."""

import gzip
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega
from typer.testing import CliRunner

from mav_handlers.channel import Channel
from mav_handlers.endpoint import MavEndpoint
from tests.places import DATA
from viso.cli import make_app


@dataclass(frozen=True)
class Replayed:
    """What the firmware made of a capture, and what we make of it.

    ``name`` is the capture's, after that of its release where that is not the reference; ``header`` is its first line,
    ``recorded`` the others; ``ours`` the lines of ``--records``, ``texts`` and ``acks`` what the vehicle sent, ``log``
    its DataFlash log.
    """

    name: str
    header: dict[str, Any]
    recorded: list[dict[str, Any]]
    ours: list[dict[str, Any]]
    texts: list[tuple[int, int, str]]
    acks: list[tuple[int, int]]
    log: Path

    @property
    def aligned(self) -> bool:
        """Whether the backend turns and shifts samples by the AHRS (T265, VOXL)."""
        return bool(self.header["params"]["VISO_TYPE"] != 1)


def read_lines(path: Path) -> list[dict[str, Any]]:
    with gzip.open(path, "rt", encoding="utf-8") as file:
        return [json.loads(line) for line in file]


def command_acks(sent: bytes) -> list[tuple[int, int]]:
    parser = ardupilotmega.MAVLink(None)
    messages = parser.parse_buffer(sent) or []
    return [(ack.command, ack.result) for ack in messages if ack.get_type() == "COMMAND_ACK"]


def run_viso_replay(args: list[str]) -> tuple[dict[str, Any], bytes]:
    """Return the output of ``viso replay --json`` and all bytes that the vehicle sent."""
    sent = bytearray()
    bytes_to_send = MavEndpoint.bytes_to_send

    def note_sent(self: MavEndpoint, channel: Channel) -> bytes:
        data = bytes_to_send(self, channel)
        sent.extend(data)
        return data

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MavEndpoint, "bytes_to_send", note_sent)
        result = CliRunner().invoke(make_app(), ["replay", *args, "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    outcome: dict[str, Any] = json.loads(result.stdout)
    return outcome, bytes(sent)


@pytest.fixture(scope="session")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Replayed]:
    """Return a function that replays a capture by its name; with the firmware's attitude where that log is kept.

    A name such as ``2026-02/mav`` has a release before it, which the vehicle then is.
    """
    folder = tmp_path_factory.mktemp("replayed")

    @cache
    def run(name: str) -> Replayed:
        release, _, stem = name.rpartition("/")
        capture, attitude = (DATA / release / kind for kind in (f"captures/{stem}.jsonl.gz", f"logs/{stem}.BIN.xz"))
        log, records = (folder / f"{release}{stem}{ending}" for ending in (".BIN", ".jsonl.gz"))
        args = [str(capture), "--log", str(log), "--records", str(records)]
        args += ["--firmware", release] if release else []
        args += ["--ahrs", str(attitude)] if attitude.exists() else []
        outcome, sent = run_viso_replay(args)
        texts = [(text["time_us"], text["severity"], text["text"]) for text in outcome["texts"]]
        header, *recorded = read_lines(capture)
        return Replayed(name, header, recorded, read_lines(records), texts, command_acks(sent), log)

    return run

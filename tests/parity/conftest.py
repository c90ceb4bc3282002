# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures played through viso, each once a session, as ``viso compare`` plays them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from tests.places import PARITY
from viso.compare.captures import Capture, Played, play, read_recorded
from viso.firmware.releases import PROFILES
from viso.logs.files import single_log


@dataclass(frozen=True)
class Replayed:
    """What the firmware made of a capture, and what we make of it.

    ``name`` is the capture's, after that of its release; ``log`` is our DataFlash log.
    """

    name: str
    recorded: Capture
    ours: Played
    log: Path


@pytest.fixture(scope="session")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Replayed]:
    """Return a function that plays a capture by its release and name, such as ``2026-02/mav``.

    The attitude is the firmware's where that log is kept.
    """
    folder = tmp_path_factory.mktemp("replayed")

    @cache
    def run(name: str) -> Replayed:
        release, _, stem = name.partition("/")
        capture, log = PARITY / release / "captures" / f"{stem}.jsonl.gz", folder / f"{release}{stem}.BIN"
        with single_log(log) as open_log:
            ours = play(capture, PROFILES[release], open_log=open_log)
        return Replayed(name, read_recorded(capture), ours, log)

    return run

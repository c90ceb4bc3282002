# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which strategies of a release its recordings prove."""

import gzip
import json
import sys
from pathlib import Path

import pytest

from tests.places import PARITY
from tools import proven_cells
from tools.proven_cells import cells, main
from viso.firmware.releases import APRIL_2026, FEBRUARY_2026, JULY_2025

MESSAGES = 60
"""Of the capture: the last ones have an error of their own."""

TRIED = {"endpoint.velocity_error", "ekf.fuses_rest"}


def test_each_strategy_is_put_back_alone() -> None:
    variants = dict(cells(APRIL_2026, FEBRUARY_2026))
    assert {"visual_odom.mav_vel_err", "endpoint.velocity_error", "ekf.fuses_rest"} < variants.keys()
    variant = variants["visual_odom.mav_vel_err"]
    assert variant.visual_odom == FEBRUARY_2026.visual_odom
    assert (variant.endpoint, variant.ekf) == (APRIL_2026.endpoint, APRIL_2026.ekf)
    assert dict(cells(JULY_2025, JULY_2025)) == {}


def test_strategy_is_proven_by_a_recording_that_comes_out_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, short = PARITY / "2026-04" / "captures" / "speedcov.jsonl.gz", tmp_path / "short.jsonl"
    with gzip.open(whole, "rt", encoding="utf-8") as file:
        header, *messages = (json.loads(line) for _, line in zip(range(1 + MESSAGES), file, strict=False))
    header.update(statustext=[], command_ack=[])
    short.write_text("\n".join(map(json.dumps, [header, *messages])))
    both = {name: one for name, one in cells(APRIL_2026, FEBRUARY_2026) if name in TRIED}
    monkeypatch.setattr(proven_cells, "cells", lambda _one, _other: both.items())
    monkeypatch.setattr(sys, "argv", ["proven_cells", str(short), "--against", FEBRUARY_2026.name])
    main()
    lines = [line.split("│") for line in capsys.readouterr().out.splitlines() if line.startswith("│")]
    rows = {strategy.strip(): names.strip() for _, strategy, names, _ in lines}
    assert rows == {"endpoint.velocity_error": "short.jsonl", "ekf.fuses_rest": "nothing here"}

# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso engine``: where the header is, and what a program made with it does in ``viso vio``."""

import json
from pathlib import Path

from tests.unit.viso.command_line import Viso
from tests.unit.viso.companion.engine.compiled import inertial_engine
from tests.unit.viso.companion.sources.film_maker import write_calibration, write_film, write_inertial_csv


def test_header_is_in_the_folder(viso: Viso) -> None:
    outcome = viso("engine")
    assert (outcome.code, outcome.err) == (0, "")
    assert (Path(outcome.out.rstrip("\n")) / "viso_engine.hpp").is_file()


def test_program_is_run_and_told_of(viso: Viso, tmp_path: Path) -> None:
    write_film(tmp_path / "film.avi")
    write_calibration(tmp_path / "small.toml")
    write_inertial_csv(tmp_path / "imu.csv", 1.3)
    film = ("film.avi", "--imu", "imu.csv", "--calibration", "small.toml")
    outcome = viso("vio", *film, "--engine", inertial_engine(), "--events", "events.jsonl", "--json")
    assert outcome.code == 0
    told = json.loads(outcome.out)
    assert (told["strategy"], told["poses"] > 5, told["engine"]["restarts"]) == ("engine", True, 0)
    events = [json.loads(line)["event"] for line in Path("events.jsonl").read_text().splitlines()]
    assert "engine_started" in events

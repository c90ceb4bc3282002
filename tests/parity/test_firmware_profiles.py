# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a later release are reproduced as that release, and are seen to differ as any other."""

import gzip
import json
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any, Final

import pytest

from ap_visualodom.log_structure import VISP, VISV
from tests.ekf_replay import replay_ekf
from tests.places import PARITY, RECORDED
from viso.compare.estimates import compare_estimates
from viso.compare.tolerances import FLIGHT, end_s
from viso.compare.vectors import line_differences
from viso.firmware.releases import (
    APRIL_2026,
    FEBRUARY_2026,
    JULY_2025,
    PROFILES,
    STABLE_4_6,
    STABLE_4_7,
    Firmware,
)
from viso.replay.feed import Replay
from viso.replay.vectors import recompute
from viso.streams.stream_kinds import read_stream
from viso.vehicle.vehicle import Vehicle, VehicleConfig

LABELS: Final = {label: index for index, label in enumerate(VISP.fields, 1)}
LATER = PARITY / "2026-02"
REFERENCE_VECTORS = RECORDED / "vectors" / "visual_odom.jsonl.gz"
APRIL_LOG = PARITY / "2026-04" / "logs" / "voxl.BIN.xz"
SPEEDS = 90
VERR, IGNORED = (2 + VISV.fields.index(label) for label in ("VErr", "Ign"))
SCENARIOS, STEPS = 306, 41113
CHUNKS = 3
BAUD = 115200
EARLIER = [STABLE_4_6, JULY_2025]


@cache
def scenarios(path: Path = LATER / "vectors" / "visual_odom.jsonl.gz") -> tuple[str, ...]:
    with gzip.open(path, "rt", encoding="utf-8") as file:
        return tuple(file)


def differences(lines: tuple[str, ...], firmware: Firmware) -> tuple[int, int]:
    """Return the numbers of steps, and of steps that come out otherwise."""
    steps, different = 0, set()
    for number, line in enumerate(map(json.loads, lines)):
        steps += len(line["steps"])
        different |= {one.place for one in line_differences(number, line, recompute(line, firmware.visual_odom))}
    return steps, len(different)


def changed_steps(line: dict[str, Any], firmware: Firmware) -> list[tuple[Any, Any]]:
    """Return the recorded steps that come out otherwise, each with how."""
    again: Any = recompute(line, firmware.visual_odom)
    return [(step, ours) for step, ours in zip(line["steps"], again["steps"], strict=True) if step != ours]


def test_scenarios_are_complete() -> None:
    assert len(scenarios()) == SCENARIOS
    assert sum(len(json.loads(line)["steps"]) for line in scenarios()) == STEPS


@pytest.mark.parametrize("chunk", [0, *(pytest.param(chunk, marks=pytest.mark.slow) for chunk in range(1, CHUNKS))])
def test_scenarios_come_out_as_the_release_has_them(chunk: int) -> None:
    steps, different = differences(scenarios()[chunk::CHUNKS], FEBRUARY_2026)
    assert steps > STEPS // 4
    assert different == 0


@pytest.mark.parametrize("firmware", EARLIER, ids=lambda one: one.name)
def test_scenarios_come_out_otherwise_as_an_earlier_release(firmware: Firmware) -> None:
    with_alignment = tuple(line for line in scenarios()[:40] if '"align_position"' in line)
    assert differences(with_alignment, firmware)[1] > 50


def test_scenarios_of_the_mav_backend_are_those_of_all_releases_before_april() -> None:
    lines = tuple(line for line in scenarios() if json.loads(line)["params"]["TYPE"] == 1)[:10]
    assert [differences(lines, firmware)[1] for firmware in (*EARLIER, FEBRUARY_2026)] == [0, 0, 0]


def test_velocity_that_is_refused_has_no_error_since_april() -> None:
    lines = tuple(line for line in scenarios() if json.loads(line)["params"]["TYPE"] == 1)[:10]
    different = [pair for line in map(json.loads, lines) for pair in changed_steps(line, APRIL_2026)]
    assert len(different) > 50
    assert all(step[0] == "speed" for step, _ in different)
    for recorded, ours in ((step[-1]["out"], again[-1]["out"]) for step, again in different):
        [before], [after] = recorded, ours
        assert before[VERR] != after[VERR] == "00000000"
        assert before[:VERR] + before[VERR + 1 :] == after[:VERR] + after[VERR + 1 :]
        assert after[IGNORED] == 1


@pytest.mark.slow
def test_scenarios_of_the_reference_are_those_of_4_6_and_not_of_the_later_one() -> None:
    lines = tuple(line for line in scenarios(REFERENCE_VECTORS)[:40] if '"align_position"' in line)
    found = {name: differences(lines, firmware)[1] for name, firmware in PROFILES.items()}
    assert found[STABLE_4_6.name] == found[JULY_2025.name] == 0
    assert found[FEBRUARY_2026.name] > 50


# Captures; that they are reproduced is tested with the others.


def errors_differ(capture: Path, count: int, firmware: Firmware) -> bool:
    """Return whether the errors of any of the first messages come out otherwise than recorded."""
    stream = read_stream(capture, 0)
    vehicle = Vehicle(VehicleConfig(defaults=stream.params, firmware=firmware))
    replay = Replay(vehicle, replace(stream, messages=stream.messages[:count]), BAUD)
    ours = [errors_of(message.as_dict()["out"]) for message in replay.run()]
    with gzip.open(capture, "rt", encoding="utf-8") as file:
        recorded = [errors_of(json.loads(line)["out"]) for line in islice(file, 1, 1 + count)]
    assert len(recorded) == len(ours) == count
    return recorded != ours


def errors_of(records: Any) -> list[list[str]]:
    return [record[LABELS["PErr"] : LABELS["AErr"] + 1] for record in records if record[0] == VISP.name]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("mocap_covariance", 70),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in (("mav", 130), ("t265", 110))),
    ],
)
def test_captures_come_out_as_their_release_alone_has_them(name: str, count: int) -> None:
    capture = LATER / "captures" / f"{name}.jsonl.gz"
    differ = {firmware for firmware in PROFILES if errors_differ(capture, count, PROFILES[firmware])}
    assert differ == {STABLE_4_6.name, JULY_2025.name}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "count"),
    [("mav", 130), *(pytest.param(*case, marks=pytest.mark.slow) for case in (("mocap", 160), ("t265", 110)))],
)
def test_captures_of_the_reference_come_out_otherwise_as_the_later_release(name: str, count: int) -> None:
    capture = RECORDED / "captures" / f"{name}.jsonl.gz"
    differ = {firmware for firmware in PROFILES if errors_differ(capture, count, PROFILES[firmware])}
    assert differ == {FEBRUARY_2026.name, STABLE_4_7.name, APRIL_2026.name}


def records_of(capture: Path, count: int | None, firmware: Firmware) -> list[Any]:
    """Return the records that the first messages of a capture make."""
    stream = read_stream(capture, 0)
    vehicle = Vehicle(VehicleConfig(defaults=stream.params, firmware=firmware))
    replay = Replay(vehicle, replace(stream, messages=stream.messages[:count]), BAUD)
    return [message.as_dict()["out"] for message in replay.run()]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "count"), [("voxl", 120), ("flight_mav_extyaw", 120), ("voxl", None), ("prearm", None)]
)
def test_captures_without_covariance_come_out_the_same_in_all_before_april(name: str, count: int | None) -> None:
    capture = RECORDED / "captures" / f"{name}.jsonl.gz"
    # In the end cameras are aligned to the yaw of the filter, which is another one in 4.6.
    releases = (JULY_2025, FEBRUARY_2026) if count is None else (*EARLIER, FEBRUARY_2026)
    first, *others = (repr(records_of(capture, count, firmware)) for firmware in releases)
    assert "VISP" in first
    assert all(other == first for other in others)


def missed(log: Path, firmware: Firmware | None = None) -> list[str]:
    """Return what the filter says otherwise than a log's, as a release; by default as the log's own."""
    comparison = compare_estimates(replay_ekf(log, firmware=firmware).until(end_s(log)), FLIGHT)
    assert comparison.records > 300
    return [check.what for check in comparison.checks if not check.passed]


@pytest.mark.slow
@pytest.mark.parametrize("log", [LATER / "logs" / "t265.BIN.xz", APRIL_LOG], ids=["2026-02", "2026-04"])
def test_filter_says_what_the_later_release_said_over_its_log(log: Path) -> None:
    assert missed(log) == []


@pytest.mark.slow
@pytest.mark.parametrize("firmware", [JULY_2025, FEBRUARY_2026], ids=lambda one: one.name)
def test_filter_of_an_earlier_release_says_otherwise_over_a_later_log(firmware: Firmware) -> None:
    assert missed(APRIL_LOG, firmware) != []


def test_velocity_has_the_error_of_its_covariance_since_april() -> None:
    capture = PARITY / "2026-04" / "captures" / "speedcov.jsonl.gz"
    with gzip.open(capture, "rt", encoding="utf-8") as file:
        recorded = [vel_errors(json.loads(line)["out"]) for line in islice(file, 1, 1 + SPEEDS)]
    april, february = (map(vel_errors, records_of(capture, SPEEDS, one)) for one in (APRIL_2026, FEBRUARY_2026))
    assert list(april) == recorded
    assert list(february) != recorded


def vel_errors(records: Any) -> list[str]:
    return [record[VERR - 1] for record in records if record[0] == VISV.name]

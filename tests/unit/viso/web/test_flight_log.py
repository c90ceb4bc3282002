# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A page is told all that a log has, and that the rest is missing."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.unit.viso.report.log_maker import LogMaker, flight, material_of
from viso.report.facts import facts_of
from viso.report.summary import summarise
from viso.web.flight_log import log_recording
from viso.web.server import encode


def page_of(maker: LogMaker, folder: Path) -> dict[str, Any]:
    """Return what a page is told of a log."""
    material = material_of(maker, folder / "flight.BIN")
    facts = facts_of(material)
    told = json.loads(encode(log_recording(material, facts, summarise(material, facts))))
    assert isinstance(told, dict)
    return told


def at(rows: list[dict[str, Any]], time_s: float) -> dict[str, Any]:
    """Return the row of a time."""
    return rows[int(np.argmin([abs(row["t"] - time_s) for row in rows]))]


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what a page is told of the made flight."""
    return page_of(flight(), tmp_path_factory.mktemp("log"))


def test_points_are_what_the_records_say(shown: dict[str, Any]) -> None:
    point = at(shown["points"], 5.0)
    assert point["vision"]["pos"] == pytest.approx([2.475, 0, -1], abs=0.03)
    assert point["ekf"] == pytest.approx([2.5, 0, -1], abs=0.03)
    assert (point["yaw_deg"], point["lag"][0]) == (-10, pytest.approx(20, abs=0.1))
    assert point["quality"] == [80, 80]
    assert at(shown["points"], 6.5)["vision"]["ignored"]
    assert at(shown["points"], 9.2)["innovations"]["pose"] | {"gate": None} == {
        "ratio": pytest.approx(1.8),
        "value": 2.0,
        "gate": None,
        "tested": 1,
        "rejected": 1,
    }


def test_silence_and_a_lost_position_are_gaps_and_no_zeros(shown: dict[str, Any]) -> None:
    silent = at(shown["points"], 8.3)
    assert (silent["vision"], silent["lag"], silent["quality"]) == (None, None, None)
    assert at(shown["points"], 1.5)["ekf"] is None
    assert "pose" not in at(shown["points"], 1.5)["innovations"]


def test_moments_leave_out_what_no_log_tells(shown: dict[str, Any]) -> None:
    moment = at(shown["moments"], 5.0)
    assert moment["state"] == {
        "time_s": 5.0,
        "faults": [],
        "clients": [],
        "mode": "GUIDED",
        "armed": True,
        "camera": "healthy",
        "aiding": "absolute",
        "yaw_deg": -10.0,
    }
    (visp, _) = moment["rates"]
    assert visp["per_s"] == {"offered": None, "dropped": None, "fused": None, "accepted": 20.0, "ignored": 0.0}
    assert not at(shown["moments"], 2.0)["state"]["armed"]


def test_verdicts_are_of_the_records_with_the_reason_for_which_they_were_withheld(shown: dict[str, Any]) -> None:
    poses = [run for run in shown["runs"] if run["name"] == "VISP"]
    assert [(run["outcome"], run["count"]) for run in poses[:2]] == [("accepted", 189), ("ignored", 20)]
    assert poses[1]["reason"] == "withheld from the EKF for low quality"


def test_texts_events_and_parameters_are_those_of_the_log(shown: dict[str, Any]) -> None:
    assert [9.0, "text", "VisOdom: reset"] in shown["texts"]
    assert [3.0, "arming", "armed"] in shown["texts"]
    (known,) = [row for row in shown["table"] if row["name"] == "VISO_QUAL_MIN"]
    assert (known["value"], known["default"]) == (20, 0)
    assert known["about"]
    assert shown["summary"]["badge"] == "trouble"
    assert shown["sources"] == {"pose": "ExtNav"}


@pytest.mark.parametrize("has_status", [False, True])
def test_log_without_vision_or_filter_says_so(tmp_path: Path, has_status: bool) -> None:
    maker = LogMaker()
    maker.add("MSG", 1.0, Message="ArduCopter V4.7.0-dev (00000000)")
    maker.parameter("EK3_SRC1_POSXY", 6)
    maker.parameter("SOMEBODY_ELSES", 0.1)
    for number in range(20):
        if has_status:
            maker.add("XKF4", 2 + 0.1 * number, SS=0x33F)
    maker.add("MSG", 6.0, Message="the end")
    told = page_of(maker, tmp_path)
    assert all(point["vision"] is point["ekf"] is point["lag"] is point["quality"] is None for point in told["points"])
    assert not any("pose" in point["innovations"] for point in told["points"])  # its source never said anything
    assert told["runs"] == told["rates"] == []
    assert set(told["state"]) == {"time_s", "faults", "clients"}
    assert ["aiding" in moment["state"] for moment in told["moments"]].count(True) == 3 * has_status
    assert "No VISP: position and attitude of vision." in told["summary"]["absent"]
    assert {"name": "SOMEBODY_ELSES", "value": 0.1}.items() <= told["table"][1].items()


@pytest.mark.slow
def test_long_log_has_no_more_points_than_a_page_can_draw_and_loses_none(tmp_path: Path) -> None:
    maker = LogMaker()
    for number in range(0, 20_000, 7):
        maker.add("VISP", 1.0 + number, Q=number == 7000)
    told = page_of(maker, tmp_path)
    assert len(told["points"]) <= 6001
    assert len(told["moments"]) <= 6001
    assert max(point["quality"][0] for point in told["points"] if point["quality"]) == 1

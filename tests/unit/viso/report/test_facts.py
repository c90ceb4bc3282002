# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of a report, and the sentences made of them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import pytest

from tests.unit.viso.doctor.own_filters import EXTNAV, Status, during, logged, quiet
from tests.unit.viso.report.log_maker import LOST, NAVIGATES, VELOCITY, LogMaker, material_of
from viso.report.facts import Facts, facts_of
from viso.report.flight_data import Material
from viso.report.summary import Level, summarise


@pytest.fixture
def maker() -> LogMaker:
    return LogMaker()


def rounded(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(round(start, 3), round(end, 3)) for start, end in spans]


def sentences(maker: LogMaker, path: Path) -> tuple[str, list[str], tuple[str, ...]]:
    """Return the first sentence, the remarks and what is absent."""
    material = material_of(maker, path / "a.BIN")
    summary = summarise(material, facts_of(material))
    return summary.sentence, [remark.text for remark in summary.remarks], summary.absent


def test_withheld_samples_are_counted_by_reason(maker: LogMaker, tmp_path: Path) -> None:
    maker.parameter("VISO_QUAL_MIN", 20)
    fields = [{}, {"Q": 5, "Ign": 1}, {"Rst": 1, "Ign": 1}, {"Rst": 1, "Ign": 1}, {"Rst": 1, "Ign": 1}]
    for time_s, values in zip((1.0, 1.5, 2.0, 2.9, 3.1), fields, strict=True):
        maker.add("VISP", time_s, **values)
    found = facts_of(material_of(maker, tmp_path / "a.BIN")).kinds[0]
    assert (found.records, list(found.withheld_for.values())) == (5, [1, 2, 1])
    assert list(found.withheld_for)[:2] == ["low quality", "the second after a reset"]
    assert found.given is None


def test_rate_gaps_and_resets_of_the_flight(facts: Facts) -> None:
    pose, velocity, change = facts.kinds
    assert (pose.records, velocity.records, change.records) == (209, 209, 0)
    assert [round(kind.rate_hz, 3) for kind in facts.kinds] == [18.995, 18.995, 0.0]
    assert rounded(facts.gaps) == [(8.0, 8.6)]
    resets = [(round(one.time_s, 2), one.by, one.what) for one in facts.resets]
    moved = "position moved by +0.00 m north, +2.00 m east"
    assert resets == [(9.0, "vision", "reset counter 0 to 1"), (9.5, "EKF", moved)]


def test_filter_of_the_flight(facts: Facts) -> None:
    assert rounded(facts.armed) == [(3.0, 11.9)]
    assert rounded(facts.positioned) == [(2.0, 11.9)]
    assert rounded(facts.over_gate) == [(9.0, 9.5)]
    assert facts.worst_ratio == pytest.approx(1.8)


def test_flight_in_words(material: Material, facts: Facts) -> None:
    found = summarise(material, facts)
    assert found.level is Level.BAD
    assert found.sentence == (
        "External navigation brought 209 poses at 19 Hz and 209 velocities at 19 Hz; the EKF had a position for 8.9 of "
        "8.9 s armed; 6 things stand out."
    )
    assert [remark.text for remark in found.remarks] == [
        "Nothing came for more than 300 ms once, for 0.6 s at worst, from 8.0 s on.",
        "The autopilot's own position test ratio (XKF4.SP, position from ExtNav) was above 1 for 5 % of 10 s, armed, "
        "from 9.000 s on, worst 1.8 at 9.000 s; position was up to 2 m off (XN9-10, witness: log).",
        "20 of 209 VISP were withheld from the EKF: 20 for low quality.",
        "20 of 209 VISV were withheld from the EKF: 20 for low quality.",
        "The reset counter of vision changed once: at 9.0 s.",
        "The EKF moved its position once while armed: at 9.5 s.",
    ]


def test_log_without_vision_says_so(maker: LogMaker, tmp_path: Path) -> None:
    maker.parameter("VISO_TYPE", 0)
    maker.add("XKF4", 1.0, SS=NAVIGATES)
    sentence, remarks, absent = sentences(maker, tmp_path)
    assert sentence == "The log holds no external navigation: no VISP, VISV or VISO record."
    assert remarks == ["No external navigation reached the autopilot's driver. VISO_TYPE is 0, which is off."]
    assert "No VISP: position and attitude of vision." in absent
    assert "No XKF1: the EKF's estimates." in absent


def test_log_without_ekf_says_so(maker: LogMaker, tmp_path: Path) -> None:
    for number in range(20):
        maker.add("VISV", 1 + number * 0.1, VX=1.0)
    sentence, remarks, absent = sentences(maker, tmp_path)
    assert sentence.endswith(
        "20 velocities at 10 Hz; the log does not show what the EKF made of it; nothing in the log can judge it."
    )
    assert remarks == ["The log has no XKF4: what the EKF made of it is not known. That is no sign that it went well."]
    assert "No PARM: parameters are unknown; VISO_DELAY_MS is taken to be 10." in absent


def test_position_that_never_comes_is_trouble(maker: LogMaker, tmp_path: Path) -> None:
    maker.parameter("EK3_SRC1_POSXY", 6)
    for number in range(200):
        maker.add("VISP", 1 + number * 0.1)
        maker.add("XKF4", 1 + number * 0.1, SS=LOST)
    sentence, remarks, _ = sentences(maker, tmp_path)
    assert "the EKF never had a horizontal position" in sentence
    assert remarks == [
        "External navigation is the EKF's source of horizontal position or velocity, and in 20 s it never had either "
        "(XKF4) (XN9-15, witness: log).",
    ]


def test_velocity_without_position_is_told(maker: LogMaker, tmp_path: Path) -> None:
    for number in range(20):
        maker.add("VISV", 1 + number * 0.1)
        maker.add("XKF4", 1 + number * 0.1, SS=VELOCITY)
    sentence, remarks, _ = sentences(maker, tmp_path)
    assert (
        "the EKF never had a horizontal position, but a velocity for 1.9 s; nothing in the log can judge it."
        in sentence
    )
    assert remarks == ["The log does not show what the EKF navigated by: its test ratios may be of other sensors."]


def test_loss_in_flight_failsafe_and_refused_arming_are_told(maker: LogMaker, tmp_path: Path) -> None:
    maker.add("MSG", 0.5, Message="PreArm: VisOdom: not healthy")
    maker.add("ARM", 1.0, ArmState=1)
    for number in range(30):
        maker.add("XKF4", 1 + number * 0.1, SS=NAVIGATES if number < 20 else LOST)
        if number < 20:
            maker.add("VISP", 1 + number * 0.1)
    maker.add("ERR", 3.9, Subsys=24, ECode=1)
    maker.add("ERR", 3.9, Subsys=17, ECode=1)
    _, remarks, _ = sentences(maker, tmp_path)
    assert remarks == [
        'The autopilot itself recorded "EKF failsafe: occurred" once, first at 3.900 s (XN9-13, witness: log).',
        "The EKF was without a horizontal position for 0.9 s while armed.",
        'Arming was refused for vision once, at last "PreArm: VisOdom: not healthy".',
        "Nothing came in the last 1.0 s of the log, armed for 1.0 s of that.",
        "The log does not show what the EKF navigated by: its test ratios may be of other sensors.",
    ]


def verdict(path: Path, status: Status = quiet, length_s: float = 12.0, **params: float) -> str:
    """Return the badge of a log with vision, beside what its filter says."""
    maker = logged(status, {**VISO, **params}, length_s)
    for number in range(121):
        maker.add("VISP", 10.0 + number * 0.1, PErr=0.1, AErr=0.1, PX=0.001 * number)
    material = material_of(maker, path / "a.BIN")
    return summarise(material, facts_of(material)).level.badge


@pytest.mark.parametrize(("source", "moves"), [(6, 1), (3, 0)])
def test_moves_of_an_ekf_on_gps_are_none_of_external_navigation(source: int, moves: int, tmp_path: Path) -> None:
    maker = logged(during(5, 8, OFE=2.0), {**VISO, "EK3_SRC1_POSXY": source}, 12.0)
    resets = facts_of(material_of(maker, tmp_path / "a.BIN")).resets
    assert len([one for one in resets if one.by == "EKF"]) == moves


VISO: Final = {**EXTNAV, "VISO_TYPE": 1, "EK3_SRC1_VELXY": 0}


@pytest.mark.parametrize(
    ("status", "params", "badge"),
    [
        (quiet, {}, "fine"),
        (during(5, 5.15, SM=1.1), {}, "look"),
        (during(5, 8, SM=1.1), {}, "trouble"),
        (during(5, 8, SM=1.1), {"EK3_SRC1_YAW": 1}, "look"),
        (during(5, 8, SH=1.1), {}, "look"),
        (during(5, 8, SP=1.1, SS=LOST), {"EK3_SRC1_POSXY": 3}, "look"),
        (quiet, {"EK3_SRC1_POSXY": 3, "EK3_SRC1_YAW": 1, "EK3_SRC2_POSXY": 6}, "no verdict"),
        (quiet, {"EK3_SRC1_POSZ": 5}, "trouble"),
    ],
)
def test_badge_follows_the_vehicle_s_own_filter_and_errors(
    status: Status, params: Mapping[str, float], badge: str, tmp_path: Path
) -> None:
    assert verdict(tmp_path, status, **params) == badge


def test_flight_that_nothing_can_judge_is_never_fine(tmp_path: Path) -> None:
    assert verdict(tmp_path, length_s=-1) == "no verdict"


def test_empty_log_has_facts(maker: LogMaker, tmp_path: Path) -> None:
    maker.parameter("VISO_TYPE", 1, 1)
    material = material_of(maker, tmp_path / "a.BIN")
    facts = facts_of(material)
    assert (facts.measurements, facts.start_s, facts.end_s) == (0, 0.0, 0.0)
    assert "VISO_TYPE is 1." in summarise(material, facts).remarks[0].text

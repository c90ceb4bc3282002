# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every text that the autopilot can send stands in the index, with cause, check and fix."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from ekf_stub import reports
from tests.places import ROOT
from viso.doctor import all_checks
from viso.explain.texts import IN_FLIGHT, all_texts, texts_like
from viso.firmware.releases import PROFILES
from viso.parameters.left_out import left_out
from viso.vehicle.copter import modes
from viso.vehicle.gps_driver import MavlinkGpsDriver
from viso.vehicle.simulated_gps import UbloxDriver

SENDING = ("send_text", "send_text_to", "_send_text", "_send_text_to")
FUNCTIONS = {  # which send a text that they are given, and its place among their arguments
    "mav_handlers/signing.py": ("tell", 0),
    "mav_handlers/handlers/missions.py": ("_warn", 1),
    "viso/vehicle/copter/modes.py": ("_refuse", 0),
    "viso/vehicle/copter/arming.py": ("_send_change", 0),
}
ROOMS = ("ap_visualodom", "ekf_stub", "mav_handlers", "viso/vehicle")
MADE_ELSEWHERE = {
    "name + words": "words_of: the filter's table, below",
    "over if is_over else lost": "variance_texts of each release, below",
    "line": "the banner, and what is left out, below",
    "_TEXTS[mode.number]": "the table of modes, below",
    "text": "an argument of a function that sends it",
    "f'{prefix}: {failure}'": "the texts against arming, which tests/docs/test_arming_page.py goes through",
}


def sent_in(path: Path) -> Iterator[ast.expr]:
    """Yield the expressions of the texts that a file sends; names stand for what they are assigned."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    function, place = FUNCTIONS.get(str(path.relative_to(ROOT)), (None, 0))
    assigned = {
        target.id: node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and node.args:
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if name in SENDING:
                yield assigned.get(ast.unparse(node.args[-1]), node.args[-1])
            elif name == function:
                yield assigned.get(ast.unparse(node.args[place]), node.args[place])


def is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def pattern_of(node: ast.expr) -> str:
    pieces = node.values if isinstance(node, ast.JoinedStr) else [node]
    return "".join(re.escape(str(one.value)) if isinstance(one, ast.Constant) else ".+" for one in pieces)


@pytest.fixture(scope="module")
def sent() -> list[ast.expr]:
    """Return the expressions of all texts that are sent; to find them takes a second."""
    return [node for room in ROOMS for path in sorted((ROOT / room).rglob("*.py")) for node in sent_in(path)]


SHOWN = [text.shown for _, text in all_texts()]


def test_texts_in_the_code_stand_in_the_index(sent: list[ast.expr]) -> None:
    patterns = {pattern_of(node) for node in sent if is_text(node)}
    assert len(patterns) > 40
    for pattern in patterns - {r".+:\ .+"}:
        assert [shown for shown in SHOWN if re.fullmatch(pattern, shown)], pattern


def test_what_is_put_together_elsewhere_is_known(sent: list[ast.expr]) -> None:
    assert {ast.unparse(node) for node in sent if not is_text(node)} <= set(MADE_ELSEWHERE)


@pytest.mark.parametrize("driver", [MavlinkGpsDriver, UbloxDriver])
def test_texts_of_drivers_of_a_gps_stand_in_the_index(driver: type[MavlinkGpsDriver | UbloxDriver]) -> None:
    assert {f"GPS 1: {driver.introduction}", f"GPS 1: {driver.detected}"} <= set(SHOWN)


def the_filters() -> list[str]:
    return [f"EKF3 IMU0 {words}" if not words.startswith("EKF3") else words for _, words in reports._WORDS]


def test_texts_of_tables_stand_in_the_index() -> None:
    for text in (
        *(re.sub(r"\{.*?\}", "1.0", words) for words in the_filters()),
        *(text for profile in PROFILES.values() for text in profile.variance_texts),
        *modes._TEXTS.values(),
        *left_out({"AHRS_EKF_TYPE": 10, "VISO_TYPE": 4}),
    ):
        assert [one for _, one in all_texts() if one.fits(text)], text


def test_every_text_has_a_cause_a_check_and_a_fix() -> None:
    for _, text in all_texts():
        assert all((text.cause, text.check, text.fix)), text.shown


def test_codes_are_the_doctors() -> None:
    known = {check.code for check in all_checks()}
    assert {code for _, text in all_texts() for code in text.codes} <= known


def test_every_text_finds_itself() -> None:
    for _, text in all_texts():
        assert text in [found for _, found in texts_like(text.shown)], text.shown
    assert len({text.shown for _, text in all_texts()}) == len(list(all_texts()))


@pytest.mark.parametrize(("words", "shown"), [
    ("EKF variance", "EKF variance"),
    ("EKF variance: position lost", "EKF variance: position lost"),
    ("EKF Failsafe: changed to ALT_HOLD Mode", "EKF Failsafe: changed to LAND Mode"),
    ("EKF3 IMU1 stopped aiding", "EKF3 IMU0 stopped aiding"),
    ("stopped aiding", "EKF3 IMU0 stopped aiding"),
    ("ekf3 imu0 is using external nav data", "EKF3 IMU0 is using external nav data"),
    ("emergency yaw reset", "EKF3 IMU0 emergency yaw reset"),
    ("PreArm: Gyros inconsistent", "Gyros inconsistent"),
    ("lane switch", "EKF3 lane switch 1"),
    ("PreArm: VisOdom: not healthy", "VisOdom: not healthy"),
    ("Arm: VisOdom: yaw diff 181.2 deg (>10)", "VisOdom: yaw diff 30.0 deg (>10)"),
    ("EKF3 IMU0 initial pos NED = 0.0,-1.2,-0.1 (m)", "EKF3 IMU0 initial pos NED = 0.0,0.0,-0.1 (m)"),
    ("Internal Errors 0x1400", "Internal Errors 0x400"),
])  # fmt: skip
def test_words_of_reports_are_found(words: str, shown: str) -> None:
    assert [text.shown for _, text in texts_like(words)] == [shown]


def test_texts_in_flight_lead_to_the_doctor() -> None:
    assert sum(bool(text.codes) for text in IN_FLIGHT) > 20

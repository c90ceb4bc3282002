# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When checks run and speak, which of them count, and what arming and disarming say."""

from typing import cast

import pytest

from ap_core.clock import VirtualClock
from ap_core.param import ParamTable
from viso.logs.vehicle_log import VehicleLog
from viso.parameters.releases import JULY_2025
from viso.parameters.table import make_groups
from viso.vehicle.copter.arming import ANY_CHECK, Arming, ArmMethod, Check, CheckLists

LOGGING, VISION = 1 << 10, 1 << 18


class FakeLog:
    """Keeps what is logged."""

    def __init__(self) -> None:
        self.records: list[object] = []

    def arming(self, *, armed: bool, checks: int, forced: bool, method: int) -> None:
        self.records.append({"armed": armed, "checks": checks, "forced": forced, "method": method})

    def event(self, event: int) -> None:
        self.records.append(event)


class Rig:
    """Checks of every list, each of which fails with its text in ``failing``; what is logged and told is kept."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(0, None, JULY_2025))
        self.failing: dict[str, str] = {}
        self.made: list[str] = []
        self.texts: list[tuple[int, str]] = []
        self.log = FakeLog()
        checks = CheckLists(
            boot=[self._check(0, "boot")],
            vehicle=[self._check(0, "height")],
            common=[self._check(LOGGING, "logging"), self._check(ANY_CHECK, "any"), self._check(VISION, "vision")],
            mandatory=[self._check(0, "position"), self._check(0, "height")],
            arm=[self._check(0, "mode"), self._check(ANY_CHECK, "switch")],
        )
        self.arming = Arming(
            checks, self.params.group("ARMING_"), self, cast(VehicleLog, self.log), self.clock, JULY_2025
        )

    def _check(self, bit: int, name: str) -> Check:
        def run() -> str | None:
            self.made.append(name)
            return self.failing.get(name)

        return Check(bit, run)

    def send_text(self, severity: int, text: str) -> None:
        self.texts.append((severity, text))

    def take_texts(self) -> list[str]:
        texts = [text for _, text in self.texts]
        self.texts.clear()
        return texts

    def update_until(self, time_s: int) -> list[int]:
        """Update once a second up to a time and return the seconds at which something was said."""
        said = []
        for second in range(self.clock.millis() // 1000 + 1, time_s + 1):
            self.clock.set_us(second * 1_000_000)
            self.arming.update()
            if self.take_texts():
                said.append(second)
        return said


@pytest.fixture
def rig() -> Rig:
    return Rig()


# Display


def test_failures_are_displayed_every_30_seconds(rig: Rig) -> None:
    rig.failing["vision"] = "VisOdom: not healthy"
    assert rig.update_until(100) == [31, 62, 93]


@pytest.mark.parametrize(("time_ms", "said"), [(30_000, []), (30_001, ["PreArm: VisOdom: not healthy"])])
def test_period_of_the_display_is_more_than_30_seconds(rig: Rig, time_ms: int, said: list[str]) -> None:
    rig.failing["vision"] = "VisOdom: not healthy"
    rig.clock.set_us(time_ms * 1000)
    rig.arming.update()
    assert rig.take_texts() == said


def test_change_to_failing_is_displayed_with_the_next_update(rig: Rig) -> None:
    rig.update_until(10)
    rig.failing["vision"] = "VisOdom: not healthy"
    assert rig.update_until(45) == [12, 43]


@pytest.mark.parametrize(("wait_ms", "said"), [(4000, 0), (4001, 1)])
def test_change_is_displayed_more_than_4_seconds_after_the_last_display(rig: Rig, wait_ms: int, said: int) -> None:
    rig.update_until(31)  # a display, though nothing fails
    rig.failing["vision"] = "VisOdom: not healthy"
    rig.arming.pre_arm_checks(display=False)
    rig.clock.set_us((31_000 + wait_ms) * 1000)
    rig.arming.update()
    assert len(rig.take_texts()) == said


def test_checks_that_never_passed_are_no_change(rig: Rig) -> None:
    rig.failing["vision"] = "VisOdom: not healthy"
    assert rig.update_until(29) == []


def test_display_works_across_the_wrap_of_milliseconds(rig: Rig) -> None:
    rig.failing["vision"] = "VisOdom: not healthy"
    rig.clock.set_us(((1 << 32) - 10_000) * 1000)
    rig.arming.update()
    rig.take_texts()
    rig.clock.set_us(((1 << 32) + 20_000) * 1000)
    rig.arming.update()
    assert rig.take_texts() == []
    rig.clock.set_us(((1 << 32) + 20_001) * 1000)
    rig.arming.update()
    assert len(rig.take_texts()) == 1


def test_option_0_keeps_the_periodic_display_quiet(rig: Rig) -> None:
    rig.params.set("ARMING_OPTIONS", 1)
    rig.failing["vision"] = "VisOdom: not healthy"
    assert rig.update_until(100) == []


def test_requested_checks_speak_at_once_in_spite_of_option_0(rig: Rig) -> None:
    rig.params.set("ARMING_OPTIONS", 1)
    rig.failing["vision"] = "VisOdom: not healthy"
    assert not rig.arming.pre_arm_checks(display=True)
    assert rig.texts == [(2, "PreArm: VisOdom: not healthy")]


# Checks


def test_every_failing_check_is_told_in_order(rig: Rig) -> None:
    rig.failing |= {"vision": "V", "height": "H", "logging": "L", "any": "A"}
    rig.arming.pre_arm_checks(display=True)
    assert rig.take_texts() == ["PreArm: H", "PreArm: L", "PreArm: A", "PreArm: V"]


def test_no_other_check_is_made_when_booting_is_not_over(rig: Rig) -> None:
    rig.failing["boot"] = "System not initialised"
    assert not rig.arming.pre_arm_checks(display=True)
    assert rig.take_texts() == ["PreArm: System not initialised"]
    assert rig.made == ["boot"]


def test_change_of_the_vehicle_s_own_checks_is_not_shown_soon(rig: Rig) -> None:
    rig.update_until(10)
    rig.failing["height"] = "Need Alt Estimate"
    assert rig.update_until(45) == [31]


def test_passing_checks_say_nothing(rig: Rig) -> None:
    assert rig.arming.pre_arm_checks(display=True)
    assert rig.take_texts() == []


@pytest.mark.parametrize(("mask", "made"), [
    (0, ["boot", "position", "height"]),
    (1, ["boot", "height", "logging", "any", "vision"]),
    (VISION, ["boot", "height", "any", "vision"]),
    (LOGGING, ["boot", "height", "logging", "any"]),
    (1 << 5, ["boot", "height", "any"]),
    (LOGGING | VISION, ["boot", "height", "logging", "any", "vision"]),
    (-1, ["boot", "height", "logging", "any", "vision"]),
])  # fmt: skip
def test_arming_check_chooses_the_checks(rig: Rig, mask: int, made: list[str]) -> None:
    rig.params.set("ARMING_CHECK", mask)
    rig.arming.pre_arm_checks(display=False)
    assert rig.made == made


def test_result_of_the_last_run_is_kept(rig: Rig) -> None:
    assert not rig.arming.passed
    rig.arming.pre_arm_checks(display=False)
    assert rig.arming.passed
    rig.failing["any"] = "no"
    rig.arming.pre_arm_checks(display=False)
    assert not rig.arming.passed


# Arming


def test_arming_is_announced(rig: Rig) -> None:
    assert rig.arming.arm(do_checks=True)
    assert rig.arming.armed
    assert rig.texts == [(6, "Arming motors")]


def test_failures_of_an_attempt_are_told_as_such(rig: Rig) -> None:
    rig.failing["vision"] = "VisOdom: not healthy"
    assert not rig.arming.arm(do_checks=True)
    assert not rig.arming.armed
    assert rig.texts == [(2, "Arm: VisOdom: not healthy")]


def test_checks_of_the_attempt_come_last(rig: Rig) -> None:
    rig.arming.arm(do_checks=True)
    assert rig.made == ["boot", "height", "logging", "any", "vision", "mode", "switch"]


def test_checks_of_the_attempt_are_not_made_after_another_failed(rig: Rig) -> None:
    rig.failing |= {"vision": "V", "mode": "M"}
    assert not rig.arming.arm(do_checks=True)
    assert rig.take_texts() == ["Arm: V"]


def test_first_failing_check_of_the_attempt_is_the_last_one_told(rig: Rig) -> None:
    rig.failing |= {"mode": "LAND mode not armable", "switch": "Safety Switch"}
    assert not rig.arming.arm(do_checks=True)
    assert rig.take_texts() == ["Arm: LAND mode not armable"]


def test_failed_attempt_leaves_the_result_of_the_pre_arm_checks(rig: Rig) -> None:
    rig.failing["mode"] = "LAND mode not armable"
    rig.arming.arm(do_checks=True)
    assert rig.arming.passed


def test_mode_is_checked_when_checks_are_switched_off(rig: Rig) -> None:
    rig.params.set("ARMING_CHECK", 0)
    rig.failing |= {"mode": "LAND mode not armable", "switch": "Safety Switch"}
    assert not rig.arming.arm(do_checks=True)
    assert rig.take_texts() == ["Arm: LAND mode not armable"]


def test_arming_without_checks_makes_the_mandatory_ones(rig: Rig) -> None:
    rig.failing |= {"vision": "VisOdom: not healthy", "mode": "LAND mode not armable", "boot": "too early"}
    assert rig.arming.arm(do_checks=False)
    assert rig.made == ["position", "height"]


def test_all_checks_are_made_when_a_mandatory_one_fails_in_a_forced_attempt(rig: Rig) -> None:
    rig.failing |= {"height": "Need Alt Estimate", "vision": "VisOdom: not healthy"}
    assert not rig.arming.arm(do_checks=False)
    assert rig.take_texts() == ["Arm: Need Alt Estimate", "Arm: Need Alt Estimate", "Arm: VisOdom: not healthy"]


def test_arming_is_logged(rig: Rig) -> None:
    rig.params.set("ARMING_CHECK", VISION)
    rig.arming.arm(do_checks=True)
    assert rig.log.records == [{"armed": True, "checks": VISION, "forced": False, "method": 1}, 10]


def test_forced_arming_is_logged_as_such(rig: Rig) -> None:
    rig.arming.arm(do_checks=False)
    assert rig.log.records == [{"armed": True, "checks": 1, "forced": True, "method": 1}, 10]


@pytest.mark.parametrize("forced", [False, True])
@pytest.mark.parametrize(("method", "number"), [
    (ArmMethod.MAVLINK, 1), (ArmMethod.LANDED, 13), (ArmMethod.DISARMDELAY, 17),
])  # fmt: skip
def test_disarming_is_logged_with_its_reason(rig: Rig, method: ArmMethod, number: int, forced: bool) -> None:
    rig.arming.arm(do_checks=True)
    rig.log.records.clear()
    rig.arming.disarm(method, forced=forced)
    assert rig.log.records == [{"armed": False, "checks": 0, "forced": forced, "method": number}, 11]


def test_failed_attempts_are_not_logged(rig: Rig) -> None:
    rig.failing["vision"] = "VisOdom: not healthy"
    rig.arming.arm(do_checks=True)
    rig.arming.disarm(ArmMethod.MAVLINK)
    assert rig.log.records == []


def test_disabled_checks_are_warned_of(rig: Rig) -> None:
    rig.params.set("ARMING_CHECK", 0)
    rig.arming.arm(do_checks=True)
    assert rig.texts == [(4, "Warning: Arming Checks Disabled"), (6, "Arming motors")]


def test_disabled_checks_are_not_warned_of_when_nobody_asked_for_any(rig: Rig) -> None:
    rig.params.set("ARMING_CHECK", 0)
    rig.arming.arm(do_checks=False)
    assert rig.take_texts() == ["Arming motors"]


def test_armed_vehicle_does_not_arm_again(rig: Rig) -> None:
    rig.arming.arm(do_checks=True)
    assert not rig.arming.arm(do_checks=True)
    assert rig.take_texts() == ["Arming motors"]


def test_armed_vehicle_makes_no_pre_arm_checks(rig: Rig) -> None:
    rig.arming.arm(do_checks=True)
    rig.made.clear()
    rig.failing["vision"] = "VisOdom: not healthy"
    assert rig.arming.pre_arm_checks(display=True)
    assert rig.made == []


def test_disarming_is_announced(rig: Rig) -> None:
    rig.arming.arm(do_checks=True)
    rig.take_texts()
    assert rig.arming.disarm(ArmMethod.MAVLINK)
    assert not rig.arming.armed
    assert rig.texts == [(6, "Disarming motors")]


def test_disarmed_vehicle_does_not_disarm(rig: Rig) -> None:
    assert not rig.arming.disarm(ArmMethod.MAVLINK)
    assert rig.take_texts() == []


def test_option_1_keeps_arming_and_disarming_quiet(rig: Rig) -> None:
    rig.params.set("ARMING_OPTIONS", 2)
    rig.arming.arm(do_checks=True)
    rig.arming.disarm(ArmMethod.MAVLINK)
    assert rig.take_texts() == []

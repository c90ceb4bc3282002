# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When checks run and speak, which of them count, and what arming and disarming say."""

import pytest

from ap_core.clock import VirtualClock
from ap_core.param import ParamTable
from emulator.arming import ANY_CHECK, CHECK_VISION, Arming, Check
from emulator.parameters import make_groups

LOGGING = 1 << 10


class Rig:
    """Four checks: always made, made unless all are off, logging, vision; each fails with its text in ``failing``."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(0))
        self.failing: dict[str, str] = {}
        self.made: list[str] = []
        self.texts: list[tuple[int, str]] = []
        checks = [
            self._check(bit, name)
            for bit, name in ((0, "system"), (LOGGING, "logging"), (ANY_CHECK, "any"), (CHECK_VISION, "vision"))
        ]
        self.arming = Arming(checks, self.params.group("ARMING_"), self, self.clock)

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
    rig.failing |= {"vision": "V", "system": "S", "logging": "L", "any": "A"}
    rig.arming.pre_arm_checks(display=True)
    assert rig.take_texts() == ["PreArm: S", "PreArm: L", "PreArm: A", "PreArm: V"]


def test_check_that_ends_the_run_is_the_last_one_told() -> None:
    rig = Rig()
    checks = [Check(0, lambda: "first", ends=True), Check(0, lambda: "second")]
    arming = Arming(checks, rig.params.group("ARMING_"), rig, rig.clock)
    assert not arming.pre_arm_checks(display=True)
    assert rig.take_texts() == ["PreArm: first"]


def test_passing_checks_say_nothing(rig: Rig) -> None:
    assert rig.arming.pre_arm_checks(display=True)
    assert rig.take_texts() == []


@pytest.mark.parametrize(("mask", "made"), [
    (0, ["system"]),
    (1, ["system", "logging", "any", "vision"]),
    (CHECK_VISION, ["system", "any", "vision"]),
    (LOGGING, ["system", "logging", "any"]),
    (1 << 5, ["system", "any"]),
    (LOGGING | CHECK_VISION, ["system", "logging", "any", "vision"]),
    (-1, ["system", "logging", "any", "vision"]),
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


def test_arming_without_checks_makes_the_mandatory_ones(rig: Rig) -> None:
    rig.failing["vision"] = "VisOdom: not healthy"
    assert rig.arming.arm(do_checks=False)
    assert rig.made == ["system"]


def test_mandatory_check_fails_arming_without_checks(rig: Rig) -> None:
    rig.failing["system"] = "System not initialised"
    assert not rig.arming.arm(do_checks=False)
    assert rig.take_texts() == ["Arm: System not initialised"]


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
    assert rig.arming.disarm()
    assert not rig.arming.armed
    assert rig.texts == [(6, "Disarming motors")]


def test_disarmed_vehicle_does_not_disarm(rig: Rig) -> None:
    assert not rig.arming.disarm()
    assert rig.take_texts() == []


def test_option_1_keeps_arming_and_disarming_quiet(rig: Rig) -> None:
    rig.params.set("ARMING_OPTIONS", 2)
    rig.arming.arm(do_checks=True)
    rig.arming.disarm()
    assert rig.take_texts() == []

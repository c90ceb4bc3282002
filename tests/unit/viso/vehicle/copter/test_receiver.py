# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pilot's radio: its sticks by their parameters, overrides that end, and switches."""

import pytest

from ap_core.clock import VirtualClock
from ap_core.param import ParamTable
from viso.parameters.table import make_groups
from viso.running.virtual_time import Scheduler
from viso.vehicle.copter.modes import ModeReason
from viso.vehicle.copter.receiver import CENTRED, Receiver
from viso.vehicle.vehicle import Vehicle, VehicleConfig

SIMULATOR = {f"RC{number}_{name}": value for number in range(1, 5) for name, value in (("MIN", 1000), ("MAX", 2000))}


@pytest.fixture
def clock() -> VirtualClock:
    clock = VirtualClock()
    clock.set_us(1_000_000)
    return clock


@pytest.fixture
def params() -> ParamTable:
    params = ParamTable(make_groups(1))
    for name, value in SIMULATOR.items():
        params.set(name, value)
    return params


@pytest.fixture
def receiver(params: ParamTable, clock: VirtualClock) -> Receiver:
    return Receiver(params, clock)


def test_sticks_are_centred_without_a_radio(receiver: Receiver) -> None:
    assert receiver.sticks() == CENTRED


@pytest.mark.parametrize(
    ("pwm_us", "deflection"),
    [(1500, 0.0), (1520, 0.0), (1521, 1 / 480), (1480, 0.0), (2000, 1.0), (2100, 1.0), (1000, -1.0), (1240, -0.5)],
)
def test_stick_deflects_beyond_its_dead_zone(receiver: Receiver, pwm_us: int, deflection: float) -> None:
    receiver.override((pwm_us,))
    assert receiver.sticks().roll == pytest.approx(deflection)


@pytest.mark.parametrize(
    ("pwm_us", "climb"), [(1500, 0.0), (1580, 0.0), (1000, -1.0), (2000, 1.0), (1030, -1.0), (1800, 0.5037)]
)
def test_throttle_climbs_beyond_the_dead_zone_about_its_middle(receiver: Receiver, pwm_us: int, climb: float) -> None:
    receiver.override((65535, 65535, pwm_us))
    assert receiver.sticks().throttle == pytest.approx(climb, abs=1e-3)


def test_stick_can_be_reversed_and_be_on_another_channel(receiver: Receiver, params: ParamTable) -> None:
    params.set("RC6_REVERSED", 1)
    params.set("RCMAP_YAW", 6)
    receiver.override((65535,) * 5 + (1900,))
    assert receiver.sticks().yaw == pytest.approx(-1.0)


@pytest.mark.parametrize(("seconds", "last_us"), [(3.0, 2_999_999), (0.5, 499_999), (500.0, 119_999_999)])
def test_override_ends_after_its_time(
    receiver: Receiver, params: ParamTable, clock: VirtualClock, seconds: float, last_us: int
) -> None:
    params.set("RC_OVERRIDE_TIME", seconds)
    receiver.override((2000,))
    clock.set_us(clock.micros64() + last_us)
    assert receiver.pwm_us(1) == 2000
    clock.set_us(clock.micros64() + 1)
    assert receiver.pwm_us(1) is None


def test_override_lasts_for_ever_or_not_at_all(receiver: Receiver, params: ParamTable, clock: VirtualClock) -> None:
    receiver.override((2000,))
    params.set("RC_OVERRIDE_TIME", -1)
    clock.set_us(10**9)
    assert receiver.pwm_us(1) == 2000
    params.set("RC_OVERRIDE_TIME", 0)
    assert receiver.pwm_us(1) is None


def test_radio_is_what_is_not_overridden(receiver: Receiver) -> None:
    receiver.radio_us = (1500, 1500, 1000, *(1500,) * 13)
    receiver.override((1700,))
    assert receiver.pwm_us(1) == 1700
    assert receiver.pwm_us(2) == 1500
    assert receiver.sticks().throttle == -1.0


# Switches


class Switched:
    """A vehicle on the bench, and what its switches have done."""

    def __init__(self, **config: object) -> None:
        self.vehicle = Vehicle(VehicleConfig(**config))  # type: ignore[arg-type]
        self.texts: list[str] = []
        self.vehicle.texts.on_text.append(lambda _severity, text: self.texts.append(text))
        self.scheduler = Scheduler(self.vehicle)
        self.run(3.0)
        self.texts.clear()

    def run(self, seconds: float) -> None:
        self.scheduler.run_until(self.scheduler.now_us + round(seconds * 1e6))

    def move(self, channel: int, pwm_us: int, seconds: float = 0.5) -> None:
        receiver = self.vehicle.copter.receiver
        receiver.radio_us = (*(1500,) * (channel - 1), pwm_us, *(1500,) * (16 - channel))
        self.run(seconds)


@pytest.fixture
def switched() -> Switched:
    return Switched(defaults={"RC7_OPTION": 80, "RC8_OPTION": 90, "VISO_TYPE": 1})


@pytest.mark.parametrize(("pwm_us", "number"), [(1199, 1), (1200, 2), (1800, 2), (1801, 3)])
def test_switch_selects_a_source_set(switched: Switched, pwm_us: int, number: int) -> None:
    switched.move(8, pwm_us)
    assert switched.vehicle.sources.active_set == number - 1
    assert switched.texts[-1] == f"Using EKF Source Set {number}"


def test_switch_aligns_the_camera_when_it_is_high(switched: Switched, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bool] = []
    monkeypatch.setattr(switched.vehicle.visual_odom, "request_align_yaw_to_ahrs", lambda: asked.append(True))
    for pwm_us in (1000, 1900, 1500, 1900):
        switched.move(7, pwm_us)
    assert [text for text in switched.texts if "Align" in text] == [
        f"RC7: VisOdomAlign {name}" for name in ("LOW", "HIGH", "MIDDLE", "HIGH")
    ]
    assert len(asked) == 2


def test_short_blip_does_nothing(switched: Switched) -> None:
    switched.move(8, 1000)
    switched.texts.clear()
    switched.move(8, 2000, seconds=0.15)
    switched.move(8, 1000)
    assert switched.texts == []


@pytest.mark.parametrize("pwm_us", [0, 800, 2200])
def test_pulse_that_is_none_moves_no_switch(switched: Switched, pwm_us: int) -> None:
    switched.move(8, 1900)
    switched.texts.clear()
    switched.move(8, pwm_us)
    assert [text for text in switched.texts if "Source" in text] == []


def test_bench_without_functions_has_nothing_to_do() -> None:
    switched = Switched()
    switched.move(8, 1900)
    assert switched.texts == []


# The mode switch

MODES = {"FLTMODE1": 2, "FLTMODE2": 5, "FLTMODE3": 9, "FLTMODE4": 4, "FLTMODE5": 16, "FLTMODE6": 0}


@pytest.mark.parametrize(
    ("pwm_us", "number"),
    [(1230, 2), (1231, 5), (1360, 5), (1361, 9), (1490, 9), (1491, 4), (1621, 16), (1749, 16), (1750, 0), (2199, 0)],
)
def test_mode_switch_enters_the_mode_of_its_position(pwm_us: int, number: int) -> None:
    switched = Switched(defaults=MODES)
    switched.move(5, 1750 if number else 1000)
    switched.move(5, pwm_us)
    modes = switched.vehicle.copter.modes
    assert (modes.current.number, modes.reason) == (number, ModeReason.RC_COMMAND)


@pytest.mark.parametrize(("parameter", "value"), [("FLTMODE_CH", 0), ("FLTMODE_CH", 6)])
def test_mode_switch_is_on_its_channel_alone(parameter: str, value: int) -> None:
    switched = Switched(defaults={**MODES, parameter: value, "FLTMODE4": 0})
    switched.move(5, 1000)
    assert switched.vehicle.copter.modes.current.number == 0


def test_mode_of_a_client_stays_until_the_mode_switch_moves() -> None:
    switched = Switched(defaults=MODES)
    switched.move(5, 1000)
    switched.vehicle.copter.modes.set_mode(9, ModeReason.GCS_COMMAND)
    switched.run(1.0)
    assert switched.vehicle.copter.modes.current.number == 9
    switched.move(5, 2000)
    assert switched.vehicle.copter.modes.current.number == 0

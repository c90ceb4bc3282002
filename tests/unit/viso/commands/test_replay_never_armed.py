# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""viso replay of a log that holds no arming, because nothing is logged before it."""

import json
from pathlib import Path

import pytest

from tests.places import DATA
from tests.unit.viso.command_line import Viso
from viso.vehicle.sensors.flight import Happening
from viso.vehicle.sensors.flown.source import read_flight

NEVER_ARMED = DATA / "strangers" / "never_armed.BIN.xz"


def test_log_of_a_vehicle_that_logs_only_when_armed_begins_armed() -> None:
    events = read_flight(NEVER_ARMED).events
    assert events[0].what is Happening.ARMED


@pytest.mark.parametrize("options", [("--log", "out.BIN"), ("--set", "VISO_DELAY_MS=20"), ("--versus", "4.7")])
def test_agreement_with_the_log_is_always_printed_and_explained(
    viso: Viso, tmp_path: Path, options: tuple[str, str]
) -> None:
    shown = viso("replay", str(NEVER_ARMED), "--imu", "log", *options)
    text = " ".join(shown.out.split())
    assert text.count("Agreement with the log's own filter: positions are") == (1 if "--log" in options else 2)
    assert "takes its first height from the pose, whatever EK3_SRC1_POSZ is, 26.5 m from the log's" in text
    assert "Yaw innovations of the log's own filter: 97.9 deg" in text
    if "--log" in options:  # it is flown armed
        assert (tmp_path / "out.BIN").stat().st_size > 0
    if "--versus" in options:  # 4.7 takes the height from the source that is set
        after = text[text.index("after: Agreement") :]
        assert "0.005 m in height" in after


def test_agreement_with_the_log_is_told_to_programs(viso: Viso) -> None:
    agreement = json.loads(viso("replay", str(NEVER_ARMED), "--imu", "log", "--json").out)["agreement"]
    assert agreement["horizontal_m"] < 0.1 < 10 < agreement["height_m"]


def test_log_without_a_byte_is_an_error(viso: Viso, tmp_path: Path) -> None:
    out = tmp_path / "out.BIN"
    shown = viso("replay", str(NEVER_ARMED), "--log", str(out))
    assert shown.code == 2
    assert "nothing was logged, because the vehicle was never armed and LOG_DISARMED is 0" in shown.err


def test_log_that_is_too_short_says_so(viso: Viso) -> None:
    shown = viso("replay", str(DATA / "strangers" / "clock_35x.BIN.xz"), "--imu", "log")
    assert "too short to fly: 13 ATT, 26 XKF1" in shown.err


def test_messages_that_are_not_the_companions_are_summed_up(viso: Viso) -> None:
    shown = viso("replay", str(DATA / "strangers" / "pitch_is_yaw.tlog.gz"))
    assert "ATTITUDE and 6 others" in " ".join(shown.out.split())
    assert "LOCAL_POSITION_NED" not in shown.out

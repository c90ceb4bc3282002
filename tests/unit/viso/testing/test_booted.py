# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vehicles that have booted, each by itself."""

from pathlib import Path

import pytest

from mav_handlers.wire.codec import Codec
from tests.places import ROOT
from tests.unit.viso.testing.sample_odometry import odometry
from viso.terminal.settings import PRESETS
from viso.testing import AutopilotOptions
from viso.testing.vehicle import READY_US, BootedVehicle, booted_vehicle


def flown(booted: BootedVehicle) -> tuple[bytes, bytes]:
    """Return the log and what the vehicle has sent after a moment of flight, with a command in between."""
    codec, scheduler = Codec(1, 197), booted.scheduler
    for count in range(20):
        pose = odometry(scheduler.now_us, x=0.05 * count, vx=1.5, reset_counter=count // 15)
        scheduler.deliver(booted.channel, codec.encode(pose))
        scheduler.run_until(scheduler.now_us + 33_333)
    booted.vehicle.params.set_from_mavlink("VISO_DELAY_MS", 20)
    booted.vehicle.copter.arm(do_checks=False)
    scheduler.run_until(scheduler.now_us + 100_000)
    sent = booted.vehicle.endpoint.bytes_to_send(booted.channel)
    booted.vehicle.close()
    return bytes(booted.logs[-1].data), sent


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        AutopilotOptions(),
        pytest.param(AutopilotOptions(preset="t265-compass", imu="bench"), marks=pytest.mark.slow),
        pytest.param(AutopilotOptions(preset="gps-and-extnav", params={"LOG_REPLAY": 1}), marks=pytest.mark.slow),
        pytest.param(AutopilotOptions(imu="hil"), marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_vehicles_of_one_kind_fly_alike(options: AutopilotOptions) -> None:
    flights = [flown(booted_vehicle(options)), flown(booted_vehicle(options))]
    assert flights[0] == flights[1]
    assert len(flights[0][0]) > 10_000


@pytest.mark.slow
def test_vehicles_have_nothing_in_common() -> None:
    options = AutopilotOptions()
    first, second = booted_vehicle(options), booted_vehicle(options)
    first.vehicle.params.set("VISO_DELAY_MS", 77)
    first.vehicle.texts.send_text(6, "only here")
    first.scheduler.run_until(READY_US + 500_000)
    assert second.vehicle.params.get_int("VISO_DELAY_MS") == 10
    assert second.scheduler.now_us == READY_US
    assert b"only here" in first.logs[-1].data
    assert b"only here" not in second.logs[-1].data


def test_file_is_read_each_time(tmp_path: Path) -> None:
    script = tmp_path / "turn.toml"
    options = AutopilotOptions(imu=f"script:{script}")
    with pytest.raises(ValueError, match=r"turn\.toml"):
        booted_vehicle(options)
    example = next((ROOT / "viso" / "vehicle" / "sensors" / "script" / "example_scripts").glob("*.toml"))
    script.write_text(example.read_text())
    assert booted_vehicle(options).scheduler.now_us == READY_US
    script.unlink()
    with pytest.raises(ValueError, match=r"turn\.toml"):
        booted_vehicle(options)


@pytest.mark.parametrize(
    "preset", [pytest.param(name, marks=() if name == "motion-capture" else pytest.mark.slow) for name in PRESETS]
)
def test_every_preset_boots(preset: str) -> None:
    vehicle = booted_vehicle(AutopilotOptions(preset=preset)).vehicle
    assert vehicle.copter.has_booted
    assert vehicle.unknown_defaults == ()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"params": {"VISO_TYPE": "1"}}, "params: VISO_TYPE is '1', not a finite number"),
        ({"params": {"VISO_TYPE": True}}, "params: VISO_TYPE is True, not a finite number"),
        ({"params": {"VISO_TYPE": [1]}}, r"params: VISO_TYPE is \[1\], not a finite number"),
        ({"params": {"VISO_SCALE": float("nan")}}, "params: VISO_SCALE is nan, not a finite number"),
        ({"params": {"VISO_POS": 1.0}}, "VISO_POS is a vector: set its _X, _Y or _Z"),
        ({"params": {"VISO_POS_M_NSE": 1e39}}, "params: .*not NAME=VALUE with a finite number"),
        ({"imu": "log:missing.BIN"}, "missing.BIN"),
    ],
)
def test_options_that_cannot_be_used_are_told(options: dict[str, object], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        booted_vehicle(AutopilotOptions(**options))  # type: ignore[arg-type]  # that is the point

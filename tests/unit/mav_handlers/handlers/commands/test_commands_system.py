# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands about the autopilot itself: restart, storage, calibration."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.wire.messages import PARAM_SET, STATUSTEXT

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

ACCEPTED, _, DENIED, UNSUPPORTED, FAILED = range(5)
CALIBRATION, STORAGE, REBOOT, ARM, PROTOCOL_VERSION = 241, 245, 246, 400, 519
FORCE = 2989


@pytest.fixture
def bench(make_bench: "MakeBench") -> "Bench":
    """Return a vehicle that can be armed by force."""
    return make_bench(until_ms=6000)


def arm(bench: "Bench") -> None:
    assert bench.client.command(ARM, 1, FORCE) == ACCEPTED


def later(bench: "Bench") -> list[STATUSTEXT]:
    bench.run_ms(3)
    return bench.client.read_of(STATUSTEXT)


class TestReboot:
    """PREFLIGHT_REBOOT_SHUTDOWN."""

    @pytest.mark.parametrize(("param1", "result"), [
        (1, ACCEPTED), (3, ACCEPTED), (0, UNSUPPORTED), (2, UNSUPPORTED), (4, UNSUPPORTED),
    ])  # fmt: skip
    def test_restart_and_bootloader_are_supported(self, bench: "Bench", param1: float, result: int) -> None:
        assert bench.client.command(REBOOT, param1) == result
        assert bench.vehicle.reboot_requested is (result == ACCEPTED)

    def test_armed_vehicle_does_not_restart(self, bench: "Bench") -> None:
        arm(bench)
        assert bench.client.command(REBOOT, 1) == FAILED
        assert bench.client.command(REBOOT, 0) == FAILED
        assert not bench.vehicle.reboot_requested

    def test_armed_vehicle_restarts_when_forced(self, bench: "Bench") -> None:
        arm(bench)
        assert bench.client.command(REBOOT, 1, 0, 0, 0, 0, 20190226) == ACCEPTED
        assert bench.vehicle.reboot_requested

    def test_vehicle_does_not_break_itself(self, bench: "Bench") -> None:
        for fault in range(93, 104):
            assert bench.client.command(REBOOT, 42, 24, 71, fault) == UNSUPPORTED, fault
            assert later(bench) == [], fault
            assert not bench.vehicle.reboot_requested, fault


class TestStorage:
    """PREFLIGHT_STORAGE."""

    @pytest.mark.parametrize("param1", [0, 1, 3])
    def test_loading_and_saving_is_not_for_clients(self, bench: "Bench", param1: float) -> None:
        assert bench.client.command(STORAGE, param1) == DENIED

    def test_reset_waits_for_a_restart(self, bench: "Bench") -> None:
        bench.client.tell(PARAM_SET(1, 1, "VISO_DELAY_MS", 55.0, 9))
        assert "VISO_DELAY_MS" in bench.vehicle.params.stored_values()
        assert bench.client.command(STORAGE, 2) == ACCEPTED
        bench.run_ms(2000)
        assert bench.vehicle.params.stored_values() == {}
        assert bench.vehicle.params.get_int("VISO_DELAY_MS") == 55

    def test_reset_is_told_to_the_asking_link(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[1].command(PROTOCOL_VERSION)
        bench.client.command(STORAGE, 2)
        bench.run_ms(3)
        assert bench.client.read_of(STATUSTEXT) == [STATUSTEXT(4, "All parameters reset, reboot board")]
        assert bench.clients[1].read_of(STATUSTEXT) == []


class TestCalibration:
    """PREFLIGHT_CALIBRATION."""

    def test_what_a_vehicle_at_rest_can_do_is_done(self, bench: "Bench") -> None:
        for params, result in (
            ((1,), ACCEPTED),
            ((0, 76), ACCEPTED),
            ((0, 0, 0, 0, 76), ACCEPTED),
            ((0,), UNSUPPORTED),
            ((0, 1), UNSUPPORTED),
            ((0, 0, 0, 1), UNSUPPORTED),
            ((0, 0, 0, 0, 1), UNSUPPORTED),
            ((0, 0, 0, 0, 2), UNSUPPORTED),
            ((0, 0, 0, 0, 4), UNSUPPORTED),
            ((0, 0, 0, 0, 0, 1), UNSUPPORTED),
        ):
            assert bench.client.command(CALIBRATION, *params) == result, params
            assert later(bench) == [], params

    def test_calibration_of_the_barometer_is_told(self, bench: "Bench") -> None:
        assert bench.client.command(CALIBRATION, 0, 0, 1) == ACCEPTED
        assert later(bench) == [
            STATUSTEXT(6, "Updating barometer calibration"),
            STATUSTEXT(6, "Barometer calibration complete"),
        ]

    def test_armed_vehicle_is_not_calibrated(self, bench: "Bench") -> None:
        arm(bench)
        later(bench)
        assert bench.client.command(CALIBRATION, 1) == FAILED
        assert later(bench) == [STATUSTEXT(5, "Disarm to allow calibration")]


def test_protocol_version_is_not_supported(bench: "Bench") -> None:
    assert bench.client.command(PROTOCOL_VERSION, 1) == UNSUPPORTED

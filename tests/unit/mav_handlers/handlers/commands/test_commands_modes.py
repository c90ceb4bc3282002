# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that change the mode, and take-off."""

import math
from typing import TYPE_CHECKING

import pytest

from mav_handlers.verdicts import HANDLED, MODE_REFUSED
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_INT, HEARTBEAT, SET_MODE, STATUSTEXT
from viso.vehicle.copter.modes import ModeNumber

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

ACCEPTED, _, DENIED, UNSUPPORTED, FAILED = range(5)
LOITER_UNLIM, RTL, LAND, TAKEOFF, VTOL_TAKEOFF, VTOL_LAND, SET, START, ARM = 17, 20, 21, 22, 84, 85, 176, 300, 400
FORCE = 2989
SETTLED_MS = 7000
NAN = math.nan


@pytest.fixture
def bench(make_bench: "MakeBench") -> "Bench":
    """Return a vehicle whose estimator has its attitude, with nothing to see yet."""
    return make_bench(until_ms=SETTLED_MS)


class TestSetMode:
    """DO_SET_MODE and SET_MODE."""

    def test_number_counts_when_its_flag_is_set(self, bench: "Bench") -> None:
        for base_mode, custom_mode, result, mode in (
            (1, 2, ACCEPTED, 2),
            (217, 4, ACCEPTED, 4),
            (257, 4, ACCEPTED, 4),
            (1.9, 4.9, ACCEPTED, 4),
            (1, 0, ACCEPTED, 0),
            (1, 256 + 5, ACCEPTED, 5),
            (1, 99, FAILED, 0),
            (1, NAN, ACCEPTED, 0),
            (0, 4, DENIED, 0),
            (80, 4, DENIED, 0),
            (NAN, 4, DENIED, 0),
            (128, 0, ACCEPTED, 0),
            (128, 1, ACCEPTED, 0),
            (128, 2, DENIED, 0),
            (129, 2, ACCEPTED, 2),
        ):
            bench.vehicle.copter.set_mode(ModeNumber.STABILIZE)
            assert bench.client.command(SET, base_mode, custom_mode) == result, (base_mode, custom_mode)
            assert bench.vehicle.copter.custom_mode() == mode, (base_mode, custom_mode)

    def test_unknown_mode_is_told_after_the_ack(self, bench: "Bench") -> None:
        assert bench.client.command(SET, 1, 99) == FAILED
        bench.run_ms(3)
        assert bench.client.read_of(STATUSTEXT) == [STATUSTEXT(4, "No such mode 99")]

    def test_change_is_seen_at_once_in_a_heartbeat_on_every_link(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=SETTLED_MS, bauds=(None, None))
        assert bench.client.command(SET, 1, 4) == ACCEPTED
        bench.run_ms(3)
        for client in bench.clients:
            [heartbeat] = client.read_of(HEARTBEAT)
            assert (heartbeat.base_mode, heartbeat.custom_mode) == (89, 4)

    def test_pilot_s_mode_does_not_run_the_position_controller(self, bench: "Bench") -> None:
        bench.client.command(SET, 1, 2)
        bench.run_ms(3)
        [heartbeat] = bench.client.read_of(HEARTBEAT)
        assert (heartbeat.base_mode, heartbeat.custom_mode) == (81, 2)

    @pytest.mark.parametrize(("base_mode", "custom_mode", "taken", "mode"), [
        (1, 4, True, 4), (1, 99, False, 0), (0, 4, False, 0), (128, 1, True, 0), (128, 7, False, 0),
        (129, (1 << 32) - 1, False, 0), (1, 0x105, True, 5),
    ])  # fmt: skip
    def test_message_is_obeyed_without_an_answer(
        self, bench: "Bench", base_mode: int, custom_mode: int, taken: bool, mode: int
    ) -> None:
        verdict = bench.client.tell(SET_MODE(1, base_mode, custom_mode))
        assert verdict is (HANDLED if taken else MODE_REFUSED)
        assert bench.client.read() == []
        assert bench.vehicle.copter.custom_mode() == mode

    def test_message_to_another_system_is_not_obeyed(self, bench: "Bench") -> None:
        bench.client.tell(SET_MODE(7, 1, 4))
        assert bench.vehicle.copter.custom_mode() == 0

    @pytest.mark.parametrize(("switch", "armed"), [(1, False), (0, True)])
    def test_safety_switch_decides_about_arming(self, make_bench: "MakeBench", switch: int, armed: bool) -> None:
        bench = make_bench(until_ms=SETTLED_MS, VISO_TYPE=0)
        bench.client.command(SET, 128, 1)
        bench.client.command(SET, 128, switch)
        assert bench.client.command(ARM, 1) == (ACCEPTED if armed else FAILED)

    @pytest.mark.parametrize(("number", "mode"), [(LOITER_UNLIM, 5), (RTL, 6), (LAND, 9), (VTOL_LAND, 9), (START, 3)])
    def test_commands_that_stand_for_a_mode_enter_it(self, bench: "Bench", number: int, mode: int) -> None:
        assert bench.client.command(number) == ACCEPTED
        assert bench.vehicle.copter.custom_mode() == mode

    def test_part_of_a_mission_cannot_be_started(self, bench: "Bench") -> None:
        assert bench.client.command(START, 0, 1) == bench.client.command(START, 1) == DENIED
        assert bench.vehicle.copter.custom_mode() == 0

    def test_armed_vehicle_without_a_position_does_not_return(self, bench: "Bench") -> None:
        assert bench.client.command(ARM, 1, FORCE) == ACCEPTED
        assert bench.client.command(RTL) == FAILED
        assert bench.vehicle.copter.custom_mode() == 0


class TestTakeoff:
    """NAV_TAKEOFF of a vehicle that can fly."""

    @pytest.fixture
    def bench(self, make_bench: "MakeBench") -> "Bench":
        return make_bench(until_ms=SETTLED_MS, flies=True)

    def test_what_nothing_can_move_says_how_it_would_fly(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=SETTLED_MS)
        self.arm_in(bench, 20)
        assert bench.client.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0) == FAILED
        bench.run_ms(3)
        assert bench.client.read_texts()[-1:] == ["Takeoff refused: nothing moves it; use --imu fly"]

    def arm_in(self, bench: "Bench", mode: int) -> None:
        assert bench.client.command(ARM, 1, FORCE) == ACCEPTED
        assert bench.client.command(SET, 1, mode) == ACCEPTED

    @pytest.mark.parametrize("frame", [0, 1, 5, 6, 10])
    def test_height_is_above_home(self, bench: "Bench", frame: int) -> None:
        assert bench.client.command_int(TAKEOFF, z=5.0, frame=frame) == DENIED

    @pytest.mark.parametrize("number", [TAKEOFF, VTOL_TAKEOFF])
    def test_it_is_accepted_where_a_user_may_take_off(self, bench: "Bench", number: int) -> None:
        self.arm_in(bench, 20)
        assert bench.client.command(number, 0, 0, 0, 0, 0, 0, 5.0) == ACCEPTED
        bench.run_ms(3500)
        assert not bench.vehicle.copter.is_landed()

    @pytest.mark.parametrize(("altitude_m", "result"), [(3e38, ACCEPTED), (math.inf, ACCEPTED), (-3e38, FAILED)])
    def test_any_height_upwards_will_do(self, bench: "Bench", altitude_m: float, result: int) -> None:
        self.arm_in(bench, 20)
        assert bench.client.command_int(TAKEOFF, z=altitude_m, frame=3) == result

    def test_it_fails_where_the_pilot_flies(self, bench: "Bench") -> None:
        self.arm_in(bench, 1)
        assert bench.client.command_int(TAKEOFF, z=5.0, frame=3) == FAILED

    def test_it_fails_while_disarmed(self, bench: "Bench") -> None:
        bench.client.command(SET, 1, 4)
        assert bench.client.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0) == FAILED

    @pytest.mark.parametrize(("param3", "result"), [(0.0, FAILED), (1.0, ACCEPTED)])
    def test_pilot_does_the_horizontal_part_with_param3(self, bench: "Bench", param3: float, result: int) -> None:
        self.arm_in(bench, 2)
        bench.client.tell(COMMAND_INT(1, 1, 3, TAKEOFF, 0, 0, 0.0, 0.0, param3, 0.0, 0, 0, 5.0))
        assert bench.client.read_of(COMMAND_ACK)[0].result == result

    def test_flying_vehicle_is_active_and_disarmed_by_force_only(self, bench: "Bench") -> None:
        self.arm_in(bench, 20)
        bench.client.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0)
        bench.run_ms(4500)
        assert bench.client.read_of(HEARTBEAT)[-1].system_status == 4
        assert bench.client.command(ARM, 0) == FAILED
        assert bench.client.command(ARM, 0, 21196) == ACCEPTED
